"""A ball with two eyes and a mouth, made here: what the picture's tests draw.

Its skin is a grid with holes over the eyes and the mouth, so lids and lips are boundary loops as in a real head.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

RADII = np.array([75.0, 100.0, 90.0])
EYES = {"left_eye": np.array([30.0, 20.0, 68.0]), "right_eye": np.array([-30.0, 20.0, 68.0])}
EYE_RADIUS = 13.0
PARAMETERS = ("jawOpen", "eyeBlinkLeft", "eyeBlinkRight", "headYaw", "leftEyeYaw", "rightEyeYaw")


@dataclass
class BallPart:
    """One part, as the picture reads it."""

    name: str
    material: str
    triangles: np.ndarray
    rest: np.ndarray
    normals: np.ndarray
    attributes: dict[str, np.ndarray] = field(default_factory=dict)
    changed: Sequence[tuple[int, int]] = ()

    def __post_init__(self) -> None:
        self.rest = self.rest.astype(np.float32)
        self.rest_normals = self.normals.astype(np.float32)
        self.vertices, self.normals = self.rest.copy(), self.rest_normals.copy()
        self.uv = np.zeros((len(self.rest), 2), np.float32)


def grid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Grid coordinates (m, 2) in 0..1 and triangles (t, 3), anticlockwise seen with u right and v up."""
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    ids = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (x.ravel() for x in (ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]))
    return np.stack([u.ravel(), v.ravel()], 1), np.vstack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def ball(radii: np.ndarray | float, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, outward normals (m, 3) and triangles of an ellipsoid, its seam at the back (-z)."""
    uv, triangles = grid(rows, columns)
    longitude, latitude = (uv[:, 0] - 0.5) * 2 * np.pi, (uv[:, 1] - 0.5) * np.pi
    unit = np.stack(
        [np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)], axis=1
    )
    normals = unit / radii
    return unit * radii, normals / np.linalg.norm(normals, axis=1, keepdims=True), triangles


def skin() -> BallPart:
    """The ball's skin, with holes before the eyes and the mouth."""
    points, normals, triangles = ball(RADII, 61, 81)
    middle = points[triangles].mean(axis=1)
    hole = (np.abs(middle[:, 1] + 35) < 5) & (np.abs(middle[:, 0]) < 25) & (middle[:, 2] > 0)
    for centre in EYES.values():
        hole |= (np.abs(middle[:, 1] - 20) < 6) & (np.abs(middle[:, 0] - centre[0]) < 11) & (middle[:, 2] > 0)
    return BallPart("face", "skin", triangles[~hole], points, normals)


def eye(name: str) -> BallPart:
    """An eyeball just behind the skin."""
    points, normals, triangles = ball(EYE_RADIUS, 25, 33)
    return BallPart(name, "eye", triangles, points + EYES[name], normals)


def inside(name: str, centre: tuple[float, float, float], radii: tuple[float, float, float]) -> BallPart:
    """A lump inside the mouth, drawn as `name`."""
    points, normals, triangles = ball(np.array(radii), 13, 17)
    return BallPart(name, name, triangles, points + centre, normals)


def rotation(yaw: float) -> np.ndarray:
    """Rotation about +y, (3, 3)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


class BallHead:
    """Eyes that turn, a mouth that opens, lids that close, a head that turns."""

    contacts = ()

    def __init__(self) -> None:
        self.parameters = PARAMETERS
        self.parts = (
            skin(),
            eye("left_eye"),
            eye("right_eye"),
            inside("teeth", (0, -35, 62), (24, 8, 14)),
            inside("mouth", (0, -35, 40), (30, 20, 20)),
        )
        self.pose(np.zeros(len(PARAMETERS)))

    def pose(self, values: np.ndarray) -> None:
        """Move everything; `changed` tells the whole of every part."""
        value = dict(zip(self.parameters, np.clip(values, -1, 1), strict=True))
        turn = rotation(value["headYaw"] * np.radians(60))
        for part in self.parts:
            vertices, normals = part.rest.astype(float), part.rest_normals.astype(float)
            if part.name in EYES:
                own = rotation(value["leftEyeYaw" if part.name == "left_eye" else "rightEyeYaw"] * np.radians(35))
                vertices = (vertices - EYES[part.name]) @ own.T + EYES[part.name]
                normals = normals @ own.T
            elif part.material == "skin":
                vertices = self._moved_skin(vertices, value)
            part.vertices[:], part.normals[:] = vertices @ turn.T, normals @ turn.T
            part.changed = [(0, len(part.vertices))]

    @staticmethod
    def _moved_skin(vertices: np.ndarray, value: dict[str, float]) -> np.ndarray:
        """Jaw down, upper lids down."""
        moved = vertices.copy()
        front = vertices[:, 2] > 0
        jaw = front & (vertices[:, 1] < -36) & (np.abs(vertices[:, 0]) < 30)
        moved[jaw, 1] -= 14.0 * value["jawOpen"]
        for name, centre in EYES.items():
            amount = value["eyeBlinkLeft" if name == "left_eye" else "eyeBlinkRight"]
            lid = front & (np.abs(vertices[:, 0] - centre[0]) < 14) & (np.abs(vertices[:, 1] - 27) < 4)
            moved[lid, 1] -= 13.0 * amount
        return moved


def values(**wanted: float) -> np.ndarray:
    """Values in PARAMETERS order, 0 where not named."""
    result = np.zeros(len(PARAMETERS))
    for name, value in wanted.items():
        result[PARAMETERS.index(name)] = value
    return result
