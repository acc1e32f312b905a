"""Heads of plain sheets and balls, whose shapes are known in closed form: what the tests of single checks look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import numpy as np

from surface.check.mouth import Mouth
from surface.check.subject import Subject
from surface.head.model.data import Group
from surface.head.model.parameters import NAMES

EYES = np.array([[31.8, 0.0, 0.0], [-31.8, 0.0, 0.0]])  # 63.6 mm apart: a head of scale 1
RADIUS = 12.0
Moves = Mapping[str, np.ndarray]


def part(name: str, points: np.ndarray, triangles: np.ndarray, *, material: str = "skin", follows: str = "skin",
         moves: Moves | None = None, normals: np.ndarray | None = None) -> SimpleNamespace:  # fmt: skip
    """A part with its shapes, displacements (m, 3) by the name of the parameter."""
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1)) if normals is None else normals
    return SimpleNamespace(
        name=name, material=material, follows=follows, triangles=np.asarray(triangles, np.int32),
        rest=np.asarray(points, np.float32), vertices=np.array(points, np.float32), normals=normals.astype(np.float32),
        moves={n: np.asarray(m, np.float32) for n, m in (moves or {}).items()},
    )  # fmt: skip


class PlainHead:
    """Parts that shapes move linearly; it has as much of a head as the checks read."""

    parameters = NAMES
    accessories = ()
    texture = None

    def __init__(self, parts: Sequence[SimpleNamespace], *, eyes: np.ndarray | None = EYES, radius: float = RADIUS,
                 jaw: float = 0.0) -> None:  # fmt: skip
        self.parts = tuple(parts)
        groups = [[Group(n, np.arange(len(m), dtype=np.int32), m) for n, m in p.moves.items()] for p in parts]
        self.data = SimpleNamespace(
            parts=[SimpleNamespace(groups=g) for g in groups], jaw=SimpleNamespace(angle_rad=jaw),
            eyes=np.zeros((2, 3)) if eyes is None else eyes, eye_radius=0.0 if eyes is None else radius, contacts=[],
        )  # fmt: skip
        self.posed = 0

    def values(self, wanted: Mapping[str, float]) -> np.ndarray:
        return np.array([wanted.get(name, 0.0) for name in NAMES])

    def pose(self, values: np.ndarray) -> None:
        self.posed += 1
        for p in self.parts:
            p.vertices[:] = p.rest + sum(values[NAMES.index(n)] * m for n, m in p.moves.items() if n in NAMES)


def subject(*parts: SimpleNamespace, **options: object) -> Subject:
    return Subject(PlainHead(parts, **options))  # type: ignore[arg-type]


def sheet(x: tuple[float, float], y: tuple[float, float], step: float, z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a flat grid that faces +z."""
    columns, rows = (round((b - a) / step) + 1 for a, b in (x, y))
    ys, xs = np.meshgrid(np.linspace(*y, rows), np.linspace(*x, columns), indexing="ij")
    ids = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (k.ravel() for k in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([xs.ravel(), ys.ravel(), np.full(xs.size, z)]), triangles


def without(points: np.ndarray, triangles: np.ndarray, x: tuple[float, float], y: tuple[float, float]) -> np.ndarray:
    """The triangles less those whose middle lies in a rectangle."""
    at = points[triangles].mean(axis=1)
    hole = (at[:, 0] > x[0]) & (at[:, 0] < x[1]) & (at[:, 1] > y[0]) & (at[:, 1] < y[1])
    return triangles[~hole]


def ball(centre: Sequence[float], radius: float = RADIUS, rows: int = 41) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, triangles that run outwards, and normals."""
    uv, triangles = sheet((-0.5, 0.5), (-0.5, 0.5), 1.0 / (rows - 1))
    longitude, latitude = 2.0 * np.pi * uv[:, 0], np.pi * uv[:, 1]
    unit = np.column_stack(
        [np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)]
    )
    return unit * radius + np.asarray(centre, float), triangles, unit


def eyeball(side: int, centre: Sequence[float] | None = None, **options: object) -> SimpleNamespace:
    """The left (0) or right (1) eye; ``centre``: elsewhere than where it turns."""
    points, triangles, normals = ball(EYES[side] if centre is None else centre)
    follows = ("left_eye", "right_eye")[side]
    return part(f"ball_{side}", points, triangles, material="eye", follows=follows, normals=normals, **options)  # type: ignore[arg-type]


def line_of_lips(y: float = -66.0, width: float = 50.0, drop: float = 15.0, z: float = 0.0) -> Mouth:
    """A straight mouth about x = 0."""
    x = np.linspace(-0.5 * width, 0.5 * width, 101)
    return Mouth(x, np.full(101, y), np.full(101, z), drop)
