"""The screen of a calibration: handles keys, collects captured angles and draws them. It opens no port."""

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
"""How far an arrow key moves a servo whose torque is on."""
BAR_LENGTH = 44
MEASURING_TOLERANCE_DEG = 1.0  # two measurements of one angle may differ by this
HELP = (
    "up/down channel   n neutral   N neutral of all   [ lowest   ] highest   t follow the extremes\n"
    "h hold / release   left/right move while it holds   c clear   s save   q leave"
)


@dataclass
class Marks:
    """The captured angles of one channel, degrees; NaN until they are captured."""

    low: float = math.nan
    neutral: float = math.nan
    high: float = math.nan

    @property
    def missing(self) -> list[str]:
        """Names of the angles that are not captured yet."""
        found = {"lowest": self.low, "neutral": self.neutral, "highest": self.high}
        return [name for name, value in found.items() if math.isnan(value)]


@dataclass
class CalibrationScreen:
    """State of a calibration, from key presses to the captured angles.

    channels : n channels. measures : whether all servos measure their position; else keys alone move them.
    margin_deg : moves the captured ends inwards, so that no servo is driven into its stop.
    angle_deg : (n,) newest angles, NaN if unknown. target_deg : (n,) goals of servos whose torque is on.
    holding : whether the torque is to be on. tracking : whether new angles widen lowest and highest.
    changed : whether angles were captured since the file was saved. question : a question that only y or n answers, or
    empty. done : whether to end. saving : whether to save now. may_replace : whether an existing file may be replaced.
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
        """Update the angles (n,), NaN if unknown; widen the captured ends while tracking with the torque off."""
        self.angle_deg = np.array(angle_deg, dtype=np.float64)
        if self.holding:  # a board that does not measure knows an angle only after it has moved the servo
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
        """Return the channels whose three angles are captured and in order, with ends moved inwards by the margin."""
        found = {}
        for channel, mark in zip(self.channels, self.marks, strict=True):
            if not mark.missing and self._in_order(mark):
                low = min(mark.low + self.margin_deg, mark.neutral)
                high = max(mark.high - self.margin_deg, mark.neutral)
                if low < high:
                    found[channel.name] = CapturedAngles(min_deg=low, neutral_deg=mark.neutral, max_deg=high)
        return found

    def in_wrong_order(self) -> list[str]:
        """Return the names of channels whose three angles are captured, but neutral is not between the ends."""
        return [
            channel.name
            for channel, mark in zip(self.channels, self.marks, strict=True)
            if not mark.missing and not self._in_order(mark)
        ]

    def _in_order(self, mark: Marks) -> bool:
        """Whether neutral lies between the ends; a tolerance allows an end at neutral, which is measured twice."""
        tolerance = max(self.margin_deg, MEASURING_TOLERANCE_DEG)
        return mark.low - tolerance <= mark.neutral <= mark.high + tolerance

    def fail(self, message: str) -> None:
        """Show why the servos cannot be used, forget their angles, and keep the torque off until h is pressed."""
        self.angle_deg = np.full(len(self.channels), np.nan)
        self.holding, self.message = False, message

    def saved(self, message: str) -> None:
        """Note that the file was written, and show a message."""
        self.saving = self.changed = False
        self.message = message

    def not_saved(self, message: str) -> None:
        """Show why the file could not be written; the captured angles are kept."""
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
            self.message = "press h first: it switches the torque on at the present angles; then the arrows move"
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
        self.message = "" if self.measures else "these servos do not measure their angle: use the arrows"

    def _toggle_holding(self) -> None:
        if not self.holding and np.isnan(self.angle_deg).any() and self.measures:
            self.message = "the angle of a servo is unknown"
            return
        self.holding = not self.holding
        self.target_deg = self.angle_deg.copy()

    def _clear(self) -> None:
        self.marks[self.selected] = Marks()

    def _save(self) -> None:
        self.saving = bool(self.captured())
        if not self.saving:
            mark = self.marks[self.selected]
            disordered = [] if mark.missing or self._in_order(mark) else ["a neutral angle between lowest and highest"]
            missing = mark.missing or disordered or ["room between its ends"]
            self.message = f"nothing to save yet: {self.channels[self.selected].name} lacks {', '.join(missing)}"

    def _leave(self) -> None:
        if self.changed:
            self.question = "leave without saving? (y/n)"
        else:
            self.done = True

    def picture(self, title: str) -> Group:
        """Return the screen: a row with a bar for each channel, a message, and help for the keys."""
        table = Table("", "channel", "now", "", "lowest", "neutral", "highest", box=None, pad_edge=False)
        for i, channel in enumerate(self.channels):
            mark = self.marks[i]
            now, *marks = [_degrees(value) for value in (self.angle_deg[i], mark.low, mark.neutral, mark.high)]
            pointer, style = (">", "bold") if i == self.selected else ("", "")
            table.add_row(pointer, channel.name, now, self._bar(i), *marks, style=style)
        motors = "torque on" if self.holding else "torque off: move it by hand"
        state = motors + (", following the extremes" if self.tracking else "")
        message = Text(self.question or self.message, style="yellow")
        return Group(Text(f"{title}   {state}", style="bold"), table, message, Text(HELP, style="dim"))

    def _bar(self, i: int) -> Text:
        """Draw the channel's range with its captured angles and its present angle."""
        mark, limit = self.marks[i], self.channels[i].limit_deg
        known = [v for v in (*limit, mark.low, mark.neutral, mark.high, self.angle_deg[i]) if not math.isnan(v)]
        low, high = min(known), max(known)

        def position(value: float) -> int:
            return round((value - low) / (high - low) * (BAR_LENGTH - 1))

        cells = ["·"] * BAR_LENGTH
        for value, sign in ((mark.low, "["), (mark.high, "]"), (mark.neutral, "|"), (self.angle_deg[i], "●")):
            if not math.isnan(value):
                cells[position(value)] = sign
        return Text("".join(cells))


def _degrees(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1f}"
