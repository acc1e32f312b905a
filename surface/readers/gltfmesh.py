"""From a glTF scene to one mesh: nodes, skins in their rest pose, primitives, morph targets.

Vertices that an exporter doubled along texture seams become one again, when place and all displacements agree: lips
that touch but move apart stay two.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.readers.gltf import Gltf
from surface.readers.meshdata import MeshData, check_size

WELD = 1e-6  # of the mesh's size: vertices nearer than this are one
MODES = {4: "triangles", 5: "strip", 6: "fan"}


@dataclass
class _Primitive:
    """One primitive in world space."""

    name: str
    vertices: Floats
    triangles: NDArray[np.int64]
    uv: Floats | None
    moves: dict[str, Floats] = field(default_factory=dict)


def read_gltf(path: Path) -> MeshData:
    """All triangles of the file's scene as one mesh.

    Raises
    ------
    FitError : the file is damaged, cut short or too large, or has no triangles; names file and element.
    """
    try:
        return _read(Gltf(path))
    except (TypeError, KeyError, AttributeError, OverflowError, MemoryError) as e:
        raise FitError(f"{path}: is damaged ({type(e).__name__}: {e})", hint="export the file again") from e


def _read(file: Gltf) -> MeshData:
    found: list[_Primitive] = []
    total = 0
    for node, matrix in _nodes(file):
        for primitive in _primitives(file, node, matrix):
            found.append(primitive)
            total += len(primitive.vertices)
            check_size(str(file.path), total, len({n for p in found for n in p.moves}))
    if not found:
        raise file.bad("scene", "holds no triangles", "export the head's mesh, not only its skeleton")
    return _weld(_joined(found))


def _nodes(file: Gltf) -> list[tuple[int, Floats]]:
    """Every node of the scene with its world matrix (4, 4)."""
    every = file.items("nodes")
    roots = _roots(file, len(every))
    out: list[tuple[int, Floats]] = []
    todo, seen = [(root, np.eye(4)) for root in reversed(roots)], set()
    while todo:
        index, above = todo.pop()
        node = file.item("nodes", index, "scene")
        if index in seen:
            raise file.bad(f"nodes[{index}]", "is its own ancestor, or stands in the scene twice")
        seen.add(index)
        matrix = above @ _local(file, node, f"nodes[{index}]")
        out.append((index, matrix))
        todo += [(child, matrix) for child in reversed(file.value(node, "children", list, f"nodes[{index}]", []))]
    return out


def _roots(file: Gltf, count: int) -> list[Any]:
    if file.items("scenes"):
        scene = file.item("scenes", file.document.get("scene", 0), "scene")
        return list(file.value(scene, "nodes", list, "scene", []))
    children = {c for n in file.items("nodes") if isinstance(n, dict) for c in n.get("children", [])}
    return [i for i in range(count) if i not in children]


def _local(file: Gltf, node: dict[str, Any], where: str) -> Floats:
    """A node's own matrix (4, 4)."""
    if "matrix" in node:
        return _numbers(file, node, "matrix", 16, where, None).reshape(4, 4).T
    out = np.eye(4)
    x, y, z, w = _numbers(file, node, "rotation", 4, where, [0.0, 0.0, 0.0, 1.0])
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    out[:3, :3] = turn * _numbers(file, node, "scale", 3, where, [1.0, 1.0, 1.0])
    out[:3, 3] = _numbers(file, node, "translation", 3, where, [0.0, 0.0, 0.0])
    return out


def _numbers(file: Gltf, table: dict[str, Any], key: str, count: int, where: str, default: Any) -> Floats:
    raw = file.value(table, key, list, where, default)
    try:
        out = np.array(raw, float)
    except (TypeError, ValueError) as e:
        raise file.bad(f"{where}.{key}", "holds something that is not a number") from e
    if out.shape != (count,) or not np.isfinite(out).all():
        raise file.bad(f"{where}.{key}", f"needs {count} finite numbers")
    return out


def _primitives(file: Gltf, index: int, matrix: Floats) -> list[_Primitive]:
    """The primitives of a node's mesh that are made of triangles, in world space."""
    node = file.item("nodes", index, "scene")
    if "mesh" not in node:
        return []
    mesh, where = file.item("meshes", node["mesh"], f"nodes[{index}].mesh"), f"meshes[{node['mesh']}]"
    title = str(node.get("name") or mesh.get("name") or where)
    joints = _joint_matrices(file, node, index) if "skin" in node else None
    out = []
    for k, table in enumerate(file.value(mesh, "primitives", list, where)):
        if not isinstance(table, dict):
            raise file.bad(f"{where}.primitives[{k}]", "is no object")
        if table.get("mode", 4) in MODES:
            out.append(_primitive(file, mesh, table, f"{where}.primitives[{k}]", title, matrix, joints))
    return out


