"""Calibrations: where each servo of one built head really has its neutral and its ends, in a file of its own.

A robot file says how a kind of head is meant to move; a calibration says how far this one does. It names for each
channel the lowest, neutral and highest angle that was captured, and a robot file that names it is carried onto them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from controller.base.config import Settings, config_error, load
from controller.base.files import format_fault, replacing
from controller.base.parameters import did_you_mean
from controller.robot.settings import Calibration, ChannelSettings, RobotSettings

Degrees = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]

SUFFIX = ".calibration.toml"
FORMAT = 1
"""Version of what :func:`save_calibration` writes; files of before there was one state none and are of version 1."""


class Captured(Settings):
    """Angles of one channel, degrees from its servo's centre as everywhere in the robot file."""

    min_deg: Degrees
    neutral_deg: Degrees
    max_deg: Degrees

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.min_deg <= self.neutral_deg <= self.max_deg or self.min_deg == self.max_deg:
            raise ValueError("must have min_deg <= neutral_deg <= max_deg, and min_deg < max_deg")
        return self


class CalibrationFile(Settings):
    """What a calibration file holds; channels that are not in it stay as the robot file has them."""

    format: int = FORMAT
    name: str
    robot: str
    channels: dict[str, Captured] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _of_a_known_format(cls, table: dict[str, Any]) -> dict[str, Any]:
        """A newer file is refused for that alone, not for each of its new keys."""
        fault = format_fault(table.get("format", FORMAT), FORMAT)
        if fault is not None:
            raise ValueError(fault)
        return table


def calibration_path(name: str, robot: Path) -> Path:
    """The file that a name means for a robot file: a path beside it, or ``<robot>.<name>.calibration.toml``."""
    return robot.parent / (name if name.endswith(".toml") else f"{robot.stem}.{name}{SUFFIX}")


def calibrated(robot: RobotSettings, path: Path) -> RobotSettings:
    """The robot carried onto the calibration in ``path``.

    Raises
    ------
    ConfigError
        when the file cannot be read, is another robot's, or names channels that the robot lacks.
    """
    found = load(path, CalibrationFile)
    known = [channel.name for channel in robot.channels]
    faults = [
        f"channels.{name}: no channel called {name!r}{did_you_mean(name, known)}"
        for name in found.channels
        if name not in known
    ]
    if found.robot != robot.name:
        faults.insert(0, f"robot: is a calibration of {found.robot!r}, not of {robot.name!r}")
    if faults:
        raise config_error(path, faults)
    channels = [
        carried(channel, found.channels[channel.name]) if channel.name in found.channels else channel
        for channel in robot.channels
    ]
    return robot.model_copy(update={"channels": channels})


def carried(channel: ChannelSettings, captured: Captured) -> ChannelSettings:
    """A channel with its calibrated points moved so that neutral and ends are those captured.

    What the mix at rest (0, or the end nearest to it) gives becomes ``neutral_deg``, the points on either side are
    stretched so that the outermost ones reach the captured ends, and the limits become the ends.
    """
    points = channel.map
    at_rest = rest_deg(channel)
    low, high = min(points.deg), max(points.deg)
    deg = [_stretched(value, (low, at_rest, high), captured) for value in points.deg]
    moved = points.model_copy(update={"deg": [round(value, 3) for value in deg]})
    return channel.model_copy(update={"map": moved, "limit_deg": (captured.min_deg, captured.max_deg), "trim_deg": 0.0})


def rest_deg(channel: ChannelSettings) -> float:
    """What a channel's mix at rest (0, or the end nearest to it) gives before its trim."""
    points = channel.map
    return _between(points, min(max(0.0, points.at[0]), points.at[-1]))


def _between(points: Calibration, at: float) -> float:
    """The angle that straight lines through the points give."""
    for left, right, low, high in zip(points.at, points.at[1:], points.deg, points.deg[1:], strict=False):
        if left <= at <= right:
            return low + (high - low) * (at - left) / (right - left)
    return points.deg[0]


def _stretched(value: float, old: tuple[float, float, float], new: Captured) -> float:
    low, rest, high = old
    if value <= rest:
        share = (rest - value) / (rest - low) if rest > low else 0.0
        return new.neutral_deg - share * (new.neutral_deg - new.min_deg)
    return new.neutral_deg + (value - rest) / (high - rest) * (new.max_deg - new.neutral_deg)


def save_calibration(path: Path, name: str, robot: str, channels: dict[str, Captured]) -> None:
    """Write a calibration, whole or not at all.

    Raises
    ------
    ControllerError
        when it cannot be written; a file that was there stays as it was.
    """
    lines = [f"format = {FORMAT}", f"name = {json.dumps(name)}", f"robot = {json.dumps(robot)}", ""]
    for channel, captured in channels.items():
        lines += [f"[channels.{json.dumps(channel)}]", *(f"{key} = {value:.2f}" for key, value in captured), ""]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8")
