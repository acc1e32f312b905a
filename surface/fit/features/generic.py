"""Split a mesh that has no recipe into parts: eyeballs, face, back of the head, what is inside the mouth.

Pieces are connected by vertices. Eyes are found by :mod:`surface.fit.eyes.search`; the largest of the others is skin;
the rest is identified by the names of its objects and materials.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.fit.eyes.search import Eyes, find_eyes, middle_x
from surface.fit.features import cavity
from surface.fit.features.others import by_object, is_skin, why_out
from surface.fit.points.recipe import PartRecipe
from surface.fit.points.refine import FitRequest
from surface.fit.points.rigidfit import rigid_fit
from surface.fit.source.chart import TILE
from surface.fit.source.islands import Island
from surface.fit.source.kinds import kind_name
from surface.fit.source.layout import lay_out, open_flat_holes, straighten_holes
from surface.fit.source.mesh import FitMesh, components, face_areas, triangles
from surface.fit.source.owncharts import usable_islands
from surface.fit.source.placing.frame import head_scale
from surface.fit.source.smooth_map import smooth_map
from surface.mesh.tessellate import MAX_ROOTS

POINTS, REST = 2450, 560  # control points of the face and of a part of the same size that hardly moves
FACE_MM2 = 1.3e5  # of a head of usual size: an island of more holds the back of the head, too
FINEST = 0.3  # in spacings of the mesh: the largest around a place count, and a coarse mesh has corners and creases
BEND = 0.12  # weight of what bends within faces of the mesh: shading shows waves that distances do not
CALM_MM = 0.25  # RMS of skin, of a head of usual size, up to which it is made calmer than the mesh's faces
ASTRAY_MM = 1.8  # of a head of usual size: where the surface is further off, it is mended
SPARE = 60  # points of the face that are kept for mending
GROWTH = 1.12  # of the face's net between two solves: small, for its points are few
DEPTH = 9  # of the cells: one in a nostril is 3 mm wide then; more where many islands lie side by side, since roots are
# shared by all
LEAST, MOST_ISLANDS = 40, 80  # control points of a small island; islands of one part
MOVING = 0.4  # an island moved by at least this share of the shapes that move the most mobile one is the face's
TONGUE = "tongue"  # one whose texture is cut up gets one skin around all of it: it would be creased where islands end
TONGUE_POINTS, TONGUE_FAIR = 300, 0.003  # of that skin: smooth, for a tongue of few faces has corners
LESS = 1e-6  # what is said to be no skin counts as face only where there is nothing else
MOVES_MM = 1.0  # of a head of usual size: what moves less does not count as moved


@dataclass(frozen=True)
class Plan:
    """The parts that a mesh is fitted as.

    parts : recipes and islands, ready to become charts.
    eyes : centres (2, 3), left first, and radius; radius 0 without eyes.
    hinge : about which the jaw turns; jaw : vertices that turn with it as a whole.
    notes : what was left out or guessed, in words. found : the eyes as they were found, to fit lids to them.
    """

    parts: list[tuple[PartRecipe, list[Island]]]
    eyes: tuple[Floats, float]
    hinge: Floats
    jaw: Ints
    notes: list[str] = field(default_factory=list)
    found: Eyes | None = None

    def vertices_of(self, material: str) -> Ints:
        """The mesh's vertices in parts of a material."""
        own = [island.vertex for part, islands in self.parts if part.material == material for island in islands]
        return np.unique(np.concatenate([np.zeros(0, np.int64), *own]))


def make_plan(mesh: FitMesh) -> Plan:
    """Sort the mesh's pieces; its shapes are named as ARKit's.

    Raises FitError: nothing is left that could be skin.
    """
    shapes = dict(zip(mesh.names, mesh.deltas, strict=True))
    scale = head_scale(mesh.vertices, shapes)
    eyes = find_eyes(mesh, partial(_largest, mesh, scale))
    label, sizes = _pieces(mesh, eyes.faces)
    rest = [int(k) for k in np.argsort(-_presence(mesh, label, sizes, scale)) if sizes[k] > 0]
    if not rest:
        raise FitError("the mesh has no skin: all of it is eyeballs or has no area", hint="export the face, too")
    notes = list(eyes.notes)
    parts = _skin(mesh, label == rest[0], scale, np.flatnonzero(eyes.faces), notes)
    parts += _others(mesh, label, rest[1:], float(sizes[rest[0]]), scale, notes)
    return Plan(parts, (eyes.centres, eyes.radius), *_hinge(mesh, shapes, scale), notes, eyes)


