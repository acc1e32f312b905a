"""Tessellate parts, and store their meshes in the head file so that loading need not tessellate again.

A part without a stored mesh, or with another budget than it was made with, is tessellated when it is loaded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from surface.base.arrays import Array, Floats
from surface.dcp import DCPSurface
from surface.head.model.data import PartData, Seam
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh
from surface.mesh.tessellate import unit_normals

KEYS = ("mesh_uv", "mesh_triangles", "mesh_side", "mesh_cell_start", "mesh_list_start", "mesh_list_ids", "mesh_made")
LOOP_SHARE = 0.4  # distance within which a border follows its loop, in chord errors


def make_surface(data: PartData) -> DCPSurface:
    """Return the part's DCP surface."""
    return DCPSurface.from_padded(
        data.points, data.weights, data.knots_u, data.knots_v, data.degrees[:, 0], data.degrees[:, 1],
        closed_u=data.closed_u, closed_v=data.closed_v,
    )  # fmt: skip


def tessellate(data: PartData, surface: DCPSurface, seams: Sequence[Seam] = ()) -> Mesh:
    """Return triangles for a part by its budget, with vertices where the head's seams begin and end."""
    most, chord, depth = data.budget
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area while borders are cut
        return surface.tessellate(
            max_points=most or None,
            chord_error=chord,
            max_depth=depth,
            domain=replace(domain_of(data), marks=_ends(seams, data.name)),
            loop_error=LOOP_SHARE * chord,
            measured=False,
            flip=data.flip,
        )


def _ends(seams: Sequence[Seam], part: str) -> Floats:
    """Return (k, 2): ends of a part's seams, where three borders or more meet; closed seams have none."""
    lines = [uv for s in seams for name, uv in ((s.part_a, s.uv_a), (s.part_b, s.uv_b)) if name == part]
    ends = [line[k] for line in lines for k in (0, -1) if not np.array_equal(line[0], line[-1])]
    return np.unique(np.array(ends, float).reshape(-1, 2), axis=0)


def domain_of(data: PartData) -> Domain:
    """Return the part's rectangle, or the one around its loops, trimmed by them.

    ``ValueError`` for a part with neither.
    """
    if data.rect is not None:
        return Domain(data.rect, data.loops, data.cuts)
    if not data.loops:
        raise ValueError("has neither loops nor rect, which say where to draw it")
    every = np.concatenate(data.loops)
    (u0, v0), (u1, v1) = every.min(axis=0), every.max(axis=0)
    return Domain((u0, u1, v0, v1), data.loops, data.cuts)


def pack(mesh: Mesh, budget: tuple[int, float, int]) -> dict[str, Array]:
    """Return the mesh as arrays to store, without positions and normals, which the surface gives."""
    return {
        "mesh_uv": mesh.uv,
        "mesh_triangles": mesh.triangles.astype(np.int32),
        "mesh_side": mesh.side.astype(np.int8),
        "mesh_cell_start": mesh.cell_start.astype(np.int32),
        "mesh_list_start": mesh.list_start.astype(np.int32),
        "mesh_list_ids": mesh.list_ids.astype(np.int32),
        "mesh_made": np.array([*budget, mesh.leaves, mesh.flip], float),
    }


def unpack(
    arrays: dict[str, Array], surface: DCPSurface, budget: tuple[int, float, int], *, rough: bool, flip: bool = False
) -> Mesh | None:
    """Return the stored mesh, or None if it is absent, made with another budget or flip, or does not fit the surface.

    ``rough`` leaves positions and normals to a deformation that computes them anyway: every vertex is put in the middle
    of its cell's control points.
    """
    if any(key not in arrays for key in KEYS):
        return None
    uv, triangles, side, start, list_start, ids, made = (arrays[key] for key in KEYS)
    if made.shape != (5,) or not np.isfinite(made).all() or tuple(made[:3]) != tuple(map(float, budget)):
        return None
    if bool(made[4]) != flip:
        return None
    if not _kinds_valid(arrays, uv.shape[:1]):
        return None
    triangles, start, list_start, ids = (a.astype(np.int64) for a in (triangles, start, list_start, ids))
    if not _indices_valid(uv, triangles, start, list_start, ids, len(surface.shifts) * surface.n):
        return None
    uv, triangles, side = uv.astype(float), triangles.astype(np.int32), side.astype(np.int64)
    cell = np.repeat(np.arange(len(start) - 1, dtype=np.int32), np.diff(start))
    if rough:
        sums = np.add.reduceat(surface.points[ids % surface.n], list_start[:-1]) / np.diff(list_start)[:, None]
        points, normals = sums[cell], np.zeros((len(uv), 3))
    else:
        points, su, sv = surface.derivatives(uv, side=side)
        normals = unit_normals(points, su, sv, triangles) * (-1.0 if made[4] else 1.0)
    return Mesh(
        points, normals, triangles, uv, side, cell, start.astype(np.int64),
        list_start.astype(np.int64), ids.astype(np.int32), int(made[3]), bool(made[4]),
    )  # fmt: skip


def _kinds_valid(arrays: dict[str, Array], vertices: tuple[int, ...]) -> bool:
    """Whether the arrays hold numbers of the right shapes, and no list is empty."""
    uv, triangles, side, *lists = (arrays[key] for key in KEYS[:-1])
    shaped = uv.shape == (*vertices, 2) and triangles.shape[1:] == (3,) and side.shape == vertices
    whole = all(a.dtype.kind in "iu" for a in (triangles, side, *lists)) and uv.dtype.kind == "f"
    return bool(shaped and whole and all(a.ndim == 1 and len(a) for a in lists) and np.isfinite(uv).all())


def _indices_valid(uv: Array, triangles: Array, start: Array, list_start: Array, ids: Array, n: int) -> bool:
    """Whether all indices are in range."""
    if not len(triangles) or len(start) != len(list_start):
        return False
    whole = start[0] == 0 and start[-1] == len(uv) and list_start[0] == 0 and list_start[-1] == len(ids)
    rising = bool((np.diff(start) > 0).all() and (np.diff(list_start) > 0).all())
    inside = triangles.min() >= 0 and triangles.max() < len(uv) and ids.min(initial=0) >= 0
    return bool(whole and rising and inside and ids.max(initial=-1) < n)
