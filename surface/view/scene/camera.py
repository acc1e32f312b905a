"""Pinhole camera in head space, with presets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

#: Point the presets look at, millimetres: between eyes and mouth, a little inside the head.
FACE_CENTRE = (0.0, -6.0, 40.0)
#: Distance of the presets, millimetres: far enough for a portrait's flat perspective.
PORTRAIT_DISTANCE = 950.0
#: Vertical field of view of the presets, degrees.
PORTRAIT_FOV_DEG = 20.5
_MAX_PITCH_DEG = 85.0


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    eye, target : (3,) position and point looked at, millimetres, head space (y up, z out of the face).
    fov_deg : vertical field of view, degrees.
    near, far : clipping distances, millimetres.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float] = FACE_CENTRE
    fov_deg: float = PORTRAIT_FOV_DEG
    near: float = 40.0
    far: float = 4000.0

    @classmethod
    def around(
        cls,
        yaw_deg: float,
        pitch_deg: float = 0.0,
        *,
        distance: float = PORTRAIT_DISTANCE,
        target: tuple[float, float, float] = FACE_CENTRE,
        fov_deg: float = PORTRAIT_FOV_DEG,
    ) -> Camera:
        """Camera on a sphere about `target`; yaw + = towards the subject's left, pitch + = from above."""
        yaw, pitch = np.radians(yaw_deg), np.radians(pitch_deg)
        direction = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        eye = np.asarray(target) + distance * direction
        return cls(eye=_triple(eye), target=target, fov_deg=fov_deg)

    @classmethod
    def front(cls) -> Camera:
        """Straight at the face."""
        return cls.around(0.0, 1.0)

    @classmethod
    def three_quarter(cls, side: str = "left") -> Camera:
        """From 38 degrees to the subject's `side` ("left" or "right")."""
        return cls.around(38.0 * _side_sign(side), 3.0)

    @classmethod
    def profile(cls, side: str = "left") -> Camera:
        """Straight at the subject's `side` ("left" or "right"), turned about the head's middle."""
        return cls.around(90.0 * _side_sign(side), 1.0, target=(0.0, FACE_CENTRE[1], 15.0))

    @property
    def yaw_deg(self) -> float:
        """Angle about y from straight ahead, degrees; + = towards the subject's left."""
        x, _, z = self._offset
        return float(np.degrees(np.arctan2(x, z)))

    @property
    def pitch_deg(self) -> float:
        """Angle above the horizon, degrees."""
        x, y, z = self._offset
        return float(np.degrees(np.arctan2(y, np.hypot(x, z))))

    @property
    def distance(self) -> float:
        """Millimetres from eye to target."""
        return float(np.linalg.norm(self._offset))

    @property
    def _offset(self) -> np.ndarray:
        """From target to eye, (3,)."""
        return np.subtract(self.eye, self.target)

    def orbit(self, yaw_deg: float, pitch_deg: float) -> Camera:
        """The camera turned about its target by these angles; pitch stops short of the poles."""
        pitch = float(np.clip(self.pitch_deg + pitch_deg, -_MAX_PITCH_DEG, _MAX_PITCH_DEG))
        return Camera.around(
            self.yaw_deg + yaw_deg, pitch, distance=self.distance, target=self.target, fov_deg=self.fov_deg
        )

    def zoom(self, factor: float) -> Camera:
        """The camera with its distance divided by `factor`, kept between 3 times `near` and 3/4 of `far`: between
        120 and 3000 mm for a head of usual size."""
        distance = float(np.clip(self.distance / factor, 3.0 * self.near, 0.75 * self.far))
        return replace(self, eye=_triple(np.asarray(self.target) + self._offset * (distance / self.distance)))

    def aimed(self, target: tuple[float, float, float]) -> Camera:
        """The same view direction and distance, moved to look at `target` (3,), millimetres."""
        return replace(self, eye=_triple(np.asarray(target) + self._offset), target=target)

    def view(self) -> np.ndarray:
        """World to camera, (4, 4) float32, for column vectors."""
        eye, target = np.asarray(self.eye, float), np.asarray(self.target, float)
        back = _unit(eye - target)
        right = np.cross((0.0, 1.0, 0.0), back)
        right = _unit(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
        matrix = np.eye(4)
        matrix[:3, :3] = right, np.cross(back, right), back
        matrix[:3, 3] = -matrix[:3, :3] @ eye
        return matrix.astype(np.float32)

    def projection(self, aspect: float) -> np.ndarray:
        """Camera to clip space, (4, 4) float32, for column vectors; `aspect` = width / height."""
        scale = 1.0 / np.tan(np.radians(self.fov_deg) / 2.0)
        depth = self.near - self.far
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = scale / aspect, scale
        matrix[2, 2], matrix[2, 3] = (self.far + self.near) / depth, 2.0 * self.far * self.near / depth
        matrix[3, 2] = -1.0
        return matrix.astype(np.float32)

    def matrix(self, aspect: float) -> np.ndarray:
        """World to clip space, (4, 4) float32, for column vectors; read-only, since it is cached."""
        return _matrix(self, aspect)


#: Presets by name, for command lines and keys.
PRESETS: dict[str, Callable[[], Camera]] = {
    "front": Camera.front,
    "three-quarter": Camera.three_quarter,
    "three-quarter-right": lambda: Camera.three_quarter("right"),
    "profile": Camera.profile,
    "profile-right": lambda: Camera.profile("right"),
}


@lru_cache(maxsize=8)
def _matrix(camera: Camera, aspect: float) -> np.ndarray:
    """See :meth:`Camera.matrix`."""
    matrix: np.ndarray = camera.projection(aspect) @ camera.view()
    matrix.flags.writeable = False
    return matrix


def _side_sign(side: str) -> float:
    """+1 for "left", -1 for "right"; ValueError otherwise."""
    if side not in ("left", "right"):
        raise ValueError(f'side must be "left" or "right", not {side!r}')
    return 1.0 if side == "left" else -1.0


def _unit(vector: np.ndarray) -> np.ndarray:
    """`vector` (3,) at length 1."""
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    """(3,) array as a tuple of floats."""
    return float(vector[0]), float(vector[1]), float(vector[2])
