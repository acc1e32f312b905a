"""Reader of glTF scenes as one mesh: nodes, skins in their rest pose, primitives, morph targets.

Vertices that an exporter duplicated along texture seams are welded where position and all displacements agree: lips
that touch but move apart stay two.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import FitError
from surface.readers.gltf.container import Gltf
from surface.readers.gltf.materials import read_materials
from surface.readers.gltf.targets import TargetNames, read_expressions
from surface.readers.meshdata import Material, MeshData, check_size

WELD = 1e-6  # of the mesh's size: vertices nearer than this are welded
TRIANGLES, STRIP, FAN = 4, 5, 6  # modes of a primitive


@dataclass(frozen=True)
class _Primitive:
    """One primitive in world space."""

    name: str
    vertices: Floats
    triangles: Ints
    uv: Floats | None
    deltas: dict[str, Floats]
    material: int | None = None
    colours: Floats | None = None


def read_gltf(path: Path) -> MeshData:
    """Return all triangles of the file's scene as one mesh.

    Raises FitError: the file is damaged, cut short or too large, or has no triangles; names file and element.
    """
    try:
        return _read(Gltf(path))
    except (TypeError, KeyError, AttributeError, OverflowError, MemoryError) as e:
        raise FitError(f"{path}: is damaged ({type(e).__name__}: {e})", hint="export the file again") from e


def _read(file: Gltf) -> MeshData:
    found: list[_Primitive] = []
    total = 0
    world, names = _world_matrices(file), TargetNames(file)
    for index in world:
        for primitive in _primitives(file, index, world, names):
            found.append(primitive)
            total += len(primitive.vertices)
            check_size(str(file.path), total, len({n for p in found for n in p.deltas}))
    if not found:
        raise file.error("scene", "holds no triangles", "export the head's mesh, not only its skeleton")
    return replace(_weld(_join(found, read_materials(file))), expressions=read_expressions(file, names))


def _world_matrices(file: Gltf) -> dict[int, Floats]:
    """Return world matrix (4, 4) by node of the scene, in the order of the scene's tree."""
    out: dict[int, Floats] = {}
    stack = [(root, np.eye(4)) for root in reversed(_roots(file))]
    while stack:
        index, parent = stack.pop()
        node, where = file.item("nodes", index, "scene"), f"nodes[{index}]"
        if index in out:
            raise file.error(where, "is its own ancestor, or is in the scene twice")
        out[index] = parent @ _local_matrix(file, node, where)
        stack += [(child, out[index]) for child in reversed(file.value(node, "children", list, where, []))]
    return out


def _roots(file: Gltf) -> list[Any]:
    if file.items("scenes"):
        scene = file.item("scenes", file.document.get("scene", 0), "scene")
        return list(file.value(scene, "nodes", list, "scene", []))
    nodes = file.items("nodes")
    children = {c for n in nodes if isinstance(n, dict) for c in n.get("children", [])}
    return [i for i in range(len(nodes)) if i not in children]


def _local_matrix(file: Gltf, node: dict[str, Any], where: str) -> Floats:
    """Return a node's own matrix (4, 4)."""
    if "matrix" in node:
        return _numbers(file, node, "matrix", where, [None] * 16).reshape(4, 4).T
    out = np.eye(4)
    x, y, z, w = _numbers(file, node, "rotation", where, [0.0, 0.0, 0.0, 1.0])
    rotation = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    out[:3, :3] = rotation * _numbers(file, node, "scale", where, [1.0, 1.0, 1.0])
    out[:3, 3] = _numbers(file, node, "translation", where, [0.0, 0.0, 0.0])
    return out


def _numbers(file: Gltf, table: dict[str, Any], key: str, where: str, default: list[Any]) -> Floats:
    """Return finite numbers of a key, as many as the default has."""
    try:
        out = np.array(file.value(table, key, list, where, default), float)
    except (TypeError, ValueError) as e:
        raise file.error(f"{where}.{key}", "holds something that is not a number") from e
    if out.shape != (len(default),) or not np.isfinite(out).all():
        raise file.error(f"{where}.{key}", f"needs {len(default)} finite numbers")
    return out


def _primitives(file: Gltf, index: int, world: dict[int, Floats], names: TargetNames) -> list[_Primitive]:
    """Return the primitives of a node's mesh that are made of triangles, in world space."""
    node = file.item("nodes", index, "scene")
    if "mesh" not in node:
        return []
    mesh, where = file.item("meshes", node["mesh"], f"nodes[{index}].mesh"), f"meshes[{node['mesh']}]"
    name = str(node.get("name") or mesh.get("name") or where)
    joints = _joint_matrices(file, node, index, world) if "skin" in node else None
    out = []
    for k, table in enumerate(file.value(mesh, "primitives", list, where)):
        at = f"{where}.primitives[{k}]"
        if not isinstance(table, dict):
            raise file.error(at, "is no object")
        if table.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN):
            out.append(_primitive(file, table, at, name, names.of(node["mesh"]), world[index], joints))
    return out


