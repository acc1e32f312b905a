"""Where a mesh ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def border_edges(triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """(k, 2) edges that only one triangle has, in the direction of that triangle."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    key, back = edges[:, 0] << 32 | edges[:, 1], edges[:, 1] << 32 | edges[:, 0]
    return edges[~np.isin(key, back)]
