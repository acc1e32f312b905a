"""The head that is checked: posed in every parameter, with what all checks measure it by."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.check.raster import Shape
from surface.head import Head
from surface.head.model.face import face_of
from surface.head.model.parameters import ANGLES, SHAPES
from surface.head.posing.part import HeadPart

EYES_MM = 63.6  # between the eyes of a head of usual size (Dodgson 2004: mean 63.4 mm)
HEIGHT_MM = 230.0  # of a head of usual size without its neck
HAIR = ("brow", "lash", "hair")
SIDES = ("left_eye", "right_eye")


class Subject:
    """A head and its vertices in any pose.

    head : changed by posing it. scale : its size relative to a head of usual size, by its eyes, else by its height.
    """

    def __init__(self, head: Head) -> None:
        self.head = head
        self.parts: tuple[HeadPart, ...] = head.parts
        self._kept: dict[tuple[tuple[str, float], ...], list[Floats32]] = {}
        self.rest = self.posed({})

    def posed(self, values: Mapping[str, float]) -> list[Floats32]:
        """Return vertices (m, 3) of every part in a pose."""
        key = tuple(sorted(values.items()))
        if key not in self._kept:
            self.head.pose(self.head.values(values))
            self._kept[key] = [p.vertices.copy() for p in self.parts]
        return self._kept[key]

    def posed_now(self, values: Mapping[str, float]) -> list[Floats32]:
        """Do the same as :meth:`posed`, and the parts are in that pose afterwards, for their normals."""
        self.head.pose(self.head.values(values))
        return self.posed(values)

    def at_one(self, name: str) -> list[Floats32]:
        """Return vertices of every part with one parameter at 1, and at least what it needs to show."""
        return self.posed(pose_of(name))

    def moves(self, name: str) -> list[Floats32]:
        """Return (m, 3): how a parameter at 1 moves the vertices of every part."""
        before = self.posed({"jawOpen": 1.0}) if name == "mouthClose" else self.rest
        return [np.asarray(b - a) for a, b in zip(before, self.at_one(name), strict=True)]

    def shapes(self, vertices: list[Floats32], *, without: tuple[str, ...] = HAIR) -> list[Shape | None]:
        """Return what a picture is drawn from, less the parts of some materials."""
        pairs = zip(self.parts, vertices, strict=True)
        return [None if p.material in without else (v, p.triangles) for p, v in pairs]

    def eye(self, side: int) -> int | None:
        """Number of the part that is the left (0) or right (1) eyeball; None without one."""
        return next((k for k, p in enumerate(self.parts) if p.follows == SIDES[side]), None)

    @cached_property
    def claimed(self) -> tuple[str, ...]:
        """Parameters that the head has something for, in the order of its parameters."""
        named = {g.name for p in self.head.data.parts for g in p.groups}
        named |= {"jawOpen"} if self.head.data.jaw.angle_rad else set()
        eyes = [self.eye(0) is not None, self.eye(1) is not None]
        named |= {n for n in ANGLES if n.startswith("head")}
        named |= {n for n in ANGLES for k in (0, 1) if eyes[k] and n.startswith(("leftEye", "rightEye")[k])}
        return tuple(n for n in (*SHAPES, *ANGLES) if n in named)

    @cached_property
    def skin(self) -> Ints:
        """Numbers of the parts that are skin, the face first, then the largest."""
        face = face_of(self.parts, self.head.data.contacts)
        found = [k for k, p in enumerate(self.parts) if p.material == "skin"]
        return np.array(sorted(found, key=lambda k: (self.parts[k] is not face, -len(self.rest[k]))), np.int64)

    @cached_property
    def eyes(self) -> Floats | None:
        """(2, 3) the centres about which the eyes turn; None for a head without eyes."""
        data = self.head.data
        return np.asarray(data.eyes, float) if data.eye_radius > 0 else None

    @cached_property
    def height(self) -> float:
        """Of all its skin, mm."""
        ys = [self.rest[k][:, 1] for k in self.skin]
        return float(max(y.max() for y in ys) - min(y.min() for y in ys)) if ys else 0.0

    @cached_property
    def scale(self) -> float:
        apart = float(np.linalg.norm(self.eyes[0] - self.eyes[1])) if self.eyes is not None else 0.0
        return apart / EYES_MM if apart > 0 else max(self.height, 1e-9) / HEIGHT_MM


def pose_of(name: str) -> dict[str, float]:
    """Return the pose in which a parameter at 1 shows: mouthClose closes what the jaw has opened."""
    return {name: 1.0, "jawOpen": 1.0} if name == "mouthClose" else {name: 1.0}
