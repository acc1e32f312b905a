"""Surfaces of many patches, as arrays of a file: control points, knots, vertices, triangles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from surface.base.arrays import Array, Floats, Ints
from surface.fit.wardrobe.skin import Skin

APART = 2.0  # between patches, in u
#: How far below nothing cover is where no hair grows: strand.frag fades it, and the tallest strands reach 0.3.
BARE = 0.5
_CELL = 12  # rows of vertices along u in a cell of the mesh: only the points that reach them are in its list
_MADE = (0.0, 1.0, 1.0)  # a budget that nothing else makes: the mesh is the file's own


@dataclass(frozen=True)
class Patches:
    """k patches of one kind, each a grid of control points.

    points : (k, nu, nv, 3) mm. degrees : in u and v. grid, fast : vertices along u and v of either quality.
    strands : (k, gu, gv, 4) texture coordinates across and along, cover, openness, at the vertices of ``grid``.
    tint, shade : (k, gu, gv), 0..1 and about 1. sway : (k, nu, nv). follow : share of the skin's
    motion; of that below the root where the patch goes as a whole, else below each point.
    """

    points: Floats
    degrees: tuple[int, int]
    grid: tuple[int, int]
    fast: tuple[int, int]
    strands: Floats
    tint: Floats
    shade: Floats
    sway: Floats
    follow: float = 0.0
    whole: bool = True


def knots(count: int, degree: int) -> Floats:
    """(count, degree + 2) knots of each control point of a clamped uniform spline over 0..1."""
    inner = np.linspace(0.0, 1.0, count - degree + 1)[1:-1]
    every = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    return np.array([every[i : i + degree + 2] for i in range(count)])


def greville(count: int, degree: int) -> Floats:
    """(count,) where each control point of :func:`knots` acts most: points of a line there give it evenly."""
    return np.asarray(knots(count, degree)[:, 1:-1].mean(axis=1))


def arrays(patches: list[Patches], skin: Skin) -> dict[str, Array]:
    """Arrays of one part by key (:mod:`surface.head.model.wardrobe`)."""
    every = [_one_kind(p, skin) for p in patches]
    out: dict[str, Array] = {}
    width = max(part["knots_u"].shape[1] for part in every), max(part["knots_v"].shape[1] for part in every)
    point = vertex = 0
    first_u: float = 0.0
    for part in every:
        for key, wanted in zip(("knots_u", "knots_v"), width, strict=True):
            part[key] = np.pad(part[key], ((0, 0), (0, wanted - part[key].shape[1])), mode="edge")
        part["knots_u"] += first_u
        part["mesh_uv"][:, 0] += first_u
        for key, first in (("mesh_triangles", vertex), ("fast", vertex), ("mesh_list_ids", point)):
            part[key] = part[key] + first
        first_u += APART * float(part.pop("count"))
        point, vertex = point + len(part["points"]), vertex + len(part["mesh_uv"])
    for key in every[0]:
        out[key] = np.concatenate([part[key] for part in every])
    sizes = out.pop("cells")
    out["mesh_cell_start"] = np.cumsum([0, *sizes[:, 0]])
    out["mesh_list_start"] = np.cumsum([0, *sizes[:, 1]])
    return _packed(out, len(sizes))


def _packed(a: dict[str, Array], leaves: int) -> dict[str, Array]:
    """The arrays as narrow as they may be stored."""
    narrow = {k: a[k].astype(np.float32) for k in ("points", "anchor", "follow", "sway", "strands")}
    whole = {k: a[k].astype(np.int32) for k in a if k.startswith("mesh_") and k not in ("mesh_uv", "mesh_side")}
    return (
        a
        | narrow
        | whole
        | {
            "degrees": a["degrees"].astype(np.int8),
            "mesh_side": a["mesh_side"].astype(np.int8),
            "tint": np.rint(255 * np.clip(a["tint"], 0, 1)).astype(np.uint8),
            "shade": np.rint(128 * np.clip(a["shade"], 0, 1.99)).astype(np.uint8),
            "fast": a["fast"].astype(np.int32),
            "mesh_made": np.array([*_MADE, leaves, 0.0]),
        }
    )


def _one_kind(p: Patches, skin: Skin) -> dict[str, Array]:
    k, nu, nv, _ = p.points.shape
    (pu, pv), (gu, gv) = p.degrees, p.grid
    points = p.points.reshape(-1, 3)
    anchor, offsets = skin.anchors(points)
    if p.follow > 0.0 and p.whole:
        anchor, offsets = _anchored_at(p.points[:, :, 0].mean(axis=1), points, nu * nv, skin)
    shift = APART * np.arange(k)
    one_u, one_v = np.repeat(knots(nu, pu), nv, axis=0), np.tile(knots(nv, pv), (nu, 1))
    u, v = np.meshgrid(np.linspace(0, 1, gu), np.linspace(0, 1, gv), indexing="ij")
    uv = np.stack([u[None] + shift[:, None, None], np.broadcast_to(v, (k, gu, gv))], axis=-1).reshape(-1, 2)
    side = (u >= 1.0) * 1 + (v >= 1.0) * 2
    first = np.arange(k)[:, None, None] * gu * gv
    sizes, lists = _cells(p)
    return {
        "points": offsets, "anchor": anchor, "count": np.array(k),
        "degrees": np.tile([pu, pv], (len(points), 1)),
        "knots_u": (one_u[None] + shift[:, None, None]).reshape(-1, pu + 2),
        "knots_v": np.tile(one_v, (k, 1)),
        "follow": np.full(len(points), p.follow), "sway": p.sway.reshape(-1),
        "strands": p.strands.reshape(-1, 4), "tint": p.tint.reshape(-1), "shade": p.shade.reshape(-1),
        "mesh_uv": uv, "mesh_side": np.tile(side.ravel(), k),
        "mesh_triangles": (first + _triangles(p.grid, p.grid)).reshape(-1, 3),
        "fast": _grown((first + _triangles(p.grid, p.fast)).reshape(-1, 3), p),
        "mesh_list_ids": (np.arange(k)[:, None] * nu * nv + lists).ravel(),
        "cells": np.tile(sizes, (k, 1)),
    }  # fmt: skip


def _grown(triangles: Ints, p: Patches) -> Ints:
    """The triangles (t, 3) but for those where no hair grows, which show nothing and cost time."""
    cover = p.strands[..., 2].reshape(-1)
    return triangles[(cover[triangles] > 1e-3 - BARE).any(axis=1)]


def _cells(p: Patches) -> tuple[Ints, Ints]:
    """Cells of one patch, each of some rows of its vertices: how many vertices and points each has, (c, 2), and the
    points of all of them, one after the other."""
    (nu, nv), (gu, gv) = p.points.shape[1:3], p.grid
    reach = knots(nu, p.degrees[0])
    ends = np.rint(np.linspace(0, gu, max(1, round(gu / _CELL)) + 1)).astype(int)
    sizes, lists = [], []
    for begin, end in pairwise(ends):
        low, high = begin / (gu - 1), (end - 1) / (gu - 1)
        rows = np.flatnonzero((reach[:, 0] <= high) & (reach[:, -1] >= low))
        lists.append((rows[:, None] * nv + np.arange(nv)).ravel())
        sizes.append(((end - begin) * gv, len(lists[-1])))
    return np.array(sizes), np.concatenate(lists)


def _anchored_at(roots: Floats, points: Floats, each: int, skin: Skin) -> tuple[Floats, Floats]:
    """Anchors of patches of ``each`` points at their roots (k, 3), and the offsets of all points from them."""
    anchor, offset = skin.anchors(roots)
    return np.repeat(anchor, each, axis=0), points - np.repeat(roots - offset, each, axis=0)


def _triangles(grid: tuple[int, int], used: tuple[int, int]) -> Ints:
    """(t, 3) triangles of a grid of vertices, over ``used`` of its rows and columns, evenly chosen."""
    (gu, gv), (fu, fv) = grid, used
    i = np.rint(np.linspace(0, gu - 1, fu)).astype(int)
    j = np.rint(np.linspace(0, gv - 1, fv)).astype(int)
    at = i[:, None] * gv + j[None, :]
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
