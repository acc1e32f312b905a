"""Chooses between the qualities of a live picture so that it holds a wanted rate; ``quality = "auto"``.

Pictures of two qualities differ, so a change waits for a quick movement of the face, as a blink or a shift of gaze, and
then dissolves from one to the other. It goes to "fast" when "full" comes too late, and back when "full" would be in
time, as far as the cost of both is known. Each return that fails makes the next wait twice as long. Pictures that come
so late that they stutter are left at once: that is seen more than the change.
"""

from __future__ import annotations

import numpy as np

LEVELS = ("full", "fast")
LATE, EARLY = 1.05, 0.85
"""Share of a period that a frame of "full" takes when it is too slow, and that it must promise to be taken again."""
WINDOW_S = 1.0
"""Frames of this time are averaged before anything is decided."""
QUICK_PER_S = 3.0
"""Speed of a parameter whose range is 1 that hides a change; a blink reaches 10."""
PATIENCE_S = 2.0
"""A change that finds no quick movement for so long begins without one."""
FRAMES, DISSOLVE_S = 8, 8 / 60
"""Length of a dissolve: so many frames, or less where they come so slowly that it would last longer than this."""
STUTTER, STUTTER_FRAMES = 1.5, 6
"""Share of a period after which a frame is seen to stutter, and how many in a row do."""
_DRAWING = 0.5
"""Share of a period that drawing takes at least where it is to blame for a stutter, and not a slow screen. Software
renderers fill pixels on other threads, so this is only a part of what a picture takes."""
RELIEF, RELIEF_FRAMES = 0.9, 10
"""After a change because of stutters, share of their periods that frames take at most, and after how many that is
judged: where fewer pixels change nothing, the screen is slow."""
HOLD_S, LONGEST_HOLD_S = 5.0, 80.0
"""Least time in "fast" before "full" is tried again, at first and at most."""
RATIO, RATIOS = 2.2, (1.2, 4.0)
"""How much longer "full" takes than "fast" until both were measured (docs/picture.md has a table), and what is believed
of measured ratios: other load may have come between the two."""
_LEAST_FRAMES = 10


class QualityChoice:
    """Decides frame by frame which qualities are drawn; knows nothing of what draws them.

    Parameters
    ----------
    rate_hz : the wanted rate, frames/s.

    Attributes
    ----------
    level : "full" or "fast", what is drawn, or what it dissolves into.
    share : of that one in the picture, 0..1; 1 where nothing else is drawn.
    seconds : how long each was drawn, by name. switches : how often it changed.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self.level, self.share, self.switches = "full", 1.0, 0
        self.seconds = dict.fromkeys(LEVELS, 0.0)
        self._means: dict[str, float] = {}
        self._ratio = RATIO
        self._hold_s, self._changed_s, self._asked_s = HOLD_S, -np.inf, np.inf
        self._last: tuple[float, np.ndarray] | None = None
        self._quick = self._moved = False
        self._frames, self._spent_s = 0, 0.0
        self._interval_s = 0.0
        self._intervals: list[float] = []  # of frames in a row that stutter, or of those after a change because of them
        self._stuttered_s, self._screen_s = 0.0, 0.0  # mean period of stutters that are judged; that of a slow screen
        self._undoes = False

    @property
    def other(self) -> str:
        """The quality that :attr:`level` is not."""
        return LEVELS[1 - LEVELS.index(self.level)]

    @property
    def drawn(self) -> tuple[str, ...]:
        """The qualities that the next frame consists of."""
        return (self.level,) if self.share >= 1.0 else (self.other, self.level)

    def begin(self, values: np.ndarray, now_s: float) -> tuple[str, ...]:
        """Begin a frame of parameter values (p,) at a time (s); returns :attr:`drawn`."""
        if self._last is not None:
            before_s, before = self._last
            step = float(np.abs(values - before).max(initial=0.0))
            self._moved, self._quick = step > 0.0, step > QUICK_PER_S * (now_s - before_s)
            self._interval_s = now_s - before_s
            self.seconds[self.level] += self._interval_s
        self._last = now_s, np.array(values, float)
        if self.share < 1.0:
            self.share = min(1.0, self.share + max(1.0 / FRAMES, self._interval_s / DISSOLVE_S))
        elif self._stutters or self._undoes or self._may_change(now_s):
            self._change(now_s)
        return self.drawn

    def end(self, seconds: float) -> None:
        """End a frame that took so long to draw. Frames of a face at rest and of a dissolve do not count."""
        if not self._moved or self.share < 1.0:
            self._intervals = [] if self.level == "full" else self._intervals
            return
        if self.level == "full":
            late_s = STUTTER * max(self._period_s, self._screen_s)
            late = self._interval_s > late_s and seconds > _DRAWING * self._period_s
            self._intervals = [*self._intervals, self._interval_s] if late else []
        elif self._stuttered_s > 0.0:
            self._judge_stutters()
        self._frames, self._spent_s = self._frames + 1, self._spent_s + seconds
        lasting = max(self._spent_s, self._frames * self._period_s)
        if self._frames >= _LEAST_FRAMES and lasting >= WINDOW_S:
            self._means[self.level] = self._spent_s / self._frames
            self._frames, self._spent_s = 0, 0.0

    @property
    def _stutters(self) -> bool:
        return self.level == "full" and len(self._intervals) >= STUTTER_FRAMES

    def _judge_stutters(self) -> None:
        """Go back to "full" where frames of "fast" come as late: the screen is so slow, and is not to blame again."""
        self._intervals.append(self._interval_s)
        if len(self._intervals) >= RELIEF_FRAMES:
            if np.mean(self._intervals) > RELIEF * self._stuttered_s:
                self._screen_s, self._undoes = self._stuttered_s, True
            self._stuttered_s = 0.0

    def _may_change(self, now_s: float) -> bool:
        """Whether the other quality is wanted, and a movement hides the change or it was wanted for long enough."""
        return self._wants_change(now_s) and (self._quick or now_s - self._asked_s >= PATIENCE_S)

    def _wants_change(self, now_s: float) -> bool:
        """Whether the other quality is wanted; notes since when it is."""
        wanted = self._is_late() if self.level == "full" else self._is_early(now_s)
        self._asked_s = min(self._asked_s, now_s) if wanted else np.inf
        return wanted

    def _is_late(self) -> bool:
        return self._means.get("full", 0.0) > LATE * self._period_s

    def _is_early(self, now_s: float) -> bool:
        """Whether "full" may be tried: its cost is that of "fast" now, times how much more it took when last seen."""
        if "fast" not in self._means or now_s - self._changed_s < self._hold_s:
            return False
        return self._means["fast"] * self._ratio < EARLY * self._period_s

    def _change(self, now_s: float) -> None:
        lasted_s, self._changed_s = now_s - self._changed_s, now_s
        self._stuttered_s = float(np.mean(self._intervals)) if self._stutters else 0.0
        self._intervals, self._undoes = [], False
        if self.level == "full":  # it is known now how much more this took
            failed = self.switches > 0 and lasted_s < LONGEST_HOLD_S
            self._hold_s = min(2.0 * self._hold_s, LONGEST_HOLD_S) if failed else HOLD_S
            if set(LEVELS) <= set(self._means):
                self._ratio = float(np.clip(self._means["full"] / self._means["fast"], *RATIOS))
        self.level, self.share = self.other, 1.0 / FRAMES
        self.switches += 1
        self._means.pop(self.level, None)
        self._frames, self._spent_s, self._asked_s = 0, 0.0, np.inf
