"""Follows a conductor: shows exactly what it sends, one's own life without it, and no jump between; no I/O here."""

from __future__ import annotations

import threading
from collections import Counter, deque

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.fleet.approach import Approach
from controller.fleet.lease import NOBODY, Token
from controller.fleet.payload import Header
from controller.motion.motion import minimum_jerk

_SHARE = 0.6
"""How much of the limits of speed and acceleration passing from one source to the other may use, beside the motion of
the sources themselves; the limiter behind it holds them in any case."""
_SHORTEST_S = 0.3
_PEAK_SPEED, _PEAK_ACCELERATION = 1.875, 5.7735
"""Greatest speed (1/s) and acceleration (1/s²) of the minimum-jerk curve from 0 to 1 over one second."""
_GAP_NS, _STEP_NS = 45_000_000, 110_000_000
"""What comes after a longer gap in which faces were lost, or was mixed after a longer step, is not shown at once: it
can be far away by then."""
_WAITING = 128


class Follower:
    """What one head shows of a conductor and of its own life.

    Faces come in by :meth:`take`, from any thread; the control loop calls :meth:`step`.

    Parameters
    ----------
    patience_s : a conductor that is silent for so long is lost. delay_ns : a face is shown so long after it was mixed,
        by the conductor's clock; 0 shows the newest at once.

    Attributes
    ----------
    highest : the highest token obeyed. taken, refused : counts; refused by reason.
    conducted : whether a conductor is followed. exact : whether exactly its faces are shown, or one's own without it.
    header : of the face that is shown. offset_ns : what one's own clock lacks to the conductor's.
    """

    def __init__(self, parameters: Parameters, patience_s: float = 0.5, delay_ns: int = 0) -> None:
        p = parameters
        self._way = Approach(p)
        self._p, self._patience_s, self._delay_ns = p, patience_s, delay_ns
        self.highest: Token = NOBODY
        self.taken, self.refused = 0, Counter[str]()
        self.conducted, self.exact = False, False
        self.header: Header | None = None
        self.offset_ns = 0
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Header, Floats]] = deque(maxlen=_WAITING)
        self._sequence = -1
        self._sent = p.neutral()  # what the conductor sent last
        self._shown = p.neutral()
        self._before, self._last_s = p.neutral(), 0.0  # what was shown before, and how long it moved from there
        self._passed_s = 0.0  # how far a conductor's time went on since the face that was shown before
        self._gap, self._blended_s, self._whole_s = np.zeros(len(p)), 0.0, 0.0
        self._heard_s = -np.inf
        self._begun, self._leads = False, False

    def take(self, header: Header, values: Floats) -> bool:
        """Take a face that arrived; False where it is refused: of a conductor that was replaced, or an old one."""
        with self._lock:
            if header.token < self.highest:
                self.refused["of a conductor that was replaced"] += 1
                return False
            if header.token > self.highest:
                self.highest, self._sequence = header.token, -1
                self._waiting.clear()
            if header.sequence <= self._sequence:
                self.refused["older than the last one"] += 1
                return False
            self._sequence, self.taken = header.sequence, self.taken + 1
            self._waiting.append((header, values))
            return True

    @property
    def due_ns(self) -> int | None:
        """When what is shown was due by one's own clock; None for what is shown as soon as it comes."""
        if not self._delay_ns or self.header is None or not self.conducted:
            return None
        return self.header.time_ns + self._delay_ns - self.offset_ns

    def shows_theirs(self, now_s: float) -> bool:
        """Whether exactly a conductor's faces are shown, and will be at a tick before ``now_s``."""
        return self.conducted and self.exact and not self._is_lost(now_s)

    def _is_lost(self, now_s: float) -> bool:
        return now_s - self._heard_s > self._patience_s

    def lead(self, token: Token) -> None:
        """Conduct by oneself: nobody with a lower token is followed from now on."""
        with self._lock:
            if token > self.highest:
                self.highest, self._sequence = token, -1
                self._waiting.clear()
                self._leads = True

    def step(self, now_ns: int, dt: float, own: Floats, out: Floats) -> int:
        """Write to ``out`` : (P,) what is shown ``dt`` s after the last step; ``own`` : (P,) is one's own life.

        Returns when the newest command in it came, by one's own clock (ns); 0 for none.
        """
        newest, self._passed_s = self._due(now_ns), 0.0
        now_s = now_ns * 1e-9
        leads, self._leads = self._leads, False
        if newest is not None:
            self._heard_s = now_s
            self._turn_to(*newest)
        elif self.conducted and (leads or self._is_lost(now_s)):
            self.conducted = False
            self._pass_to(own)
        elif not self._begun:
            self._pass_to(own, first=True)
        self._begun = True
        self._show(self._sent if self.conducted else own, dt, out)
        header = self.header
        return 0 if not self.conducted or header is None or not header.stamp_ns else header.stamp_ns - self.offset_ns

    def _turn_to(self, header: Header, face: Floats) -> None:
        """Show a face from now on, or go on to it."""
        before, self.header, self._sent = self.header, header, face
        if before is None or before.token != header.token or not self.conducted:
            self._pass_to(face, first=not self._begun)
            self.conducted = True
            return
        self._passed_s = 1e-9 * (header.time_ns - before.time_ns)
        if _is_far(before, header):
            self._catch_up()

    def _due(self, now_ns: int) -> tuple[Header, Floats] | None:
        """The newest face that is to be shown by now."""
        found = None
        with self._lock:
            while self._waiting:
                if self._delay_ns and self._waiting[0][0].time_ns + self._delay_ns > now_ns + self.offset_ns:
                    break
                found = self._waiting.popleft()
        return found

    def _catch_up(self) -> None:
        """Go on within the limits to what a conductor sent after a gap."""
        if self.exact:
            self._leave()
            self._gap[:], self._whole_s = 0.0, 0.0
            self.exact = False
        self._way.follow(self._sent + self._left() * self._gap)

    def _pass_to(self, source: Floats, *, first: bool = False) -> None:
        """Begin to pass to another source: the gap to it closes along a minimum-jerk curve."""
        self._gap = np.zeros_like(source) if first else self._shown - source
        if first:
            self._shown[:] = source
        elif self.exact:
            self._leave()
        size = np.abs(self._gap)
        speed = _PEAK_SPEED * size / (_SHARE * self._p.max_speed)
        acceleration = np.sqrt(_PEAK_ACCELERATION * size / (_SHARE * self._p.max_acceleration))
        self._whole_s = 0.0 if first else max(_SHORTEST_S, float(speed.max()), float(acceleration.max()))
        self._blended_s = 0.0
        self._way.follow(source + self._gap)
        self.exact = first

    def _show(self, source: Floats, dt: float, out: Floats) -> None:
        if not self.exact:
            self._approach(source, dt, out)
        if self.exact:
            out[:] = source
            self._before, self._last_s = self._shown, self._passed_s or dt
        self._shown = out.copy()

    def _leave(self) -> None:
        """What was shown last was exactly a source's: go on from there, as fast as it moved."""
        speed = (self._shown - self._before) / self._last_s if self._last_s > 0.0 else np.zeros_like(self._shown)
        self._way.begin(self._shown, speed, self._last_s, self._shown)

    def _left(self) -> float:
        """How much of the gap is still to be closed, 1 to 0."""
        return 1.0 - minimum_jerk(self._blended_s / self._whole_s) if self._whole_s > 0.0 else 0.0

    def _approach(self, source: Floats, dt: float, out: Floats) -> None:
        """Follow the blend of both sources within the limits, until every parameter has met its end."""
        self._blended_s += dt
        left = self._left()
        self._way.step(dt, source + left * self._gap, out, stay=left == 0.0, passed_s=self._passed_s or dt)
        self.exact = left == 0.0 and bool(self._way.met.all())


def _is_far(before: Header, after: Header) -> bool:
    """Whether a face is too far from the one shown before to be shown at once."""
    passed = after.time_ns - before.time_ns
    return passed > (_GAP_NS if after.sequence - before.sequence > 1 else _STEP_NS)
