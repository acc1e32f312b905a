"""Slopes of a mesh in (u, v), which the fit shall match besides positions, so that light falls on it as on the mesh.

A slope is the difference of position over one face's width in u, and in v, by least squares over its corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, vstack

from surface.base.arrays import Floats
from surface.fit.source.islands import Island


@dataclass(frozen=True)
class Slopes:
    """Slopes at the faces of a chart.

    Attributes
    ----------
    uv : (f, 2) face centres; span : (f, 2) a face's extent in u and in v.
    mix_u, mix_v : (f, n) sparse; times the mesh's n vertices: what a surface's S_u, S_v times span should be.
    weight : (f,) in least squares.
    """

    uv: Floats
    span: Floats
    mix_u: csr_matrix
    mix_v: csr_matrix
    weight: Floats


def face_slopes(island: Island, vertices: int, weight: Floats, *, doubt_slivers: bool = False) -> Slopes:
    """Slopes of an island of a mesh with ``vertices`` vertices; ``weight (m,)`` of its points.

    With ``doubt_slivers`` a face counts as far as its form decides its slope. Corners that lie nearly on one line in
    (u, v) say next to nothing of the slope across it: their errors come out larger by the variance inflation factor
    1 / (1 - r^2), r the correlation of u and v over them, and so the weight is multiplied by 1 - r^2.
    """
    used = island.faces >= 0
    corner = np.where(used, island.faces, 0)
    uv = island.uv[corner] * used[..., None]
    centre = uv.sum(axis=1) / used.sum(axis=1)[:, None]
    offset = (island.uv[corner] - centre[:, None]) * used[..., None]
    moments = np.einsum("fki,fkj->fij", offset, offset)
    moments += 1e-9 * np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-18 * np.eye(2)
    gradient = np.einsum("fij,fkj->fki", np.linalg.inv(moments), offset)
    span = np.sqrt(np.einsum("fki,fki->fi", offset, offset))
    place, shape = (np.repeat(np.arange(len(corner)), 4), island.vertex[corner].ravel()), (len(corner), vertices)
    mix_u, mix_v = (csr_matrix(((gradient[..., i] * span[:, i, None]).ravel(), place), shape=shape) for i in (0, 1))
    decided = np.linalg.det(moments)  # above 0 also without extent in u or v, where full weight does no harm
    trust = decided / np.maximum((span**2).prod(axis=1), decided) if doubt_slivers else np.ones(len(corner))
    return Slopes(centre, span, mix_u, mix_v, trust * np.where(used, weight[corner], np.inf).min(axis=1))


def join_slopes(parts: list[Slopes]) -> Slopes:
    """The slopes of several islands as one."""
    mix_u, mix_v = (vstack([getattr(p, k) for p in parts]).tocsr() for k in ("mix_u", "mix_v"))
    uv, span, weight = (np.concatenate([getattr(p, k) for p in parts]) for k in ("uv", "span", "weight"))
    return Slopes(uv, span, mix_u, mix_v, weight)
