"""A robot's configuration: buses, and channels from parameters to servo angles.

A channel is one servo: a weighted mix of parameters, carried through calibrated points to an angle, then kept
inside its limits, speed and acceleration. Angles are degrees from the servo's centre, growing with its ticks.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from controller.base.config import Settings
from controller.robot.buses import Bus
from controller.robot.rules import RuleSettings
from controller.robot.terms import Curve, Finite, Term, check_points

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
