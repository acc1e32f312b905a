"""Where the lips shade what lines the mouth: next to its rim, which lies behind them.

Light is computed from the opening of the lips as if nothing stood between; the rim would be the brightest place of the
lining, and show as a pale fringe beside the dark inner sides of the lips.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.mesh.mesh import border_edges
from surface.view.draw.tooth_necks import distances, welded

_RIM_MM = 0.5, 7.0  # from the rim: as far as it lies in the lips' shade, and where none is left
_LEFT = 0.12  # of the light, in that shade


def rim_shade(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> NDArray[np.float32]:
    """Return (m,) float32: the share of light that comes to each vertex (m, 3), mm, of a lining past the lips; 1 all
    over a closed one."""
    if not len(triangles):
        return np.ones(len(vertices), np.float32)
    same, at = welded(vertices)
    joined = same[triangles]
    joined = joined[(joined != np.roll(joined, 1, axis=1)).all(axis=1)].astype(np.int32)
    rim = np.unique(border_edges(joined))
    if not len(rim):
        return np.ones(len(vertices), np.float32)
    share = np.clip((distances(at, at[rim]) - _RIM_MM[0]) / (_RIM_MM[1] - _RIM_MM[0]), 0.0, 1.0)
    shade = _LEFT + (1.0 - _LEFT) * share * share * (3.0 - 2.0 * share)
    return np.asarray(shade[same], np.float32)
