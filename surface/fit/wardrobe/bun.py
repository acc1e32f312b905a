"""Hair drawn back into a bun."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import TIED, Hairline, directions
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheet, sheets
from surface.fit.wardrobe.skin import CENTRE, Skin, unit
from surface.fit.wardrobe.strays import Strays, strays
from surface.fit.wardrobe.styles import Style, step, tangent

BUN = np.array([0.0, 98.0, -97.0])  # its middle, mm
_OUT = unit(np.array([0.0, 0.42, -0.91]))  # where it points
_RADII = np.array([29.0, 26.0, 22.0])  # half its width, its height, and along where it points
GUIDES = 73
LAYERS = (
    Layer(1.06, 0.50, 1.0, 4.0, 0.8, 26.0, edge_mm=10.0), Layer(1.0, 0.78, 0.92, 4.0, 1.1, 20.0, edge_mm=12.0),
    Layer(0.90, 1.8, 0.80, 4.0, 2.1, 13.0, edge_mm=14.0),
)  # fmt: skip
# The inner one so dense that it is closed up to its tip: nothing lies below it
BUN_LAYERS = (Layer(1.04, 0.5, 1.0, 6.0), Layer(1.0, 7.6, 0.82, 0.2))
UNDER_MM = 8.0  # from the middle of the bun's base: there strands of the skull end, well below the coil
FADE_MM = -7.0, 9.0  # short hairs that the tie does not reach: without them the line is cut as with a saw
EDGE_MM = 2.5  # outside the line, where the first hairs grow
STRAYS, COIL_STRAYS = Strays(44, 4.5, (0.0, 0.85)), Strays(12, 5.0, (0.0, 0.9))
_UNEVEN = 0.01  # rad from the crown, by which hair begins sooner or later: along an even line it would be a cap
_TURNS = 0.62  # of a strand about the bun, from its base to its tip


def bun(skin: Skin) -> Style:
    """All hair lies on the skull, from the line to a bun high on the back of the head."""
    line = Hairline(skin, TIED)
    base = BUN - 14.0 * _OUT
    round_it = np.linspace(np.pi, -np.pi, GUIDES)
    uneven = _UNEVEN * (np.sin(9.0 * round_it + 1.0) + 0.7 * np.sin(23.0 * round_it))
    toward = directions(line.down(round_it) + 0.012 + uneven, round_it)
    roots = CENTRE + toward * skin.reach(toward)[:, None]

    def thickness(at: Floats) -> Floats:
        return np.asarray(1.0 + 4.9 * step(line.inside(at), -2.0, 34.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        ahead = tangent(base - at, normals)
        back = tangent(np.tile([0.0, 0.25, -1.0], (len(at), 1)), normals)
        near = step(-np.linalg.norm(at - base, axis=1), -120.0, -50.0)[:, None]
        return unit(ahead * (0.65 + 0.35 * near) + 0.35 * (1.0 - near) * back)

    def cut(at: Floats) -> Floats:
        return np.asarray(np.linalg.norm(at - base, axis=1) - UNDER_MM)

    def edge(at: Floats) -> Floats:
        return np.asarray(line.inside(at) + EDGE_MM)

    comb = Comb(roots[::-1], np.full(GUIDES, 330.0), thickness, flow, cut, 0.0, 0.9, 0.0, steps=66, slack=0.4,
                edge=edge)  # fmt: skip
    made = sheets(skin, comb, LAYERS, Weave((73, 12), (97, 15), (49, 9), -0.35), seed=31, closed=True)
    coil = _coil()
    stray = [strays(sheet, how, middle, seed=38) for sheet, how, middle in (
        (made[0], STRAYS, CENTRE), (coil[0], COIL_STRAYS, BUN),
    )]  # fmt: skip
    return Style([*coil, *made], line, fade=FADE_MM, strays=tuple(stray))


def _frame() -> Floats:
    """(3, 3) rows: to the left, up and out of the bun."""
    side = np.array([1.0, 0.0, 0.0])
    return np.stack([side, np.cross(_OUT, side), _OUT])


def _surface(polar: Floats, round_it: Floats, grown: float) -> Floats:
    """Places (..., 3) on the bun, or one that is larger, by the angle from its pole and round it."""
    polar, round_it = np.broadcast_arrays(polar, round_it)
    unit_ball = np.stack([np.sin(polar) * np.cos(round_it), np.sin(polar) * np.sin(round_it), np.cos(polar)], axis=-1)
    return np.asarray(BUN + (grown * _RADII * unit_ball) @ _frame())


def _coil() -> list[Patches]:
    """Strands that wind round the bun, in lobes, from its base to its tip."""
    weave, random = Weave((25, 10), (49, 13), (21, 7)), np.random.default_rng(35)
    start = np.linspace(0.0, 2.0 * np.pi, weave.points[0])[:, None]
    t = np.linspace(0.0, 1.0, weave.points[1])[None]
    polar = np.radians(138.0 - 137.0 * t) + 0.0 * start
    out = []
    for layer in BUN_LAYERS:
        lobes = 1.0 + 0.035 * np.sin(5.0 * start) * np.sin(polar)
        points = _surface(polar, start - 2.0 * np.pi * _TURNS * t, layer.share)
        points = BUN + (points - BUN) * lobes[..., None]
        out.append(sheet(points, layer, weave, random, True, 0.06))
    return out
