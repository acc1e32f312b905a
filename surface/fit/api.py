"""Fit a head to a mesh with expression shapes, from the file to the head's folder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.base.progress import Progress, no_progress, part_of
from surface.check.overlaps import overlap_notes
from surface.fit.eyes.colours import paint_layers
from surface.fit.eyes.drawn_lids import seat_drawn_lids
from surface.fit.eyes.lids import fit_lids, gazes_of
from surface.fit.features.accessories import make_accessories
from surface.fit.features.blink_squints import cancel_squints_in_blinks
from surface.fit.features.cavity import MATERIAL
from surface.fit.features.combs import combed
from surface.fit.features.cutouts import cut_out
from surface.fit.features.eye_corners import corners_paint, corners_part, lacks_corners
from surface.fit.features.findings import findings
from surface.fit.features.finish import finish_head
from surface.fit.features.generic import Plan, make_plan
from surface.fit.features.joins import find_seams
from surface.fit.features.levelled import level_seams
from surface.fit.features.mouth.redrawn import redrawn_mouth
from surface.fit.features.pieces import HeadRig, eyeball_part, hair_parts, skin_part, teeth_part
from surface.fit.features.rigging import find_jaw, take_tongue
from surface.fit.features.wrinkles import with_deep_wrinkles
from surface.fit.filling.api import Filling, filled
from surface.fit.measures.dense import errors_at_rest
from surface.fit.measures.mend import faults_of, mend_spikes, turned_faces
from surface.fit.measures.own_overlaps import MeshOverlaps
from surface.fit.measures.refusal import save_or_refuse
from surface.fit.painting.skin import SkinIslands
from surface.fit.painting.texture import head_texture
from surface.fit.points.facets import facet_sag
from surface.fit.points.importance import POINTS_PER_EYE as MORE_POINTS
from surface.fit.points.importance import with_importance
from surface.fit.points.lid_seating import close_lips, seat_lids
from surface.fit.points.local import localised
from surface.fit.points.recipe import PartRecipe, Recipe, in_place, recipe_for
from surface.fit.points.refine import fit_chart
from surface.fit.points.report import RMS_MM, Errors, FitReport, FitResult, FittedPart, PartReport, measure
from surface.fit.points.strength import strengthen
from surface.fit.points.strokes import make_paint
from surface.fit.reportfile import write_report
from surface.fit.source.chart import Chart, make_chart
from surface.fit.source.islands import Island, find_islands
from surface.fit.source.junctions import joined_borders
from surface.fit.source.layout import open_flat_holes
from surface.fit.source.load import Loaded, LoadOptions, load_mesh
from surface.fit.source.mesh import SMALL, FitMesh, check_manifold, is_mapped
from surface.fit.source.names import sources_of
from surface.fit.source.naming.misnamed import correct_shapes
from surface.fit.source.naming.shapes import to_arkit
from surface.fit.source.placing.anatomy import Landmarks
from surface.fit.source.placing.frame import head_scale
from surface.fit.source.placing.place import neck_of, place
from surface.fit.source.repair import repaired
from surface.fit.source.wrap import wrap_chart
from surface.head import Head
from surface.head.model.data import HeadData, Neck, PartData, with_greatest_error
from surface.head.model.file import check_writable, load_data
from surface.head.model.meshes import pack, tessellate
from surface.head.model.parameters import NAMES, read_pose
from surface.head.model.texture import HeadTexture
from surface.head.posing.fit_error import write_fit_error
from surface.head.posing.part import make_surface
from surface.head.posing.rig import SkinRig

FILLING = 0.4  # of the time of a fit that fills in shapes: how long that takes
OTHER_MESH_MM = 1.0  # RMS distance at rest that only a head fitted to another mesh has
# Errors on an average head from which on a part beside the face, such as hair, is left out.
LOOSE_MM = 3.0  # RMS
LOOSE_99_MM = 5.0  # 99 of 100 samples
# pose that decides how finely a part is cut into triangles
SAMPLE_POSE = {"jawOpen": 0.6, "mouthSmileLeft": 0.4, "mouthSmileRight": 0.4, "eyeBlinkLeft": 0.4, "eyeBlinkRight": 0.4}

LINING_POSE = {**SAMPLE_POSE, "jawOpen": 1.0, "mouthClose": 0.5}  # of what lines the mouth, which bends most over a jaw


def fit_head(
    mesh_path: str | Path, out_dir: str | Path, *, name: str, progress: Progress | None = None,
    options: LoadOptions = LoadOptions(), report_dir: str | Path | None = None, force: bool = False,
    filling: Filling | None = None,
) -> FitReport:  # fmt: skip
    """Fit a head to a mesh and write it.

    mesh_path : .glb, .gltf or .vrm with morph targets, .obj with a folder of shapes, or .npz.
    out_dir : folder that gets head.toml and head.npz.
    progress : called with the part being fitted and the fraction done, 0..1.
    options : how to interpret the mesh. report_dir : folder that gets the report (see
        :func:`surface.fit.reportfile.write_report`). force : write a head that does not follow its mesh, too.
    filling : a head that gives the shapes which the mesh lacks.

    Raises FitError: the mesh cannot be read, has no faces, holds NaN, is no manifold, or does
    not fit together; nothing is written then. Or the head does not follow the mesh (:func:`faults_of`): it is written
    to :func:`refused_folder`, to be looked at, and what is in ``out_dir`` stays.
    HeadFileError: a folder cannot be written to.
    """
    report = progress or no_progress
    for folder in (out_dir, report_dir):
        check_writable(folder or out_dir)
    loaded = load_mesh(mesh_path, options)
    if filling is not None:
        loaded = filled(loaded, mesh_path, filling, options, part_of(report, 0.0, FILLING))
        report = part_of(report, FILLING, 1.0)
    result = fit_mesh(loaded, name, report, str(mesh_path))
    if report_dir is not None:
        write_report(result, report_dir, report)
    beside = result.errors, result.accessories, result.texture
    save_or_refuse(out_dir, result.head, result.report.faults, *beside, force=force)
    return result.report


def measure_head(head: str | Path, mesh_path: str | Path, options: LoadOptions = LoadOptions()) -> dict[str, Floats]:
    """Measure how far a head that was fitted to a mesh lies from it, and keep that in the head's folder.

    head : its folder. mesh_path, options : as they were given to :func:`fit_head`.
    Returns the distances of its vertices at rest, (m,) mm by part; NaN where the mesh has nothing.

    Raises FitError: the mesh cannot be read, or is not the one that the head was fitted to; nothing is written then.
    HeadFileError: the head cannot be read or written to.
    """
    data = load_data(head)
    mesh, charts = charts_of(mesh_path, options)
    errors = errors_at_rest(data, mesh, charts)
    known = np.concatenate([np.zeros(0), *errors.values()])
    off = float(np.sqrt(np.nanmean(known**2))) if np.isfinite(known).any() else np.inf
    if off > OTHER_MESH_MM * head_scale(mesh.vertices, dict(zip(mesh.names, mesh.deltas, strict=True))):
        why = f"{head}: was not fitted to {mesh_path}: " + (
            f"{off:.1f} mm RMS from it" if errors else "no part is in it"
        )
        raise FitError(why, hint="name the mesh and the options that the head was made with")
    write_fit_error(head, errors, Head(data).parts)
    return errors


def charts_of(mesh_path: str | Path, options: LoadOptions = LoadOptions()) -> tuple[FitMesh, dict[str, Chart]]:
    """A mesh as it is fitted, and the charts of its parts by name. Raises FitError, as :func:`fit_head` does."""
    planned = _planned(load_mesh(mesh_path, options), str(mesh_path))
    mesh = planned.mesh
    return mesh, {part.name: part_chart(mesh, part, islands) for part, islands in planned.plan.parts}


def fit_mesh(loaded: Loaded, name: str, progress: Progress, where: str = "mesh") -> FitResult:
    """Fit all parts of a mesh in memory; ``where`` names it in messages."""
    planned = _planned(loaded, where)
    loaded, recipe, mesh, plan = planned.loaded, planned.recipe, planned.mesh, planned.plan
    worn, sources = make_accessories(loaded), sources_of(mesh.names)
    rig = HeadRig(sources, find_jaw(mesh, sources, plan.jaw, plan.hinge), *plan.eyes, np.array(recipe.tongue))
    parts, reports, fitted_parts = _fit_parts(mesh, recipe, plan, rig, progress, comb=not loaded.exported)
    charts = {p.name: p.chart for p in fitted_parts}
    paint = make_paint(recipe.paint, charts, mesh)
    scale, seams = head_scale(mesh.vertices, dict(zip(mesh.names, mesh.deltas, strict=True))), find_seams(charts)
    bands = None
    if plan.found and plan.found.openings and lacks_corners(loaded):
        bands = corners_part(parts[0].name, fitted_parts[0].chart, fitted_parts[0].fitted, mesh, rig, scale)
    parts, seams = (parts, seams) if bands is None else ([*parts, bands[0]], [*seams, *bands[1]])
    paint += paint_layers(mesh, plan.found, parts) if plan.found else []
    paint += corners_paint(mesh, plan.found) if plan.found and bands is not None else []
    head = HeadData(
        name, _provenance(recipe), _neck(mesh, recipe, loaded.marks), rig.eyes, rig.radius, rig.jaw,
        parts, seams, paint, placement=loaded.placement,
    )  # fmt: skip
    if recipe.parts:  # of other meshes nobody knows whether a crease is theirs
        head = level_seams(head)
    head = finish_head(head, mesh, charts, recipe)
    head = replace(head, parts=[_with_mesh(p, head) for p in head.parts])
    if plan.found:
        head, lid_notes = seat_drawn_lids(head)
        head, squint_notes = cancel_squints_in_blinks(head)
        plan.notes.extend([*lid_notes, *squint_notes])
    texture = _texture(mesh, plan)
    missing = tuple(n for n in loaded.named.missing if not any(g.name == n for p in head.parts for g in p.groups))
    moving = sorted({*sources, *loaded.named.missing} - {*missing})
    head, local = localised(head, scale)
    head, dense, mended = mend_spikes(head, mesh, sources, fitted_parts, scale)
    head = with_greatest_error(head, str(dense.greatest) if dense.greatest else "")
    head = redrawn_mouth(head, recipe)  # after all that is measured against the mesh
    notes = [*worn.notes, *loaded.notes, *plan.notes, *turned_faces(mesh), str(local), *mended]
    notes += findings(head, loaded.marks, _kinds(loaded), {one.kind for one in worn.accessories})
    notes += overlap_notes(head, MeshOverlaps(head, mesh, sources, fitted_parts, scale).depth)
    report = FitReport(
        name, reports, moving, missing, loaded.named.left_out, notes, scale,
        loaded.named.made_of(loaded.mesh.names), loaded.named.empty, loaded.named.presets,
        {**loaded.pieces, **worn.pieces}, dense, tuple(faults_of(dense, fitted_parts, scale)), loaded.named.filled,
        local,
    )  # fmt: skip
    return FitResult(head, report, fitted_parts, errors_at_rest(head, mesh, charts), worn.accessories, texture)


def _texture(mesh: FitMesh, plan: Plan) -> HeadTexture | None:
    """The texture of the head of a mesh whose eyes were looked for, so that it is known what is skin."""
    if not plan.found:
        return None
    skin = [SkinIslands(part.name, own, part.tiled) for part, own in plan.parts if part.material == "skin"]
    texture, notes = head_texture(mesh, plan.found, skin)
    plan.notes.extend(notes)
    return texture


def _kinds(loaded: Loaded) -> set[str]:
    """Of the mesh's pieces, those that were left out, too, but not those that are worn as they are."""
    worn = loaded.worn
    kept = {name for k, name in enumerate(worn.pieces) if (worn.piece == k).any()} if worn is not None else set()
    return {kind.split(",")[0] for name, kind in loaded.pieces.items() if name not in kept}


