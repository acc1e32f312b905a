"""Fit named variations of a head (identities) to mixes of the identity modes of its mesh.

Each variation lists by how much measures of the face change (``identities.toml``). The modes are made symmetric; the
shortest mix of them, in standard deviations, that changes the measures so is fitted with the knots that the head has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from surface.base import files
from surface.base.arrays import Array, Floats, Ints
from surface.base.errors import FitError
from surface.fit.api import eyes_of, part_chart, prepare, recipe_plan
from surface.fit.points.net import Net
from surface.fit.points.recipe import Recipe, in_place, recipe_for
from surface.fit.points.solve import basis, solve
from surface.fit.source.chart import Chart
from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.file import load_data
from surface.head.model.identity import Identity, fingerprint, save_identities, with_identities
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.rig import SkinRig

TABLE = Path(__file__).with_name("identities.toml")
LEAST_MM = 0.01
LID_V, ROWS = 0.03, 9  # how far a lid reaches outside the hole in the skin, in v; samples across it
SHORT_MM = 1.0  # lids whose way is shorter than this, at the corners, are changed less
TRIES, STEP, RANGE = 14, 0.5, (-0.4, 0.8)  # of scaling a blink; share of the gap per step; least and most change
NEAR = 8  # mesh vertices whose displacement a hair or a tooth follows
SAME_FIT_MM = 0.5  # RMS distance from the mesh that only a head fitted to another mesh has


@dataclass(frozen=True)
class Wanted:
    """The table: landmarks as vertices, measures between them, and per cent of change by identity."""

    vertices: int
    longest: float
    landmarks: Ints
    measures: dict[str, dict[str, Any]]
    identities: dict[str, dict[str, float]]


def read_wanted(path: Path = TABLE) -> Wanted:
    """The table of variations."""
    table = files.read_toml(path)
    return Wanted(**table | {"landmarks": np.array(table["landmarks"])})


def add_identities(head: str | Path, mesh_path: str | Path, modes_path: str | Path) -> list[str]:
    """Fit the table's variations to a head and keep them in its folder; returns their names.

    head : a head folder that was fitted to the mesh. mesh_path : that mesh.
    modes_path : .npz with ``deltas (k, n, 3)``, displacements of the mesh's vertices per standard deviation.

    Raises FitError: the head was not fitted to this mesh, or the modes do not belong to it. Nothing is written then.
    HeadFileError: the head cannot be read.
    """
    data, wanted = load_data(head), read_wanted()
    loaded = load_mesh(mesh_path)
    recipe = recipe_for(loaded.mesh)
    if recipe is None or len(loaded.mesh.vertices) != wanted.vertices:
        raise FitError(f"{mesh_path}: no variations are known for this mesh", hint="they are made for ICT-FaceKit's")
    mesh = in_place(loaded, recipe).mesh
    modes = symmetric(mesh.vertices, read_modes(Path(modes_path), mesh, mesh_path))
    fields = dict(zip(wanted.identities, mixes(mesh.vertices, modes, wanted), strict=True))
    made = fit_identities(data, mesh, recipe, fields, str(head))
    save_identities(head, made)
    return [i.name for i in made]


def read_modes(path: Path, mesh: FitMesh, mesh_path: str | Path) -> Floats:
    """(k, n, 3) displacements in mm, in the unit that the mesh's file has."""
    with files.reading(path, FitError, hint="give the identity modes of this mesh"):
        deltas = _numbers(files.read_npz(path), "deltas")
    with files.reading(mesh_path, FitError, hint="give the mesh that the head was fitted to, as .npz"):
        own = _numbers(files.read_npz(mesh_path), "neutral")
    if deltas.ndim != 3 or deltas.shape[1:] != mesh.vertices.shape:
        raise FitError(f"{path}: deltas has shape {deltas.shape}, expected (k, {len(mesh.vertices)}, 3)")
    if not np.isfinite(deltas).all():
        mode = int(np.flatnonzero(~np.isfinite(deltas).all(axis=(1, 2)))[0])
        raise FitError(f"{path}: deltas[{mode}] holds something that is not a finite number")
    scaled: Floats = deltas * (np.ptp(mesh.vertices) / np.ptp(own))
    return scaled


def _numbers(arrays: dict[str, Array], key: str) -> Floats:
    if key not in arrays or arrays[key].dtype.kind not in "fiu":
        raise ValueError(f"has no array of numbers {key!r}")
    return arrays[key].astype(float)


