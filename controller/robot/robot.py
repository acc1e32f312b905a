"""A robot's configuration: buses, and channels from parameters to servo angles.

A channel is one servo: a weighted mix of parameters, carried through calibrated points to an angle, then kept
inside its limits, speed and acceleration. Angles are degrees from the servo's centre, growing with its ticks.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from controller.base.config import Settings, load
from controller.base.parameters import Parameters, did_you_mean
from controller.robot.buses import Bus
from controller.robot.rules import RuleSettings
from controller.robot.terms import Curve, Finite, Term, check_points
from drivers import check_model
from drivers.base.errors import DriverError
from drivers.core.registry import FAMILIES

Degrees = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Play = Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)]


class Calibration(Settings):
    """Calibrated points of a channel: the mix at ``at`` gives the angle in ``deg``, straight or smooth between them."""

    at: list[Finite]
    deg: list[Degrees]
    curve: Curve = "straight"

    @model_validator(mode="after")
    def _pairs(self) -> Calibration:
        check_points(self.at, self.deg, "deg")
        return self


class PulseSettings(Settings):
    """Pulses of a hobby servo (us) at angles of the channel (degrees), measured in place of the model's."""

    deg: list[Degrees]
    us: list[Annotated[float, Field(ge=64, le=4080)]]

    @model_validator(mode="after")
    def _pairs(self) -> PulseSettings:
        check_points(self.deg, self.us, "us")
        steps = [after - before for before, after in pairwise(self.us)]
        if not (all(step > 0 for step in steps) or all(step < 0 for step in steps)):
            raise ValueError("us must rise, or fall, with every angle")
        return self


