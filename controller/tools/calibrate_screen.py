"""CalibrationScreen a calibration: what the keys do, and the screen that shows it. No port is touched here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from controller.base.parameters import Floats
from controller.robot.calibration import Captured
from controller.robot.settings import ChannelSettings

STEP_DEG = 0.5
"""How far an arrow key moves a servo that holds."""
BAR = 44
HELP = (
    "up/down channel   n neutral   N neutral of all   [ lowest   ] highest   t follow the extremes\n"
    "h hold / let go   left/right move while it holds   c clear   s save   q leave"
)


@dataclass
class Marks:
    """What has been captured of one channel, degrees; NaN is not yet."""

    low: float = math.nan
    neutral: float = math.nan
    high: float = math.nan

    @property
    def missing(self) -> list[str]:
        """What is still to be captured."""
        found = {"lowest": self.low, "neutral": self.neutral, "highest": self.high}
        return [name for name, value in found.items() if math.isnan(value)]


@dataclass
class CalibrationScreen:
    """The state between the keys and the file.

    Parameters
    ----------
    channels : n channels.
    measures : whether their servos say where they are; those that do not are moved by keys alone.
    margin_deg : kept away from the captured ends, so that nothing is driven into its stop.

    Attributes
    ----------
    angle_deg : (n,) newest angles, NaN where not known.
    target_deg : (n,) where the servos shall hold.
    holding : whether the motors shall be on. tracking : whether ``see`` widens lowest and highest.
    asking : a question that only y or n answers, or empty. done : whether to leave. saving : whether to save.
    may_replace : whether a file that is in the way may be replaced.
    """

    channels: Sequence[ChannelSettings]
    measures: bool = True
    margin_deg: float = 1.0
    selected: int = 0
    holding: bool = False
    tracking: bool = False
    changed: bool = False
    saving: bool = False
    may_replace: bool = False
    done: bool = False
    asking: str = ""
    told: str = ""
    angle_deg: Floats = field(init=False)
    target_deg: Floats = field(init=False)
    marks: list[Marks] = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.channels)
        self.angle_deg, self.target_deg = np.full(n, np.nan), np.full(n, np.nan)
        self.marks = [Marks() for _ in self.channels]

    def see(self, angle_deg: Floats) -> None:
        """Take in angles (n,), NaN where nothing fresh is known."""
        self.angle_deg = np.array(angle_deg, dtype=np.float64)
        if self.holding:  # a board only knows where its servos are once it moves them
            self.target_deg = np.where(np.isnan(self.target_deg), self.angle_deg, self.target_deg)
        if not self.tracking or self.holding:
            return
        for mark, angle in zip(self.marks, self.angle_deg, strict=True):
            if not math.isnan(angle):
                mark.low, mark.high = float(np.fmin(mark.low, angle)), float(np.fmax(mark.high, angle))
                self.changed = True

    def press(self, key: str) -> None:
        """One key: a character, or ``up``, ``down``, ``left``, ``right``."""
        if self.asking:
            self._answer(key)
            return
        self.told = ""
        {
            "up": lambda: self._select(-1),
            "down": lambda: self._select(1),
            "left": lambda: self._move(-STEP_DEG),
            "right": lambda: self._move(STEP_DEG),
            "n": lambda: self._capture("neutral", [self.selected]),
            "N": lambda: self._capture("neutral", range(len(self.channels))),
            "[": lambda: self._capture("low", [self.selected]),
            "]": lambda: self._capture("high", [self.selected]),
            "t": self._toggle_tracking,
            "h": self._toggle_holding,
            "c": self._clear,
            "s": self._save,
            "q": self._leave,
        }.get(key, lambda: None)()

    def captured(self) -> dict[str, Captured]:
        """Channels of which all three angles are known, ends moved inwards by the margin."""
        found = {}
        for channel, mark in zip(self.channels, self.marks, strict=True):
            if not mark.missing:
                low = min(mark.low + self.margin_deg, mark.neutral)
                high = max(mark.high - self.margin_deg, mark.neutral)
                if low < high:
                    found[channel.name] = Captured(min_deg=low, neutral_deg=mark.neutral, max_deg=high)
        return found

    def saved(self, told: str) -> None:
        """The file was written, or was not."""
        self.saving = False
        self.told = told

    def ask(self, question: str) -> None:
        """Ask before a file is replaced; ``y`` sets ``saving`` again."""
        self.saving, self.asking = False, question

    # ------------------------------------------------------------------ keys

    def _answer(self, key: str) -> None:
        question, agreed = self.asking, key in "yY"
        if key not in "yYnN":
            return
        self.asking = ""
        if question.startswith("leave"):
            self.done = agreed
        else:
            self.saving = self.may_replace = agreed
            self.told = "" if agreed else "not saved"

    def _select(self, step: int) -> None:
        self.selected = (self.selected + step) % len(self.channels)

    def _move(self, step_deg: float) -> None:
        if not self.holding:
            self.told = "h switches the motors on where they stand; then the arrows move"
            return
        low, high = self.channels[self.selected].limit_deg
        target = self.target_deg[self.selected] + step_deg
        if math.isnan(target):
            return
        self.target_deg[self.selected] = min(max(target, low), high)
        if target != self.target_deg[self.selected]:
            self.told = f"limit_deg of the robot file ends at {self.target_deg[self.selected]:g}"

    def _capture(self, name: str, indices: Sequence[int]) -> None:
        unknown = []
        for i in indices:
            angle = float(self.angle_deg[i])
            if math.isnan(angle):
                unknown.append(self.channels[i].name)
                continue
            setattr(self.marks[i], name, angle)
            self.changed = True
        if unknown:
            self.told = f"no angle from {', '.join(unknown)}"

    def _toggle_tracking(self) -> None:
        self.tracking = not self.tracking and self.measures
        self.told = "" if self.measures else "these servos do not say where they are: use the arrows"

    def _toggle_holding(self) -> None:
        if not self.holding and np.isnan(self.angle_deg).any() and self.measures:
            self.told = "not every servo says where it is"
            return
        self.holding = not self.holding
        self.target_deg = self.angle_deg.copy()

    def _clear(self) -> None:
        self.marks[self.selected] = Marks()

    def _save(self) -> None:
        self.saving = bool(self.captured())
        if not self.saving:
            missing = self.marks[self.selected].missing or ["a way between its ends"]
            self.told = f"nothing to save yet: {self.channels[self.selected].name} lacks {', '.join(missing)}"

    def _leave(self) -> None:
        if self.changed:
            self.asking = "leave without saving? (y/n)"
        else:
            self.done = True

    # ------------------------------------------------------------------ screen

    def picture(self, title: str) -> Group:
        """The screen: a bar for each channel and what the keys do."""
        table = Table("", "channel", "now", "", "lowest", "neutral", "highest", box=None, pad_edge=False)
        for i, channel in enumerate(self.channels):
            mark = self.marks[i]
            words = [_degrees(value) for value in (mark.low, mark.neutral, mark.high)]
            style = "bold" if i == self.selected else ""
            pointer = ">" if i == self.selected else ""
            table.add_row(pointer, channel.name, _degrees(self.angle_deg[i]), self._bar(i), *words, style=style)
        motors = "motors on" if self.holding else "motors off: move it by hand"
        state = motors + (", following the extremes" if self.tracking else "")
        told = self.asking or self.told
        return Group(
            Text(f"{title}   {state}", style="bold"), table, Text(told, style="yellow"), Text(HELP, style="dim")
        )

    def _bar(self, i: int) -> Text:
        """The channel's range with what was captured and where it is."""
        mark, limit = self.marks[i], self.channels[i].limit_deg
        known = [v for v in (*limit, mark.low, mark.neutral, mark.high, self.angle_deg[i]) if not math.isnan(v)]
        low, high = min(known), max(known)

        def place(value: float) -> int:
            return round((value - low) / (high - low) * (BAR - 1))

        cells = ["·"] * BAR
        for value, sign in ((mark.low, "["), (mark.high, "]"), (mark.neutral, "|"), (self.angle_deg[i], "●")):
            if not math.isnan(value):
                cells[place(value)] = sign
        return Text("".join(cells))


def _degrees(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1f}"
