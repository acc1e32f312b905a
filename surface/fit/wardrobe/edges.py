"""Edges of sheets along their strands, as beside a face: strands grow sparse there, leave the others and end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import Thickness, way
from surface.fit.wardrobe.patches import BARE, Patches
from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.styles import thinned

_WANDERS = 0.3  # by how much cover at an edge differs along it
_WAVES = (34.0, 1.0), (18.0, 0.8), (10.3, 0.6)  # along strands, in which it does: how long, mm, and how far
_ASLANT = 0.7  # of the way along strands, by which they are out of step across them
_BARED = 0.9  # of the light that sheets above keep from an edge, what reaches it where they fray: else it is dark
Edges = tuple[Thickness | None, Thickness | None]
"""Mm (n,) over which strands grow sparse at places (n, 3) of the first line of strands and of the last; None where they
do not."""


def frayed(made: Patches, edges: Edges, share: float, random: np.random.Generator) -> Patches:
    """A sheet of one patch whose strands grow sparse over a share of what ``edges`` say: where an edge wanders, single
    strands come out of it and end."""
    if edges == (None, None):
        return made
    at = surface_at(made.points[0], made.degrees, [np.linspace(0.0, 1.0, n) for n in made.grid])
    across, along = way(at, 0), way(at, 1)
    strands = made.strands.copy()
    cover, opened = strands[0, ..., 2], strands[0, ..., 3]
    for width, away, line in zip(edges, (across, across[-1] - across), at[[0, -1]], strict=True):
        if width is not None:
            left = away / (share * width(line)) - _WANDERS * _wandering(away, along, random)
            left = np.where(away > 0.0, left, -BARE)
            cover[:] = thinned(cover, left)
            opened += _BARED * np.sqrt(1.0 - np.clip(left, 0.0, 1.0)) * (1.0 - opened)
    return replace(made, strands=strands)


def _wandering(across: Floats, along: Floats, random: np.random.Generator) -> Floats:
    """(gu, gv) noise from 0 to 1 at such mm, which changes along strands more slowly than across them."""
    out = np.zeros_like(across)
    for (long, far), begun in zip(_WAVES, random.uniform(0.0, 2.0 * np.pi, len(_WAVES)), strict=True):
        out += far * (0.5 + 0.5 * np.sin(2.0 * np.pi * (along + _ASLANT * across) / long + begun))
    return out / sum(far for _, far in _WAVES)