def _primitive(
    file: Gltf, mesh: dict[str, Any], table: dict[str, Any], where: str, title: str, matrix: Floats,
    joints: Floats | None,
) -> _Primitive:  # fmt: skip
    attributes = file.value(table, "attributes", dict, where)
    vertices = file.floats(file.value(attributes, "POSITION", int, where), 3, f"{where}.POSITION")
    uv = None
    if "TEXCOORD_0" in attributes:
        uv = file.floats(attributes["TEXCOORD_0"], 2, f"{where}.TEXCOORD_0") * [1.0, -1.0] + [0.0, 1.0]
        _same_count(file, where, "TEXCOORD_0", uv, vertices)
    place = _Placing(matrix) if joints is None else _skinned(file, attributes, joints, len(vertices), where)
    moves = {name: place.turn(delta) for name, delta in _targets(file, mesh, table, len(vertices), where).items()}
    corners = _triangles(file, table, len(vertices), where)
    if place.mirrors:
        corners = corners[:, [0, 2, 1]]
    material = table.get("material")
    if isinstance(material, int) and len(file.items("materials")) > material >= 0:
        title = f"{title}/{file.item('materials', material, where).get('name', material)}"
    return _Primitive(title, place.move(vertices), corners, uv, moves)


def _same_count(file: Gltf, where: str, key: str, got: NDArray[np.floating], vertices: Floats) -> None:
    if len(got) != len(vertices):
        raise file.bad(f"{where}.{key}", f"has {len(got)} elements for {len(vertices)} vertices")


class _Placing:
    """Matrices (4, 4) or one for each vertex (n, 4, 4), applied to points and to displacements."""

    def __init__(self, matrix: Floats) -> None:
        self.matrix = matrix

    @property
    def mirrors(self) -> bool:
        """Does it turn the surface inside out?"""
        return bool(np.median(np.linalg.det(self.matrix[..., :3, :3])) < 0)

    def turn(self, rows: Floats) -> Floats:
        """Displacements (n, 3)."""
        turned: Floats = np.einsum("...ij,...j->...i", self.matrix[..., :3, :3], rows)
        return turned

    def move(self, points: Floats) -> Floats:
        """Points (n, 3)."""
        return self.turn(points) + self.matrix[..., :3, 3]


def _joint_matrices(file: Gltf, node: dict[str, Any], index: int) -> Floats:
    """(j, 4, 4) from bind space to the world, joints as they stand."""
    where = f"nodes[{index}].skin"
    skin = file.item("skins", node["skin"], where)
    world = dict(_nodes(file))
    joints = file.value(skin, "joints", list, where)
    if any(j not in world for j in joints) or not joints:
        raise file.bad(where, "names a joint that is not in the scene")
    out = np.stack([world[j] for j in joints])
    if "inverseBindMatrices" in skin:
        inverse = file.floats(skin["inverseBindMatrices"], 16, where)
        if len(inverse) != len(joints):
            raise file.bad(where, f"has {len(inverse)} matrices for {len(joints)} joints")
        out = out @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
    return out


def _skinned(file: Gltf, attributes: dict[str, Any], joints: Floats, count: int, where: str) -> _Placing:
    """Linear blend skinning in the pose the file is in."""
    for key in ("JOINTS_0", "WEIGHTS_0"):
        if key not in attributes:
            raise file.bad(f"{where}.{key}", "is missing in a skinned mesh")
    ids = file.integers(attributes["JOINTS_0"], f"{where}.JOINTS_0", 4)
    weights = file.floats(attributes["WEIGHTS_0"], 4, f"{where}.WEIGHTS_0")
    if len(ids) != count or len(weights) != count or ids.max(initial=0) >= len(joints):
        raise file.bad(where, "joints and weights do not fit the mesh")
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    return _Placing(np.einsum("nk,nkij->nij", weights, joints[ids]))


def _targets(
    file: Gltf, mesh: dict[str, Any], table: dict[str, Any], count: int, where: str
) -> dict[str, Floats]:  # fmt: skip
    """Displacements (n, 3) by name."""
    targets = file.value(table, "targets", list, where, [])
    given = _extra_names(mesh) or _extra_names(table)
    names = [given[k] if k < len(given) else f"target{k}" for k in range(len(targets))]
    out = {}
    for k, (name, target) in enumerate(zip(names, targets, strict=True)):
        at = f"{where}.targets[{k}] ({name})"
        if not isinstance(target, dict):
            raise file.bad(at, "is no object")
        if name in out:
            raise file.bad(at, "this name stands there twice", "give every shape its own name")
        if "POSITION" in target:
            out[name] = file.floats(target["POSITION"], 3, at)
            if len(out[name]) != count:
                raise file.bad(at, f"has {len(out[name])} displacements for {count} vertices")
    return out