@dataclass(frozen=True)
class _Planned:
    """A mesh as it is fitted, ``mesh`` with seated lids and ``loaded`` without, and what of it becomes a part."""

    loaded: Loaded
    recipe: Recipe
    mesh: FitMesh
    plan: Plan


def _planned(loaded: Loaded, where: str) -> _Planned:
    """Repair and place a mesh, and plan its parts, by a recipe where it has one; ``where`` names it in messages."""
    recipe = recipe_for(loaded.mesh) if is_mapped(loaded.mesh) else None
    if recipe is not None:
        loaded = in_place(loaded, recipe)
        mesh = prepare(loaded.mesh, recipe)
        return _Planned(loaded, recipe, mesh, recipe_plan(mesh, recipe))
    loaded = _repaired(place(loaded), where)
    check_manifold(loaded.mesh, where)
    mesh, exchanged = correct_shapes(to_arkit(loaded.mesh, loaded.named))
    plan = make_plan(mesh)
    plan.notes.extend(exchanged)
    mesh, taken = take_tongue(mesh, plan.vertices_of("tongue"), plan.jaw)
    plan.notes.extend(taken)
    mesh, seated = fit_lids(mesh, plan.found) if plan.found else (mesh, [])
    plan.notes.extend(seated)
    return _Planned(loaded, Recipe([]), mesh, plan)


