"""The screen of a calibration: handles keys, collects captured angles and draws them. Opens no port."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from controller.base.parameters import Floats
from controller.robot.calibration import CapturedAngles
from controller.robot.settings import ChannelSettings

STEP_DEG = 0.5
"""How far an arrow key moves a servo that holds."""
BAR = 44
SLACK_DEG = 1.0  # of one angle that is measured twice
HELP = (
    "up/down channel   n neutral   N neutral of all   [ lowest   ] highest   t follow the extremes\n"
    "h hold / release   left/right move while it holds   c clear   s save   q leave"
)


@dataclass
class Marks:
    """Captured angles of one channel, degrees; NaN before they are captured."""

    low: float = math.nan
    neutral: float = math.nan
    high: float = math.nan

    @property
    def missing(self) -> list[str]:
        """Names of the angles that are still to be captured."""
        found = {"lowest": self.low, "neutral": self.neutral, "highest": self.high}
        return [name for name, value in found.items() if math.isnan(value)]


@dataclass
class CalibrationScreen:
    """State of a calibration, from key presses to the captured angles.

    channels : n channels. measures : whether their servos measure their position; others are moved by keys alone.
    margin_deg : kept away from the captured ends, so that nothing is driven into its stop.
    angle_deg : (n,) newest angles, NaN where not known. target_deg : (n,) where the servos shall hold.
    holding : whether the motors shall be on. tracking : whether new angles widen lowest and highest.
    question : one that only y or n answers, or empty. done : whether to leave. saving : whether to save.
    may_replace : whether an existing file may be replaced.
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
    question: str = ""
    message: str = ""
    angle_deg: Floats = field(init=False)
    target_deg: Floats = field(init=False)
    marks: list[Marks] = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.channels)
        self.angle_deg, self.target_deg = np.full(n, np.nan), np.full(n, np.nan)
        self.marks = [Marks() for _ in self.channels]

    def set_angles(self, angle_deg: Floats) -> None:
        """Update the angles (n,), NaN where nothing fresh is known."""
        self.angle_deg = np.array(angle_deg, dtype=np.float64)
        if self.holding:  # a board knows the angle of a servo only after it has moved it
            self.target_deg = np.where(np.isnan(self.target_deg), self.angle_deg, self.target_deg)
        if not self.tracking or self.holding:
            return
        for mark, angle in zip(self.marks, self.angle_deg, strict=True):
            if not math.isnan(angle):
                mark.low, mark.high = float(np.fmin(mark.low, angle)), float(np.fmax(mark.high, angle))
                self.changed = True

    def handle_key(self, key: str) -> None:
        """Handle one key: a character, or ``up``, ``down``, ``left``, ``right``."""
        if self.question:
            self._answer(key)
            return
        self.message = ""
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

    def captured(self) -> dict[str, CapturedAngles]:
        """The channels whose three angles are known and in order, ends moved inwards by the margin."""
        found = {}
        for channel, mark in zip(self.channels, self.marks, strict=True):
            if not mark.missing and self._in_order(mark):
                low = min(mark.low + self.margin_deg, mark.neutral)
                high = max(mark.high - self.margin_deg, mark.neutral)
                if low < high:
                    found[channel.name] = CapturedAngles(min_deg=low, neutral_deg=mark.neutral, max_deg=high)
        return found

    def in_wrong_order(self) -> list[str]:
        """Names of channels whose three angles are known, but neutral lies outside of lowest and highest."""
        return [
            channel.name
            for channel, mark in zip(self.channels, self.marks, strict=True)
            if not mark.missing and not self._in_order(mark)
        ]

    def _in_order(self, mark: Marks) -> bool:
        """Whether neutral lies between the ends; an end may be neutral itself, and measured twice."""
        slack = max(self.margin_deg, SLACK_DEG)
        return mark.low - slack <= mark.neutral <= mark.high + slack

    def fail(self, message: str) -> None:
        """Nothing is known of the servos: show why. The motors do not come on again by themselves."""
        self.angle_deg = np.full(len(self.channels), np.nan)
        self.holding, self.message = False, message

    def saved(self, message: str) -> None:
        """The file was written: show a message."""
        self.saving = self.changed = False
        self.message = message

    def not_saved(self, message: str) -> None:
        """The file could not be written: show why; what was captured stays."""
        self.saving, self.message = False, message

    def ask(self, question: str) -> None:
        """Ask before a file is replaced; ``y`` sets ``saving`` again."""
        self.saving, self.question = False, question

    def _answer(self, key: str) -> None:
        question, agreed = self.question, key in "yY"
        if key not in "yYnN":
            return
        self.question = ""
        if question.startswith("leave"):
            self.done = agreed
        else:
            self.saving = self.may_replace = agreed
            self.message = "" if agreed else "not saved"

    def _select(self, step: int) -> None:
        self.selected = (self.selected + step) % len(self.channels)

    def _move(self, step_deg: float) -> None:
        if not self.holding:
            self.message = "h switches the motors on where they stand; then the arrows move"
            return
        low, high = self.channels[self.selected].limit_deg
        target = self.target_deg[self.selected] + step_deg
        if math.isnan(target):
            return
        self.target_deg[self.selected] = min(max(target, low), high)
        if target != self.target_deg[self.selected]:
            self.message = f"limit_deg of the robot file ends at {self.target_deg[self.selected]:g}"

    def _capture(self, name: str, indices: Sequence[int]) -> None:
        known = [i for i in indices if not math.isnan(self.angle_deg[i])]
        for i in known:
            setattr(self.marks[i], name, float(self.angle_deg[i]))
            self.changed = True
        if unknown := [self.channels[i].name for i in indices if i not in known]:
            self.message = f"no angle from {', '.join(unknown)}"

    def _toggle_tracking(self) -> None:
        self.tracking = not self.tracking and self.measures
        self.message = "" if self.measures else "these servos do not say where they are: use the arrows"

    def _toggle_holding(self) -> None:
        if not self.holding and np.isnan(self.angle_deg).any() and self.measures:
            self.message = "not every servo says where it is"
            return
        self.holding = not self.holding
        self.target_deg = self.angle_deg.copy()

    def _clear(self) -> None:
        self.marks[self.selected] = Marks()

    def _save(self) -> None:
        self.saving = bool(self.captured())
        if not self.saving:
            mark = self.marks[self.selected]
            between = [] if mark.missing or self._in_order(mark) else ["a neutral angle between lowest and highest"]
            missing = mark.missing or between or ["a way between its ends"]
            self.message = f"nothing to save yet: {self.channels[self.selected].name} lacks {', '.join(missing)}"

    def _leave(self) -> None:
        if self.changed:
            self.question = "leave without saving? (y/n)"
        else:
            self.done = True

    def picture(self, title: str) -> Group:
        """The screen: a bar for each channel, and help for the keys."""
        table = Table("", "channel", "now", "", "lowest", "neutral", "highest", box=None, pad_edge=False)
        for i, channel in enumerate(self.channels):
            mark = self.marks[i]
            now, *words = [_degrees(value) for value in (self.angle_deg[i], mark.low, mark.neutral, mark.high)]
            pointer, style = (">", "bold") if i == self.selected else ("", "")
            table.add_row(pointer, channel.name, now, self._bar(i), *words, style=style)
        motors = "motors on" if self.holding else "motors off: move it by hand"
        state = motors + (", following the extremes" if self.tracking else "")
        message = Text(self.question or self.message, style="yellow")
        return Group(Text(f"{title}   {state}", style="bold"), table, message, Text(HELP, style="dim"))

    def _bar(self, i: int) -> Text:
        """The channel's range with its captured angles and its present one."""
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