def _extra_names(table: dict[str, Any]) -> list[str]:
    extras = table.get("extras")
    names = extras.get("targetNames") if isinstance(extras, dict) else None
    return [str(n) for n in names] if isinstance(names, list) else []


def _triangles(file: Gltf, table: dict[str, Any], count: int, where: str) -> NDArray[np.int64]:
    """(t, 3) corners; strips and fans are taken apart."""
    given = "indices" in table
    index = file.integers(table["indices"], f"{where}.indices").ravel() if given else np.arange(count)
    wrong = np.flatnonzero(index >= count)
    if len(wrong):
        raise file.bad(f"{where}.indices, element {wrong[0]}", f"points at vertex {index[wrong[0]]} of {count}")
    mode = table.get("mode", 4)
    if mode == 4:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    k = np.arange(max(len(index) - 2, 0))
    if mode == 6:
        return np.column_stack([index[np.zeros_like(k)], index[k + 1], index[k + 2]])
    return np.column_stack([index[k], index[k + 1 + k % 2], index[k + 2 - k % 2]])


def _joined(found: list[_Primitive]) -> MeshData:
    """All primitives as one mesh, nothing welded."""
    names = tuple(dict.fromkeys(n for p in found for n in p.moves))
    starts = np.cumsum([0, *(len(p.vertices) for p in found)])
    deltas = np.zeros((len(names), int(starts[-1]), 3))
    for p, start in zip(found, starts, strict=False):
        for k, name in enumerate(names):
            if name in p.moves:
                deltas[k, start : start + len(p.vertices)] = p.moves[name]
    corners = np.concatenate([p.triangles + s for p, s in zip(found, starts, strict=False)])
    faces = np.column_stack([corners, np.full(len(corners), -1)])
    piece = np.repeat(np.arange(len(found)), [len(p.triangles) for p in found])
    mapped = np.array([p.uv is not None for p in found])[piece]
    uv = np.concatenate([np.zeros((len(p.vertices), 2)) if p.uv is None else p.uv for p in found])
    return MeshData(
        np.concatenate([p.vertices for p in found]), faces, uv, np.where(mapped[:, None], faces, -1), names, deltas,
        piece, tuple(p.name for p in found),
    )  # fmt: skip


def _weld(mesh: MeshData) -> MeshData:
    """Border vertices with one place and one motion become one; triangles without area are dropped.

    Where that would make more than two triangles meet in an edge, two sheets lie on each other and stay apart.
    """
    group = _groups(mesh)
    for _ in range(3):
        doubled = _crowded(group[mesh.faces[:, :3]], len(mesh.vertices))
        if not len(doubled):
            break
        group = np.where(np.isin(group, doubled), np.arange(len(group)), group)
    kept, inverse = np.unique(group, return_inverse=True)
    faces = np.where(mesh.faces >= 0, inverse.ravel()[mesh.faces], -1)
    a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
    good = (a != b) & (b != c) & (c != a)
    return MeshData(
        mesh.vertices[kept], faces[good], mesh.uv, mesh.face_uv[good], mesh.names, mesh.deltas[:, kept],
        mesh.piece[good], mesh.pieces,
    )  # fmt: skip


def _groups(mesh: MeshData) -> NDArray[np.int64]:
    """(n,) for every vertex the first one that it is one with."""
    n = len(mesh.vertices)
    one, two = _edges(mesh.faces[:, :3])
    _, at, count = np.unique(np.minimum(one, two) * n + np.maximum(one, two), return_index=True, return_counts=True)
    border = np.unique(np.concatenate([one[at[count == 1]], two[at[count == 1]]]))
    step = max(float(np.ptp(mesh.vertices, axis=0).max(initial=0.0)) * WELD, 1e-30)
    keys = np.concatenate([mesh.vertices[None, border], mesh.deltas[:, border]]).transpose(1, 0, 2)
    flat = keys.reshape(len(border), 3 * (1 + len(mesh.names)))
    rounded = np.ascontiguousarray(np.round(flat / step)) + 0.0  # no negative zeros
    rows = rounded.view(np.dtype((np.void, rounded.shape[1] * 8))).ravel()
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    out = np.arange(n)
    out[border] = border[first[inverse.ravel()]]
    return out


def _edges(triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return triangles.ravel(), triangles[:, [1, 2, 0]].ravel()


def _crowded(triangles: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Vertices at edges that more than two triangles share, or two in one direction."""
    a, b, c = triangles.T
    one, two = _edges(triangles[(a != b) & (b != c) & (c != a)])
    out = []
    for key, most in ((np.minimum(one, two) * n + np.maximum(one, two), 2), (one * n + two, 1)):
        _, at, count = np.unique(key, return_index=True, return_counts=True)
        out += [one[at[count > most]], two[at[count > most]]]
    return np.unique(np.concatenate(out))