def _repaired(loaded: Loaded, where: str) -> Loaded:
    """The mesh as a manifold whose pieces share the edges along which they touch, and notes of what that took.

    Raises FitError: the mesh has no height, by which all lengths are judged.
    """
    scale = head_scale(loaded.mesh.vertices, dict(zip(loaded.mesh.names, loaded.mesh.deltas, strict=True)))
    if not scale > SMALL:
        raise FitError(f"{where}: lies flat: it has no height", hint="say with --up which axis points up, as --up z")
    mesh, joined = joined_borders(loaded.mesh, scale)
    mesh, notes = repaired(mesh)
    return replace(loaded, mesh=mesh, notes=(*loaded.notes, *joined, *notes))


def _fit_parts(
    mesh: FitMesh, recipe: Recipe, plan: Plan, rig: HeadRig, progress: Progress, *, comb: bool = True
) -> tuple[list[PartData], list[PartReport], list[FittedPart]]:  # fmt: skip
    """Every chart of the plan, teeth, hair and eyeballs; progress counts control points. comb : cut strips of lashes
    into hairs where no texture draws these; an exported head has them, or has none."""
    parts: list[PartData] = []
    reports, fitted_parts = [], []
    ends = np.cumsum([0, *(p.request.points for p, _ in plan.parts)]) / max(
        sum(p.request.points for p, _ in plan.parts), 1
    )
    scale = head_scale(mesh.vertices, dict(zip(mesh.names, mesh.deltas, strict=True)))
    still = replace(mesh, names=(), deltas=mesh.deltas[:0])  # for parts that move as a whole
    for (part, islands), low, high in zip(plan.parts, ends, ends[1:], strict=False):
        chart, step = part_chart(mesh, part, islands), part_of(progress, low, high)
        request = part.request
        if not parts and plan.found and plan.found.openings:
            chart = with_importance(chart, mesh, *plan.eyes)
            request = replace(request, points=request.points + len(plan.eyes[0]) * MORE_POINTS)
        if not parts:  # the plan's scale is that of the mesh before its lids were fitted, the bounds' that of the head
            request = replace(request, calm_mm=min(request.calm_mm, RMS_MM * scale))
        fitted = fit_chart(mesh if part.follows == "skin" else still, chart, request, partial(step, part.name))
        fine = facet_sag(mesh, chart) <= RMS_MM * scale
        report = measure(part.name, chart, fitted, mesh.names, fine)
        if parts and not recipe.parts and _is_loose(report.neutral, scale):
            off = f"{report.neutral.rms:.1f} mm RMS, 99 % within {report.neutral.p99:.1f} mm"
            plan.notes.append(f"{part.name}: left out: it cannot be fitted, {off}")
            continue
        parts.append(skin_part(part, chart, fitted, rig))
        if comb and part.material == "lash" and not recipe.parts and rig.radius > 0:
            parts[-1] = combed(parts[-1], mesh, islands, rig.eyes, scale)
        if not recipe.parts:
            parts[-1] = cut_out(parts[-1], mesh, islands)
        reports.append(report)
        fitted_parts.append(FittedPart(part.name, chart, fitted, chart.mix @ mesh.vertices))
        if recipe.hair and recipe.hair["face"] == part.name:
            parts += hair_parts(mesh, chart, fitted, recipe.hair["brow"], rig)
    for part in recipe.teeth:
        data, report = teeth_part(mesh, part, rig)
        parts.append(data)
        reports.append(report)
    if rig.radius > 0:
        parts += [eyeball_part(side, e, rig.radius) for side, e in zip(("left", "right"), rig.eyes, strict=True)]
    return parts, reports, fitted_parts


