"""Reference implementations that compute the same vertices by sparse matrix, blendshapes, stencils or a spline library.

The libraries splinepy and geomdl are measured only if they are installed.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple

import numpy as np

from surface.base.arrays import Floats
from surface.base.jit import kernel
from surface.dcp import DCPSurface
from surface.mesh.mesh import Mesh

BLENDSHAPES = 52
GEOMDL_VERTICES = 200  # that geomdl computes; all would take minutes

Evaluator = Callable[[], object]


class Peer(NamedTuple):
    """A reference implementation.

    time_factor : the measured time is multiplied by it. reach : bound, as of a :class:`.bench.Measure`.
    """

    name: str
    prepare: Callable[[DCPSurface, Mesh], Evaluator]
    time_factor: float = 1.0
    reach: str = ""


def vertex_sums(mesh: Mesh) -> list[Peer]:
    """Return implementations that sum control points or blendshapes, for a mesh of any surface.

    The row of blendshapes names the MB it reads: memory limits its speed only if the caches hold less.
    """
    megabytes = BLENDSHAPES * 3 * 4 * len(mesh.vertices) / 1e6
    return [
        Peer("scipy CSR @ dense", sparse_matrix, reach=">= 12"),
        Peer(f"numpy {BLENDSHAPES} blendshapes, {megabytes:.1f} MB", blendshapes, reach=">= 3"),
        Peer("stencil table, row by row", stencils),
    ]


def libraries(mesh: Mesh) -> list[Peer]:
    """Return the installed spline libraries, for a sheet of :mod:`.bench`; they evaluate basis functions each time."""
    known = [Peer("splinepy", splinepy), Peer("geomdl", geomdl, len(mesh.uv) / GEOMDL_VERTICES)]
    return [peer for peer in known if importlib.util.find_spec(peer.name) is not None]


def one_thread() -> AbstractContextManager[object]:
    """Limit numpy's matrix products to one thread if threadpoolctl is installed; otherwise do nothing."""
    if importlib.util.find_spec("threadpoolctl") is None:
        return nullcontext()
    limits: AbstractContextManager[object] = importlib.import_module("threadpoolctl").threadpool_limits(1)
    return limits


def sparse_matrix(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """Return a product of scipy's compressed sparse rows and the control points, float32."""
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side).astype(np.float32)
    points = surface.points.astype(np.float32)
    return lambda: matrix @ points


def blendshapes(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """Return a product of 52 blendshape weights and 52 displacements of every vertex, float32."""
    shapes = np.ones((BLENDSHAPES, 3 * len(mesh.vertices)), dtype=np.float32)
    amounts = np.ones(BLENDSHAPES, dtype=np.float32)
    return lambda: amounts @ shapes


def stencils(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """Return the evaluation of a stencil table, row by row with one thread, float32.

    The table holds, per vertex, the number, indices and weights of the control points that influence it, as in
    Pixar's OpenSubdiv (``Far::StencilTable``).
    """
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side)
    sizes, ids = np.diff(matrix.indptr).astype(np.int32), matrix.indices.astype(np.int32)
    weights, points = matrix.data.astype(np.float32), surface.points.astype(np.float32)
    out = np.zeros((len(mesh.vertices), 3), dtype=np.float32)

    def evaluate() -> np.ndarray:
        _apply_stencils(sizes, ids, weights, points, out)
        return out

    return evaluate


@kernel
def _apply_stencils(sizes, ids, weights, points, out):  # type: ignore[no-untyped-def]
    at = 0
    for s in range(sizes.shape[0]):
        x, y, z = np.float32(0), np.float32(0), np.float32(0)
        for q in range(at, at + sizes[s]):
            w, i = weights[q], ids[q]
            x += w * points[i, 0]
            y += w * points[i, 1]
            z += w * points[i, 2]
        out[s, 0], out[s, 1], out[s, 2] = x, y, z
        at += sizes[s]


def splinepy(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """Return the evaluation by splinepy's compiled NURBS, one thread."""
    library = importlib.import_module("splinepy")
    side, points, knots = net_of(surface)
    net = points.reshape(side, side, 3).transpose(1, 0, 2).reshape(-1, 3)  # splinepy varies u fastest
    spline = library.NURBS([3, 3], [knots, knots], net, np.ones((len(net), 1)))
    uv = np.ascontiguousarray(mesh.uv)
    return lambda: spline.evaluate(uv, nthreads=1)


def geomdl(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """Return the evaluation by geomdl's NURBS in plain Python, for the first :data:`GEOMDL_VERTICES` vertices."""
    side, points, knots = net_of(surface)
    spline = importlib.import_module("geomdl.NURBS").Surface()
    spline.degree_u = spline.degree_v = 3
    spline.set_ctrlpts(np.hstack([points, np.ones((len(points), 1))]).tolist(), side, side)
    spline.knotvector_u = spline.knotvector_v = knots.tolist()
    uv = mesh.uv[:GEOMDL_VERTICES].tolist()
    return lambda: spline.evaluate_list(uv)


def net_of(surface: DCPSurface) -> tuple[int, Floats, Floats]:
    """Return the side of a square bicubic net made by :func:`.bench.sheet`, its points (n, 3) and its knot vector."""
    side = int(np.sqrt(surface.n))
    knots = np.concatenate([surface.padded[1][:side, 0], surface.padded[1][side - 1, 1:]])
    return side, surface.points, knots
