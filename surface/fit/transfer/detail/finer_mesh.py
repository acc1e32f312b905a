"""Triangles over a surface that are short enough to follow a scan's detail; those that draw a head are long where it is
flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.transfer.warp import Warp
from surface.mesh.mesh import Mesh
from surface.mesh.splitedges import Middles, split_edges

ROUNDS = 2  # of halving edges


@dataclass(frozen=True)
class FineMesh:
    """``uv (n, 2)`` of a surface, ``side (n,)`` from which each evaluates it (None: any), ``triangles (t, 3)``, and the
    places ``rest (n, 3)`` on the surface."""

    uv: Floats
    side: Ints | None
    triangles: Ints
    rest: Floats


def finer_mesh(mesh: Mesh, rest: Floats, surface: DCPSurface, warp: Warp, longest: float) -> FineMesh:
    """A mesh whose edges are split until a map takes their ends no further apart than ``longest`` mm.

    rest : (n, 3) the mesh's vertices. Its own vertices stay the first ones; edges of borders stay whole. No edge is
    halved more than :data:`ROUNDS` times.
    """
    uv, triangles, at = mesh.uv, np.asarray(mesh.triangles, np.int64), warp(rest)
    middles = Middles(len(uv))

    def is_long(edges: Ints) -> Bools:
        out: Bools = np.linalg.norm(at[edges[:, 0]] - at[edges[:, 1]], axis=1) > longest
        return out

    for _ in range(ROUNDS):
        triangles = split_edges(triangles, is_long, middles)
        ends = np.array(middles.ends, np.int64).reshape(-1, 2)[len(uv) - len(mesh.uv) :]
        new = uv[ends].mean(axis=1)
        places = surface.evaluate(new)
        uv, rest, at = (np.concatenate(pair) for pair in ((uv, new), (rest, places), (at, warp(places))))
    side = None if mesh.side is None else np.append(mesh.side, np.zeros(len(uv) - len(mesh.uv), np.int64))
    return FineMesh(uv, side, triangles, rest)
