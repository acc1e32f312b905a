"""Short hair: combed forwards to the side on top, close at the sides and behind."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheets
from surface.fit.wardrobe.skin import CENTRE, Skin, unit
from surface.fit.wardrobe.styles import Style, step, tangent

CROWN = np.array([12.0, 132.0, -42.0])
RING_RAD = 0.05  # from the crown, seen from the skull's middle: where guides begin
GUIDES = 73
LAYERS = (Layer(1.06, 0.46, 1.0, 34.0), Layer(1.0, 0.70, 0.92, 20.0), Layer(0.90, 1.6, 0.74, 12.0))


def short(skin: Skin) -> Style:
    """Strands go from the crown to the line all round, and over it on the forehead."""
    line = Hairline(skin)
    round_it = np.linspace(np.pi, -np.pi, GUIDES)

    def thickness(at: Floats) -> Floats:
        full = 3.0 + 8.0 * _top(at) + 3.0 * _top(at) * step(at[:, 2], 30.0, 75.0) - 1.4 * step(-at[:, 1], -40.0, 50.0)
        return np.asarray(1.8 + full * step(line.inside(at), -10.0, 26.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        away = tangent(at - CROWN, normals)
        aside = tangent(np.tile([0.8, 0.0, 0.5], (len(at), 1)), normals)
        down = tangent(np.tile([0.0, -1.0, -0.1], (len(at), 1)), normals)
        top = _top(at)[:, None]
        return tangent(away * (0.8 + 0.2 * top) + 0.35 * top * aside + 0.45 * (1.0 - top) * down, normals)

    def cut(at: Floats) -> Floats:
        front = step(at[:, 2], 34.0, 84.0)
        nape = step(-at[:, 2], 30.0, 50.0)
        return np.asarray(line.inside(at) + 2.0 + 17.0 * front + 4.0 * nape)

    roots = _ring(skin, round_it)
    ragged = 2.0 + 5.0 * step(np.cos(round_it), 0.3, 0.8)  # in front
    comb = Comb(roots, np.full(GUIDES, 330.0), thickness, flow, cut, ragged, steps=66, slack=0.5)
    made = sheets(skin, comb, LAYERS, Weave((73, 12), (97, 15), (49, 9)), seed=11, closed=True)
    return Style(made, line)


def _ring(skin: Skin, round_it: Floats) -> Floats:
    """(g, 3) places on the skin in a small ring round the crown."""
    pole = unit(CROWN - CENTRE)
    front = unit(np.array([0.0, 0.0, 1.0]) - pole[2] * pole)
    side = np.cross(pole, front)
    aside = np.outer(np.cos(round_it), front) + np.outer(np.sin(round_it), side)
    toward = unit(np.cos(RING_RAD) * pole + np.sin(RING_RAD) * aside)
    return np.asarray(CENTRE + toward * skin.reach(toward)[:, None])


def _top(at: Floats) -> Floats:
    """(n,) 1 on top of the head, 0 at its sides."""
    return step(at[:, 1] + 0.25 * at[:, 2], 78.0, 118.0)
