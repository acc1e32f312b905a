"""Long hair: parted, over the ears to the shoulders."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.locks import Locks, grow, spread
from surface.fit.wardrobe.skin import Skin, unit
from surface.fit.wardrobe.styles import Style, cap, lock_patches, roots_inside, shades, step, tangent

PART_X = 14.0  # of the parting, mm


def long(skin: Skin) -> Style:
    """Parted beside the middle, falling over the ears to the shoulders, with a slight wave."""
    line = Hairline(skin)
    among = roots_inside(skin, line, 0.5)
    _, y, z = among.T
    upper = among[(y > 30.0 - 0.4 * z) | (z < -20.0)]
    upper = upper[upper[:, 1] > 0.0]
    close = (line.inside(upper) < 9.0) | ((np.abs(upper[:, 0] - PART_X) < 14.0) & (upper[:, 2] > -50.0))
    roots = upper[spread(skin, upper, np.where(close, 8.0, 14.0), 8)]
    random = np.random.default_rng(21)
    layer = random.uniform(0.0, 1.0, len(roots))

    def thickness(at: Floats) -> Floats:
        return np.asarray(1.8 + 8.0 * step(line.inside(at), -6.0, 34.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        side = np.where(at[:, 0] > PART_X, 1.0, -1.0)
        front = step(at[:, 2], 0.0, 60.0)
        # Away from the parting, back from the face, and down.
        falling = step(-at[:, 1], -105.0, -40.0)
        wanted = np.column_stack([side * (1.0 - 0.85 * falling), -0.35 - 1.6 * falling, -0.55 * front - 0.25])
        on_skull = tangent(wanted, normals)
        free = step(-at[:, 1], -30.0, 10.0)[:, None]
        wave = 0.10 * np.sin(at[:, 1] / 17.0 + 6.0 * layer)
        down = unit(np.column_stack([0.05 * np.sign(at[:, 0]) + wave, -np.ones(len(at)), 0.02 + 0.0 * wave]))
        return unit(on_skull * (1.0 - free) + down * free)

    length = roots[:, 1] + 130.0 + 30.0 * layer + 36.0 * step(roots[:, 1], 60.0, 120.0) + 20.0
    paths, normals = grow(
        skin, roots, length, thickness, flow, lift=1.0 + 0.3 * layer, below=0.8, steps=26, stiff=0.6, slack=7.0,
        ears=True,
    )  # fmt: skip
    width = (15.0 + 3.0 * step(roots[:, 1], 40.0, 100.0)) * random.uniform(0.8, 1.25, len(roots))
    locks = Locks(paths, normals, width, shades(len(roots), 22), layer)
    sway = np.full(len(roots), 0.75)
    hanging = lock_patches(
        locks, 8, (3, 10), (2, 6), sway, bulge=0.10, root=0.8, tip=0.5, edge_cover=0.6, fall_from=0.72,
    )  # fmt: skip
    return Style([cap(skin, line, thickness, share=0.78, openness=0.55)], line, (hanging,))
