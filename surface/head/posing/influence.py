"""Express every vertex of a head as sums over control points, to evaluate the surfaces on a graphics processor.

Weights do not change while a face moves, so the division of Eq. (1) can be done beforehand. With W the sum of all
b w, a vertex is the sum of c P with c = b w / W, and by the quotient rule its derivative in u, times a positive
factor, is the sum of d P with d = (b_u w - c W_u) / W; in v alike. A rigid part has four points of its own, the
columns of its motion and its shift. A seam's vertex takes its share of the two vertices it lies between.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.deform.lists import LANES, Lists, build_lists
from surface.head.posing.head import Head
from surface.head.posing.part import HeadPart, SkinPart
from surface.head.posing.seams import SeamStitch

Row = tuple[Ints, Floats]
_RIGID_POINTS = 4


class Influence:
    """The sums of all vertices of a head at rest.

    points : number of points the sums run over.
    part_start : (parts + 1,) int64, first vertex of every part.
    start : (m + 1,) int64, first entry of every vertex.
    ids : (k,) int64, points.
    weights : (k, 3) float64, factors for the position and for its derivatives in u and v, ordered so that their
        cross product points outwards.
    share : (m,) float32, how much of the head's rotation a vertex takes.
    """

    def __init__(self, head: Head) -> None:
        first, rows, shares = 0, [], []
        for part in head.parts:
            own, count = _rows(part)
            rows.append([(ids + first, weights) for ids, weights in own])
            shares.append(_share(part))
            first += count
        self.points = first
        self.part_start = np.cumsum([0, *(len(part.vertices) for part in head.parts)])
        at = {part.name: i for i, part in enumerate(head.parts)}
        for stitch in head.stitches:
            one, two = at[stitch.first.name], at[stitch.second.name]
            _stitch_rows(stitch, rows[one], rows[two], shares[one], shares[two])
        every = [row for part_rows in rows for row in part_rows]
        self.start = np.cumsum([0, *(len(ids) for ids, _ in every)])
        self.ids = np.concatenate([ids for ids, _ in every])
        self.weights = np.concatenate([weights for _, weights in every])
        self.share = np.concatenate(shares).astype(np.float32)


def _rows(part: HeadPart) -> tuple[list[Row], int]:
    """Return sums of one part's vertices over its own points, empty for those that a seam has added; and how many
    points."""
    if isinstance(part, SkinPart):
        lists = build_lists(part.surface, part.mesh, True)
        count = part.surface.n
        own = _skin_rows(lists, -1.0 if part.mesh.flip else 1.0)
        rows = [(ids % count, weights) for ids, weights in own]  # copies of a closed surface's points are the same
    else:
        rows, count = _rigid_rows(part), _RIGID_POINTS
    empty: Row = (np.zeros(0, np.int64), np.zeros((0, 3)))
    return rows + [empty] * (len(part.vertices) - len(rows)), count


def _skin_rows(lists: Lists, sign: float) -> list[Row]:
    """Return sums from a mesh's blocks; ``sign`` -1 turns the normals round."""
    rows: list[Row] = []
    for cell, (first, last) in enumerate(zip(lists.cell_start, lists.cell_start[1:], strict=False)):
        ids, block = _block(lists, cell, int(last - first))
        total = block.sum(axis=1, keepdims=True)
        value = block[:, :, :1] / total[:, :, :1]
        slopes = (block[:, :, 1:] - value * total[:, :, 1:]) / total[:, :, :1]
        slopes[:, :, 0] *= sign
        weights = np.concatenate([value, slopes], axis=2)
        used = np.abs(weights).max(axis=2) > 0.0
        rows += [(ids[keep], own[keep]) for keep, own in zip(used, weights, strict=True)]
    return rows


def _block(lists: Lists, cell: int, count: int) -> tuple[Ints, Floats]:
    """Return points (r,) of a cell, and b w, b_u w and b_v w (count, r, 3) of its vertices."""
    tiles = int(lists.tile_start[cell + 1] - lists.tile_start[cell])
    rows, room, at = (int(x[cell]) for x in (lists.rows, lists.room, lists.at))
    value = lists.value[at : at + tiles * room * LANES].reshape(tiles, room, 1, LANES)
    slope = lists.slope[2 * at : 2 * (at + tiles * room * LANES)].reshape(tiles, room, 2, LANES)
    both = np.concatenate([value, slope], axis=2)[:, :rows].astype(np.float64)
    first = int(lists.ids_at[cell])
    ids = lists.ids[first : first + rows].astype(np.int64)
    return ids, both.transpose(0, 3, 1, 2).reshape(tiles * LANES, rows, 3)[:count]


def _rigid_rows(part: HeadPart) -> list[Row]:
    """Return sums over the columns of a rigid motion and its shift; derivatives are any two directions along the
    surface."""
    mesh = part.mesh
    vertices, normals = np.asarray(mesh.vertices, float), np.asarray(mesh.normals, float)
    sideways = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    along = np.cross(sideways, normals)
    weights = np.zeros((len(vertices), _RIGID_POINTS, 3))
    weights[:, :3] = np.stack([vertices, along, np.cross(normals, along)], axis=2)
    weights[:, 3, 0] = 1.0
    ids = np.arange(_RIGID_POINTS)
    return [(ids, own) for own in weights]


def _share(part: HeadPart) -> Floats32:
    """Return the share of the head's rotation of each of a part's vertices; 1 for those that a seam has added."""
    share = np.ones(len(part.vertices), np.float32)
    share[: len(part.share)] = part.share
    return share


def _stitch_rows(stitch: SeamStitch, first: Sequence[Row], second: list[Row], one: Floats32, two: Floats32) -> None:
    """Sums and shares of a seam's vertices in the second part, from those of the first."""
    if not len(stitch.ids):
        return
    for vertex, low, high, share in zip(stitch.ids, stitch.low, stitch.high, stitch.share, strict=True):
        (ids_a, a), (ids_b, b) = first[low], first[high]
        second[vertex] = np.concatenate([ids_a, ids_b]), np.concatenate([(1.0 - share) * a, share * b])
    two[stitch.ids] = (1.0 - stitch.share) * one[stitch.low] + stitch.share * one[stitch.high]
