"""Reads the settings of idle motion from a file in ``configs/life``; missing keys are those of ``natural``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from controller.base.config import Fraction, Number, Settings, check, read_toml
from controller.base.errors import ParameterError
from controller.base.parameters import Parameters, did_you_mean
from controller.base.paths import config_dir, find_config
from controller.layers.idle.draws import Draw, Span, in_order
from controller.vocabulary.sides import unknown_names

Manner = Literal["alone", "listen", "speak"]
"""How a face behaves: with nobody in particular, listening to somebody, or speaking."""

MANNERS: tuple[Manner, ...] = ("alone", "listen", "speak")

AUTO = "auto"
"""Chooses the manner: ``speak`` while the face speaks, ``listen`` for a time after that, else ``alone``."""

Seconds = Annotated[Number, Field(gt=0, le=3600)]
Delay = Annotated[Number, Field(ge=0, le=10)]
Degrees = Annotated[Number, Field(ge=0, le=45)]
Angle = Annotated[Number, Field(ge=-45, le=45)]
Weight = Annotated[Number, Field(ge=0, le=1000)]
Factor = Annotated[Number, Field(ge=0, le=10)]
Fractions = Annotated[tuple[Fraction, Fraction], AfterValidator(in_order)]
Angles = Annotated[tuple[Degrees, Degrees], AfterValidator(in_order)]
Period = Annotated[Number, Field(ge=0.1, le=3600)]
Periods = Annotated[tuple[Period, Period], AfterValidator(in_order)]  # times are divided by them
Hertz = Annotated[Number, Field(ge=0.005, le=5)]
Band = Annotated[tuple[Hertz, Hertz], AfterValidator(in_order)]
Share = Annotated[Number, Field(ge=0, le=0.2)]


def check_manner(name: str | None) -> Manner | None:
    """Return the manner of a name; None for ``auto`` and for None. Raises ParameterError: unknown name."""
    if name is None or name == AUTO:
        return None
    for manner in MANNERS:
        if manner == name:
            return manner
    known = ", ".join((AUTO, *MANNERS))
    raise ParameterError(f"unknown manner {name!r}{did_you_mean(name, (AUTO, *MANNERS))}", hint=f"one of: {known}")


class BlinkSettings(Settings):
    interval_s: Draw
    double_share: Fraction
    double_gap_s: Span
    close_s: Seconds
    hold_s: Span
    open_s: Seconds
    shift_deg: Degrees
    shift_share: Fraction
    partial_share: Fraction
    partial_amount: Fractions
    lag_s: Annotated[Number, Field(ge=0, le=0.05)]
    uneven_share: Fraction
    along: dict[str, Fraction]


class EyeSettings(Settings):
    base_s: Seconds
    per_deg_s: Delay
    micro_interval_s: Draw
    micro_deg: Degrees
    drift_deg: Degrees


class PointSettings(Settings):
    yaw_deg: Angle
    pitch_deg: Angle
    spread_deg: Degrees = 0.0
    weight: Weight = 1.0


class WanderSettings(Settings):
    weight: Weight
    mean_deg: Annotated[Degrees, Field(gt=0)]
    least_deg: Degrees
    directions: Annotated[list[Weight], Field(min_length=8, max_length=8)]


class GazeSettings(Settings):
    fixation_s: Draw
    listener: Annotated[dict[str, PointSettings], Field(min_length=1)]
    points: dict[str, PointSettings]
    wander: WanderSettings


class MannerSettings(Settings):
    look_s: Draw
    away_s: Draw
    farthest_deg: Degrees
    blink_rate: Annotated[Number, Field(gt=0, le=10)]
    sway: Factor


class TurnSettings(Settings):
    comfort_deg: Degrees
    share: Fraction
    pitch_share: Fraction
    delay_s: Delay
    base_s: Seconds
    per_deg_s: Delay


class PostureSettings(Settings):
    interval_s: Draw
    length_s: Span
    yaw_deg: Degrees
    pitch_deg: Degrees
    roll_deg: Degrees


class HeadSettings(Settings):
    yaw_deg: Degrees
    pitch_deg: Degrees
    roll_deg: Degrees
    period_s: Periods


class BreathSettings(Settings):
    inhale_s: Seconds
    hold_s: Seconds
    exhale_s: Seconds
    pause_s: Seconds
    pitch_deg: Degrees
    rise_mm: Annotated[Number, Field(ge=0, le=10)]


class PupilSettings(Settings):
    slow_hz: Band
    slow: Share
    fast_hz: Band
    fast: Share
    breath: Share
    latency_s: Delay
    narrow_s: Seconds
    widen_s: Seconds


class NodSettings(Settings):
    interval_s: Draw
    depth_deg: Angles
    cycle_s: Annotated[tuple[Seconds, Seconds], AfterValidator(in_order)]
    most_cycles: Annotated[int, Field(ge=1, le=10)]
    fade: Fraction


class PoseSettings(Settings):
    weights: dict[str, Annotated[Number, Field(ge=-1, le=1)]]
    side: Literal["both", "either"] = "both"
    often: Weight = 1.0


class GestureSettings(Settings):
    interval_s: Draw
    rise_s: Seconds
    hold_s: Span
    fall_s: Seconds
    amount: Fraction
    poses: dict[str, PoseSettings]


class FidgetSettings(GestureSettings):
    parameters: list[str] = []


class SpeechSettings(Settings):
    gate: Fraction
    pause_s: Seconds
    stress: Fraction
    stress_gap_s: Seconds
    brow_share: Fraction
    nod_share: Fraction
    blink_share: Fraction
    end_blink_share: Fraction
    away_share: Fraction
    listen_s: Seconds
    nod_deg: Angles
    nod_s: Seconds
    rise_s: Seconds
    hold_s: Span
    fall_s: Seconds
    amount: Fraction
    brows: dict[str, PoseSettings]


class IdleSettings(Settings):
    """All settings of idle motion."""

    blink: BlinkSettings
    eyes: EyeSettings
    gaze: GazeSettings
    alone: MannerSettings
    listen: MannerSettings
    speak: MannerSettings
    turn: TurnSettings
    posture: PostureSettings
    head: HeadSettings
    breath: BreathSettings
    pupil: PupilSettings
    nod: NodSettings
    fidget: FidgetSettings
    smile: GestureSettings
    swallow: GestureSettings
    speech: SpeechSettings

    def manner(self, name: Manner) -> MannerSettings:
        """Return the settings of a manner."""
        table: MannerSettings = getattr(self, name)
        return table

    @classmethod
    def named(cls, name: str, parameters: Parameters) -> IdleSettings:
        """Read the settings at a path or of a name in ``configs/life``; missing keys are those of ``natural``.

        Raises ConfigError: the file cannot be read or is invalid; it lists every fault with its key.
        """
        path, shipped = find_config("life", name), config_dir() / "life" / "natural.toml"
        table = read_toml(path)
        merged = table if path == shipped else _merge(read_toml(shipped), table)
        return check(merged, cls, path, lambda settings: list(_faults(settings, parameters)))


def _merge(shipped: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of both; a key of ``own`` replaces that of ``shipped``."""
    merged = {**shipped, **own}
    for name in set(shipped) & set(own):
        if isinstance(shipped[name], Mapping) and isinstance(own[name], Mapping):
            merged[name] = {**shipped[name], **own[name]}
    return merged


def _faults(settings: IdleSettings, parameters: Parameters) -> Iterator[str]:
    for i, name in enumerate(settings.fidget.parameters):
        if name not in parameters.names:
            yield f"fidget.parameters[{i}]: unknown parameter {name!r}{did_you_mean(name, parameters.names)}"
    yield from unknown_names(parameters, "blink.along", settings.blink.along)
    tables = {"fidget.poses": settings.fidget.poses, "smile.poses": settings.smile.poses,
              "swallow.poses": settings.swallow.poses, "speech.brows": settings.speech.brows}  # fmt: skip
    for where, poses in tables.items():
        for name, pose in poses.items():
            yield from unknown_names(parameters, f"{where}.{name}.weights", pose.weights)
