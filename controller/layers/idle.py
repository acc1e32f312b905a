"""Generates idle motion: blinks, glances, micro-saccades, breathing, sway and small fidgets.

It depends on nothing but the seed and the times it is updated to; the settings are in ``configs/life``.
"""

from __future__ import annotations

import math
import random
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from controller.base.config import Number, Settings, Share, load
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import find_config
from controller.motion.motion import Envelope, minimum_jerk

Seconds = Annotated[Number, Field(gt=0, le=3600)]
Degrees = Annotated[Number, Field(ge=0, le=45)]


def _in_order(span: tuple[float, float]) -> tuple[float, float]:
    if span[0] > span[1]:
        raise ValueError(f"must be [shortest, longest], not {list(span)}")
    return span


Span = Annotated[tuple[Annotated[Number, Field(ge=0, le=3600)], Seconds], AfterValidator(_in_order)]


Period = Annotated[Number, Field(ge=0.1, le=3600)]
Periods = Annotated[tuple[Period, Period], AfterValidator(_in_order)]  # times are divided by them


class BlinkSettings(Settings):
    interval_s: Span
    double_share: Share
    double_gap_s: Span
    close_s: Seconds
    hold_s: Span
    open_s: Seconds
    shift_deg: Degrees
    shift_share: Share


class EyeSettings(Settings):
    interval_s: Span
    yaw_deg: Degrees
    pitch_deg: Degrees
    home_share: Share
    micro_interval_s: Span
    micro_deg: Degrees


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


class FidgetSettings(Settings):
    interval_s: Span
    rise_s: Seconds
    hold_s: Span
    fall_s: Seconds
    amount: Share
    parameters: list[str]


class IdleSettings(Settings):
    """All settings of idle motion."""

    blink: BlinkSettings
    eyes: EyeSettings
    head: HeadSettings
    breath: BreathSettings
    fidget: FidgetSettings

    @classmethod
    def named(cls, name: str, parameters: Parameters) -> IdleSettings:
        """The settings at a path or of a name in ``configs/life``. Raises ConfigError."""

        def faults(settings: IdleSettings) -> list[str]:
            return [f"fidget.parameters[{i}]: unknown parameter {name!r}{did_you_mean(name, parameters.names)}"
                    for i, name in enumerate(settings.fidget.parameters) if name not in parameters.names]  # fmt: skip

        return load(find_config("life", name), cls, faults)


