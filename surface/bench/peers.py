"""Other ways to the same vertices, for comparison: sparse matrices, blendshapes, stencil tables, spline libraries.

splinepy and geomdl are measured where they are installed; nothing here needs them.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.mesh.mesh import Mesh

from .stencils import stencil_evaluator

BLENDSHAPES = 52
SAMPLES = 200  # vertices that geomdl computes; all would take minutes

Evaluator = Callable[[], object]


def one_thread() -> AbstractContextManager[object]:
    """Keep numpy's matrix products to one thread where threadpoolctl is installed; else they use what they find."""
    if importlib.util.find_spec("threadpoolctl") is None:
        return nullcontext()
    limits: AbstractContextManager[object] = importlib.import_module("threadpoolctl").threadpool_limits(1)
    return limits


def sparse_matrix(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """scipy's compressed sparse rows times the control points, float32."""
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side).astype(np.float32)
    points = surface.points.astype(np.float32)
    return lambda: matrix @ points


def blendshapes(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """52 amounts times 52 displacements of every vertex, float32."""
    shapes = np.ones((BLENDSHAPES, 3 * len(mesh.vertices)), dtype=np.float32)
    amounts = np.ones(BLENDSHAPES, dtype=np.float32)
    return lambda: amounts @ shapes


def stencils(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """A stencil table, evaluated row by row."""
    return stencil_evaluator(surface, mesh)[0]


def splinepy(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """splinepy's compiled NURBS, one thread."""
    library = importlib.import_module("splinepy")
    side, points, knots = net_of(surface)
    net = points.reshape(side, side, 3).transpose(1, 0, 2).reshape(-1, 3)  # u runs fastest there
    spline = library.NURBS([3, 3], [knots, knots], net, np.ones((len(net), 1)))
    uv = np.ascontiguousarray(mesh.uv)
    return lambda: spline.evaluate(uv, nthreads=1)


def geomdl(surface: DCPSurface, mesh: Mesh) -> Evaluator:
    """geomdl's NURBS in plain Python, for the first :data:`SAMPLES` vertices."""
    side, points, knots = net_of(surface)
    spline = importlib.import_module("geomdl.NURBS").Surface()
    spline.degree_u = spline.degree_v = 3
    spline.set_ctrlpts(np.hstack([points, np.ones((len(points), 1))]).tolist(), side, side)
    spline.knotvector_u = spline.knotvector_v = knots.tolist()
    uv = mesh.uv[:SAMPLES].tolist()
    return lambda: spline.evaluate_list(uv)


def libraries(mesh: Mesh) -> Iterator[tuple[str, Callable[[DCPSurface, Mesh], Evaluator], float]]:
    """Installed spline libraries: name, how to prepare one, and by what its time is to be multiplied."""
    for name, prepare, share in (("splinepy", splinepy, 1.0), ("geomdl", geomdl, len(mesh.uv) / SAMPLES)):
        if importlib.util.find_spec(name) is not None:
            yield name, prepare, share


def net_of(surface: DCPSurface) -> tuple[int, Floats, Floats]:
    """Side of a square bicubic net, its points ``(n, 3)`` and its knot vector, as :func:`.bench.sheet` makes it."""
    side = int(np.sqrt(surface.n))
    knots = np.concatenate([surface.padded[1][:side, 0], surface.padded[1][side - 1, 1:]])
    return side, surface.points, knots