def _largest(mesh: FitMesh, scale: float, gone: Bools) -> Bools:
    """(f,) which faces are skin once those that are ``gone`` are left out: the most present piece."""
    label, sizes = _pieces(mesh, gone)
    skin: Bools = (label == np.argmax(_presence(mesh, label, sizes, scale))) & ~gone
    return skin


def _pieces(mesh: FitMesh, gone: Bools | None = None) -> tuple[Ints, Floats]:
    """(f,) which connected piece of one material a face belongs to, and each one's area; faces that are ``gone (f,)``
    belong to the last, whose area is 0."""
    if gone is not None and gone.any():
        rest = replace(mesh, faces=mesh.faces[~gone], piece=mesh.piece[~gone] if len(mesh.piece) else mesh.piece)
        own, sizes = _pieces(rest)
        label = np.full(len(gone), len(sizes))
        label[~gone] = own
        return label, np.append(sizes, 0.0)
    kinds = np.array([kind_name(name) for name in mesh.pieces] or ["skin"])
    known, kind_of = np.unique(kinds, return_inverse=True)
    kind = kind_of.ravel()[mesh.piece] if len(mesh.piece) else np.zeros(len(mesh.faces), np.int64)
    corner = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces) * len(known) + kind[:, None]
    label = components(corner[:, :3].ravel(), corner[:, 1:].ravel(), len(mesh.vertices) * len(known))[corner[:, 0]]
    label = np.unique(label, return_inverse=True)[1].ravel()
    return label.astype(np.int64), np.bincount(label, face_areas(mesh.vertices, mesh.faces)).astype(np.float64)


def _presence(mesh: FitMesh, label: Ints, sizes: Floats, scale: float) -> Floats:
    """How much of a face each piece is: its area, times the shapes that move it; reduced for hair."""
    used = mesh.faces >= 0
    piece = np.zeros(len(mesh.vertices), np.int64)
    piece[mesh.faces[used]] = np.repeat(label, used.sum(axis=1))
    moving = np.zeros(len(sizes))  # shapes that move each
    for delta in mesh.deltas:
        moving[np.unique(piece[np.abs(delta).max(axis=1) > MOVES_MM * scale])] += 1
    return sizes * (1.0 + moving) * np.where(is_skin(mesh, label, len(sizes)), 1.0, LESS)


def _skin(
    mesh: FitMesh, chosen: Bools, scale: float, eyeballs: Ints, notes: list[str]
) -> list[tuple[PartRecipe, list[Island]]]:  # fmt: skip
    """The face, and, as parts of their own, islands of the same piece that hardly move, and what lines the mouth."""
    islands = usable_islands(mesh, np.flatnonzero(chosen), scale, notes, "face", face=True, others=eyeballs)
    if not islands:
        raise FitError("the skin has no area", hint="export the mesh again")
    lining = cavity.line_mouth(mesh, islands, np.flatnonzero(chosen), eyeballs)
    inner = [i for i, x in zip(islands, lining, strict=True) if x]
    islands = [i for i, x in zip(islands, lining, strict=True) if not x]
    most = [np.abs(mesh.deltas[:, i.vertex]).max(axis=(1, 2), initial=0.0) for i in islands]
    moved = np.array([(m > MOVES_MM * scale).sum() for m in most])
    mobile = moved >= MOVING * moved.max(initial=0)
    face, rest = ([i for i, x in zip(islands, mobile, strict=True) if x == wanted] for wanted in (True, False))
    area = sum(_area(mesh, i) for i in face)
    beyond = np.clip(area / (FACE_MM2 * scale**2) - 1.0, 0.0, 1.0)
    out = [_part("face", "skin", int(POINTS * (1.0 + beyond)), 0.1, 0.25, scale, face, mesh)]
    if rest:
        share = sum(_area(mesh, i) for i in rest) / max(area + sum(_area(mesh, i) for i in inner), 1e-9)
        points = int(np.clip(POINTS * share, max(REST, LEAST * len(rest)), POINTS))
        out.append(_part("back", "skin", points, 0.1, 0.4, scale, rest, mesh))
    if inner:
        out.append(_lining(cavity.NAME, scale, inner, mesh))
    return out


