"""Divide a piece of a mesh into regions that can be flattened, along the shortest lines.

A minimal cut through the graph of faces, whose edges are as strong as the mesh's edges are long, is the shortest line
between two sets of faces that are said to lie on either side.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from surface.base.arrays import Bools, Floats, Ints
from surface.base.jit import kernel
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh, components, directed_edges, face_areas, triangles

VIEWS = 96  # directions from which the head is seen
PIXELS = 448  # of a depth map along each side
MIN_COSINE = 0.25  # between a face's normal and a direction of view that can judge the face
DEPTH_TOLERANCE = 3.0  # of depth, in pixels
OUTSIDE, INSIDE = 0.12, 0.01  # fractions of directions that see a face which is surely outside, and surely inside
LINING_MM2 = 220.0  # of a head of usual size: a smaller hidden place is a nostril or a fold
FACE_ANGLE = np.radians(100.0)  # from straight ahead, seen from the head's middle, within which skin is the face's
BACK_ANGLE = np.radians(135.0)  # beyond which it is the back of the head
MIN_BACK_AREA = 0.08  # of the back of the head, as a fraction of the area; a mask has no back
END_FRACTION = 0.3  # of a region's faces at either end, between which the region is cut in two
CAPACITY_UNITS = 1e4  # integer capacity of the longest edge in the minimal cut


def own_corners(mesh: FitMesh, faces: Ints) -> Island:
    """Faces (f,) of a mesh as an island without (u, v): one point for corners that hang together by faces' edges.

    Where a surface touches itself in a vertex, or more than two faces meet in an edge, it comes apart.
    """
    rows = mesh.faces[faces]
    used = rows >= 0
    slot = np.arange(rows.size).reshape(rows.shape)
    a, b = directed_edges(rows)
    at, after = directed_edges(np.where(used, slot, -1))
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    alone = ~np.append(same[1:], False) & ~np.append(False, same[:-1])  # not one of three
    one, two = order[:-1][same & alone], order[1:][same & alone]
    opposite = a[one] == b[two]
    one, two = one[opposite], two[opposite]
    label = components(np.append(at[one], after[one]), np.append(after[two], at[two]), rows.size).reshape(rows.shape)
    point, inverse = np.unique(label[used], return_inverse=True)
    vertex = np.zeros(len(point), np.int64)
    vertex[inverse] = rows[used]
    local = np.full(rows.shape, -1, np.int64)
    local[used] = inverse
    return Island(vertex, np.zeros((len(point), 2)), local)


def connected(mesh: FitMesh, faces: Ints) -> list[Ints]:
    """The faces (f,) in groups that hang together by edges, the largest first."""
    one, two, _ = neighbours(mesh, faces)
    label = components(one, two, len(faces))
    groups = [faces[label == k] for k in range(int(label.max(initial=-1)) + 1)]
    return sorted(groups, key=len, reverse=True)


def neighbours(mesh: FitMesh, faces: Ints) -> tuple[Ints, Ints, Floats]:
    """Pairs (e,), (e,) of faces, as places in ``faces``, that share an edge, and its length (e,)."""
    island = own_corners(mesh, faces)
    a, b = directed_edges(island.faces)
    face = np.repeat(np.arange(len(faces)), (island.faces >= 0).sum(axis=1))
    key = np.minimum(a, b) * len(island.vertex) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, two = order[twice], order[twice + 1]
    ends = mesh.vertices[island.vertex[np.stack([a[one], b[one]])]]
    return face[one], face[two], np.linalg.norm(ends[0] - ends[1], axis=1)


def shortest_cut(mesh: FitMesh, faces: Ints, inside: Bools, outside: Bools) -> Bools:
    """(f,) the side of every face: True with those ``inside``, False with those ``outside``."""
    if not inside.any() or not outside.any():
        return ~outside if inside.any() else np.zeros(len(faces), bool)
    one, two, length = neighbours(mesh, faces)
    n = len(faces)
    strength = np.maximum(1, np.rint(CAPACITY_UNITS * length / max(float(length.max(initial=0.0)), 1e-12))).astype(
        np.int32
    )
    ends = [(np.full(int(m.sum()), source), np.flatnonzero(m)) for source, m in ((n, inside), (n + 1, outside))]
    pairs = [(one, two, strength), *((a, b, np.full(len(a), int(CAPACITY_UNITS) * 8, np.int32)) for a, b in ends)]
    a = np.concatenate([p[0] for p in pairs])
    b = np.concatenate([p[1] for p in pairs])
    both = np.concatenate([p[2] for p in pairs])
    graph = csr_matrix(coo_matrix((np.append(both, both), (np.append(a, b), np.append(b, a))), shape=(n + 2, n + 2)))
    graph.data = graph.data.astype(np.int32)
    flow = maximum_flow(graph, n, n + 1)
    left = csr_matrix(graph - flow.flow)
    left.eliminate_zeros()
    side = np.zeros(n + 2, bool)
    side[breadth_first_order(left, n, return_predecessors=False)] = True
    return side[:n]


def in_two(mesh: FitMesh, faces: Ints) -> list[Ints]:
    """A region cut across its longest axis."""
    middle = mesh.vertices[mesh.faces[faces][:, :3]].mean(axis=1)
    axis = np.linalg.svd(middle - middle.mean(axis=0), full_matrices=False)[2][0]
    place = np.argsort(np.argsort(middle @ axis, kind="stable"), kind="stable") / max(len(faces) - 1, 1)
    side = shortest_cut(mesh, faces, place <= END_FRACTION, place >= 1.0 - END_FRACTION)
    return [part for half in (faces[side], faces[~side]) for part in connected(mesh, half)]


def face_regions(mesh: FitMesh, faces: Ints, others: Ints, scale: float) -> list[Ints]:
    """Regions of a face's skin: its front and sides first, the back of the head, what lines the mouth and sockets.

    others : faces of what stands in its openings, as eyeballs do. scale : the head's size.
    """
    hidden = _hidden(mesh, faces, others, scale)
    outer = faces[~hidden]
    back = _back(mesh, outer)
    return [
        part for region in (outer[~back], outer[back], faces[hidden]) if len(region) for part in connected(mesh, region)
    ]


def _hidden(mesh: FitMesh, faces: Ints, others: Ints, scale: float) -> Bools:
    """(f,) what cannot be seen from outside: linings of mouth and sockets, where they are large."""
    seen = sight(mesh, faces, others)
    hidden = ~shortest_cut(mesh, faces, seen > OUTSIDE, seen < INSIDE)
    area = face_areas(mesh.vertices, mesh.faces[faces])
    place = np.flatnonzero(hidden)
    for group in connected(mesh, faces[hidden]) if hidden.any() else []:
        own = place[np.isin(faces[place], group)]
        if area[own].sum() < LINING_MM2 * scale**2:
            hidden[own] = False
    return hidden


def sight(mesh: FitMesh, faces: Ints, others: Ints) -> Floats:
    """(f,) from which share of all directions in front of it a face can be seen, by depth maps of the head.

    others : (g,) further faces that may stand before them.
    """
    tri = triangles(mesh.faces[np.concatenate([faces, others])])
    a, b, c = mesh.vertices[mesh.faces[faces][:, :3]].swapaxes(0, 1)  # the middle of a bent quad may lie inside
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = (a + b + c) / 3.0
    centre = mesh.vertices[tri].mean(axis=(0, 1))
    radius = float(np.linalg.norm(mesh.vertices[tri] - centre, axis=2).max())
    step = 2.0 * radius / (PIXELS - 3)
    facing, seen = np.zeros(len(faces)), np.zeros(len(faces))
    for way in directions(VIEWS):
        before = normal @ way > MIN_COSINE
        seen += before & _visible(mesh.vertices[tri] - centre, middle - centre, way, radius, step)
        facing += before
    return seen / np.maximum(facing, 1.0)


def directions(count: int) -> Floats:
    """(count, 3) unit vectors all around, evenly, along a spiral."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    return np.column_stack([np.sqrt(1.0 - z**2) * np.cos(turn), np.sqrt(1.0 - z**2) * np.sin(turn), z])


