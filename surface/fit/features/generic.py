"""Split a mesh that has no recipe into parts: eyeballs, face, back of the head, what is inside the mouth.

Pieces are connected by vertices. Two balls that mirror each other are eyes; the largest of the others is skin; the rest
is identified by the names of its objects and materials.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.fit.features.rigging import rigid_fit
from surface.fit.points.lid_seating import fit_sphere
from surface.fit.points.recipe import PartRecipe
from surface.fit.points.refine import FitRequest
from surface.fit.source.chart import TILE
from surface.fit.source.frame import head_scale
from surface.fit.source.islands import Island
from surface.fit.source.layout import lay_out, open_flat_holes, straighten_holes
from surface.fit.source.mesh import FitMesh, components, face_areas, renumbered, triangles
from surface.fit.source.owncharts import usable_islands
from surface.mesh.tessellate import MOST_ROOTS

WORDS = {  # in the name of an object or material -> material of the part; the first that fits
    "lash": "lash", "brow": "brow", "hair": "brow", "beard": "brow", "teeth": "teeth", "tooth": "teeth",
    "tongue": "tongue", "gum": "gums", "mouth": "mouth", "cavity": "mouth", "oral": "mouth",
}  # fmt: skip
KEPT = ("skin", "socket", "lid")  # in the name of a piece that is no part of an eyeball, however near it is
POINTS, REST = 2450, 560  # control points of the face and of a part of the same size that hardly moves
FACE_MM2 = 1.3e5  # of a head of usual size: an island of more holds the back of the head, too
FINEST = 0.9  # in spacings of the mesh; its triangles may be of any size, and the largest around a place count
ASTRAY_MM = 1.8  # of a head of usual size: where the surface is further off, it is mended
SPARE = 60  # points of the face that are kept for mending
GROWTH = 1.12  # of the face's net between two solves: small, for its points are few
DEPTH = 8  # of the cells; more where many islands lie side by side, since roots are shared by all
LEAST, MOST_ISLANDS = 40, 80  # control points of a small island; islands of one part
TOOTH_MM, TEETH = 24.0, 12  # so many pieces no larger than this are teeth
ROUND = 0.07  # how far a ball may stray from a sphere, in radii
BALL = (0.02, 0.14)  # radius of an eyeball, in heights of the mesh
MOVING = 0.4  # an island moved by at least this share of the shapes that move the most mobile one is the face's
MOVES_MM = 1.0  # of a head of usual size: what moves less does not count as moved


@dataclass(frozen=True)
class Plan:
    """The parts that a mesh is fitted as.

    parts : recipes and islands, ready to become charts.
    eyes : centres (2, 3), left first, and radius; radius 0 without eyes.
    hinge : about which the jaw turns; jaw : vertices that turn with it as a whole.
    notes : what was left out or guessed, in words.
    """

    parts: list[tuple[PartRecipe, list[Island]]]
    eyes: tuple[Floats, float]
    hinge: Floats
    jaw: Ints
    notes: list[str] = field(default_factory=list)


def make_plan(mesh: FitMesh) -> Plan:
    """Sort the mesh's pieces; its shapes are named as ARKit's.

    Raises FitError: nothing is left that could be skin.
    """
    shapes = dict(zip(mesh.names, mesh.deltas, strict=True))
    scale = head_scale(mesh.vertices, shapes)
    label, sizes = _pieces(mesh)
    eyes, gone = _find_eyes(mesh, label, scale)
    rest = [k for k in np.argsort(-_presence(mesh, label, sizes, scale)) if k not in gone and sizes[k] > 0]
    if not rest:
        raise FitError("the mesh has no skin: all of it is eyeballs or has no area", hint="export the face, too")
    notes = [f"{len(gone)} pieces are eyeballs, replaced by exact ones"] if gone else []
    gone_faces = np.flatnonzero(np.isin(label, list(gone)))
    parts = _skin(mesh, label == rest[0], scale, gone_faces, notes)
    parts += _others(mesh, label, rest[1:], float(sizes[rest[0]]), scale, notes)
    return Plan(parts, eyes, *_hinge(mesh, shapes, scale), notes)


def _pieces(mesh: FitMesh) -> tuple[Ints, Floats]:
    """(f,) which connected piece of one material a face belongs to, and each one's area."""
    kinds = np.array([_kind(name) for name in mesh.pieces] or ["skin"])
    known, kind_of = np.unique(kinds, return_inverse=True)
    kind = kind_of.ravel()[mesh.piece] if len(mesh.piece) else np.zeros(len(mesh.faces), np.int64)
    corner = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces) * len(known) + kind[:, None]
    label = components(corner[:, :3].ravel(), corner[:, 1:].ravel(), len(mesh.vertices) * len(known))[corner[:, 0]]
    label = np.unique(label, return_inverse=True)[1].ravel()
    return label.astype(np.int64), np.bincount(label, face_areas(mesh.vertices, mesh.faces)).astype(np.float64)


