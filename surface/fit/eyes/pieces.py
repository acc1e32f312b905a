"""Eyes that are pieces of their own: found by the names of nodes, objects and materials, else by their form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.eyes.names import is_cover, is_eye, is_iris
from surface.fit.points.ballfit import Ball, fit_ball, front_ball
from surface.fit.source.mesh import FitMesh, components, face_areas, renumbered

SIZE_RANGE = (0.1, 0.46)  # radius of an eyeball, in distances between both; a large cartoon's is 0.4
USUAL_SIZE = 0.19  # that of people
SIZE_DEVIATION = 0.45  # standard deviation of its logarithm over all kinds of heads
MAX_FIT_ERROR = 0.035  # median distance of a ball's points from a sphere, in radii
EXACT_ERROR = 0.01  # the same of a sphere that is as exact as its facets allow
MIN_SPREAD = 0.6  # sine of half the angle that a piece has to span for its sphere to be trusted
MAX_ASYMMETRY = 0.3  # of the distance between two eyes: how far they may be from mirroring each other
MAX_RADIUS_DIFFERENCE = 0.2  # of both eyes, relative
MIN_VERTICES = 12  # of a ball without a name
MAX_BALLS = 3  # of one size; more of them are teeth, beads or buttons
EYE_REACH = 1.3  # in radii: pieces within this distance belong to the eye, such as cornea, iris and highlight


@dataclass(frozen=True)
class Piece:
    """A connected set of faces of one name on one side of the head.

    faces : ids (k,); points (m, 3) with weights (m,), the area around each; ball : None for what is flat.
    """

    name: str
    faces: Ints
    points: Floats
    weight: Floats
    ball: Ball | None

    @property
    def middle(self) -> Floats:
        """(3,) mean of its surface."""
        return np.average(self.points, axis=0, weights=self.weight)


@dataclass(frozen=True)
class Side:
    """One eye out of pieces: its faces, its sphere if it is round, the radius of its iris, mm, if a piece shows it."""

    faces: Ints
    ball: Ball | None
    points: Floats
    weight: Floats
    iris: float = 0.0
    pieces: list[Piece] = field(default_factory=list)

    @property
    def middle(self) -> Floats:
        """(3,) mean of what it is made of, or its centre."""
        return np.average(self.points, axis=0, weights=self.weight) if self.ball is None else self.ball.centre


def named_sides(mesh: FitMesh, middle: float) -> list[Side]:
    """The left and the right eye out of pieces that are named as such; empty where no two mirror each other."""
    names = np.array([is_eye(name) for name in mesh.pieces], bool)
    if not names.any():
        return []
    chosen = np.flatnonzero(names[mesh.piece])
    pieces = [half for piece in pieces_of(mesh, chosen) for half in _halves(mesh, piece, middle)]
    sides = [[p for p in pieces if (p.middle[0] > middle) == left] for left in (True, False)]
    found = [_side(own) for own in sides if own]
    return found if len(found) == 2 and mirrored(found[0].middle, found[1].middle, middle) else []


def pieces_of(mesh: FitMesh, chosen: Ints) -> list[Piece]:
    """Faces (k,) as connected pieces of one name each."""
    if not len(chosen):
        return []
    faces, n = mesh.faces[chosen], len(mesh.vertices)
    own = mesh.piece[chosen] if len(mesh.piece) else np.zeros(len(chosen), np.int64)
    corner = np.where(faces < 0, faces[:, :1], faces) + own[:, None] * n
    label = components(np.repeat(corner[:, 0], 3), corner[:, 1:].ravel(), n * (int(own.max()) + 1))[corner[:, 0]]
    order = np.argsort(label, kind="stable")
    runs = np.split(chosen[order], np.flatnonzero(np.diff(label[order])) + 1)
    return [_piece(mesh, run) for run in runs]


def _piece(mesh: FitMesh, faces: Ints) -> Piece:
    points, weight = weighted_points(mesh, faces)
    return Piece(mesh.piece_of(int(faces[0])), faces, points, weight, fit_ball(points, weight))


def weighted_points(mesh: FitMesh, faces: Ints) -> tuple[Floats, Floats]:
    """The vertices (m, 3) that faces use, and the area around each (m,)."""
    used, local = renumbered(mesh.faces[faces])
    corner = local >= 0
    share = face_areas(mesh.vertices, mesh.faces[faces]) / corner.sum(axis=1)
    weight = np.bincount(local[corner], np.repeat(share, corner.sum(axis=1)), len(used)).astype(np.float64)
    return mesh.vertices[used], weight + 1e-9 * max(float(weight.max(initial=0.0)), 1e-9)


def _halves(mesh: FitMesh, piece: Piece, middle: float) -> list[Piece]:
    """A piece that lies on both sides of the head, cut in two; any other as it is."""
    x = piece.points[:, 0] - middle
    if x.min() > -0.2 * np.ptp(x) or x.max() < 0.2 * np.ptp(x):
        return [piece]
    corner = np.where(mesh.faces[piece.faces] < 0, mesh.faces[piece.faces][:, :1], mesh.faces[piece.faces])
    left = mesh.vertices[corner].mean(axis=1)[:, 0] > middle
    return [_piece(mesh, piece.faces[chosen]) for chosen in (left, ~left) if chosen.any()]


def _side(pieces: list[Piece]) -> Side:
    """One eye: its sphere is the largest round piece's, or else that of all of it."""
    solid = [p for p in pieces if not is_cover(p.name)] or pieces
    round_ones = [(p, p.ball) for p in solid if p.ball is not None and is_round(p.ball)]
    points, weight = (np.concatenate([getattr(p, k) for p in solid]) for k in ("points", "weight"))
    ball: Ball | None
    if round_ones:
        best, ball = max(round_ones, key=lambda pair: pair[1].radius)
        points, weight = best.points, best.weight
    else:
        whole = fit_ball(points, weight)
        ball = whole if whole is not None and whole.spread > MIN_SPREAD and whole.off < 2 * MAX_FIT_ERROR else None
    faces = np.concatenate([p.faces for p in pieces])
    return Side(faces, _on_front(points, weight, ball), points, weight, _iris(pieces), pieces)