def _primitive(
    file: Gltf, table: dict[str, Any], where: str, name: str, target_names: list[str], matrix: Floats,
    joints: Floats | None,
) -> _Primitive:  # fmt: skip
    attributes = file.value(table, "attributes", dict, where)
    vertices = file.floats(file.value(attributes, "POSITION", int, where), 3, f"{where}.POSITION")
    uv = None
    if "TEXCOORD_0" in attributes:
        uv = file.floats(attributes["TEXCOORD_0"], 2, f"{where}.TEXCOORD_0") * [1.0, -1.0] + [0.0, 1.0]
        if len(uv) != len(vertices):
            raise file.error(f"{where}.TEXCOORD_0", f"has {len(uv)} elements for {len(vertices)} vertices")
    if joints is not None:
        matrix = _skin_matrices(file, attributes, joints, len(vertices), where)
    linear = matrix[..., :3, :3]
    deltas = _targets(file, table, target_names, len(vertices), where)
    deltas = {name: _apply(linear, delta) for name, delta in deltas.items()}
    triangles = _triangles(file, table, len(vertices), where)
    if np.median(np.linalg.det(linear)) < 0:  # a mirroring matrix turns the surface inside out
        triangles = triangles[:, [0, 2, 1]]
    colours = _colours(file, attributes, len(vertices), where) if "COLOR_0" in attributes else None
    material = table.get("material")
    if isinstance(material, int) and len(file.items("materials")) > material >= 0:
        name = f"{name}/{file.item('materials', material, where).get('name', material)}"
    else:
        material = None
    return _Primitive(name, _apply(linear, vertices) + matrix[..., :3, 3], triangles, uv, deltas, material, colours)


def _colours(file: Gltf, attributes: dict[str, Any], count: int, where: str) -> Floats | None:
    """Return (count, 3): linear RGB of vertices, 0..1 (glTF 2.0 specification, section 3.7.2.1); None where they are
    damaged, for they do not change where a mesh lies."""
    index, name = attributes["COLOR_0"], f"{where}.COLOR_0"
    try:
        width = 4 if file.item("accessors", index, name).get("type") == "VEC4" else 3
        rgb: Floats = np.clip(file.floats(index, width, name)[:, :3], 0.0, 1.0)
    except FitError:
        return None
    return rgb if len(rgb) == count else None


def _apply(matrices: Floats, rows: Floats) -> Floats:
    """Return one matrix (3, 3), or one for each row (n, 3, 3), times vectors (n, 3)."""
    out: Floats = np.einsum("...ij,...j->...i", matrices, rows)
    return out


def _joint_matrices(file: Gltf, node: dict[str, Any], index: int, world: dict[int, Floats]) -> Floats:
    """Return (j, 4, 4): from bind space to the world, joints in the pose of the file."""
    where = f"nodes[{index}].skin"
    skin = file.item("skins", node["skin"], where)
    joints = file.value(skin, "joints", list, where)
    if any(j not in world for j in joints) or not joints:
        raise file.error(where, "names a joint that is not in the scene")
    out = np.stack([world[j] for j in joints])
    if "inverseBindMatrices" in skin:
        inverse = file.floats(skin["inverseBindMatrices"], 16, where)
        if len(inverse) != len(joints):
            raise file.error(where, f"has {len(inverse)} matrices for {len(joints)} joints")
        out = out @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
    return out


def _skin_matrices(file: Gltf, attributes: dict[str, Any], joints: Floats, count: int, where: str) -> Floats:
    """Return linear blend skinning: a matrix for each vertex, (count, 4, 4)."""
    for key in ("JOINTS_0", "WEIGHTS_0"):
        if key not in attributes:
            raise file.error(f"{where}.{key}", "is missing in a skinned mesh")
    ids = file.integers(attributes["JOINTS_0"], f"{where}.JOINTS_0", 4)
    weights = file.floats(attributes["WEIGHTS_0"], 4, f"{where}.WEIGHTS_0")
    if len(ids) != count or len(weights) != count or ids.max(initial=0) >= len(joints):
        raise file.error(where, "joints and weights do not fit the mesh")
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    out: Floats = np.einsum("nk,nkij->nij", weights, joints[ids])
    return out


def _targets(file: Gltf, table: dict[str, Any], names: list[str], count: int, where: str) -> dict[str, Floats]:
    """Return displacements (count, 3) of the morph targets by name."""
    out = {}
    for k, target in enumerate(file.value(table, "targets", list, where, [])):
        name = names[k]
        at = f"{where}.targets[{k}] ({name})"
        if not isinstance(target, dict):
            raise file.error(at, "is no object")
        if "POSITION" in target:
            out[name] = file.floats(target["POSITION"], 3, at)
            if len(out[name]) != count:
                raise file.error(at, f"has {len(out[name])} displacements for {count} vertices")
    return out


