"""Hair drawn back into a bun."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.locks import Locks, grow, spread
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.skin import Skin, unit
from surface.fit.wardrobe.styles import ACROSS, ALONG, Style, cap, lock_patches, roots_inside, shades, step, tangent

BUN = np.array([0.0, 98.0, -97.0])  # its middle, mm
_OUT = unit(np.array([0.0, 0.42, -0.91]))  # where it points
_RADII = np.array([29.0, 26.0, 22.0])  # half its width, its height, and along where it points
_TURNS = 0.62  # of a strand about the bun, from its base to its tip


def bun(skin: Skin) -> Style:
    """All hair lies on the skull, from the line to a bun high on the back of the head."""
    line = Hairline(skin)
    base = BUN - 14.0 * _OUT
    among = roots_inside(skin, line, 0.8)
    inside = line.inside(among)
    far = np.linalg.norm(among - base, axis=1)
    among, inside = among[far > 34.0], inside[far > 34.0]
    roots = among[spread(skin, among, np.where(inside < 8.0, 6.0, 15.0), 31)]
    random = np.random.default_rng(32)
    layer = random.uniform(0.0, 1.0, len(roots))

    def thickness(at: Floats) -> Floats:
        return np.asarray(0.9 + 4.2 * step(line.inside(at), -1.0, 36.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        ahead = tangent(base - at, normals)
        back = tangent(np.tile([0.0, 0.25, -1.0], (len(at), 1)), normals)
        near = step(-np.linalg.norm(at - base, axis=1), -110.0, -50.0)[:, None]
        return unit(ahead * (0.55 + 0.45 * near) + 0.45 * (1.0 - near) * back)

    away = np.linalg.norm(roots - base, axis=1)
    length = np.minimum(1.08 * away, 95.0 + 10.0 * layer)
    paths, normals = grow(skin, roots, length, thickness, flow, lift=1.0 + 0.25 * layer, below=0.8, steps=16, stiff=0.5,
                          slack=0.4, settle=0.15)  # fmt: skip
    width = (10.0 + 3.5 * step(line.inside(roots), 4.0, 20.0)) * random.uniform(0.8, 1.25, len(roots))
    locks = Locks(paths, normals, width, shades(len(roots), 33), layer)
    drawn = lock_patches(locks, 6, (3, 6), (2, 4), np.zeros(len(roots)), bulge=0.07, root=0.9, tip=0.75, tip_cover=0.5,
                         edge_cover=0.55, fall_from=0.6, root_fade=0.75)  # fmt: skip
    return Style([_twists(), drawn, _core(), cap(skin, line, thickness, short_mm=0.5)], line)


def _frame() -> Floats:
    """(3, 3) rows: to the left, up and out of the bun."""
    side = np.array([1.0, 0.0, 0.0])
    return np.stack([side, np.cross(_OUT, side), _OUT])


def _surface(polar: Floats, round_it: Floats, grown: float = 1.0) -> tuple[Floats, Floats]:
    """Places (..., 3) on the bun and its normals, by the angle from its pole and round it."""
    polar, round_it = np.broadcast_arrays(polar, round_it)
    unit_ball = np.stack([np.sin(polar) * np.cos(round_it), np.sin(polar) * np.sin(round_it), np.cos(polar)], axis=-1)
    return BUN + (grown * _RADII * unit_ball) @ _frame(), unit((unit_ball / _RADII) @ _frame())


def _twists(count: int = 17) -> Patches:
    """Locks that wind round the bun."""
    t = np.linspace(0.0, 1.0, 15)[None]
    random = np.random.default_rng(35)
    start = 2.0 * np.pi * (np.arange(count) + random.uniform(-0.25, 0.25, count))[:, None] / count
    polar = np.radians(128.0 - 116.0 * t) + 0.0 * start
    layer = random.uniform(0.0, 1.0, count)
    paths, normals = _surface(polar, start + 2.0 * np.pi * _TURNS * t)
    paths = paths + normals * (0.8 + 1.6 * layer)[:, None, None]
    locks = Locks(paths, normals, np.full(count, 15.0), shades(count, 36), layer)
    return lock_patches(locks, 7, (3, 8), (2, 5), np.full(count, 0.06), bulge=0.16, root=0.95, tip=0.28, tip_cover=0.7,
                        edge_cover=0.75, fall_from=0.8)  # fmt: skip


def _core() -> Patches:
    """The closed ball under them."""
    gu, gv = 17, 9
    s, t = np.meshgrid(np.linspace(0, 1, gu), np.linspace(0, 1, gv), indexing="ij")
    points, _ = _surface(
        np.pi * (1.0 - np.linspace(0, 1, 7)[None, :]), 2.0 * np.pi * np.linspace(0, 1, 11)[:, None], 0.97
    )
    strands = np.stack([160 * s * ACROSS, 60 * t * ALONG, 1.5 + 0.0 * t, 0.6 + 0.0 * t], axis=-1)
    zero = np.zeros((1, gu, gv))
    return Patches(points[None], (2, 2), (gu, gv), (9, 5), strands[None], zero, zero + 0.85, np.full((1, 11, 7), 0.06))