def _on_front(points: Floats, weight: Floats, ball: Ball | None) -> Ball | None:
    """The sphere, or that of the front of an eye that is none."""
    return ball if ball is None or ball.off < EXACT_ERROR else front_ball(points, weight, ball)


def is_round(ball: Ball) -> bool:
    """Are the points on a sphere, and on enough of one?"""
    return ball.off < MAX_FIT_ERROR and ball.spread > MIN_SPREAD


def _iris(pieces: list[Piece]) -> float:
    """Radius of the largest piece that is an iris, mm; 0 without one."""
    rims = [p.points - 0.5 * (p.points.max(axis=0) + p.points.min(axis=0)) for p in pieces if is_iris(p.name)]
    return max((float(np.linalg.norm(r[:, :2], axis=1).max()) for r in rims), default=0.0)


def mirrored(p: Floats, q: Floats, middle: float) -> bool:
    """Do a left and a right point (3,) mirror each other, about, at the plane x = middle?"""
    apart = float(p[0] - q[0])
    aside = abs(float(p[0] + q[0]) - 2.0 * middle)
    return apart > 0 and aside < MAX_ASYMMETRY * apart and float(np.abs((p - q)[1:]).max()) < MAX_ASYMMETRY * apart


def round_sides(pieces: list[Piece], middle: float, near: Floats | None) -> list[Side]:
    """The pair of balls that most resembles two eyes; empty where there is none.

    middle : x of the plane between them. near : (2, 3) left and right, where lids close, if that is known.
    """
    balls = [p for p in pieces if p.ball is not None and len(p.points) >= MIN_VERTICES and is_round(p.ball)]
    balls = [p for p in balls if _apart(p, balls) <= MAX_BALLS]
    left, right = ([p for p in balls if (p.ball.centre[0] > middle) == x] for x in (True, False))  # type: ignore[union-attr]
    pairs = [(_likeness(a.ball, b.ball, middle, near), a, b) for a in left for b in right if a.ball and b.ball]
    likely = [pair for pair in pairs if pair[0] > 0]
    if not likely:
        return []
    _, a, b = max(likely, key=lambda pair: pair[0])
    return [Side(p.faces, _on_front(p.points, p.weight, p.ball), p.points, p.weight, pieces=[p]) for p in (a, b)]


def _apart(piece: Piece, balls: list[Piece]) -> int:
    """How many other balls are as large as one and lie beside it."""
    own = piece.ball
    others = [p.ball for p in balls if p.ball is not None and p.ball is not own]
    if own is None:
        return 0
    alike = [b for b in others if abs(b.radius - own.radius) < MAX_RADIUS_DIFFERENCE * own.radius]
    return sum(float(np.linalg.norm(b.centre - own.centre)) > own.radius for b in alike)


def _likeness(a: Ball, b: Ball, middle: float, near: Floats | None) -> float:
    """How much two balls are like a pair of eyes, 0..1; 0 for two that cannot be one."""
    apart = float(np.linalg.norm(a.centre - b.centre))
    size = 0.5 * (a.radius + b.radius) / max(apart, 1e-9)
    if not mirrored(a.centre, b.centre, middle) or abs(a.radius - b.radius) > MAX_RADIUS_DIFFERENCE * a.radius:
        return 0.0
    if not SIZE_RANGE[0] < size < SIZE_RANGE[1]:
        return 0.0
    if near is not None and max(np.linalg.norm(x.centre - n) for x, n in zip((a, b), near, strict=True)) > 0.5 * apart:
        return 0.0
    return float(np.exp(-0.5 * (np.log(size / USUAL_SIZE) / SIZE_DEVIATION) ** 2)) * (
        1.0 - 0.5 * (a.off + b.off) / (2 * MAX_FIT_ERROR)
    )


def around(pieces: list[Piece], sides: list[Side]) -> Ints:
    """Faces of all pieces that lie in a ball a little larger than an eye: cornea, iris, highlight."""
    balls = [s.ball for s in sides if s.ball is not None]
    own = [piece.faces for piece in pieces if any(_within(piece, ball) for ball in balls)]
    return np.concatenate([np.zeros(0, np.int64), *own])


def _within(piece: Piece, ball: Ball) -> bool:
    return bool((np.linalg.norm(piece.points - ball.centre, axis=1) < EYE_REACH * ball.radius).all())