def _triangles(file: Gltf, table: dict[str, Any], count: int, where: str) -> Ints:
    """Return (t, 3): vertex ids of triangles, of a strip's or of a fan's."""
    index = np.arange(count)
    if "indices" in table:
        index = file.integers(table["indices"], f"{where}.indices").ravel()
    wrong = np.flatnonzero(index >= count)
    if len(wrong):
        raise file.error(f"{where}.indices, element {wrong[0]}", f"points at vertex {index[wrong[0]]} of {count}")
    mode = table.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    k = np.arange(max(len(index) - 2, 0))
    if mode == FAN:
        return np.column_stack([index[np.zeros_like(k)], index[k + 1], index[k + 2]])
    return np.column_stack([index[k], index[k + 1 + k % 2], index[k + 2 - k % 2]])


def _join(found: list[_Primitive], materials: list[Material]) -> MeshData:
    """Return all primitives as one mesh, nothing welded."""
    names = tuple(dict.fromkeys(n for p in found for n in p.deltas))
    starts = np.cumsum([0, *(len(p.vertices) for p in found)]).tolist()
    deltas = np.zeros((len(names), starts[-1], 3))
    for p, start, stop in zip(found, starts, starts[1:], strict=False):
        for name, delta in p.deltas.items():
            deltas[names.index(name), start:stop] = delta
    corners = np.concatenate([p.triangles + start for p, start in zip(found, starts, strict=False)])
    faces = np.column_stack([corners, np.full(len(corners), -1)])
    piece = np.repeat(np.arange(len(found)), [len(p.triangles) for p in found])
    has_uv = np.array([p.uv is not None for p in found])[piece]
    uv = np.concatenate([np.zeros((len(p.vertices), 2)) if p.uv is None else p.uv for p in found])
    colours = tuple(None if p.material is None else materials[p.material] for p in found)
    of_vertices = None
    if any(p.colours is not None for p in found):
        of_vertices = np.concatenate([np.ones_like(p.vertices) if p.colours is None else p.colours for p in found])
    return MeshData(
        np.concatenate([p.vertices for p in found]), faces, uv, np.where(has_uv[:, None], faces, -1), names, deltas,
        piece, tuple(p.name for p in found), colours, colours=of_vertices,
    )  # fmt: skip


def _weld(mesh: MeshData) -> MeshData:
    """Weld border vertices with equal positions and displacements; triangles without area are dropped.

    Where that would make more than two triangles meet in an edge, two sheets lie on each other and stay apart.
    """
    group = _groups(mesh)
    for _ in range(3):
        crowded = _non_manifold(group[mesh.faces[:, :3]], len(mesh.vertices))
        if not len(crowded):
            break
        group = np.where(np.isin(group, crowded), np.arange(len(group)), group)
    kept, inverse = np.unique(group, return_inverse=True)
    faces = np.where(mesh.faces >= 0, inverse.ravel()[mesh.faces], -1)
    good = _has_area(faces)
    return replace(
        mesh, vertices=mesh.vertices[kept], faces=faces[good], face_uv=mesh.face_uv[good], deltas=mesh.deltas[:, kept],
        piece=mesh.piece[good], colours=None if mesh.colours is None else mesh.colours[kept],
    )  # fmt: skip


def _has_area(triangles: Ints) -> np.ndarray:
    """Whether the three vertices of each triangle differ, (t,) bool."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return np.asarray((a != b) & (b != c) & (c != a))


def _groups(mesh: MeshData) -> Ints:
    """Return (n,): for every vertex the first one that it is welded with."""
    n = len(mesh.vertices)
    start, end, key = _edges(mesh.faces[:, :3], n)
    _, at, count = np.unique(key, return_index=True, return_counts=True)
    border = np.unique(np.concatenate([start[at[count == 1]], end[at[count == 1]]]))
    step = max(float(np.ptp(mesh.vertices, axis=0).max(initial=0.0)) * WELD, 1e-30)
    keys = np.concatenate([mesh.vertices[None, border], mesh.deltas[:, border]]).transpose(1, 0, 2)
    flat = keys.reshape(len(border), 3 * (1 + len(mesh.names)))
    rounded = np.ascontiguousarray(np.round(flat / step)) + 0.0  # no negative zeros
    rows = rounded.view(np.dtype((np.void, rounded.shape[1] * 8))).ravel()
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    out = np.arange(n)
    out[border] = border[first[inverse.ravel()]]
    return out


def _edges(triangles: Ints, n: int) -> tuple[Ints, Ints, Ints]:
    """Start and end of every triangle's edges, and a number for each that is equal in both directions."""
    start, end = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    return start, end, np.minimum(start, end) * n + np.maximum(start, end)


def _non_manifold(triangles: Ints, n: int) -> Ints:
    """Return vertices at edges that more than two triangles share, or two in one direction."""
    start, end, both = _edges(triangles[_has_area(triangles)], n)
    out = []
    for key, most in ((both, 2), (start * n + end, 1)):
        _, at, count = np.unique(key, return_index=True, return_counts=True)
        out += [start[at[count > most]], end[at[count > most]]]
    return np.unique(np.concatenate(out))
