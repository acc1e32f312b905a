"""Settings of a robot file: channels from parameters to servo angles, safety rules, profiles, landmarks.

A channel is one servo: a weighted mix of parameters, mapped through calibrated points to an angle, then kept inside
its limits of position, speed and acceleration. Angles are degrees from the servo's centre, growing with its ticks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from controller.base.config import Settings
from controller.base.parameters import Floats
from controller.robot.buses import Bus
from controller.robot.formulas import parse_formula
from controller.robot.linkages.kind import AnyLinkage, LinkageSettings
from controller.robot.terms import Curve, Finite, Term, check_points
from drivers.base.errors import DriverError
from drivers.core.registry import usual_rate_hz

Degrees = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Play = Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Side = Literal["low", "high"]
Names = Annotated[list[str], Field(min_length=1)]


class Calibration(Settings):
    """Calibrated points of a channel: the mix at ``at`` gives the angle in ``deg``, straight or smooth between them."""

    at: list[Finite]
    deg: list[Degrees]
    curve: Curve = "straight"

    @model_validator(mode="after")
    def _are_points(self) -> Calibration:
        check_points(self.at, self.deg, "deg")
        return self


class PulseSettings(Settings):
    """Measured pulses of a hobby servo (us) at angles of the channel (degrees), instead of those of its model."""

    deg: list[Degrees]
    us: list[Annotated[float, Field(ge=64, le=4080)]]

    @model_validator(mode="after")
    def _are_monotonic(self) -> PulseSettings:
        check_points(self.deg, self.us, "us")
        steps = [after - before for before, after in pairwise(self.us)]
        if not (all(step > 0 for step in steps) or all(step < 0 for step in steps)):
            raise ValueError("us must rise, or fall, with every angle")
        return self


class AnchorSettings(Settings):
    """Where on the skin a servo pulls; the ``map`` of its channel then converts millimetres of pull to degrees.

    ``point`` is (u, v) of the part, a position [x, y, z] in mm, for which the nearest vertex of the skin is used, or
    the name of a landmark of the robot. Skin within ``reach_mm`` moves along, less with distance; with ``like`` it
    moves as that parameter moves it (a jaw on its hinge, a lid on its axle). ``both`` also pulls at the mirrored point.
    """

    point: str | Annotated[list[Finite], Field(min_length=2, max_length=3)]
    direction: tuple[Finite, Finite, Finite]
    part: str = "face"
    reach_mm: Positive = 15.0
    like: str | None = None
    both: bool = False

    @field_validator("direction")
    @classmethod
    def _is_not_zero(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(value):
            raise ValueError("a direction must not be zero")
        return value

    @model_validator(mode="after")
    def _is_both_or_like(self) -> AnchorSettings:
        if self.both and self.like is not None:
            raise ValueError("both and like do not go together")
        return self

    @property
    def unit_direction(self) -> Floats:
        """(3,) the direction with length 1."""
        unit: Floats = np.array(self.direction) / np.linalg.norm(self.direction)
        return unit


class SmoothSettings(Settings):
    """Smoothing of a channel's target: a moving average over ``average_s``, or a One Euro filter.

    min_cutoff_hz : cut-off for a target at rest; lower is smoother. beta : its increase with speed, Hz per degree/s.
    """

    average_s: Annotated[float, Field(ge=0, le=5, allow_inf_nan=False)] | None = None
    min_cutoff_hz: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] | None = None
    beta: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _is_one(self) -> SmoothSettings:
        if (self.average_s is None) == (self.min_cutoff_hz is None):
            raise ValueError("needs either average_s or min_cutoff_hz")
        if self.average_s is not None and self.beta:
            raise ValueError("beta goes with min_cutoff_hz")
        return self


def _readable(text: str) -> str:
    parse_formula(text)
    return text


class ChannelSettings(Settings):
    """One servo: what it follows, its calibrated points and its limits."""

    name: str
    bus: str
    id: Annotated[int, Field(ge=0, le=252)]
    model: str
    mix: dict[str, Term] = {}
    join: Literal["sum", "min", "max"] = "sum"
    formula: Annotated[str, AfterValidator(_readable)] | None = None
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
    smooth: SmoothSettings | None = None
    slow_start_s: Annotated[float, Field(ge=0, le=60, allow_inf_nan=False)] = 0.0
    dead_band_deg: Play = 0.0
    slack_deg: Play = 0.0
    profile: str | None = None

    @field_validator("limit_deg")
    @classmethod
    def _is_in_order(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise ValueError("the lower limit must be below the upper one")
        return value

    @model_validator(mode="after")
    def _follows_one(self) -> ChannelSettings:
        if sum((bool(self.mix), self.anchor is not None, self.formula is not None)) > 1:
            raise ValueError("needs one of mix, formula and anchor")
        return self

    @property
    def follows(self) -> bool:
        """Whether the channel has its own mix, formula or anchor; else a linkage gives its angle."""
        return bool(self.mix) or self.anchor is not None or self.formula is not None


class PreventRule(Settings):
    """Antagonists: ``channel`` is limited to ``extreme`` while ``other`` is, or should go, past ``other_extreme``.

    ``other`` has precedence, but waits until ``channel`` has moved back. Positions in rules are relative: 0 is the
    channel's angle for the neutral face, 1 its limit on the side of ``toward``, so a rule stays valid after another
    calibration. :mod:`controller.robot.safety` applies the rules.
    """

    channel: str
    toward: Side
    extreme: Share
    other: str
    other_toward: Side
    other_extreme: Share


class TimingRule(Settings):
    """Time at an extreme: after ``hold_s`` past ``extreme`` the limit falls to it, stays there, and rises again."""

    channels: Names
    toward: Side
    extreme: Share
    hold_s: Seconds
    fall_s: Positive
    rest_s: Seconds
    recover_s: Positive


class LoadRule(Settings):
    """Load: after ``after_s`` above ``current_a`` the servo gives way from its measured position.

    It moves back at ``fall_deg_s`` while overloaded, by at most ``most_deg``; ``rest_s`` after the load has gone the
    limit returns at ``rise_deg_s``.
    """

    channels: Names
    current_a: Positive
    after_s: Seconds
    most_deg: Positive = 15.0
    fall_deg_s: Positive = 30.0
    rest_s: Seconds = 1.0
    rise_deg_s: Positive = 10.0


class HeatRule(Settings):
    """Temperature: from ``above_c`` to ``full_c`` the range about the neutral face and the top speed shrink.

    At ``full_c`` they are multiplied by ``range`` and ``speed``.
    """

    channels: Names
    above_c: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
    full_c: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
    range: Share = 0.5
    speed: Annotated[float, Field(ge=0.05, le=1, allow_inf_nan=False)] = 0.3

    @model_validator(mode="after")
    def _rises(self) -> HeatRule:
        if self.above_c >= self.full_c:
            raise ValueError("above_c must be below full_c")
        return self


Rule = TypeVar("Rule", TimingRule, LoadRule, HeatRule)


class RuleSettings(Settings):
    """All safety rules of a robot, by kind."""

    prevent: list[PreventRule] = []
    timing: list[TimingRule] = []
    load: list[LoadRule] = []
    heat: list[HeatRule] = []

    def within(self, names: Sequence[str]) -> RuleSettings:
        """The rules as far as they concern the channels called ``names``; ``prevent`` needs both of its channels."""
        return RuleSettings(
            prevent=[rule for rule in self.prevent if {rule.channel, rule.other} <= set(names)],
            timing=_for_channels(self.timing, names),
            load=_for_channels(self.load, names),
            heat=_for_channels(self.heat, names),
        )

    def mentions(self) -> Iterator[tuple[str, str]]:
        """Yield the key of the rule and the name of every channel that a rule names."""
        for i, rule in enumerate(self.prevent):
            yield f"rules.prevent[{i}].channel", rule.channel
            yield f"rules.prevent[{i}].other", rule.other
        for kind in ("timing", "load", "heat"):
            for i, named in enumerate(getattr(self, kind)):
                for j, name in enumerate(named.channels):
                    yield f"rules.{kind}[{i}].channels[{j}]", name


def _for_channels(rules: list[Rule], names: Sequence[str]) -> list[Rule]:
    kept = [(rule, [name for name in rule.channels if name in names]) for rule in rules]
    return [rule.model_copy(update={"channels": own}) for rule, own in kept if own]


class RobotSettings(Settings):
    """The channels of one robot, on one or more buses.

    ``calibration`` names a file that ``omote calibrate`` wrote for this head (:mod:`controller.robot.calibration`);
    ``vocabularies`` files with parameters of its own that its mixes name.
    """

    name: str
    description: str = ""
    calibration: str | None = None
    vocabularies: Annotated[list[str], Field(max_length=64)] = []
    buses: list[Bus] = Field(min_length=1, max_length=64)
    channels: list[ChannelSettings] = Field(min_length=1, max_length=1024)
    linkages: Annotated[list[AnyLinkage], Field(max_length=64)] = []
    landmarks: dict[str, Annotated[list[Finite], Field(min_length=2, max_length=3)]] = {}
    profiles: dict[str, dict[str, Any]] = {}
    rules: RuleSettings = RuleSettings()

    @model_validator(mode="before")
    @classmethod
    def _fill_in_profiles(cls, table: Any) -> Any:
        """Fill in values of channels from their profile where they do not set them."""
        channels, profiles = table.get("channels"), table.get("profiles", {})
        if not isinstance(channels, list) or not isinstance(profiles, dict):
            return table
        return {**table, "channels": [_with_profile(channel, profiles) for channel in channels]}

    @model_validator(mode="after")
    def _fill_in_rates(self) -> RobotSettings:
        """Fill in the rate of buses that give none: the default for their servos."""
        for at, bus in enumerate(self.buses):
            models = [channel.model for channel in self.on_bus(bus.name)]
            if "rate_hz" not in bus.model_fields_set:
                with suppress(DriverError):  # an unknown model or kind has an error of its own
                    self.buses[at] = bus.model_copy(update={"rate_hz": usual_rate_hz(bus.family, models, bus.baud)})
        return self

    @property
    def anchored_channels(self) -> list[ChannelSettings]:
        """The channels that have an anchor, in file order."""
        return [channel for channel in self.channels if channel.anchor is not None]

    def linkages_on(self, bus: str) -> list[LinkageSettings]:
        """The linkages of the channels on a bus; a linkage lies on one."""
        names = {channel.name for channel in self.on_bus(bus)}
        return [linkage for linkage in self.linkages if names.issuperset(linkage.channels)]

    def on_bus(self, name: str) -> list[ChannelSettings]:
        """The channels on the bus called ``name``, in file order."""
        return [channel for channel in self.channels if channel.bus == name]


def _with_profile(channel: Any, profiles: dict[str, Any]) -> Any:
    """Return a channel with the values of its profile; with the values of all profiles where its name is unknown."""
    if not isinstance(channel, dict) or "profile" not in channel:
        return channel
    own = profiles.get(str(channel["profile"]))
    tables = [own] if isinstance(own, dict) else [each for each in profiles.values() if isinstance(each, dict)]
    return {key: value for table in (*tables, channel) for key, value in table.items()}
