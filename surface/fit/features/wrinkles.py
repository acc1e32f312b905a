"""Add wrinkles to a fitted face: control points with small spans along lines, and groups that sink them.

At rest they lie on the surface and move with every other group as the skin around them does, so that they change it
little. The displacements that sink them are solved by least squares for a furrow of the wanted depth and width.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.fit.points.strokes import arc_length, evenly, smooth_line, uv_of
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import WRINKLE, Group, PartData, Rule
from surface.head.model.furrow import Furrow, furrow_knots, furrow_moves
from surface.head.model.meshes import make_surface

DEEPENED = 1.5
ALONG = 1.8  # distance of the points along a line, in widths of its furrow


@dataclass(frozen=True)
class WrinkleLine:
    """One line in the skin, and the group that sinks it."""

    group: str
    furrow: Furrow


def add_wrinkles(
    face: PartData, chart: Chart, mesh: FitMesh, wanted: list[dict[str, Any]]
) -> tuple[PartData, list[Rule]]:
    """The face with control points along the wanted lines, and what moves them.

    wanted : tables with ``group``, ``terms``, ``depth`` and ``width`` in mm, ``lines`` of (x, y) seen from the front;
        with ``mirror`` the same on the right side, "Left" in names becoming "Right"; ``raised``, more lines, along
        which the skin rises by ``rise`` mm, as a cheek does next to its fold.
    """
    lines, rules = [], []
    for table in wanted:
        for sided in (table, _mirrored(table)) if table.get("mirror") else (table,):
            rules.append(Rule(sided["group"], tuple(sided["terms"]), float(sided.get("power", 2.0))))
            lines += [_wrinkle_line(sided, np.array(line, float), chart, mesh) for line in sided["lines"]]
            up = sided | {"depth": -sided.get("rise", 0.0)}
            lines += [_wrinkle_line(up, np.array(line, float), chart, mesh) for line in sided.get("raised", [])]
    if not lines:
        return face, []
    surface = make_surface(face)
    knots = [furrow_knots(f.furrow, surface) for f in lines]
    face = _with_points(face, surface, np.concatenate([k[0] for k in knots]), np.concatenate([k[1] for k in knots]))
    first = np.cumsum([surface.n, *(len(k[0]) for k in knots)])
    groups: dict[str, list[tuple[Ints, Floats]]] = {}
    surface = make_surface(face)
    for f, a, b in zip(lines, first, first[1:], strict=False):
        groups.setdefault(f.group, []).append(_moves(f.furrow, surface, np.arange(a, b)))
    made = [
        Group(name, np.concatenate([i for i, _ in own]).astype(np.int32),
              np.concatenate([m for _, m in own]).astype(np.float32))
        for name, own in groups.items()
    ]  # fmt: skip
    return replace(face, groups=[*face.groups, *made]), rules


def with_deep_wrinkles(part: PartData, points: Floats) -> Floats:
    """Control points (n, 3) with all of a part's wrinkles in them, deeper than they ever are: to cut it into triangles
    that are fine enough for their shading."""
    out = points.copy()
    for g in part.groups:
        if g.name.startswith(WRINKLE):
            out[g.ids] += DEEPENED * g.moves
    return out


def _mirrored(table: dict[str, Any]) -> dict[str, Any]:
    lines = {k: [[[-x, y] for x, y in line] for line in table.get(k, [])] for k in ("lines", "raised")}
    terms = [{_other(name): share for name, share in term.items()} for term in table["terms"]]
    return table | lines | {"group": _other(table["group"]), "terms": terms}


def _other(name: str) -> str:
    """The name of the right side's for the left side's, and the other way round."""
    return name.replace("Left", "*").replace("Right", "Left").replace("*", "Right")


def _wrinkle_line(table: dict[str, Any], line: Floats, chart: Chart, mesh: FitMesh) -> WrinkleLine:
    """A line seen from the front, projected onto the mesh, in evenly spaced points."""
    smooth = smooth_line(line, closed=False)
    samples = chart.mix @ mesh.vertices
    near = ((samples[None, :, :2] - smooth[:, None]) ** 2).sum(axis=2) - 1e-3 * samples[:, 2] * np.abs(samples[:, 2])
    z = samples[near.argmin(axis=1), 2]
    at = np.column_stack([smooth, np.convolve(np.pad(z, 3, mode="edge"), np.full(7, 1 / 7), "valid")])
    width = float(table["width"])
    at = evenly(at, max(3, round(arc_length(at)[-1] / (ALONG * width)) + 1))
    return WrinkleLine(table["group"], Furrow(uv_of(chart, mesh, at), float(table["depth"]), width))


def _with_points(face: PartData, surface: DCPSurface, knots_u: Floats, knots_v: Floats) -> PartData:
    """More points that change next to nothing: each where the surface is, with the weight 1, in every group."""
    centre = np.column_stack([knots_u[:, 2], knots_v[:, 2]])
    share = surface.basis_matrix(centre).tocsr()
    n, k = surface.n, len(centre)
    groups = []
    for g in face.groups:
        field = np.zeros((n, 3))
        field[g.ids] = g.moves
        extra = share @ field
        moved = np.flatnonzero(np.linalg.norm(extra, axis=1) > 1e-3)
        ids, moves = np.concatenate([g.ids, n + moved]), np.concatenate([g.moves, np.round(extra[moved], 4)])
        groups.append(Group(g.name, ids.astype(np.int32), moves.astype(np.float32)))
    return replace(
        face,
        points=np.concatenate([face.points, share @ face.points]),
        weights=np.concatenate([face.weights, np.ones(k)]),
        knots_u=np.concatenate([face.knots_u, knots_u]),
        knots_v=np.concatenate([face.knots_v, knots_v]),
        degrees=np.concatenate([face.degrees, np.full((k, 2), 3)]),
        groups=groups,
        jaw=np.concatenate([face.jaw, share @ face.jaw]),
        lids=np.concatenate([face.lids, share @ face.lids]),
    )


def _moves(f: Furrow, surface: DCPSurface, ids: Ints) -> tuple[Ints, Floats]:
    return ids, furrow_moves(f, surface, ids)