class IdleMotion:
    """Idle motion of one face.

    Parameters
    ----------
    settings : rates and sizes. seed : the same seed gives the same motion.

    Attributes
    ----------
    liveliness : 0..1, scales everything; at 0 nothing moves. values : (P,) float64, what it adds to the face.
    eye_yaw_rad, eye_pitch_rad : where the eyes are off their direction. head_rad : (3,) yaw, pitch, roll of the head.
    """

    def __init__(self, parameters: Parameters, settings: IdleSettings, seed: int = 0) -> None:
        self.liveliness = 0.0
        self.values = parameters.neutral()
        self.eye_yaw_rad = self.eye_pitch_rad = 0.0
        self.head_rad = np.zeros(3)
        self._random = random.Random(seed)
        self._settings = settings
        self._lids = parameters.indices(["eyeBlinkLeft", "eyeBlinkRight"])
        self._eyes = parameters.indices(["leftEyeYaw", "rightEyeYaw", "leftEyePitch", "rightEyePitch"])
        self._eye_scale = parameters.full_scale_rad[self._eyes]
        self._head = parameters.indices(["headYaw", "headPitch", "headRoll"])
        self._head_scale = parameters.full_scale_rad[self._head]
        self._fidgets = parameters.indices(settings.fidget.parameters)
        self._fidget, self._fidget_index = Envelope(0.0, 0.0, 0.0, 0.0), 0
        self._blinks: list[Envelope] = []
        self._sway = [(self._pick(settings.head.period_s), self._random.uniform(0, 2 * math.pi)) for _ in range(9)]
        self._next_blink_s = self._next_eye_s = self._next_fidget_s = -math.inf

    def shift(self, angle_rad: float, now_s: float) -> None:
        """The gaze jumps by an angle; a large jump may trigger a blink."""
        blink = self._settings.blink
        if math.degrees(abs(angle_rad)) >= blink.shift_deg and self._random.random() < blink.shift_share:
            self._next_blink_s = min(self._next_blink_s, now_s)

    def update(self, now_s: float, *, looking: bool, blink_block: float = 0.0, gaze_block: float = 0.0) -> Floats:
        """Move to ``now_s``; returns :attr:`values`.

        looking : something is looked at: micro-saccades instead of glances, and no eye angles in ``values``.
        blink_block, gaze_block : how much an expression holds back blinks and glances, 0..1.
        """
        self.values.fill(0.0)
        if self.liveliness <= 0.0:
            self._rest()
            return self.values
        self._move_eyes(now_s, looking)
        self._move_head(now_s)
        self._do_fidget(now_s)
        self.values[self._lids] = self._blink(now_s) * (1.0 - blink_block)
        self.values[self._head] = self.head_rad / self._head_scale
        if not looking:
            open_ = self.liveliness * (1.0 - gaze_block)
            self.values[self._eyes[:2]] = open_ * self.eye_yaw_rad / self._eye_scale[:2]
            self.values[self._eyes[2:]] = open_ * self.eye_pitch_rad / self._eye_scale[2:]
        return self.values

    def _rest(self) -> None:
        self.eye_yaw_rad = self.eye_pitch_rad = 0.0
        self.head_rad[:] = 0.0
        self._blinks.clear()
        self._next_blink_s = self._next_eye_s = self._next_fidget_s = -math.inf

    def _pick(self, span: tuple[float, float]) -> float:
        return self._random.uniform(*span)

    def _blink(self, now_s: float) -> float:
        """How far the lids are closed, 0..1."""
        blink = self._settings.blink
        if self._next_blink_s == -math.inf:
            self._next_blink_s = now_s + self._pick(blink.interval_s)
        if now_s >= self._next_blink_s:
            self._blinks = [Envelope(now_s, blink.close_s, self._pick(blink.hold_s), blink.open_s)]
            if self._random.random() < blink.double_share:
                again = self._blinks[0].end_s + self._pick(blink.double_gap_s)
                self._blinks.append(Envelope(again, blink.close_s, self._pick(blink.hold_s), blink.open_s))
            self._next_blink_s = self._blinks[-1].end_s + self._pick(blink.interval_s)
        return max((each.level(now_s) for each in self._blinks), default=0.0)

    def _move_eyes(self, now_s: float, looking: bool) -> None:
        if now_s < self._next_eye_s:
            return
        eyes = self._settings.eyes
        self._next_eye_s = now_s + self._pick(eyes.micro_interval_s if looking else eyes.interval_s)
        home = not looking and self._random.random() < eyes.home_share
        yaw, pitch = (eyes.micro_deg, eyes.micro_deg) if looking else (eyes.yaw_deg, eyes.pitch_deg)
        spread = 0.0 if home else 0.5  # two standard deviations reach the figure in the file
        yaw_share, pitch_share = (min(max(self._random.gauss(0.0, spread), -1.0), 1.0) for _ in range(2))
        self.eye_yaw_rad, self.eye_pitch_rad = math.radians(yaw_share * yaw), math.radians(pitch_share * pitch)

    def _move_head(self, now_s: float) -> None:
        head, breath = self._settings.head, self._settings.breath
        reach = (head.yaw_deg, head.pitch_deg, head.roll_deg)
        for axis in range(3):
            waves = self._sway[3 * axis : 3 * axis + 3]
            mean = sum(math.sin(2 * math.pi * now_s / period + phase) for period, phase in waves) / 3
            self.head_rad[axis] = math.radians(reach[axis]) * mean * self.liveliness
        self.head_rad[1] -= math.radians(breath.pitch_deg) * _breath(breath, now_s) * self.liveliness

    def _do_fidget(self, now_s: float) -> None:
        fidget = self._settings.fidget
        if self._next_fidget_s == -math.inf:
            self._next_fidget_s = now_s + self._pick(fidget.interval_s)
        if now_s >= self._next_fidget_s and len(self._fidgets):
            self._fidget = Envelope(now_s, fidget.rise_s, self._pick(fidget.hold_s), fidget.fall_s)
            self._fidget_index = int(self._random.choice(self._fidgets.tolist()))
            self._next_fidget_s = self._fidget.end_s + self._pick(fidget.interval_s)
        self.values[self._fidget_index] += self._fidget.level(now_s) * fidget.amount * self.liveliness


def _breath(breath: BreathSettings, now_s: float) -> float:
    """How full the lungs are, 0..1."""
    t = now_s % (breath.inhale_s + breath.hold_s + breath.exhale_s + breath.pause_s)
    if t < breath.inhale_s + breath.hold_s:
        return minimum_jerk(t / breath.inhale_s)
    return 1.0 - minimum_jerk((t - breath.inhale_s - breath.hold_s) / breath.exhale_s)