def _lining(name: str, scale: float, islands: list[Island], mesh: FitMesh) -> tuple[PartRecipe, list[Island]]:
    """A part that lines the mouth, whether it is of the skin's piece or one of its own."""
    points, coarse, error = cavity.POINTS, cavity.COARSE, cavity.ERROR_MM
    made, own = _part(name, cavity.MATERIAL, points + cavity.SPARE, coarse, error, scale, islands, mesh)
    request = replace(made.request, spare=cavity.SPARE, dense=True)
    budget = made.budget[0], cavity.CHORD_MM * scale, made.budget[2]
    return replace(made, request=request, budget=budget), own


def _part(
    name: str, material: str, points: int, coarse: float, error: float, scale: float, islands: list[Island],
    mesh: FitMesh,
) -> tuple[PartRecipe, list[Island]]:  # fmt: skip
    face = name == "face"
    request = FitRequest(
        points, coarse=coarse, neutral_mm=error * scale, shape_mm=0.45 * scale,
        finest=FINEST, bend=BEND, calm_mm=CALM_MM * scale if material == "skin" else 0.0,
        growth=GROWTH if face else 1.25,
        astray_mm=ASTRAY_MM * scale, spare=SPARE if face else 0,
    )  # fmt: skip
    depth = DEPTH + int(np.ceil(np.log2(max(1.0, TILE * len(islands) / MAX_ROOTS))))
    budget = 0, 0.24 * scale if face else 0.5 * scale, depth
    recipe = PartRecipe(name, material, "skin", [], request, budget, downweight_slivers=True)
    return recipe, [smooth_map(mesh, open_flat_holes(straighten_holes(i))) for i in lay_out(mesh, islands)]


def _others(
    mesh: FitMesh, label: Ints, pieces: list[int], skin_area: float, scale: float, notes: list[str]
) -> list[tuple[PartRecipe, list[Island]]]:  # fmt: skip
    """All further pieces, one part for each object or material that they belong to."""
    out: list[tuple[PartRecipe, list[Island]]] = []
    for (name, kind), own in by_object(mesh, label, pieces, scale).items():
        made: list[str] = []
        faces = np.flatnonzero(np.isin(label, own))
        few = kind.rule != "eye" and len(own) <= MOST_ISLANDS
        islands = usable_islands(mesh, faces, scale, made, repr(name)) if few else []
        if why := why_out(name, kind, len(islands) if few else len(own), MOST_ISLANDS):
            notes.append(why)
            continue
        notes += made
        share = sum(_area(mesh, i) for i in islands) / max(skin_area, 1e-9)
        points = int(np.clip(1.5 * POINTS * share, min(3 * LEAST * len(islands), POINTS), POINTS))
        title = f"{kind.material if kind.material != 'skin' else 'piece'}_{len(out) + 1}"
        if kind.material == cavity.MATERIAL:
            out.append(_lining(title, scale, islands, mesh))
        else:
            part = _part(title, kind.material, points, 0.34, 0.5, scale, islands, mesh)
            cut_up = kind.material == TONGUE and len(own) == 1 and len(islands) > 1
            out.append((_wrapped(part[0]), islands) if cut_up else part)
        notes.append(f"{name!r}: {kind.name}: {len(islands)} islands as {title}")
    return out


def _wrapped(part: PartRecipe) -> PartRecipe:
    """The part as one smooth skin around all its islands."""
    return replace(part, wrapped=True, even=True, request=replace(part.request, points=TONGUE_POINTS, fair=TONGUE_FAIR))


def _area(mesh: FitMesh, island: Island) -> float:
    tri = mesh.vertices[island.vertex][triangles(island.faces)]
    return float(0.5 * np.linalg.norm(np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0]), axis=1).sum())


def _hinge(mesh: FitMesh, shapes: dict[str, Floats], scale: float) -> tuple[Floats, Ints]:
    """The axis about which the chin turns when the jaw opens, and the chin's vertices; none where it does not turn."""
    none = np.zeros(3), np.zeros(0, np.int64)
    if "jawOpen" not in shapes:
        return none
    length = np.linalg.norm(shapes["jawOpen"], axis=1)
    chin = np.flatnonzero(length > 0.8 * length.max())
    if len(chin) < 12 or length.max() < 3 * scale:
        return none
    rest = mesh.vertices[chin]
    turn, shift = rigid_fit(rest, rest + shapes["jawOpen"][chin])
    angle = float(np.arctan2(turn[2, 1], turn[1, 1]))
    if not np.radians(4.0) < angle < np.radians(50.0):
        return none
    y, z = np.linalg.solve(np.eye(2) - turn[1:, 1:], shift[1:] + turn[1:, 0] * rest[:, 0].mean())
    return np.array([middle_x(mesh), y, z]), chin