def symmetric(vertices: Floats, modes: Floats) -> Floats:
    """Modes (k, n, 3) without their difference between left and right."""
    other = cKDTree(vertices).query(vertices * [-1.0, 1.0, 1.0])[1]
    return 0.5 * (modes + modes[:, other] * [-1.0, 1.0, 1.0])


def mixes(vertices: Floats, modes: Floats, wanted: Wanted) -> list[Floats]:
    """Displacements (n, 3) of every variation: shortest mix of modes that changes the measures as wanted."""
    at = wanted.landmarks
    base = measure(vertices[at], wanted.measures)
    per_mode = {n: np.array([measure(d, wanted.measures)[n] for d in modes[:, at]]) for n in base}
    out = []
    for name, goals in wanted.identities.items():
        system = np.array([per_mode[n] for n in goals])
        target = np.array([0.01 * percent * base[n] for n, percent in goals.items()])
        mix = np.linalg.lstsq(system, target, rcond=None)[0]
        length = float(np.linalg.norm(mix))
        if not length:
            raise FitError(f"identity {name}: the modes change none of {', '.join(goals)}", hint="give other modes")
        mix *= min(1.0, wanted.longest / length)
        out.append(np.tensordot(mix, modes, axes=1))
    return out


def measure(landmarks: Floats, measures: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Every measure of landmarks (68, 3), or by how much displacements of them change it."""
    out = {}
    for name, m in measures.items():
        axis = "xyz".index(m["axis"])
        out[name] = float(landmarks[m["to"], axis].mean() - landmarks[m["from"], axis].mean())
    return out


def fit_identities(
    head: HeadData, mesh: FitMesh, recipe: Recipe, fields: dict[str, Floats], where: str
) -> list[Identity]:  # fmt: skip
    """Groups of control points that move the head as ``fields`` move the mesh."""
    base = prepare(mesh, recipe)
    others = [prepare(replace(mesh, vertices=mesh.vertices + field), recipe) for field in fields.values()]
    shifts = np.stack([o.vertices - base.vertices for o in others])
    eyes = eyes_of(base, recipe)[0]
    eye_shifts = np.stack([eyes_of(o, recipe)[0] - eyes for o in others])
    charts = {p.name: part_chart(base, p, islands) for p, islands in recipe_plan(base, recipe).parts}
    moves = _part_moves(head, charts, base.vertices, shifts, eye_shifts, where)
    jaw = _jaw_shift(head, moves)
    lids = [_rims(base, charts[head.parts[0].name], eye) for eye in eyes]
    out, fit = [], fingerprint(head)
    for k, name in enumerate(fields):
        identity = Identity(name, {p: _group(name, m[k]) for p, m in moves.items()}, {}, eye_shifts[k], jaw[k], fit)
        out.append(close_lids(head, identity, lids))
    return out


def _part_moves(
    head: HeadData, charts: dict[str, Chart], rest: Floats, shifts: Floats, eye_shifts: Floats, where: str
) -> dict[str, Floats]:  # fmt: skip
    """By part, (k, n, 3): how its control points follow displacements ``shifts (k, vertices, 3)`` of the mesh."""
    out = {}
    for part in head.parts:
        if part.follows in ("left_eye", "right_eye"):
            own = eye_shifts[:, int(part.follows == "right_eye")]
            out[part.name] = np.repeat(own[:, None], len(part.points), axis=1)
        elif part.name in charts:
            out[part.name] = _solved(part, charts[part.name], rest, shifts, where)
        else:
            out[part.name] = _followed(part.points, rest, shifts)
    return out


def _rims(mesh: FitMesh, chart: Chart, eye: Floats) -> tuple[Floats, Floats]:
    """(u, v), (c, ROWS, 2), of the upper and the lower lid: columns by x, rows from the edge of the hole outwards."""
    hole = chart.hole_near(mesh.vertices, eye)
    uv = chart.loops[hole][np.argsort(mesh.vertices[chart.loop_vertices[hole], 0])]
    above = uv[:, 1] > 0.5 * (uv[:, 1].min() + uv[:, 1].max())
    rows = np.column_stack([np.zeros(ROWS), np.linspace(0.0, LID_V, ROWS)])
    return uv[above][:, None] + rows, uv[~above][:, None] - rows


def close_lids(head: HeadData, identity: Identity, lids: list[tuple[Floats, Floats]]) -> Identity:
    """The identity with changes to the blinks, so that its lids close as those of the head itself do.

    A blink is scaled along x by how much further the lids' edges have to go; found by iteration, for where a lid ends
    depends on the eyeball, too.
    """
    face = head.parts[0]
    net = Net(np.zeros((len(face.points), 4), np.int64), face.knots_u, face.knots_v)
    for name, (upper, lower) in zip(("eyeBlinkLeft", "eyeBlinkRight"), lids, strict=True):
        edges = basis(net, np.vstack([upper, lower]).reshape(-1, 2))
        open_, closed = (_edge_heights(head, edges, len(upper), {name: v}) for v in (0.0, 1.0))
        x, travel = open_[0], open_[1] - closed[1]
        share = best = np.zeros(len(x))
        least = np.inf
        for _ in range(TRIES):
            trial = with_identities(head, {"": _with_change(head, identity, name, x, share)}, {"": 1.0}, "")
            wider = _edge_heights(trial, edges, len(upper), {name: 1.0})[1] - closed[1]
            if (off := float((wider + 0.2 * np.abs(wider)).max())) < least:
                least, best = off, share
            share = np.clip(share + STEP * wider * travel / (travel**2 + SHORT_MM**2), *RANGE)
        identity = _with_change(head, identity, name, x, best)
    return identity


def _edge_heights(head: HeadData, edges: csr_matrix, upper: int, pose: dict[str, float]) -> tuple[Floats, Floats]:
    """x of the upper lid, and height of its lowest place above the highest of the lower one, in a pose."""
    values = np.array([pose.get(n, 0.0) for n in NAMES])
    at = (edges @ SkinRig(head.parts[0], head).apply(read_pose(values))).reshape(-1, ROWS, 3)
    x, top, bottom = at[:, :, 0].mean(axis=1), at[:upper, :, 1].min(axis=1), at[upper:, :, 1].max(axis=1)
    order = np.argsort(x[upper:])
    return x[:upper], top - np.interp(x[:upper], x[upper:][order], bottom[order])


def _with_change(head: HeadData, identity: Identity, name: str, x: Floats, share: Floats) -> Identity:
    """The identity with a blink's groups changed by their ``share`` at places ``x``."""
    changes = {part: [g for g in groups if g.name != name] for part, groups in identity.changes.items()}
    order = np.argsort(x)
    for part in head.parts:
        for g in part.groups:
            if g.name == name:
                moves = np.interp(part.points[g.ids, 0], x[order], share[order])[:, None] * g.moves
                changes.setdefault(part.name, []).append(Group(name, g.ids, np.round(moves, 3).astype(np.float32)))
    return replace(identity, changes=changes)


def _solved(part: PartData, chart: Chart, rest: Floats, shifts: Floats, where: str) -> Floats:
    """(k, n, 3) by least squares with the part's own knots."""
    net = Net(np.zeros((len(part.points), 4), np.int64), part.knots_u, part.knots_v)
    b = basis(net, chart.uv)
    off = np.linalg.norm(b @ part.points - chart.mix @ rest, axis=1)[~chart.folded]
    if float(np.sqrt((off**2).mean())) > SAME_FIT_MM:
        raise FitError(f"{where}: part {part.name!r} was not fitted to this mesh", hint="fit the head again")
    fields = np.hstack(list(shifts))
    slopes = None
    if chart.slopes is not None:
        slopes = chart.slopes, chart.slopes.mix_u @ fields, chart.slopes.mix_v @ fields
    x = solve(net, b, chart.weight, chart.mix @ fields, 1e-4, slopes)
    return x.reshape(len(net), len(shifts), 3).transpose(1, 0, 2)


def _followed(points: Floats, rest: Floats, shifts: Floats) -> Floats:
    """(k, n, 3) displacements of hair and teeth: of the mesh around each of their points."""
    distance, nearest = cKDTree(rest).query(points, k=NEAR)
    weight = 1.0 / (distance + 0.5)
    weight /= weight.sum(axis=1, keepdims=True)
    followed: Floats = np.einsum("nj,knjc->knc", weight, shifts[:, nearest])
    return followed


def _jaw_shift(head: HeadData, moves: dict[str, Floats]) -> Floats:
    """(k, 3) displacement of the hinge: that of what turns about it, so that its arc stays the same."""
    face = head.parts[0]
    total = face.jaw @ moves[face.name].transpose(1, 0, 2).reshape(len(face.jaw), -1)
    shift = total.reshape(-1, 3) / max(float(face.jaw.sum()), 1e-9)
    shift[:, 0] = 0.0
    return shift


def _group(name: str, moves: Floats) -> Group:
    ids = np.flatnonzero(np.linalg.norm(moves, axis=1) > LEAST_MM)
    return Group(name, ids.astype(np.int32), np.round(moves[ids], 3).astype(np.float32))
