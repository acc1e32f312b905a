"""Calibration files: the measured neutral and end angles of each servo of one built head.

A robot file describes how heads of one model move, a calibration file how far one built head does. It holds the lowest,
neutral and highest angle captured for each channel; the channels of a robot file that names it are fitted to them.
"""

from __future__ import annotations

import bisect
from pathlib import Path
from typing import Any, Self

import numpy as np
import tomli_w
from pydantic import Field, model_validator

from controller.base.config import Settings, config_error, load
from controller.base.files import format_fault, replacing
from controller.base.parameters import did_you_mean
from controller.robot.settings import Calibration, ChannelSettings, Degrees, RobotSettings
from controller.robot.terms import curve_corners

SUFFIX = ".calibration.toml"
FORMAT = 1
"""Version of the files that :func:`save_calibration` writes; a file that states none is read as version 1."""


class CapturedAngles(Settings):
    """Angles of one channel, degrees from its servo's centre as everywhere in the robot file."""

    min_deg: Degrees
    neutral_deg: Degrees
    max_deg: Degrees

    @model_validator(mode="after")
    def _is_in_order(self) -> Self:
        if not self.min_deg <= self.neutral_deg <= self.max_deg or self.min_deg == self.max_deg:
            raise ValueError("must have min_deg <= neutral_deg <= max_deg, and min_deg < max_deg")
        return self


class CalibrationFile(Settings):
    """The contents of a calibration file; channels that it does not name stay as in the robot file."""

    format: int = FORMAT
    name: str
    robot: str
    channels: dict[str, CapturedAngles] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _has_a_known_format(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Refuse a newer file with one error about its version instead of errors about its new keys."""
        fault = format_fault(table.get("format", FORMAT), FORMAT)
        if fault is not None:
            raise ValueError(fault)
        return table


def calibration_path(name: str, robot: Path) -> Path:
    """Return the path for a name in a robot file: a path beside it, or ``<robot>.<name>.calibration.toml``."""
    return robot.parent / (name if name.endswith(".toml") else f"{robot.stem}.{name}{SUFFIX}")


def calibrated(robot: RobotSettings, path: Path) -> RobotSettings:
    """Return the robot with its channels fitted to the calibration in ``path``.

    Raises ConfigError when the file cannot be read, is another robot's, or names channels that the robot lacks.
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
        fit_to_captured(channel, found.channels[channel.name]) if channel.name in found.channels else channel
        for channel in robot.channels
    ]
    return robot.model_copy(update={"channels": channels})


def fit_to_captured(channel: ChannelSettings, captured: CapturedAngles) -> ChannelSettings:
    """Return a channel with its calibrated points moved so that neutral and ends are at the captured angles.

    The angle of the mix at rest becomes ``neutral_deg``, the points on either side are stretched so that the outermost
    ones reach the captured ends, and the limits become the ends. Where no point is at rest, one is added between those
    on either side.
    """
    points = _with_rest(channel)
    ends = {min(points.deg): captured.min_deg, max(points.deg): captured.max_deg}
    stretch = sorted((ends | {rest_deg(channel): captured.neutral_deg}).items())
    deg = np.interp(points.deg, [old for old, _ in stretch], [new for _, new in stretch])
    moved = points.model_copy(update={"deg": np.round(deg, 3).tolist()})
    return channel.model_copy(update={"map": moved, "limit_deg": (captured.min_deg, captured.max_deg), "trim_deg": 0.0})


def _with_rest(channel: ChannelSettings) -> Calibration:
    """Return the points of a channel; one is added for the mix at rest where that lies between two others."""
    points = channel.map
    if 0.0 in points.at or not points.at[0] < 0.0 < points.at[-1]:
        return points
    k = bisect.bisect(points.at, 0.0)
    at, deg = ([*row[:k], rest, *row[k:]] for row, rest in ((points.at, 0.0), (points.deg, rest_deg(channel))))
    return points.model_copy(update={"at": at, "deg": deg})


def rest_deg(channel: ChannelSettings) -> float:
    """The angle that a channel's mix at rest (0, or the end nearest to it) gives before its trim."""
    points = channel.map
    return float(np.interp(0.0, *curve_corners(np.array(points.at), np.array(points.deg), points.curve)))


def save_calibration(path: Path, name: str, robot: str, channels: dict[str, CapturedAngles]) -> None:
    """Write a calibration, whole or not at all; raises ControllerError when it cannot be written."""
    angles = {channel: {key: round(deg, 2) for key, deg in captured} for channel, captured in channels.items()}
    table = {"format": FORMAT, "name": name, "robot": robot, "channels": angles}
    with replacing(path) as temporary:
        temporary.write_text(tomli_w.dumps(table), encoding="utf-8")
