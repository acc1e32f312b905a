"""A gimbal: one servo turns a ring, and a servo on the ring turns the part inside, such as an eye.

omote's angles turn by yaw first and then by pitch. A gimbal whose outer ring is pitch needs other angles for the same
direction of gaze: yaw' = asin(sin yaw cos pitch), pitch' = atan2(sin pitch, cos pitch cos yaw); roll is ignored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from controller.base.parameters import Floats
from controller.robot.linkages.kind import API, LinkageKind, LinkageSettings

_MAX_DEG = 80.0


class GimbalSettings(LinkageSettings):
    """``channels`` : the servo of yaw, then that of pitch. ``outer`` : which of the two turns the outer ring."""

    channels: Annotated[list[str], Field(min_length=2, max_length=2)]
    outer: Literal["yaw", "pitch"] = "pitch"

    @model_validator(mode="after")
    def _fits(self) -> GimbalSettings:
        if set(self.inputs) != {"yaw", "pitch"}:
            raise ValueError("inputs: a gimbal has yaw and pitch")
        return self


@dataclass(frozen=True)
class Gimbal:
    """yaw_first : whether the inputs are yaw, pitch; else pitch, yaw. pitch_outside : pitch turns the outer ring."""

    yaw_first: bool
    pitch_outside: bool

    def angles(self, inputs: Floats) -> tuple[Floats, bool]:
        """(2,) degrees of the servos of yaw and of pitch; clipped at 80 degrees, before the rings align."""
        wanted = inputs if self.yaw_first else inputs[::-1]
        clipped = np.clip(wanted, -_MAX_DEG, _MAX_DEG)
        beyond = bool((clipped != wanted).any())
        if not self.pitch_outside:
            return clipped, beyond
        yaw, pitch = np.radians(clipped)
        inner, outer = np.arcsin(np.sin(yaw) * np.cos(pitch)), np.arctan2(np.sin(pitch), np.cos(pitch) * np.cos(yaw))
        return np.degrees(np.array([inner, outer])), beyond


def _make(settings: GimbalSettings) -> Gimbal:
    return Gimbal(next(iter(settings.inputs)) == "yaw", settings.outer == "pitch")


LINKAGE = LinkageKind(
    api=API, kind="gimbal", title="two servos, one on the ring of the other", settings=GimbalSettings, make=_make
)