def _visible(tri: Floats, points: Floats, way: Floats, radius: float, step: float) -> Bools:
    """(f,) whether points (f, 3) are nothing's rear, seen against ``way``, to a few steps of a depth map."""
    side = np.cross(way, np.eye(3)[np.argmin(np.abs(way))])
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(way, side), way], axis=1)
    depth = np.full((PIXELS, PIXELS), -np.inf)
    draw_depth((tri @ frame + [radius, radius, 0.0]) / [step, step, 1.0] + [1.0, 1.0, 0.0], depth)
    at = points @ frame
    pixel = np.rint((at[:, :2] + radius) / step + 1.0).astype(np.int64)
    visible: Bools = at[:, 2] > depth[pixel[:, 1], pixel[:, 0]] - DEPTH_TOLERANCE * step
    return visible


@kernel
def draw_depth(tri: Floats, depth: Floats) -> None:
    """Draw triangles (t, 3, 3), x and y in pixels, into ``depth (h, w)``, which keeps the largest z."""
    for t in range(len(tri)):
        a, b, c = tri[t, 0], tri[t, 1], tri[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-9:
            continue
        for y in range(int(np.ceil(min(a[1], b[1], c[1]))), int(np.floor(max(a[1], b[1], c[1]))) + 1):
            for x in range(int(np.ceil(min(a[0], b[0], c[0]))), int(np.floor(max(a[0], b[0], c[0]))) + 1):
                p = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                q = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                if p >= 0.0 and q >= 0.0 and p + q <= 1.0:
                    depth[y, x] = max(depth[y, x], p * a[2] + q * b[2] + (1.0 - p - q) * c[2])


def _back(mesh: FitMesh, faces: Ints) -> Bools:
    """(f,) the back of the head, seen from the middle between its front and its back; nothing of a mask."""
    middle = mesh.vertices[mesh.faces[faces][:, :3]].mean(axis=1)
    centre = _middle(mesh, faces)
    way = middle - centre
    way[:, 1] = np.maximum(way[:, 1], 0.0)  # below, the neck is cut along its whole length
    angle = np.arccos(np.clip(way[:, 2] / np.maximum(np.linalg.norm(way, axis=1), 1e-12), -1.0, 1.0))
    area = face_areas(mesh.vertices, mesh.faces[faces])
    if area[angle > BACK_ANGLE].sum() < MIN_BACK_AREA * area.sum():
        return np.zeros(len(faces), bool)
    return ~shortest_cut(mesh, faces, angle < FACE_ANGLE, angle > BACK_ANGLE)


def _middle(mesh: FitMesh, faces: Ints) -> Floats:
    """The middle of the head: as high as what moves, halfway between the front there and the back."""
    used = np.unique(mesh.faces[faces])
    used = used[used >= 0]
    moved = np.linalg.norm(mesh.deltas[:, used], axis=2).sum(axis=0)
    points = mesh.vertices[used]
    low, high = points.min(axis=0), points.max(axis=0)
    y = float(np.average(points[:, 1], weights=moved)) if moved.sum() > 0 else 0.5 * (low[1] + high[1])
    near = points[np.abs(points[:, 1] - y) < 0.2 * max(high[0] - low[0], 1e-9)]
    near = near if len(near) else points
    return np.array([0.5 * (low[0] + high[0]), y, 0.5 * (near[:, 2].min() + near[:, 2].max())])
