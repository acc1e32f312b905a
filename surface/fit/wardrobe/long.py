"""Long hair: parted, over the ears to the shoulders."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheets
from surface.fit.wardrobe.skin import CENTRE, Skin, unit
from surface.fit.wardrobe.strays import Strays, strays
from surface.fit.wardrobe.styles import Style, cap, step, tangent

PART_X = 14.0  # of the parting, mm
WANDERS_MM = (0.7, 61.0, 0.6), (0.25, 27.0, 2.1)  # how far it wanders to either side, over which length, begun where
BEGINS_MM = 8.5  # inside the hairline, where the parting does and with it the sheets: before them lies the under-cap
AT_PARTING = 0.22  # share of the hair's thickness at the parting: roots lie in a shallow valley, not beside a slot
CROWN_Z = 5.0, 50.0  # mm: behind the first that valley is filled, before the other not: the outline would be notched
APART_MM = 0.05  # of either side's roots from the parting's middle: more would be a slot with the cap's edge in it
ALONG_PART, FANNED = 25, 12  # guides that begin along the parting, and at its end behind
TIPS_Y, SHORTER_MM = (
    -122.0,
    24.0,
)  # mm: where it ends at the sides, and by how much it is shorter behind, clear of the back
OVER_EAR_MM = 11.0
_MEET = 5.0  # guides from where both sides meet behind, over which waves begin: else there is a gap between them
_LEVELLED = 2.5, 1.5, 0.0  # guides and places along them, over which those that hang are levelled
_HANGS_Y = 55.0, 95.0  # mm: where they hang, and where they do not yet
_WAVE_MM, _WAVE_DEEP_MM = 88.0, 3.4  # how long waves of hair that hangs are, and how far they go at most
_TURNS_IN_MM = 30.0, 9.0  # of its end, that turns in, and by how much
RAGGED_MM = 1.5  # by how much locks differ in length: more is a hem torn, not cut
STRAYS = Strays(15, 5.0, (0.02, 0.97))  # of either side
FRAYED_MM, FRAYED_Y = (9.0, 20.0), (20.0, 70.0)  # over which strands grow sparse beside the cheek and at the temple; mm
LAYERS = (
    Layer(1.07, 0.46, 1.0, 56.0, 0.1), Layer(1.0, 0.70, 0.90, 42.0, 0.1), Layer(0.84, 1.6, 0.72, 26.0),
)  # fmt: skip


def long(skin: Skin) -> Style:
    """Parted beside the middle, falling over the ears to the shoulders, with a slight wave."""
    line = Hairline(skin)

    def thickness(at: Floats) -> Floats:
        return np.asarray(1.4 + _full(line, at))

    sides = [_curtain(skin, line, side) for side in (1.0, -1.0)]
    hanging = _inner_last([patch for patches in sides for patch in patches])
    stray = tuple(strays(patches[0], STRAYS, CENTRE, seed=28 + k) for k, patches in enumerate(sides))
    return Style(
        [cap(skin, line, thickness, share=0.5, short_mm=0.5, openness=0.7)], line, tuple(hanging), strays=stray
    )


def _full(line: Hairline, at: Floats) -> Floats:
    """(n,) mm that hair adds over places (n, 3): less at the line, and at the parting before the crown."""
    beside = step(np.abs(at[:, 0] - PART_X), 0.0, 30.0) + 1.0 - step(at[:, 2], *CROWN_Z)
    return np.asarray(
        9.5 * step(line.inside(at), -8.0, 34.0) * (AT_PARTING + (1.0 - AT_PARTING) * np.minimum(beside, 1.0))
    )


def _inner_last(hanging: list[Patches]) -> list[Patches]:
    """Sheets of both sides, the outermost first."""
    each = len(hanging) // 2
    return [patch for pair in zip(hanging[:each], hanging[each:], strict=True) for patch in pair]


def _at_face(at: Floats) -> Floats:
    """(n,) mm over which strands grow sparse at places (n, 3) of the edge beside the face: below it there is hair at
    the temple alone, and few strands before a cheek look like dots."""
    return np.asarray(FRAYED_MM[0] + (FRAYED_MM[1] - FRAYED_MM[0]) * step(at[:, 1], *FRAYED_Y))


def _at_ear(at: Floats) -> Floats:
    """(n,) 1 over an ear, 0 away from it."""
    x, y, z = np.abs(at[:, 0]), at[:, 1], at[:, 2]
    return np.asarray(step(x, 62.0, 78.0) * step(-y, -66.0, -34.0) * step(-z, -50.0, -20.0))


def _hung(paths: Floats, side: float) -> Floats:
    """Guides (g, k, 3) of one side, which hang straight from where they stand out to where they stand out again, as
    from the temple to the ear, and lie level beside each other."""
    out = side * paths[..., 0]
    for row, y in zip(out, paths[..., 1], strict=True):
        order = np.argsort(y)
        hull: list[int] = []
        for k in order:
            while len(hull) > 1 and _inside(*(np.array([y[j], row[j]]) for j in (*hull[-2:], k))):
                hull.pop()
            hull.append(int(k))
        row[:] = np.maximum(row, np.interp(y, y[hull], row[hull]))
    hung = np.concatenate([side * out[..., None], paths[..., 1:]], axis=-1)
    level = gaussian_filter(hung, _LEVELLED, mode="nearest")
    hangs = step(-paths[..., 1:2], *(-y for y in reversed(_HANGS_Y)))
    from_behind = np.arange(float(len(paths)))[:: 1 if side > 0.0 else -1]  # both sides stay where they meet
    apart = step(from_behind, 0.0, 3.0 * _LEVELLED[0])[:, None, None]
    return np.asarray(paths + hangs * apart * (level - paths))


def _waved(paths: Floats, side: float) -> Floats:
    """Guides (g, k, 3) of one side in slight waves, that grow from where they hang to their ends, which turn in: locks
    are out of step with those further on, since hair that falls in one plane looks like a board."""
    x, y, z = np.moveaxis(paths, 2, 0)
    free, ends = step(-y, -35.0, 40.0), step(-y, -TIPS_Y - _TURNS_IN_MM[0], -TIPS_Y)
    which = np.linspace(0.0, 1.0, len(paths))[:, None]
    way = 2.0 * np.pi * (y / _WAVE_MM + 0.9 * np.sin(5.0 * which))
    from_behind = np.arange(float(len(paths)))[:: 1 if side > 0.0 else -1, None]  # both sides stay where they meet
    deep = _WAVE_DEEP_MM * free * step(from_behind, 0.0, _MEET)
    wave = deep * np.sin(way)
    outwards = side * (wave - _TURNS_IN_MM[1] * ends)
    return np.stack([x + outwards, y, z + 0.8 * deep * np.cos(way)], axis=2)


def _inside(a: Floats, b: Floats, c: Floats) -> bool:
    """Does b lie below the line from a to c?"""
    return bool((b[0] - a[0]) * (c[1] - a[1]) >= (b[1] - a[1]) * (c[0] - a[0]))


def _curtain(skin: Skin, line: Hairline, side: float) -> list[Patches]:
    """Sheets of the hair that falls to one side of the parting, from the face to the middle of the back."""
    roots = _parting(skin, line)
    roots[:, 0] += APART_MM * side
    fan = np.concatenate([np.zeros(ALONG_PART), np.linspace(0.0, 1.0, FANNED + 1)[1:]])
    back = np.concatenate([np.linspace(0.0, 1.0, ALONG_PART), np.ones(FANNED)])

    def thickness(at: Floats) -> Floats:
        return np.asarray(1.2 + _full(line, at) + OVER_EAR_MM * _at_ear(at))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        front = step(at[:, 2], 0.0, 60.0)
        falling = step(-at[:, 1], -105.0, -40.0)
        aside = side * (1.0 - fan) * (1.0 - 0.85 * falling) - 0.012 * fan * at[:, 0]
        forwards = (0.22 - 0.37 * back) * (1.0 - front) - 0.35 * front * back - 0.8 * fan * (1.0 - falling)
        wanted = np.column_stack([aside, -0.3 - 1.6 * falling, forwards])
        free = step(-at[:, 1], -30.0, 10.0)[:, None]
        wave = 0.05 * np.sin(at[:, 1] / 19.0 + 9.0 * back)
        down = unit(np.column_stack([-0.10 * side * (1.0 - fan) + wave, -np.ones(len(at)), 0.02 + 0.0 * wave]))
        return unit(tangent(wanted, normals) * (1.0 - free) + down * free)

    def slack(at: Floats) -> Floats:
        return np.asarray(1.0 + 24.0 * step(-at[:, 1], -25.0, 10.0))

    def cut(at: Floats) -> Floats:
        return np.asarray(at[:, 1] - TIPS_Y - SHORTER_MM * step(-at[:, 2], -10.0, 60.0))

    order = slice(None) if side < 0.0 else slice(None, None, -1)  # so that the outside is outside
    fan, back = fan[order], back[order]
    length = np.full(len(roots), 430.0)
    comb = Comb(
        roots[order], length, thickness, flow, cut, RAGGED_MM, 2.0, steps=72, stiff=0.6, slack=slack, ears=True,
        drape=lambda paths: _waved(_hung(paths, side), side),
    )  # fmt: skip
    return sheets(
        skin,
        comb,
        LAYERS,
        Weave((37, 16), (49, 25), (25, 13)),
        seed=21,
        sway=0.75,
        edges=(_at_face, None) if side < 0.0 else (None, _at_face),
    )


def _parting(skin: Skin, line: Hairline) -> Floats:
    """(ALONG_PART + FANNED, 3) places on the skin along the parting, from the line backwards, the last one again and
    again."""
    z = np.linspace(125.0, -62.0, 400)
    wander = sum(far * np.sin(2.0 * np.pi * z / wave + begun) for far, wave, begun in WANDERS_MM)
    toward = unit(np.column_stack([PART_X + wander, np.full(len(z), 95.0), z]))
    every = CENTRE + toward * skin.reach(toward)[:, None]
    every = every[line.inside(every) > BEGINS_MM]
    at = every[np.rint(np.linspace(0, len(every) - 1, ALONG_PART)).astype(int)]
    return np.concatenate([at, np.repeat(at[-1:], FANNED, axis=0)])
