"""Clothes: a shirt over neck and shoulders that closes the bust, with different necks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.shade import surface_at, worn_shade
from surface.fit.wardrobe.skin import Skin, unit
from surface.fit.wardrobe.styles import step

THREADS = 1.0 / 26.0  # tiles of the noise for a mm of cloth
_CLEAR_MM = 3.5  # between skin and cloth
#: Half width, half depth and middle of the trunk by height, mm: from the shoulders down, beyond the bust's end.
_TRUNK = np.array(
    [
        # y, half width, front z, back z
        (-104.0, 66.0, 46.0, -74.0),
        (-118.0, 92.0, 46.0, -92.0),
        (-132.0, 122.0, 50.0, -106.0),
        (-148.0, 152.0, 58.0, -116.0),
        (-170.0, 176.0, 70.0, -122.0),
        (-200.0, 190.0, 84.0, -124.0),
        (-250.0, 196.0, 98.0, -122.0),
        (-330.0, 192.0, 100.0, -112.0),
    ]
)
_ROUND = 2.6  # exponent of the trunk's section, a superellipse
#: Rows of a collar that is rolled down, from inside it over the rim to below its fold: share of its height, mm
#: outwards, shares of its roll outwards and up, and how open the cloth lies there.
_ROLLED = np.array(
    [
        (0.60, -1.6, 0.00, 0.00, 0.40),
        (0.90, -1.2, 0.00, 0.00, 0.50),
        (1.00, -0.4, 0.20, 0.35, 0.80),
        (1.00, 0.0, 0.75, 0.30, 1.00),
        (0.88, 0.0, 1.15, 0.00, 1.00),
        (0.60, 0.0, 1.30, 0.00, 1.00),
        (0.34, 0.0, 1.35, 0.00, 0.95),
        (0.20, 0.0, 1.15, 0.00, 0.80),
        (0.17, 0.0, 0.45, 0.00, 0.50),
        (0.10, 0.0, 0.15, 0.00, 0.55),
    ]
)
#: Of a folded collar: places round it, and how much closer together they are in front; by the angle from the front, how
#: far it hangs from its rim, mm, most at its two points and hardly where its edges meet, and how far it stands out,
#: least where they meet, or it would jut out there as a board.
_FOLDED, _DENSE = 64, 0.35
_LINED = 0.8  # of a collar's height, over which its inside is made: below it one sees the back of its outside
_FALL = (0.0, 0.40, 0.52, 1.0, np.pi), (3.0, 54.0, 50.0, 30.0, 20.0)
_OUT = (0.0, 0.15, 0.40, 1.0, np.pi), (1.0, 2.2, 7.0, 11.0, 15.0)


@dataclass(frozen=True)
class Neck:
    """A neck line: its height in front, at the side and behind, mm, and how far the cloth stands off the neck.

    stand : height of a collar over the line, mm; lean : how far its rim leans outwards. fold : does it fold back?
    roll : how far a collar that is rolled down stands out beyond its inside, mm; 0 where it is not.
    """

    front: float
    side: float
    back: float
    off: float
    stand: float = 0.0
    lean: float = 0.0
    fold: bool = False
    roll: float = 0.0


NECKS = {
    "clothes-crew": Neck(-126.0, -100.0, -86.0, 2.5, 7.0, 1.0),
    "clothes-turtleneck": Neck(-110.0, -96.0, -81.0, 3.5, 25.0, 2.0, roll=3.4),
    "clothes-shirt": Neck(-122.0, -98.0, -84.0, 4.0, 22.0, 5.0, fold=True),
}


def garment(skin: Skin, neck: Neck) -> list[Patches]:
    """The trunk with its collar, one closed patch from the collar's rim down, and the collar folded over it."""
    nu = 40
    angle = np.linspace(np.pi, -np.pi, nu)  # from behind round the left; 0 is in front
    ring = _ring(skin, neck, angle)
    collar, trunk = _collar(skin, ring, neck), _trunk(skin, ring, angle)
    points = _closed(np.stack([*collar, *trunk], axis=1))
    seen = skin.points[hidden_below(skin, neck) < 0.5]
    if neck.roll > 0.0:
        openness = np.concatenate([_ROLLED[:, 4], np.linspace(0.75, 1.0, 3), np.ones(len(trunk) - 3)])
        return [_shaded(_patch(points, (73, 33), (33, 33), openness), seen)]
    out = [_patch(points, (73, 25), (33, 25), _dark_within((1.5 if neck.fold else 1.0) * len(collar), points.shape[1]))]
    if neck.fold:
        around = _dense_in_front(_FOLDED)
        folded = _closed(np.stack(_folded(skin, _ring(skin, neck, around), around), axis=1))
        over = _patch(folded, (97, 9), (65, 5), _dark_within(1, folded.shape[1]))
        at = [np.linspace(0.0, 1.0, n) for n in (240, 20)]
        lies = surface_at(folded, (3, 3), at)[:, 6:].reshape(-1, 3)
        return [_shaded(over, seen), _shaded(out[0], np.concatenate([seen, lies]))]
    return [_shaded(patch, seen) for patch in out]


