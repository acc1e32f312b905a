"""How deep wrinkles lie in the skin: where each of them sinks it, and how much of it a pose shows.

The floor of a furrow sees less of the light around it than the skin beside it does. Shaders darken it by its depth:
each vertex knows the wrinkles that reach it and how deep they are there when whole, each frame how much of them shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from surface.head.model.data import WRINKLE
from surface.view.scene.parts import ViewHead, ViewPart

if TYPE_CHECKING:
    from surface.head import Head
    from surface.head.model.data import Group
    from surface.head.posing.part import HeadPart

MOST = 64
"""Wrinkles of a head whose floors are darkened: OpenGL 3.1 need not have room for many more uniforms."""
TOGETHER = 2
"""Wrinkles that a vertex knows, where they overlap."""


class Wrinkles:
    """The wrinkles of a head, and how much of them shows.

    head : it has wrinkles, see :func:`wrinkles_of`; names (w,) of their groups.

    Attributes
    ----------
    count : number of wrinkles. depths : (w,) float32, mm, how deep each is now where a vertex has the share 1 of it.
    """

    def __init__(self, head: Head, names: Sequence[str]) -> None:
        from surface.head.model.rules import Drivers  # compiled: loaded when first used

        self._head, self.count = head, len(names)
        self._drivers = Drivers([rule for rule in head.data.rules if rule.group in names])
        self._rows = [self._drivers.names.index(name) for name in names]
        groups = {part.name: [g for g in part.groups if g.name in names] for part in head.data.parts}
        sunk = {part.name: _sunk(part, groups[part.name], names) for part in head.parts if groups[part.name]}
        self._most_mm = max(float(depth.max()) for depth in sunk.values())
        self._at = {name: _deepest(depth / max(self._most_mm, 1e-9)) for name, depth in sunk.items()}
        self.depths = np.zeros(self.count, np.float32)

    def show(self, values: np.ndarray) -> None:
        """Take the parameter values (P,) by which the head is posed."""
        amounts = self._drivers.amounts(self._head.read_pose(values).shapes)
        self.depths[:] = self._most_mm * amounts[self._rows]

    def at(self, part: ViewPart) -> np.ndarray:
        """Which wrinkles reach the vertices of a part, (m, 4) uint8: the number of one and its share of the depth,
        0..255 for 0..1, and the same of another that overlaps it."""
        known = self._at.get(part.name)
        return np.zeros((len(part.vertices), 2 * TOGETHER), np.uint8) if known is None else known


def wrinkles_of(head: ViewHead) -> Wrinkles | None:
    """The wrinkles of a head that parameters drive; None where it has none."""
    data = getattr(head, "data", None)
    driven = {rule.group for rule in getattr(data, "rules", ())}
    groups = (group.name for part in getattr(data, "parts", ()) if part.follows == "skin" for group in part.groups)
    names = [name for name in dict.fromkeys(groups) if name.startswith(WRINKLE) and name in driven][:MOST]
    return Wrinkles(head, names) if names else None  # type: ignore[arg-type]


def _sunk(part: HeadPart, groups: Sequence[Group], names: Sequence[str]) -> np.ndarray:
    """(m, w) float32: how deep each whole wrinkle sinks the vertices of a part, mm; 0 where it raises them."""
    from surface.deform.deformation import Deformation  # compiled: loaded when first used
    from surface.head.posing.decimated_head import submesh  # compiled: loaded when first used

    near = _reached(part, np.concatenate([group.ids for group in groups]))
    skin = Deformation(part.surface, submesh(part.mesh, near))
    rest, normals = skin.vertices.copy(), skin.normals.copy()
    depth = np.zeros((len(part.mesh.uv), len(names)), np.float32)
    for group in groups:
        points = np.array(part.surface.points)
        np.add.at(points, group.ids, group.moves)
        skin.set_points(points)
        depth[near, names.index(group.name)] = ((rest - skin.vertices) * normals).sum(axis=1)
    sunk: np.ndarray = np.maximum(depth, 0.0)[part.of_mesh]
    return sunk


def _reached(part: HeadPart, points: np.ndarray) -> np.ndarray:
    """(k,) vertices of a part's mesh in cells that any of the control ``points`` (n,) reaches, ascending."""
    mesh = part.mesh
    cell = np.repeat(np.arange(len(mesh.list_start) - 1), np.diff(mesh.list_start))
    reached = cell[np.isin(mesh.list_ids % part.surface.n, points)]
    return np.flatnonzero(np.isin(mesh.cell, reached))


def _deepest(share: np.ndarray) -> np.ndarray:
    """(m, 2 t) uint8: of shares (m, w) of depth the greatest of each vertex, each after the number of its wrinkle."""
    order = np.argsort(-share, axis=1, kind="stable")[:, :TOGETHER]
    out = np.zeros((len(share), 2 * TOGETHER), np.uint8)
    columns = order.shape[1]
    out[:, : 2 * columns : 2] = order
    out[:, 1 : 2 * columns : 2] = np.rint(255.0 * np.take_along_axis(share, order, axis=1))
    return out
