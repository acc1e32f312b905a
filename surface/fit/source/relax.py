"""Open up holes that a chart squeezes flat, so that (u, v) is about as long across a lid as along it.

Around every flat hole v is stretched about the hole's centre line. Within the hole's width lines of constant v, and
with them slits, stay straight; further away the stretching fades. u is unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.islands import Island, boundary_loops

OPEN = 0.4  # height over width that a flat hole gets
BAND = 2.0  # half the height of the steep band, in heights of the hole
REACH_V = 2.0  # how far the stretching is felt up and down, in widths of the hole
REACH_U = 1.2  # and to the sides


@dataclass(frozen=True)
class _Band:
    """What is stretched: about v = ``centre``, whole between u = ``start`` and ``end``."""

    centre: float
    start: float
    end: float
    half: float
    extra: float

    def shift(self, uv: Floats) -> Floats:
        """(m,) what is added to v."""
        x, width = uv[:, 1] - self.centre, self.end - self.start
        beside = np.maximum(self.start - uv[:, 0], uv[:, 0] - self.end) / (REACH_U * width)
        t = np.clip(beside, 0.0, 1.0)
        fade = (1.0 - t * t * (3.0 - 2.0 * t)) * np.exp(-((x / (REACH_V * width)) ** 2))
        return self.extra * self.half * np.arctan(x / self.half) * fade


def open_flat_holes(island: Island) -> Island:
    """The island with v stretched around its flat holes."""
    v = island.uv[:, 1] + sum((band.shift(island.uv) for band in _bands(island)), np.zeros(len(island.uv)))
    return Island(island.vertex, np.column_stack([island.uv[:, 0], v]), island.faces)


def _bands(island: Island) -> list[_Band]:
    bands = []
    for loop in boundary_loops(island)[1:]:
        (u0, v0), (u1, v1) = island.uv[loop].min(axis=0), island.uv[loop].max(axis=0)
        width, height = u1 - u0, max(v1 - v0, 1e-6)
        if height < OPEN * width:
            bands.append(_Band(0.5 * (v0 + v1), u0, u1, BAND * height, OPEN * width / height - 1.0))
    return bands
