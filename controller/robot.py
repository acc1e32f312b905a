"""A robot's configuration: buses, and channels from parameters to servo angles.

A channel is one servo: a weighted mix of parameters, carried through calibrated points to an angle, then kept
inside its limits, speed and acceleration. Angles are degrees from the servo's centre, growing with its ticks.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from controller.config import Settings, config_error, load
from controller.parameters import Parameters, did_you_mean
from controller.rules import RuleSettings

Degrees = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Play = Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)]


class BusSettings(Settings):
    """One wire with many servos."""

    name: str
    kind: Literal["dynamixel", "simulated"]
    port: str = ""
    baud: int = 1_000_000
    rate_hz: Annotated[float, Field(ge=1, le=500)] = 50.0
    watchdog_ms: Annotated[int, Field(ge=0, le=2540)] = 200
    faults: list[str] = []

    @model_validator(mode="after")
    def _needs_port(self) -> BusSettings:
        if self.kind != "simulated" and not self.port:
            raise ValueError("port is needed for a real bus; omote ports lists them")
        return self


class Calibration(Settings):
    """Calibrated points of a channel: the mix at ``at`` gives the angle in ``deg``, straight between them."""

    at: list[Annotated[float, Field(allow_inf_nan=False)]]
    deg: list[Degrees]

    @model_validator(mode="after")
    def _pairs(self) -> Calibration:
        if len(self.at) != len(self.deg) or len(self.at) < 2:
            raise ValueError("at and deg need the same number of points, two or more")
        if any(b <= a for a, b in zip(self.at, self.at[1:], strict=False)):
            raise ValueError("at must rise from point to point")
        return self


class ChannelSettings(Settings):
    """One servo and the chain that leads to it."""

    name: str
    bus: str
    id: Annotated[int, Field(ge=0, le=252)]
    model: str
    mix: dict[str, Annotated[float, Field(allow_inf_nan=False)]]
    map: Calibration
    limit_deg: tuple[Degrees, Degrees]
    max_speed_deg_s: Positive
    max_accel_deg_s2: Positive
    reverse: bool = False
    zero_deg: Degrees = 0.0
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


class RobotSettings(Settings):
    """The channels of one robot, on one or more buses."""

    name: str
    description: str = ""
    buses: list[BusSettings] = Field(min_length=1)
    channels: list[ChannelSettings] = Field(min_length=1)
    profiles: dict[str, dict[str, Any]] = {}
    rules: RuleSettings = RuleSettings()

    @model_validator(mode="before")
    @classmethod
    def _fill_in_profiles(cls, table: Any) -> Any:
        """Give channels what their profile says and they do not."""
        channels, profiles = table.get("channels"), table.get("profiles", {})
        if not isinstance(channels, list) or not isinstance(profiles, dict):
            return table
        filled = [_with_profile(i, channel, profiles) for i, channel in enumerate(channels)]
        return {**table, "channels": filled}

    def on_bus(self, name: str) -> list[ChannelSettings]:
        """The channels on the bus called ``name``, in file order."""
        return [channel for channel in self.channels if channel.bus == name]


def _with_profile(i: int, channel: Any, profiles: dict[str, Any]) -> Any:
    if not isinstance(channel, dict) or "profile" not in channel:
        return channel
    name = channel["profile"]
    if not isinstance(profiles.get(name), dict):
        raise ValueError(f"channels[{i}].profile: no profile called {name!r}{did_you_mean(str(name), profiles)}")
    return {**profiles[name], **channel}


def load_robot(path: Path, parameters: Parameters) -> RobotSettings:
    """Read and cross-check a robot file.

    Raises
    ------
    ConfigError
        listing every fault: unknown keys and parameters, doubled names and ids, buses that do not exist.
    """
    robot = load(path, RobotSettings)
    faults = _doubled(robot) + _references(robot, parameters) + _rules(robot)
    if faults:
        raise config_error(path, faults)
    return robot


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


def _references(robot: RobotSettings, parameters: Parameters) -> list[str]:
    from controller.errors import ParameterError

    buses = {bus.name for bus in robot.buses}
    faults = []
    for i, channel in enumerate(robot.channels):
        if channel.bus not in buses:
            faults.append(f"channels[{i}].bus: no bus called {channel.bus!r} (buses: {', '.join(sorted(buses))})")
        for name in channel.mix:
            try:
                parameters.index(name)
            except ParameterError as error:
                faults.append(f"channels[{i}].mix.{name}: {error}")
        low, high = channel.limit_deg
        faults += [
            f"channels[{i}].map.deg: {deg:g} lies outside limit_deg [{low:g}, {high:g}]"
            for deg in channel.map.deg
            if not low <= deg <= high
        ]
    return faults


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
