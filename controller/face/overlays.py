"""Computes overlays for the picture.

They are: control points, the influence of one of them, the quad tree's triangles, vertices that the last update moved,
servo anchors, and the difference to the face that the servos show. They are computed from a second copy of the head, so
that they show the full tessellation whatever the picture draws. This module does not depend on any window library.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats
from surface.head import Head
from surface.head.model.parameters import rotation

PART = "face"
Kind = Literal["control points", "influence", "quad tree", "touched", "anchors", "measured"]
KINDS: tuple[Kind, ...] = ("control points", "influence", "quad tree", "touched", "anchors", "measured")
MAX_MARKS = 1500
"""Number of points of one kind that are drawn; four times as many edges of the quad tree."""
_MIN_WEIGHT = 0.01
_MIN_MOVE_MM = 0.05  # a smaller movement is not visible


@dataclass(frozen=True)
class Marks:
    """Points or lines to draw.

    points : (m, 3) mm. lines : (k, 2, 3) mm. shades : (m,) or (k,) 0..1, intensity of each.
    families : (m,) colour number of each point, equal for points of one group. labels : texts by point index.
    """

    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    lines: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))
    shades: Floats = field(default_factory=lambda: np.zeros(0))
    families: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    labels: Mapping[int, str] = field(default_factory=dict)


class Overlays:
    """Computes the overlays of a face.

    head : a separate copy of the head that is drawn. anchors : (uv, name) of each servo's anchor on the skin.
    """

    def __init__(self, head: Head, anchors: Sequence[tuple[Floats, str]] = ()) -> None:
        self._head, self._part = head, head.part(PART)
        self._index, self._anchors = head.parts.index(self._part), tuple(anchors)
        data = next(part for part in head.data.parts if part.name == PART)
        self.groups = [group.name for group in data.groups]
        self._families = _families(len(data.points), data.groups)
        edges = np.sort(self._part.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        self._edges = np.unique(edges, axis=0)
        self._measured: Floats | None = None
        self._before = self._part.vertices.copy()
        self._moved = np.zeros(len(self._before), bool)
        self.chosen = 0

    def pose(self, values: Floats, measured: Floats | None = None) -> None:
        """Pose the copy. values : (h,) of the face. measured : (h,) of the face that the servos show; None: unknown."""
        self._measured = None
        if measured is not None:
            self._head.pose(measured)
            self._measured = self._part.vertices.astype(np.float64)
        self._head.pose(values)
        self._values = values
        self._moved = np.abs(self._part.vertices - self._before).max(axis=1) > _MIN_MOVE_MM
        self._before = self._part.vertices.copy()

    def marks(self, kind: Kind) -> Marks:
        """Return the marks of one kind."""
        makers: dict[Kind, Callable[[], Marks]] = {
            "control points": self._control_points,
            "influence": self._influence,
            "quad tree": self._quad_tree,
            "touched": self._touched,
            "anchors": self._anchor_marks,
            "measured": self._differences,
        }
        return makers[kind]()

    def _places(self) -> Floats:
        """Return the control points (n, 3) mm, with the head's rotation."""
        turn, pivot = rotation(*self._head.read_pose(self._values).head), np.array(self._head.data.neck.pivot)
        local = np.asarray(self._head.place_points(self._values)[0][self._index], np.float64)
        places: Floats = pivot + (local - pivot) @ turn.T
        return places

    def _control_points(self) -> Marks:
        places = self._places()
        step = max(1, -(-len(places) // MAX_MARKS))
        shown = places[::step]
        return Marks(points=shown, shades=np.ones(len(shown)), families=self._families[::step])

    def _influence(self) -> Marks:
        """Mark vertices by their weight of the chosen control point (paper, figure 4), and the control point."""
        column = self._part.surface.basis_matrix(self._part.mesh.uv).tocsc()[:, self.chosen].toarray().ravel()
        reached = np.flatnonzero(column > _MIN_WEIGHT)
        reached = reached[np.argsort(-column[reached])][: MAX_MARKS - 1]
        points = np.vstack([self._places()[self.chosen], self._part.vertices[reached].astype(np.float64)])
        return Marks(points=points, shades=np.append(1.0, column[reached]), labels={0: f"{self.chosen}"},
                     families=np.append(1, np.zeros(len(reached), np.intp)))  # fmt: skip

    def choose(self, place: Floats) -> None:
        """Choose the control point nearest to a position (3,) mm, whose influence is then shown."""
        self.chosen = int(np.argmin(np.linalg.norm(self._places() - place, axis=1)))

    def _quad_tree(self) -> Marks:
        vertices = self._part.vertices.astype(np.float64)
        ahead = vertices[:, 2] > np.median(vertices[:, 2])
        edges = self._edges[ahead[self._edges].all(axis=1)]
        lines = vertices[edges[:: max(1, -(-len(edges) // (4 * MAX_MARKS)))]]
        return Marks(lines=lines, shades=np.full(len(lines), 0.5))

    def _touched(self) -> Marks:
        ids = np.flatnonzero(self._moved)
        points = self._part.vertices[ids[:: max(1, -(-len(ids) // MAX_MARKS))]].astype(np.float64)
        return Marks(points=points, shades=np.ones(len(points)), families=np.ones(len(points), np.intp))

    def _anchor_marks(self) -> Marks:
        if not self._anchors:
            return Marks()
        uv = np.array([each for each, _ in self._anchors])
        basis = self._part.surface.basis_matrix(uv)
        points = np.asarray(basis @ self._places())
        return Marks(points=points, shades=np.ones(len(points)), families=np.ones(len(points), np.intp),
                     labels={i: name for i, (_, name) in enumerate(self._anchors)})  # fmt: skip

    def _differences(self) -> Marks:
        """Draw lines from the commanded to the measured positions of vertices, where they differ."""
        if self._measured is None:
            return Marks()
        wanted = self._part.vertices.astype(np.float64)
        apart = np.linalg.norm(self._measured - wanted, axis=1)
        seen = np.flatnonzero(apart > 0.1)
        seen = seen[:: max(1, -(-len(seen) // MAX_MARKS))]
        lines = np.stack([wanted[seen], self._measured[seen]], axis=1)
        return Marks(lines=lines, shades=np.clip(apart[seen] / 5.0, 0.2, 1.0))


def _families(count: int, groups: Sequence[object]) -> NDArray[np.intp]:
    """Return (n,) the number, from 1 on, of the group that moves each control point farthest; 0 if none does."""
    farthest, family = np.zeros(count), np.zeros(count, np.intp)
    for i, group in enumerate(groups, 1):
        ids, moves = np.asarray(group.ids), np.linalg.norm(np.asarray(group.moves), axis=-1)  # type: ignore[attr-defined]
        more = moves > farthest[ids]
        farthest[ids[more]], family[ids[more]] = moves[more], i
    return family