def part_chart(mesh: FitMesh, part: PartRecipe, islands: list[Island]) -> Chart:
    """The chart of one part of a plan: its islands in tiles, or one skin around them."""
    if part.wrapped:
        return wrap_chart(mesh, islands, even=part.even)
    return make_chart(mesh, islands, normalise=part.tiled, downweight_slivers=part.downweight_slivers)


def prepare(mesh: FitMesh, recipe: Recipe) -> FitMesh:
    """The mesh as the recipe wants it: lips closed, shapes strengthened, lids seated on anatomical eyeballs."""
    mesh = strengthen(close_lips(mesh, recipe.lips_close), recipe.strengthened)
    balls = recipe.eyeballs(mesh)
    return mesh if balls is None else seat_lids(mesh, *balls, recipe.seated, gazes_of(mesh))


def recipe_plan(mesh: FitMesh, recipe: Recipe) -> Plan:
    """Every part of a recipe with its islands, flat holes opened; parts without an island are left out."""
    islands = find_islands(mesh)
    parts = []
    for part in recipe.parts:
        own = [open_flat_holes(i) for i in islands if part.holds(float(np.median(i.vertex)))]
        if own:
            uv = own[0].uv
            unit_square = uv.min() > -0.05 and uv.max() < 1.05 and np.ptp(uv, axis=0).min() > 0.7
            parts.append((replace(part, tiled=len(own) > 1 or not unit_square), own))
    return Plan(parts, eyes_of(mesh, recipe), np.array(recipe.hinge), np.arange(*recipe.jaw_teeth))


