"""Short hair, cut in three ways: with a fringe, swept back from the forehead, and thin with receding temples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import POINTS, RECEDED, SLANTED, Hairline
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheets, tips
from surface.fit.wardrobe.skin import CENTRE, Skin, unit
from surface.fit.wardrobe.strays import Strays, strays
from surface.fit.wardrobe.styles import Style, step, tangent

CROWN = np.array([12.0, 132.0, -42.0])
RING_RAD = 0.05  # from the crown, seen from the skull's middle: where guides leave it
GUIDES = 73
FADE_MM = -4.0, 15.0  # of skin below a fringe, which is no dark patch where locks part at the temple
SWEPT_FADE_MM = -5.0, 17.0  # of skin below hair that is swept back, which grows denser over so wide a border
STRAYS = Strays(36, 5.0, (0.04, 0.9))
RAGGED_MM = 0.7  # by how much the line differs at which hair that is swept back begins
CLOSE_MM = 0.9, 0.4  # over the skin, where hair ends at the line: at the sides and over the forehead
_FLAT_MM = 2.0  # inside the line, over which hair that is swept back lies on the skin and begins to cover it
_SPREADS, _EVEN = 3, 0.75  # how often guides are spread, and how evenly each time
WEAVE = Weave((73, 12), (97, 15), (49, 9), 0.35)
FRINGED = (
    Layer(1.10, 0.44, 1.0, 42.0), Layer(1.0, 0.70, 0.88, 28.0, edge_mm=8.0),
    Layer(0.88, 1.8, 0.70, 17.0, edge_mm=11.0),
)  # fmt: skip
SWEPT = (
    Layer(1.10, 0.46, 1.0, 8.0, cropped_mm=7.0, edge_mm=12.0),
    Layer(1.0, 0.72, 0.90, 6.0, cropped_mm=7.0, edge_mm=16.0),
    Layer(0.88, 1.8, 0.76, 4.0, cropped_mm=7.0, edge_mm=20.0),
)  # fmt: skip


@dataclass(frozen=True)
class Sweep:
    """How hair is swept back: its line; mm it has over the skin at the sides, on top, and more at the forehead; how far
    it goes to one side; mm from the line until it lies so high; its sheets."""

    points: Floats
    sides_mm: float
    top_mm: float
    front_mm: float
    aside: float
    rise_mm: float
    layers: tuple[Layer, ...]


BACK = Sweep(POINTS, 2.2, 6.5, 5.5, 0.45, 30.0, SWEPT)
THIN = Sweep(RECEDED, 2.6, 3.6, 0.8, 0.25, 34.0, SWEPT)


def short(skin: Skin) -> Style:
    """Strands go from the crown to the line all round, and over it on the forehead, in a fringe to one side that leaves
    the temples free."""
    line = Hairline(skin, SLANTED)

    def thickness(at: Floats) -> Floats:
        full = 1.6 + 9.0 * _top(at) + 2.0 * _top(at) * step(at[:, 2], 30.0, 75.0) + 1.6 * step(at[:, 1], 10.0, 60.0)
        return np.asarray(1.0 + full * step(line.inside(at), -10.0, 30.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        away = tangent(at - CROWN, normals)
        aside = tangent(np.tile([0.9, 0.0, 0.4], (len(at), 1)), normals)
        top = _top(at)[:, None]
        return tangent(away * (0.8 + 0.2 * top) + 0.5 * top * aside + 0.45 * (1.0 - top) * _down(at, normals), normals)

    def cut(at: Floats) -> Floats:
        fringe = step(at[:, 2], 44.0, 80.0) * step(-np.abs(at[:, 0] - 6.0), -64.0, -16.0)
        lower = 13.0 + 7.0 * step(at[:, 0], -30.0, 30.0)
        return np.asarray(line.inside(at) + 1.0 + lower * fringe)

    def comb(round_it: Floats) -> Comb:
        ragged = 1.4 + 3.6 * step(np.cos(round_it), 0.75, 0.95)  # in front
        return Comb(
            _ring(skin, round_it), np.full(GUIDES, 330.0), thickness, flow, cut, ragged, 2.2, 0.7, steps=66, slack=0.5,
            pole=True,
        )  # fmt: skip

    made = sheets(skin, _spread(skin, comb), FRINGED, WEAVE, seed=11, closed=True)
    return Style(made, line, fade=FADE_MM, strays=(strays(made[0], STRAYS, CENTRE, seed=12),))


def swept(skin: Skin) -> Style:
    """Hair stands up a little at the forehead and lies back from there, close at the sides."""
    return _swept_back(skin, BACK, seed=51)


def thin(skin: Skin) -> Style:
    """Thin hair lies back from a line that has receded at the temples."""
    return _swept_back(skin, THIN, seed=61)


def _swept_back(skin: Skin, sweep: Sweep, seed: int) -> Style:
    """Guides go from the crown to the line, as strands do that were combed the other way."""
    line = Hairline(skin, sweep.points)

    def thickness(at: Floats) -> Floats:
        front = sweep.front_mm * step(at[:, 2], 10.0, 60.0)
        full = sweep.sides_mm + _top(at) * (sweep.top_mm - sweep.sides_mm + front)
        close = CLOSE_MM[0] + (CLOSE_MM[1] - CLOSE_MM[0]) * step(at[:, 2], 35.0, 60.0)
        return np.asarray(close + full * step(line.inside(at), _FLAT_MM, sweep.rise_mm) ** 0.8)

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        away = tangent(at - CROWN, normals)
        aside = tangent(np.tile([1.0, 0.0, 0.2], (len(at), 1)), normals)
        top = _top(at)[:, None]
        along = away + sweep.aside * top * aside + 0.35 * (1.0 - top) * _down(at, normals)
        return tangent(along, normals)

    def slack(at: Floats) -> Floats:
        return np.asarray(0.1 + 0.4 * step(line.inside(at), 0.0, 25.0))

    def cut(at: Floats) -> Floats:
        return np.asarray(line.inside(at) + 1.0)

    def comb(round_it: Floats) -> Comb:
        return Comb(
            _ring(skin, round_it), np.full(GUIDES, 330.0), thickness, flow, cut, RAGGED_MM, 1.9, 1.0, steps=66,
            slack=slack, pole=True,
        )  # fmt: skip

    made = sheets(skin, _spread(skin, comb), sweep.layers, WEAVE, seed=seed, closed=True)
    stray = strays(made[0], STRAYS, CENTRE, seed=seed + 1)
    return Style(made, line, fade=SWEPT_FADE_MM, strays=(stray,))


def _spread(skin: Skin, comb: Callable[[Floats], Comb]) -> Comb:
    """A comb by the angles at which guides leave the crown, so that they end about evenly along the line: where they
    end far apart, the sheet would leave the skin."""
    round_it = np.linspace(np.pi, -np.pi, GUIDES)
    evenly = np.linspace(0.0, 1.0, GUIDES)
    for _ in range(_SPREADS):
        apart = np.linalg.norm(np.diff(tips(skin, comb(round_it)), axis=0), axis=1)
        share = np.concatenate([[0.0], np.cumsum(apart)]) / apart.sum()
        round_it = np.interp(evenly, _EVEN * share + (1.0 - _EVEN) * evenly, round_it)
    return comb(round_it)


def _ring(skin: Skin, round_it: Floats) -> Floats:
    """(g, 3) places on the skin in a small ring round the crown."""
    pole = unit(CROWN - CENTRE)
    front = unit(np.array([0.0, 0.0, 1.0]) - pole[2] * pole)
    side = np.cross(pole, front)
    aside = np.outer(np.cos(round_it), front) + np.outer(np.sin(round_it), side)
    toward = unit(np.cos(RING_RAD) * pole + np.sin(RING_RAD) * aside)
    return np.asarray(CENTRE + toward * skin.reach(toward)[:, None])


def _down(at: Floats, normals: Floats) -> Floats:
    """(n, 3) down along the skin, and a little back."""
    return tangent(np.tile([0.0, -1.0, -0.1], (len(at), 1)), normals)


def _top(at: Floats) -> Floats:
    """(n,) 1 on top of the head, 0 at its sides."""
    return step(at[:, 1] + 0.25 * at[:, 2], 78.0, 118.0)