class AnchorSettings(Settings):
    """Where on the skin a servo pulls; its ``map`` then gives degrees for millimetres of pull.

    ``point`` is (u, v) of the part, a place [x, y, z] in mm, of which the nearest point of the skin is taken, or the
    name of one of the robot's landmarks. Skin within ``reach_mm`` goes with it, less with distance; with ``like`` it
    goes as that parameter moves it (a jaw on its hinge, a lid on its axle). ``both`` pulls at the mirrored point too.
    """

    point: str | Annotated[list[Finite], Field(min_length=2, max_length=3)]
    direction: tuple[Finite, Finite, Finite]
    part: str = "face"
    reach_mm: Positive = 15.0
    like: str | None = None
    both: bool = False

    @field_validator("direction")
    @classmethod
    def _is_one(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(value):
            raise ValueError("a direction must not be zero")
        return value

    @model_validator(mode="after")
    def _one_kind(self) -> AnchorSettings:
        if self.both and self.like is not None:
            raise ValueError("both and like do not go together")
        return self


class ChannelSettings(Settings):
    """One servo and the chain that leads to it."""

    name: str
    bus: str
    id: Annotated[int, Field(ge=0, le=252)]
    model: str
    mix: dict[str, Term] = {}
    join: Literal["sum", "min", "max"] = "sum"
    anchor: AnchorSettings | None = None
    map: Calibration
    limit_deg: tuple[Degrees, Degrees]
    max_speed_deg_s: Positive
    max_accel_deg_s2: Positive
    max_jerk_deg_s3: Positive | None = None
    reverse: bool = False
    zero_deg: Degrees = 0.0
    pulse: PulseSettings | None = None
    wire_name: str = ""
    trim_deg: Degrees = 0.0
    dead_band_deg: Play = 0.0
    slack_deg: Play = 0.0
    profile: str | None = None

    @field_validator("limit_deg")
    @classmethod
    def _in_order(cls, value: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise ValueError("the lower limit must be below the upper one")
        return value

    @model_validator(mode="after")
    def _one_source(self) -> ChannelSettings:
        if bool(self.mix) == (self.anchor is not None):
            raise ValueError("needs either mix or anchor")
        return self


class RobotSettings(Settings):
    """The channels of one robot, on one or more buses.

    ``calibration`` names a file that ``omote calibrate`` made of this very head (:mod:`controller.robot.calibration`).
    """

    name: str
    description: str = ""
    calibration: str | None = None
    buses: list[Bus] = Field(min_length=1)
    channels: list[ChannelSettings] = Field(min_length=1)
    landmarks: dict[str, Annotated[list[Finite], Field(min_length=2, max_length=3)]] = {}
    profiles: dict[str, dict[str, Any]] = {}
    rules: RuleSettings = RuleSettings()

    @model_validator(mode="before")
    @classmethod
    def _fill_in_profiles(cls, table: Any) -> Any:
        """Give channels what their profile says and they do not."""
        channels, profiles = table.get("channels"), table.get("profiles", {})
        if not isinstance(channels, list) or not isinstance(profiles, dict):
            return table
        filled = [_with_profile(channel, profiles) for channel in channels]
        return {**table, "channels": filled}

    def on_bus(self, name: str) -> list[ChannelSettings]:
        """The channels on the bus called ``name``, in file order."""
        return [channel for channel in self.channels if channel.bus == name]


def _with_profile(channel: Any, profiles: dict[str, Any]) -> Any:
    """A channel with what its profile says; with that of all profiles where there is none of that name (a fault)."""
    if not isinstance(channel, dict) or "profile" not in channel:
        return channel
    own = profiles.get(str(channel["profile"]))
    tables = [own] if isinstance(own, dict) else [each for each in profiles.values() if isinstance(each, dict)]
    return {key: value for table in (*tables, channel) for key, value in table.items()}


def load_robot(path: Path, parameters: Parameters) -> RobotSettings:
    """Read and cross-check a robot file.

    Raises
    ------
    ConfigError
        listing every fault: unknown keys and parameters, doubled names and ids, buses that do not exist.
    """
    robot = load(path, RobotSettings, lambda read: _doubled(read) + _references(read, parameters) + _rules(read))
    if robot.calibration is None:
        return robot
    from controller.robot.calibration import calibrated, calibration_path

    return calibrated(robot, calibration_path(robot.calibration, path))


def _doubled(robot: RobotSettings) -> list[str]:
    faults = []
    seen: dict[tuple[str, object], int] = {}
    for i, channel in enumerate(robot.channels):
        for key in (("name", channel.name), ("id", (channel.bus, channel.id))):
            first = seen.setdefault(key, i)
            if first != i:
                faults.append(f"channels[{i}].{key[0]}: {getattr(channel, key[0])!r} is taken by channels[{first}]")
    names = [bus.name for bus in robot.buses]
    faults += [f"buses[{i}].name: {n!r} is taken" for i, n in enumerate(names) if n in names[:i]]
    return faults


def _models(robot: RobotSettings) -> list[str]:
    """Servo models that their bus does not drive, and settings that mean nothing there."""
    faults = []
    buses = {bus.name: bus for bus in robot.buses}
    for i, channel in enumerate(robot.channels):
        bus = buses.get(channel.bus)
        if bus is None:
            continue
        try:
            check_model(bus.family, channel.model)
        except DriverError as error:
            faults.append(f"channels[{i}].model: {error}" + (f" ({error.hint})" if error.hint else ""))
        if channel.pulse is not None and not FAMILIES.get(bus.family).hobby:
            faults.append(f"channels[{i}].pulse: is for hobby servos; {bus.name!r} is a {bus.family} bus")
    return faults


def _references(robot: RobotSettings, parameters: Parameters) -> list[str]:
    from controller.base.errors import ParameterError

    buses = {bus.name for bus in robot.buses}
    used = {channel.bus for channel in robot.channels}
    faults = [f"buses[{i}]: no channel is on {b.name!r}" for i, b in enumerate(robot.buses) if b.name not in used]
    faults += _models(robot)
    for i, channel in enumerate(robot.channels):
        if channel.profile is not None and channel.profile not in robot.profiles:
            known = did_you_mean(channel.profile, robot.profiles)
            faults.append(f"channels[{i}].profile: no profile called {channel.profile!r}{known}")
        if channel.bus not in buses:
            faults.append(f"channels[{i}].bus: no bus called {channel.bus!r} (buses: {', '.join(sorted(buses))})")
        named = [(f"mix.{name}", name) for name in channel.mix]
        if channel.anchor is not None:
            faults += _landmark(robot, i, channel.anchor)
            named += [("anchor.like", channel.anchor.like)] if channel.anchor.like is not None else []
        for key, name in named:
            try:
                parameters.index(name)
            except ParameterError as error:
                faults.append(f"channels[{i}].{key}: {error}")
        low, high = channel.limit_deg
        faults += [
            f"channels[{i}].map.deg: {deg:g} lies outside limit_deg [{low:g}, {high:g}]"
            for deg in channel.map.deg
            if not low <= deg <= high
        ]
    return faults


def _landmark(robot: RobotSettings, i: int, anchor: AnchorSettings) -> list[str]:
    point = anchor.point
    if not isinstance(point, str) or point in robot.landmarks:
        return []
    return [f"channels[{i}].anchor.point: no landmark called {point!r}{did_you_mean(point, robot.landmarks)}"]


def _rules(robot: RobotSettings) -> list[str]:
    """Rules must name channels that exist, and pairs that share a bus."""
    bus = {channel.name: channel.bus for channel in robot.channels}
    faults = [
        f"{key}: no channel called {name!r}{did_you_mean(name, bus)}"
        for key, name in robot.rules.mentions()
        if name not in bus
    ]
    for i, rule in enumerate(robot.rules.prevent):
        if rule.channel == rule.other:
            faults.append(f"rules.prevent[{i}].other: is the channel itself")
        elif bus.get(rule.channel) != bus.get(rule.other) and {rule.channel, rule.other} <= set(bus):
            faults.append(f"rules.prevent[{i}].other: {rule.other!r} is on another bus than {rule.channel!r}")
    return faults
