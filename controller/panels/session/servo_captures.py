"""Angles that are captured of servos in the panel, and the calibration that they make.

Independent of the window library.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from controller.base.errors import ParameterError
from controller.panels.session.feed import servo_key
from controller.robot.calibration import SUFFIX, CapturedAngles, save_calibration
from controller.robot.settings import RobotSettings

Mark = Literal["lowest", "neutral", "highest"]
MARKS: tuple[Mark, ...] = ("lowest", "neutral", "highest")


@dataclass(frozen=True)
class Captured:
    """Angles of one servo, degrees, as far as they were captured."""

    lowest: float | None = None
    neutral: float | None = None
    highest: float | None = None

    def angles(self) -> CapturedAngles | None:
        """Return the three of them; None while one is missing, or they are not in order."""
        if self.lowest is None or self.neutral is None or self.highest is None:
            return None
        if not self.lowest <= self.neutral <= self.highest or self.lowest == self.highest:
            return None
        return CapturedAngles(min_deg=self.lowest, neutral_deg=self.neutral, max_deg=self.highest)


class ServoCaptures:
    """Captures angles of servos and writes them as calibrations.

    robots : of the stage. folder : calibrations are written there.
    """

    def __init__(self, robots: Sequence[RobotSettings], folder: Path) -> None:
        self._robots, self._folder = robots, folder
        self._captured: dict[str, Captured] = {}
        self._servos: dict[str, Mapping[str, Any]] = {}

    def of(self, servo: Mapping[str, Any]) -> Captured:
        """Return what was captured of a servo."""
        return self._captured.get(servo_key(servo), Captured())

    def capture(self, servo: Mapping[str, Any], mark: Mark) -> None:
        """Keep where a servo is now. Raises ParameterError: that is not known."""
        measured = servo.get("measured_deg")
        if measured is None:
            raise ParameterError(f"{servo['name']} does not say where it is", hint="see its row in the tab Servos")
        key = servo_key(servo)
        self._servos[key] = servo
        self._captured[key] = replace(self.of(servo), **{mark: round(float(measured), 2)})

    def clear(self, servo: Mapping[str, Any]) -> None:
        """Forget what was captured of a servo."""
        self._captured.pop(servo_key(servo), None)

    def save(self, name: str) -> list[Path]:
        """Write a calibration for each robot of which servos were captured whole; returns the files.

        Raises ParameterError: the name is none, no servo was captured whole, or a file is there. ControllerError: it
        cannot be written.
        """
        if not name.strip().replace("-", "_").isidentifier():
            raise ParameterError(f"{name!r} cannot be the name of a calibration", hint="as: desk")
        found: dict[str, dict[str, CapturedAngles]] = {}
        for key, captured in self._captured.items():
            if (angles := captured.angles()) is not None:
                found.setdefault(self._robot_of(self._servos[key]), {})[str(self._servos[key]["name"])] = angles
        if not found:
            raise ParameterError("no servo has its lowest, neutral and highest angle, in this order",
                                 hint="capture all three")  # fmt: skip
        paths = [self._folder / f"{robot}.{name.strip()}{SUFFIX}" for robot in found]
        for path in paths:
            if path.exists():
                raise ParameterError(f"{path}: there is such a file already", hint="choose another name")
        for path, (robot, channels) in zip(paths, found.items(), strict=True):
            save_calibration(path, name.strip(), robot, channels)
        return paths

    def _robot_of(self, servo: Mapping[str, Any]) -> str:
        """Return the name of the robot that a servo belongs to."""
        parts = str(servo["bus"]).split("/")
        own = [each for each in self._robots if any(channel.name == servo["name"] for channel in each.channels)]
        named = [each for each in own if each.name in parts] or own
        if not named:
            raise ParameterError(f"{servo['name']} belongs to no robot of this stage", hint="open the stage again")
        return named[0].name
