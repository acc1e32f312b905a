"""Mesh files made for tests: GLB with morph targets, OBJ with shapes; and other layouts of one mesh."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from surface.fit.source.mesh import FitMesh, triangles

FLOAT, UINT = 5126, 5125


class GlbBuilder:
    """Collects accessors and writes a .glb; ``document`` may be changed before :meth:`save`."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}], "accessors": [], "bufferViews": [],
        }  # fmt: skip
        self.data = b""

    def view(self, array: np.ndarray) -> int:
        """A buffer view that holds the array."""
        self.data += b"\0" * (-len(self.data) % 4)
        self.document["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes})
        self.data += array.tobytes()
        return len(self.document["bufferViews"]) - 1

    def accessor(self, array: np.ndarray, component: int, kind: str, **other: Any) -> int:
        """An accessor over a new view."""
        entry = {"bufferView": self.view(array), "componentType": component, "count": len(array), "type": kind, **other}
        if kind == "VEC3" and component == FLOAT and len(array):
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.document["accessors"].append(entry)
        return len(self.document["accessors"]) - 1

    def sparse(self, array: np.ndarray) -> int:
        """A sparse accessor of float triples over zeros."""
        ids = np.flatnonzero(np.abs(array).max(axis=1) > 0)
        self.document["accessors"].append({
            "componentType": FLOAT, "count": len(array), "type": "VEC3",
            "sparse": {
                "count": len(ids),
                "indices": {"bufferView": self.view(ids.astype(np.uint32)), "componentType": UINT},
                "values": {"bufferView": self.view(array[ids].astype(np.float32))},
            },
        })  # fmt: skip
        return len(self.document["accessors"]) - 1

    def bytes(self) -> bytes:
        """The file."""
        self.document["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def meshopt_stream(data: bytes, stride: int) -> bytes:
    """A stream of attributes as EXT_meshopt_compression defines it, all differences stored as whole bytes."""
    plain = np.frombuffer(data, np.uint8).reshape(-1, stride)
    steps = np.diff(plain, axis=0, prepend=np.zeros((1, stride), np.uint8)).astype(np.int8).astype(int)
    coded, out = np.where(steps < 0, -2 * steps - 1, 2 * steps).astype(np.uint8), b"\xa0"
    room = min((8192 // stride) & ~15, 256)
    for first in range(0, len(plain), room):
        for column in coded[first : first + room].T:
            groups = -(-len(column) // 16)
            out += b"\xff" * -(-groups // 4) + column.tobytes() + bytes(16 * groups - len(column))
    return out + bytes(max(32, stride))


def meshopt_compressed(builder: GlbBuilder) -> GlbBuilder:
    """The same file with all its buffer views compressed."""
    out = GlbBuilder()
    out.document = {**builder.document, "bufferViews": [], "extensionsRequired": ["EXT_meshopt_compression"]}
    for view in builder.document["bufferViews"]:
        plain = builder.data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        at = out.view(np.frombuffer(meshopt_stream(plain, 4), np.uint8))
        packed = {**out.document["bufferViews"][at], "mode": "ATTRIBUTES", "byteStride": 4, "count": len(plain) // 4}
        out.document["bufferViews"][at] = {
            "buffer": 1, "byteLength": len(plain), "extensions": {"EXT_meshopt_compression": packed}
        }  # fmt: skip
    return out


def corners(mesh: FitMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices doubled along texture seams: vertex ids, uv, triangles (t, 3)."""
    tri, tri_uv = triangles(mesh.faces), triangles(mesh.face_uv)
    pairs = np.column_stack([tri.ravel(), tri_uv.ravel()])
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    return unique[:, 0], mesh.uv[unique[:, 1]], inverse.reshape(-1, 3)


def glb(mesh: FitMesh, *, sparse: bool = False, names: bool = True) -> GlbBuilder:
    """A mesh as one primitive, in metres."""
    out = GlbBuilder()
    vertex, uv, tri = corners(mesh)
    points = (0.001 * mesh.vertices[vertex]).astype(np.float32)
    add = out.sparse if sparse else (lambda a: out.accessor(a, FLOAT, "VEC3"))
    primitive = {
        "attributes": {
            "POSITION": out.accessor(points, FLOAT, "VEC3"),
            "TEXCOORD_0": out.accessor((uv * [1, -1] + [0, 1]).astype(np.float32), FLOAT, "VEC2"),
        },
        "indices": out.accessor(tri.astype(np.uint32).ravel(), UINT, "SCALAR"),
        "targets": [{"POSITION": add((0.001 * d[vertex]).astype(np.float32))} for d in mesh.deltas],
    }
    out.document["meshes"][0]["primitives"] = [primitive]
    if names:
        out.document["meshes"][0]["extras"] = {"targetNames": list(mesh.names)}
    return out


def write_obj(path: Path, mesh: FitMesh, shapes: Path | None = None) -> Path:
    """An OBJ in mm, and one a shape in a folder."""

    def text(points: np.ndarray) -> list[str]:
        return [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]

    lines = text(mesh.vertices) + [f"vt {u:.7g} {v:.7g}" for u, v in mesh.uv]
    for face, texture in zip(mesh.faces, mesh.face_uv, strict=True):
        lines.append("f " + " ".join(f"{a + 1}/{b + 1}" for a, b in zip(face, texture, strict=True) if a >= 0))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if shapes is not None:
        shapes.mkdir(exist_ok=True)
        for name, delta in zip(mesh.names, mesh.deltas, strict=True):
            (shapes / f"{name}.obj").write_text("\n".join(text(mesh.vertices + delta)) + "\n", encoding="utf-8")
    return path


def triangulated(mesh: FitMesh) -> FitMesh:
    """Every quad cut in two."""
    cut = [np.column_stack([triangles(a), np.full(len(triangles(a)), -1)]) for a in (mesh.faces, mesh.face_uv)]
    piece = np.concatenate([mesh.piece, mesh.piece[mesh.faces[:, 3] >= 0]]) if len(mesh.piece) else mesh.piece
    return replace(mesh, faces=cut[0], face_uv=cut[1], piece=piece)


def remapped(mesh: FitMesh, island: np.ndarray, place: Any) -> FitMesh:
    """Other texture coordinates: ``place(k, uv)`` of every face's ``island (f,)``; islands share none."""
    uv, face_uv = [], np.full_like(mesh.face_uv, -1)
    start = 0
    for k in np.unique(island):
        own = mesh.face_uv[island == k]
        used, inverse = np.unique(own, return_inverse=True)
        local = inverse.reshape(own.shape) - int(used[0] < 0)
        used = used[used >= 0]
        face_uv[island == k] = np.where(own >= 0, local + start, -1)
        uv.append(place(int(k), mesh.uv[used]))
        start += len(used)
    return replace(mesh, uv=np.concatenate(uv), face_uv=face_uv)
