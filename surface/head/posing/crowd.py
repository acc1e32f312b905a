"""A crowd: many copies of one head, each with its own parameters, posed in one batch.

The copies share weights, lists, triangles and colours; each has its own control points, vertices and normals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.deform.batch import DeformationBatch
from surface.head.model.parameters import Pose
from surface.head.posing.head import Head
from surface.head.posing.part import HeadPart, RigidPart, SkinPart, Turn


@dataclass
class CrowdPart:
    """One part of all heads.

    part : of the template head. vertices, normals : (h, m, 3) float32 of h heads.
    batch : the copies of its deformation; None for a part that does not deform.
    """

    part: HeadPart
    vertices: Floats32
    normals: Floats32
    batch: DeformationBatch | None

    @property
    def nbytes(self) -> int:
        """Bytes of all heads' arrays."""
        return self.vertices.nbytes + self.normals.nbytes + (self.batch.nbytes if self.batch is not None else 0)


class Crowd:
    """``count`` copies of a template head, initially at rest; swaying hair follows the template's.

    head : the template, whose parts they share. It is posed by the crowd, so nothing else may pose it meanwhile.

    Attributes
    ----------
    parts : in the order of the head's parts.
    values : (h, P) float64, parameters as given to the last :meth:`pose`, not clipped; read-only.

    Raises ValueError: fewer than one head.
    """

    def __init__(self, head: Head, count: int) -> None:
        if count < 1:
            raise ValueError(f"count: must be at least 1, not {count}")
        self.head = head
        neutral = np.zeros(len(head.parameters))
        head.pose(neutral)
        self.parts = tuple(_make_part(part, count) for part in head.parts)
        at = {id(part): i for i, part in enumerate(head.parts)}
        self._stitches = [(stitch, at[id(stitch.first)], at[id(stitch.second)]) for stitch in head.stitches]
        self._turns: list[Turn] = [Turn(np.eye(3), head.data.neck.pivot)] * count
        self._values, self._lives = np.tile(neutral, (count, 1)), np.zeros((count, 2))
        self.values = self._values.view()
        self.values.flags.writeable = False

    def __len__(self) -> int:
        """Number of heads."""
        return len(self._values)

    @property
    def nbytes(self) -> int:
        """Bytes of all heads, without what they share."""
        return sum(part.nbytes for part in self.parts)

    def pose(self, values: Floats, lives: Floats | None = None) -> list[int]:
        """Move every head to its parameter values (h, P), clipped to their ranges; return the heads whose values
        or breath changed.

        lives : (h, 2) what :meth:`surface.head.Head.live` takes, of each head; None: at rest.

        Raises ValueError: wrong shape or a value that is not a number; the heads keep their poses.
        """
        given = np.asarray(values, np.float64)
        if given.shape != self._values.shape:
            raise ValueError(f"values has shape {given.shape}, expected {self._values.shape}")
        for row in given[np.isnan(given).any(axis=1)]:
            self.head.read_pose(row)  # raises, before anything moves
        lives = np.zeros_like(self._lives) if lives is None else lives
        breathes = lives[:, 0] != self._lives[:, 0]
        moved = np.flatnonzero((given != self._values).any(axis=1) | breathes).tolist()
        self._lives = np.array(lives, float)
        poses = [self._read_pose(k, given[k]) for k in moved]
        points = {c.part.name: c.part.rig.move_all(poses) for c in self.parts if moved and isinstance(c.part, SkinPart)}
        finishing = [
            self._place(k, pose, {name: rows[i] for name, rows in points.items()})
            for i, (k, pose) in enumerate(zip(moved, poses, strict=True))
        ]
        for part in self.parts:
            if part.batch is not None:
                part.batch.compute()
        for finish in finishing:
            finish()
        self._values[moved] = given[moved]
        return moved

    def _read_pose(self, k: int, values: Floats) -> Pose:
        """Return values (P,) as a pose of head k, with its breath."""
        self.head.live(*self._lives[k].tolist())
        return self.head.read_pose(values)

    def show(self, k: int) -> None:
        """Give the template head the vertices, normals and pupils of head k, until it is posed again."""
        self.head.live(*self._lives[k].tolist())
        for crowd in self.parts:
            crowd.part.show(crowd.vertices[k], crowd.normals[k], self._turns[k])

    def _place(self, k: int, pose: Pose, moved: Mapping[str, Floats]) -> Callable[[], None]:
        """Place the control points of head k; return a function to call once its vertices are computed.

        That function rotates the parts and closes the seams. ``moved`` : control points of the deforming parts, by
        name, as moved by groups.
        """
        rows, turn = self.head.place_pose(pose, moved)
        for crowd, points in zip(self.parts, rows, strict=True):
            if crowd.batch is not None:
                crowd.batch.place(k, points)
            elif isinstance(crowd.part, RigidPart):
                crowd.part.move(points[:3].T, points[3], turn, crowd.vertices[k], crowd.normals[k])
        return lambda: self._finish(k, turn)

    def _finish(self, k: int, turn: Turn) -> None:
        """Rotate the deforming parts of head k with the head, and close its seams."""
        self._turns[k] = turn
        for crowd in self.parts:
            if crowd.batch is not None:
                source = _UnrotatedPart(crowd.batch.vertices[k], crowd.batch.normals[k])
                rows = 0, len(source.vertices)
                turn.rotate(source, crowd.part.share, rows, crowd.vertices[k], crowd.normals[k])
        for stitch, first, second in self._stitches:
            if len(stitch.ids):
                one, two = self.parts[first], self.parts[second]
                stitch.join(one.vertices[k], one.normals[k], two.vertices[k], two.normals[k])


@dataclass
class _UnrotatedPart:
    """Vertices and normals of one part of one head, before the head's rotation."""

    vertices: Floats32
    normals: Floats32


def _make_part(part: HeadPart, count: int) -> CrowdPart:
    """Return a part of ``count`` heads, as it is now."""
    vertices, normals = (np.tile(array, (count, 1, 1)) for array in (part.vertices, part.normals))
    batch = DeformationBatch(part.deformation, count) if isinstance(part, SkinPart) else None
    return CrowdPart(part, vertices, normals, batch)