def _with_mesh(part: PartData, head: HeadData) -> PartData:
    """The part with its tessellation, so that a face starts at once; fine enough for a face that moves."""
    surface = make_surface(part)
    if part.follows == "skin":
        pose = LINING_POSE if part.material == MATERIAL else SAMPLE_POSE
        moved = SkinRig(part, head).apply(read_pose(np.array([pose.get(n, 0.0) for n in NAMES])))
        surface = surface.with_points(with_deep_wrinkles(part, moved))
    return replace(part, mesh=pack(tessellate(part, surface, head.seams), part.budget))


def eyes_of(mesh: FitMesh, recipe: Recipe) -> tuple[Floats, float]:
    """Centres (2, 3) and radius; a head without known eyes gets none (radius 0)."""
    balls = recipe.eyeballs(mesh)
    if balls is None:
        return np.zeros((2, 3)), 0.0
    centre = np.array(balls[1].centre)
    return np.stack([centre, centre * [-1.0, 1.0, 1.0]]), balls[1].radius


def _neck(mesh: FitMesh, recipe: Recipe, marks: Landmarks = Landmarks()) -> Neck:
    """The recipe's neck, or one below the eyes, or in the lower quarter of a head nothing is known of."""
    if recipe.neck:
        x, y, z = recipe.neck
        return Neck((x, y, z))
    return neck_of(mesh, marks)


def _provenance(recipe: Recipe) -> dict[str, str]:
    made = "fitted by least squares with omote fit; control points and displacements, not the source mesh"
    return {"made": made, **{f"source_{k}": v for k, v in recipe.source.items()}}


def _is_loose(errors: Errors, scale: float) -> bool:
    """Whether a part beside the face is so far off its mesh that it would look like something else."""
    return errors.rms > LOOSE_MM * scale or errors.p99 > LOOSE_99_MM * scale
