"""Seams: two islands of the mesh meet in one border; drawn from two surfaces it must not show a crack.

The first part is the master. Vertices of the second part on the seam are put onto the first part's border edges,
with its normals, after every pose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.head.data import Seam
from surface.head.part import HeadPart

NEAR = 2e-3  # in (u, v): a vertex nearer than this to the seam's polyline is on it


class Zipper:
    """One seam, ready to be closed.

    Parameters
    ----------
    seam : polylines of both sides; first, second : the parts they belong to.
    """

    def __init__(self, seam: Seam, first: HeadPart, second: HeadPart) -> None:
        self.first, self.second = first, second
        a_ids, a_at = _along(first, seam.uv_a)
        b_ids, b_at = _along(second, seam.uv_b)
        inside = (b_at >= a_at.min(initial=np.inf)) & (b_at <= a_at.max(initial=-np.inf))
        self.ids, at = b_ids[inside], b_at[inside]
        after = np.clip(np.searchsorted(a_at, at), 1, max(len(a_at) - 1, 1))
        self.low, self.high = a_ids[after - 1], a_ids[after]
        gap = np.maximum(a_at[after] - a_at[after - 1], 1e-12)
        self.share = ((at - a_at[after - 1]) / gap).astype(np.float32)[:, None]

    def close(self) -> None:
        """Put the second part's border onto the first one's."""
        if not len(self.ids) or not (self.first.changed or self.second.changed):
            return
        for name in ("vertices", "normals"):
            source, target = getattr(self.first, name), getattr(self.second, name)
            low = source[self.low]
            target[self.ids] = low + self.share * (source[self.high] - low)
        self.second.touch()


def _along(part: HeadPart, line: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Border vertices of a part on a polyline, and how far along it they lie, in its points; in order."""
    ids = border_vertices(part.triangles)
    uv = part.mesh.uv[ids]
    start, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step * step).sum(axis=1), 1e-18)
    t = np.clip(((uv[:, None] - start) * step).sum(axis=2) / length, 0.0, 1.0)
    distance = np.linalg.norm(uv[:, None] - (start + t[..., None] * step), axis=2)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(ids))
    on = distance[rows, nearest] < NEAR
    at = nearest[on] + t[rows, nearest][on]
    order = np.argsort(at, kind="stable")
    return ids[on][order], at[order]


def border_vertices(triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """Vertices of edges that only one triangle has."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
    key, count = np.unique(edges[:, 0] << 32 | edges[:, 1], return_counts=True)
    lone = key[count == 1]
    return np.unique(np.concatenate([lone >> 32, lone & 0xFFFFFFFF]))