def _kind(name: str) -> str:
    """Part of a head that an object's or material's name stands for; skin without a known word."""
    return next((m for word, m in WORDS.items() if word in name.lower()), "skin")


def _presence(mesh: FitMesh, label: Ints, sizes: Floats, scale: float) -> Floats:
    """How much of a face each piece is: its area, times the shapes that move it."""
    used = mesh.faces >= 0
    piece = np.zeros(len(mesh.vertices), np.int64)
    piece[mesh.faces[used]] = np.repeat(label, used.sum(axis=1))
    moving = np.zeros(len(sizes))  # shapes that move each
    for delta in mesh.deltas:
        moving[np.unique(piece[np.abs(delta).max(axis=1) > MOVES_MM * scale])] += 1
    return sizes * (1.0 + moving)


def _points(mesh: FitMesh, chosen: Bools) -> Floats:
    return mesh.vertices[renumbered(mesh.faces[chosen])[0]]


def _find_eyes(mesh: FitMesh, label: Ints, scale: float) -> tuple[tuple[Floats, float], set[int]]:
    """The two largest balls that mirror each other, and every piece inside or on them."""
    height, middle = float(np.ptp(mesh.vertices[:, 1])), _middle_x(mesh)
    balls = {}
    for k in np.unique(label):
        points = _points(mesh, label == k)
        if len(points) >= 12 and (ball := _ball(points, height)):
            balls[int(k)] = ball
    best: tuple[float, int, int] | None = None
    for i, (p, r) in balls.items():
        for j, (q, s) in balls.items():
            mirrored = abs(p[0] + q[0] - 2 * middle) < 0.5 * r and np.linalg.norm((p - q)[1:]) < 0.5 * r
            if p[0] - middle > r > q[0] - middle and mirrored and abs(r - s) < 0.1 * r and r > (best or (0.0,))[0]:
                best = r, i, j
    if best is None:
        return (np.zeros((2, 3)), 0.0), set()
    eyes = np.stack([balls[best[1]][0], balls[best[2]][0]])
    return (eyes, best[0]), _within(mesh, label, eyes, best[0])


def _middle_x(mesh: FitMesh) -> float:
    return float(0.5 * (mesh.vertices[:, 0].min() + mesh.vertices[:, 0].max()))


def _ball(points: Floats, height: float) -> tuple[Floats, float] | None:
    """Centre and radius of points that lie on a ball, at least its front half; None for anything else."""
    extent = np.ptp(points, axis=0)
    if extent.max() > 2.6 * extent[:2].min() or extent.max() > 3 * BALL[1] * height or extent.min() <= 0:
        return None
    centre, radius = fit_sphere(points)
    off = np.abs(np.linalg.norm(points - centre, axis=1) - radius)
    fits = BALL[0] * height < radius < BALL[1] * height and float(np.sqrt((off**2).mean())) < ROUND * radius
    return (centre, radius) if fits and extent[:2].min() > 1.5 * radius else None


def _within(mesh: FitMesh, label: Ints, eyes: Floats, radius: float) -> set[int]:
    """Pieces that lie in a ball a little larger than the eye, unless they are said to be skin or hair: cornea, iris."""
    near = (np.linalg.norm(mesh.vertices[:, None] - eyes, axis=2) < 1.3 * radius).any(axis=1)
    inside = {int(k) for k in np.unique(label) if near[renumbered(mesh.faces[label == k])[0]].all()}
    names = {k: mesh.piece_of(int(np.argmax(label == k))).lower() for k in inside}
    return {k for k in inside if _kind(names[k]) == "skin" and not any(w in names[k] for w in KEPT)}