def _shaded(patch: Patches, things: Floats) -> Patches:
    """A patch in the shade of things (n, 3): of chin and neck, and below a collar."""
    strands = patch.strands.copy()
    strands[..., 3] *= 1.0 - worn_shade(patch, things)
    return replace(patch, strands=strands)


def _closed(points: Floats) -> Floats:
    """Points (nu, nv, 3) whose first and last columns lie half way between their neighbours, else the cloth has an edge
    down the back where it is closed."""
    out = points.copy()
    out[0] = out[-1] = 0.5 * (points[1] + points[-2])
    return out


def _dark_within(inner: float, rows: int) -> Floats:
    """(k,) how open cloth lies from row to row, of which the first ``inner`` lie inside the collar."""
    return 0.45 + 0.55 * step(np.linspace(0.0, 1.0, 8 * rows), 0.0, 1.5 * inner / rows)


def _ring(skin: Skin, neck: Neck, angle: Floats) -> Floats:
    """(nu, 3) the line round the neck, on the skin."""
    front, back = 0.5 * (1.0 + np.cos(angle)), 0.5 * (1.0 - np.cos(angle))
    height = neck.side + (neck.front - neck.side) * front**3 + (neck.back - neck.side) * back**3
    out = np.empty((len(angle), 3))
    for i, (a, y) in enumerate(zip(angle, height, strict=True)):
        middle = np.array([0.0, y, -14.0 - 0.12 * (y + 100.0)])
        out[i] = _outwards(skin, middle, np.array([np.sin(a), 0.0, np.cos(a)]))
    return out


def _outwards(skin: Skin, middle: Floats, direction: Floats) -> Floats:
    """Where a ray from inside the neck leaves the skin, by the samples in a narrow beam about it."""
    ahead = skin.points[skin.bare] - middle
    along = ahead @ direction
    off = np.linalg.norm(ahead - along[:, None] * direction, axis=1)
    near = np.flatnonzero((off < 7.0) & (along > 0.0) & (along < 110.0))
    if not len(near):
        return middle + 60.0 * direction
    share = np.exp(-((off[near] / 3.5) ** 2))
    return np.asarray(middle + direction * (along[near] * share).sum() / share.sum())


def _smooth(rows: Floats, times: int = 2) -> Floats:
    """A closed row (nu, 3), whose ends are the same place, smoothed along."""
    ring = rows[:-1]
    for _ in range(times):
        ring = 0.5 * ring + 0.25 * (np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0))
    return np.vstack([ring, ring[:1]])


def _collar(skin: Skin, ring: Floats, neck: Neck) -> list[Floats]:
    """Rows of the collar, from inside its rim over it and down to the line."""
    normals, _ = skin.nearest(ring)
    level = unit(normals * (1.0, 0.0, 1.0))
    up = np.array([0.0, 1.0, 0.0])
    line = _smooth(ring) + neck.off * level
    rim = line + neck.stand * (up + np.array([0.0, 0.0, 0.25])) + neck.lean * level
    if neck.stand > 12.0:  # the neck is narrower there
        normals, height = skin.nearest(rim)
        rim = _smooth(rim + (neck.off + 0.5 * neck.lean - height)[:, None] * unit(normals * (1.0, 0.3, 1.0)))
    if neck.roll > 0.0:
        return [line + h * (rim - line) + (away + out * neck.roll) * level + over * neck.roll * up
                for h, away, out, over, _ in _ROLLED]  # fmt: skip
    deep = max(9.0, _LINED * neck.stand)
    inside, lip = rim - 1.6 * level - deep * unit(rim - line), rim - 0.8 * level  # along the collar, which leans
    return [inside, lip, rim + 1.0 * up, rim + 1.2 * level - 1.0 * up, 0.5 * (rim + line) + 0.8 * level]


