"""Two servos side by side that push a plate on a joint by rods: equal angles pitch it, opposite angles roll it.

It is the usual neck of small heads, and drives eyes with two rods. See :mod:`controller.robot.linkages.rods`.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from controller.robot.linkages.kind import API, Linkage, LinkageKind, LinkageSettings
from controller.robot.linkages.rods import POSE, Rods
from controller.robot.terms import Finite

Point = tuple[Finite, Finite, Finite]
Points = Annotated[list[Point], Field(min_length=2, max_length=6)]


class RodSettings(LinkageSettings):
    """Geometry in mm, a point for each servo; see :class:`controller.robot.linkages.rods.Rods`."""

    plate: Points
    axle: Points
    horn: Points
    axis: Points

    @model_validator(mode="after")
    def _fits(self) -> RodSettings:
        unknown = [name for name in self.inputs if name not in POSE]
        if unknown:
            raise ValueError(f"inputs: there is no {unknown[0]!r}; there are {', '.join(POSE)}")
        if len(self.inputs) != len(self.channels):
            raise ValueError(
                f"{len(self.channels)} servos determine {len(self.channels)} inputs, not {len(self.inputs)}"
            )
        for key in ("plate", "axle", "horn", "axis"):
            if len(getattr(self, key)) != len(self.channels):
                raise ValueError(f"{key} needs a point for each of the {len(self.channels)} channels")
        if not all(any(each) for each in self.axis):
            raise ValueError("axis must not be zero")
        make_rods(self)
        return self


class DifferentialSettings(RodSettings):
    """Two servos, two inputs."""

    channels: Annotated[list[str], Field(min_length=2, max_length=2)]


def make_rods(settings: RodSettings) -> Linkage:
    """Create the rods of settings. Raises ValueError where they do not determine the pose of the plate."""
    arrays = (
        np.array(each, dtype=np.float64) for each in (settings.plate, settings.axle, settings.horn, settings.axis)
    )
    return Rods.of(tuple(settings.inputs), *arrays)


LINKAGE = LinkageKind(
    api=API,
    kind="differential",
    title="two servos with rods to one plate",
    settings=DifferentialSettings,
    make=make_rods,
)