def _skin(
    mesh: FitMesh, chosen: Bools, scale: float, eyeballs: Ints, notes: list[str]
) -> list[tuple[PartRecipe, list[Island]]]:  # fmt: skip
    """The face, and, as a part of their own, islands of the same piece that hardly move."""
    islands = usable_islands(mesh, np.flatnonzero(chosen), scale, notes, "face", face=True, others=eyeballs)
    if not islands:
        raise FitError("the skin has no area", hint="export the mesh again")
    most = [np.abs(mesh.deltas[:, i.vertex]).max(axis=(1, 2), initial=0.0) for i in islands]
    moved = np.array([(m > MOVES_MM * scale).sum() for m in most])
    mobile = moved >= MOVING * moved.max(initial=0)
    face, rest = ([i for i, x in zip(islands, mobile, strict=True) if x == wanted] for wanted in (True, False))
    area = sum(_area(mesh, i) for i in face)
    beyond = np.clip(area / (FACE_MM2 * scale**2) - 1.0, 0.0, 1.0)
    out = [_part("face", "skin", int(POINTS * (1.0 + beyond)), 0.1, 0.25, scale, face, mesh)]
    if rest:
        share = sum(_area(mesh, i) for i in rest) / max(area, 1e-9)
        points = int(np.clip(POINTS * share, max(REST, LEAST * len(rest)), POINTS))
        out.append(_part("back", "skin", points, 0.1, 0.4, scale, rest, mesh))
    return out


def _part(
    name: str, material: str, points: int, coarse: float, error: float, scale: float, islands: list[Island],
    mesh: FitMesh,
) -> tuple[PartRecipe, list[Island]]:  # fmt: skip
    face = name == "face"
    request = FitRequest(points, coarse=coarse, neutral_mm=error * scale, shape_mm=0.45 * scale, finest=FINEST,
                growth=GROWTH if face else 1.25, astray_mm=ASTRAY_MM * scale, spare=SPARE if face else 0)  # fmt: skip
    depth = DEPTH + int(np.ceil(np.log2(max(1.0, TILE * len(islands) / MOST_ROOTS))))
    budget = 0, 0.24 * scale if face else 0.5 * scale, depth
    recipe = PartRecipe(name, material, "skin", [], request, budget, doubt_slivers=True)
    return recipe, [open_flat_holes(straighten_holes(i)) for i in lay_out(mesh, islands)]


def _others(
    mesh: FitMesh, label: Ints, pieces: list[int], skin_area: float, scale: float, notes: list[str]
) -> list[tuple[PartRecipe, list[Island]]]:  # fmt: skip
    """All further pieces, one part for each object or material that they belong to."""
    out: list[tuple[PartRecipe, list[Island]]] = []
    for (name, material), own in _by_material(mesh, label, pieces, scale).items():
        made: list[str] = []
        few = len(own) <= MOST_ISLANDS
        faces = np.flatnonzero(np.isin(label, own))
        islands = usable_islands(mesh, faces, scale, made, repr(name)) if few else []
        if not 0 < len(islands) <= MOST_ISLANDS:
            count = len(islands) if few else len(own)
            why = f"{count} separate pieces are too many to fit" if count else "no area"
            notes.append(f"{name!r}: left out: {why}")
            continue
        notes += made
        share = sum(_area(mesh, i) for i in islands) / max(skin_area, 1e-9)
        points = int(np.clip(1.5 * POINTS * share, min(3 * LEAST * len(islands), POINTS), POINTS))
        title = f"{material if material != 'skin' else 'piece'}_{len(out) + 1}"
        out.append(_part(title, material, points, 0.34, 0.5, scale, islands, mesh))
        notes.append(f"{name!r}: {len(islands)} islands as {title}")
    return out


def _by_material(mesh: FitMesh, label: Ints, pieces: list[int], scale: float) -> dict[tuple[str, str], list[int]]:
    """Pieces by the object they belong to and the material it says; a row of small unnamed ones is teeth."""
    out: dict[tuple[str, str], list[int]] = {}
    small: dict[str, list[int]] = {}
    for k in pieces:
        name = mesh.piece_of(int(np.argmax(label == k)))
        material = _kind(name)
        tiny = np.ptp(_points(mesh, label == k), axis=0).max() < TOOTH_MM * scale
        if material == "skin" and tiny:
            small.setdefault(name, []).append(k)
        else:
            out.setdefault((name, material), []).append(k)
    for name, own in small.items():
        out.setdefault((name, "teeth" if len(own) >= TEETH else "skin"), []).extend(own)
    return out


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
    return np.array([_middle_x(mesh), y, z]), chin