def _trunk(skin: Skin, ring: Floats, angle: Floats) -> list[Floats]:
    """Rows from the line over the shoulders down, clear of the skin."""
    rows = []
    for y, half, front, back in _TRUNK:
        c, s = np.cos(angle), np.sin(angle)
        long = (np.abs(c) ** _ROUND + np.abs(s) ** _ROUND) ** (-1.0 / _ROUND)
        depth, middle = 0.5 * (front - back), 0.5 * (front + back)
        row = np.column_stack([half * s * long, np.full(len(angle), y), middle + depth * c * long])
        row[:, 1] = np.minimum(row[:, 1], ring[:, 1] - 3.0 - 0.10 * (-104.0 - y))
        rows.append(_clear(skin, row))
    return rows


def _clear(skin: Skin, row: Floats, least: float = _CLEAR_MM) -> Floats:
    """A row (nu, 3) moved off the skin where it is nearer than ``least`` mm."""
    for _ in range(3):
        normals, height = skin.nearest(row)
        near = np.linalg.norm(row - _foot(skin, row), axis=1) < 40.0
        row = _smooth(row + (np.maximum(least - height, 0.0) * near)[:, None] * normals, 1)
    return row


def _foot(skin: Skin, row: Floats) -> Floats:
    """The nearest places of the skin to a row (nu, 3)."""
    _, offset = skin.anchors(row)
    return np.asarray(row - offset)


def _dense_in_front(count: int) -> Floats:
    """Angles (count,) round the neck as :func:`garment` has them, close together in front, where a collar opens."""
    t = np.linspace(1.0, -1.0, count)
    return np.asarray(np.pi * (_DENSE * t + (1.0 - _DENSE) * t**3))


def _folded(skin: Skin, ring: Floats, angle: Floats) -> list[Floats]:
    """Rows of a collar folded back: from the rim outwards and down, its edges in front running apart to two points."""
    neck = NECKS["clothes-shirt"]
    rim = _collar(skin, ring, neck)[2]
    normals, _ = skin.nearest(ring)
    level = unit(normals * (1.0, 0.0, 1.0))
    away = np.abs(angle)
    fall = np.interp(away, *_FALL)[:, None]
    out = np.interp(away, *_OUT)[:, None]
    down = np.array([0.0, -1.0, 0.0])
    rows = [rim + 0.3 * down, rim + 0.22 * out * level + 0.4 * down, rim + 0.55 * out * level + 0.35 * fall * down]
    rows += [rim + out * level + 0.75 * fall * down, rim + (out + 1.5) * level + fall * down]
    return [rows[0], rows[1], *(_clear(skin, _smooth(row, 1), 5.5) for row in rows[2:])]


def _patch(points: Floats, grid: tuple[int, int], fast: tuple[int, int], open_along: Floats) -> Patches:
    """One patch of cloth; ``open_along`` : (k,) how open it lies, evenly along v."""
    nu, nv, _ = points.shape
    gu, gv = grid
    s, t = np.meshgrid(np.linspace(0, 1, gu), np.linspace(0, 1, gv), indexing="ij")
    openness = np.interp(t, np.linspace(0.0, 1.0, len(open_along)), open_along)
    strands = np.stack([s * 700 * THREADS, t * 260 * THREADS, np.ones_like(t), openness], axis=-1)
    zero = np.zeros((1, gu, gv))
    return Patches(points[None], (3, 3), grid, fast, strands[None], zero, zero + 1.0, np.zeros((1, nu, nv)), 0.0)


def hidden_below(skin: Skin, neck: Neck) -> Floats:
    """(s,) which samples of the skin the cloth covers, 0..1."""
    angle = np.arctan2(skin.points[:, 0], skin.points[:, 2] + 14.0)
    front, back = 0.5 * (1.0 + np.cos(angle)), 0.5 * (1.0 - np.cos(angle))
    line = neck.side + (neck.front - neck.side) * front**3 + (neck.back - neck.side) * back**3
    return step(line - 8.0 - skin.points[:, 1], 0.0, 4.0)
