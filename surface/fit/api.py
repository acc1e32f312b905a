"""Turn a mesh with texture coordinates and expression shapes into a head."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surface.fit.chart import make_chart
from surface.fit.islands import Island, find_islands
from surface.fit.joins import find_seams
from surface.fit.mesh import FitMesh, load_mesh
from surface.fit.names import sources_of
from surface.fit.pieces import Body, eyeball_part, hair_parts, skin_part, teeth_part
from surface.fit.recipe import PartRecipe, Recipe, recipe_for
from surface.fit.refine import fit_chart
from surface.fit.relax import open_flat_holes
from surface.fit.report import FitReport, measure
from surface.fit.rigging import find_jaw
from surface.fit.seat import close_lips, seat_lids, strengthen
from surface.fit.strokes import make_paint
from surface.head.data import HeadData, Neck, PartData
from surface.head.file import save_data
from surface.head.meshes import pack, tessellate
from surface.head.parameters import NAMES, read_pose
from surface.head.part import make_surface
from surface.head.rig import SkinRig

Floats = NDArray[np.float64]
Progress = Callable[[str, float], None]
# the pose that decides how finely a part is cut into triangles
LIVELY = {"jawOpen": 0.6, "mouthSmileLeft": 0.4, "mouthSmileRight": 0.4, "eyeBlinkLeft": 0.4, "eyeBlinkRight": 0.4}


def fit_head(mesh_path: str | Path, out_dir: str | Path, *, name: str, progress: Progress | None = None) -> FitReport:
    """Fit a head to a mesh and write it.

    Parameters
    ----------
    mesh_path : .npz in the layout of :mod:`surface.fit.mesh`.
    out_dir : folder that gets head.toml and head.npz.
    name : the head's short name.
    progress : called with the part being fitted and the fraction done, 0..1.

    Raises
    ------
    FitError : the mesh cannot be read, has no texture coordinates or faces, holds NaN, or does not fit together.
        Nothing is written then.
    """
    mesh = load_mesh(mesh_path)
    data, report = fit_mesh(mesh, recipe_for(mesh), name, progress or (lambda part, done: None))
    save_data(out_dir, data)
    return report


def fit_mesh(mesh: FitMesh, recipe: Recipe, name: str, progress: Progress) -> tuple[HeadData, FitReport]:
    """Fit all parts of a mesh in memory."""
    mesh = _prepare(mesh, recipe)
    body = _body(mesh, recipe)
    steps = _Steps(recipe, progress)
    parts, reports, charts = [], [], {}
    for part, islands in _islands_of(mesh, recipe):
        chart = make_chart(mesh, islands, normalise=len(islands) > 1 or not _unit_square(islands[0]))
        fitted = fit_chart(mesh if part.follows == "skin" else _still(mesh), chart, part.wish, steps.of(part))
        parts.append(skin_part(part, chart, fitted, body))
        reports.append(measure(part.name, chart, fitted, mesh.names))
        charts[part.name] = chart
        if recipe.hair and recipe.hair["face"] == part.name:
            parts += hair_parts(mesh, chart, fitted, recipe.hair["brow"], body)
    for part in recipe.teeth:
        data, report = teeth_part(mesh, part, body)
        parts.append(data)
        reports.append(report)
    if body.radius > 0:
        parts += [eyeball_part(side, e, body.radius) for side, e in zip(("left", "right"), body.eyes, strict=True)]
    head = HeadData(
        name, _provenance(recipe), _neck(mesh, recipe), body.eyes, body.radius, body.jaw,
        parts, find_seams(charts), make_paint(recipe.paint, charts, mesh),
    )  # fmt: skip
    head = replace(head, parts=[_with_mesh(p, head) for p in parts])
    return head, FitReport(name, reports, sorted(body.sources))


def _body(mesh: FitMesh, recipe: Recipe) -> Body:
    sources = sources_of(mesh.names)
    jaw = find_jaw(mesh, sources, np.arange(*recipe.jaw_teeth), np.array(recipe.hinge or (0.0, 0.0, 0.0)))
    return Body(sources, jaw, *_eyes(mesh, recipe), np.array(recipe.tongue))


def _still(mesh: FitMesh) -> FitMesh:
    """The mesh without its shapes, for parts that move as a whole."""
    return replace(mesh, names=(), deltas=mesh.deltas[:0])


def _prepare(mesh: FitMesh, recipe: Recipe) -> FitMesh:
    mesh = strengthen(close_lips(mesh, recipe.lips_close), "eyeBlink", recipe.blink)
    balls = recipe.eyeballs(mesh)
    return mesh if balls is None else seat_lids(mesh, *balls, recipe.seated)


def _islands_of(mesh: FitMesh, recipe: Recipe) -> list[tuple[PartRecipe, list[Island]]]:
    """Every part with its islands, flat holes opened; parts without an island are left out."""
    islands = find_islands(mesh)
    out = []
    for part in recipe.parts:
        own = [open_flat_holes(i) for i in islands if part.holds(float(np.median(i.vertex)))]
        if own:
            out.append((part, own))
    return out


def _unit_square(island: Island) -> bool:
    return bool(island.uv.min() > -0.05 and island.uv.max() < 1.05 and np.ptp(island.uv, axis=0).min() > 0.7)


class _Steps:
    """Progress over all parts, by their number of points."""

    def __init__(self, recipe: Recipe, progress: Progress) -> None:
        self._progress = progress
        self._total = float(sum(p.wish.points for p in recipe.parts) or 1)
        self._before = 0.0

    def of(self, part: PartRecipe) -> Callable[[float], None]:
        """Progress of one part, 0..1."""
        start = self._before
        self._before += part.wish.points / self._total
        return lambda done: self._progress(part.name, min(1.0, start + done * part.wish.points / self._total))


def _with_mesh(part: PartData, head: HeadData) -> PartData:
    """The part with its tessellation, so that a face starts at once; fine enough for a face that moves."""
    surface = make_surface(part)
    if part.follows == "skin":
        lively = SkinRig(part, head).apply(read_pose(np.array([LIVELY.get(n, 0.0) for n in NAMES])))
        surface = surface.with_points(lively)
    return replace(part, mesh=pack(tessellate(part, surface), part.budget))


def _eyes(mesh: FitMesh, recipe: Recipe) -> tuple[Floats, float]:
    """Centres (2, 3) and radius; a head without known eyes gets none (radius 0)."""
    balls = recipe.eyeballs(mesh)
    if balls is None:
        return np.zeros((2, 3)), 0.0
    centre = np.array(balls[1].centre)
    return np.stack([centre, centre * [-1.0, 1.0, 1.0]]), balls[1].radius


def _neck(mesh: FitMesh, recipe: Recipe) -> Neck:
    """The recipe's neck, or one in the lower quarter of a head nothing is known of."""
    if recipe.neck is not None:
        return Neck(recipe.neck)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    height = float(high[1] - low[1])
    pivot = (0.0, float(low[1]) + 0.3 * height, float(0.5 * (low[2] + high[2])))
    return Neck(pivot, 0.0, float(low[1]) + 0.02 * height, float(low[1]) + 0.2 * height)


def _provenance(recipe: Recipe) -> dict[str, str]:
    made = "fitted by least squares with omote fit; control points and displacements, not the source mesh"
    return {"made": made, **{f"source_{k}": v for k, v in recipe.source.items()}}
