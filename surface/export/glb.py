"""Write a head as binary glTF 2.0: a node a part, a morph target a shape (glTF 2.0 specification, sections 3 and 4)."""

from __future__ import annotations

import json
import struct
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array
from surface.base.errors import ExportError
from surface.export.exporter import Exporter
from surface.export.png import png_bytes
from surface.export.shapes import Piece, pieces_of
from surface.head import Head
from surface.head.model.parameters import ANGLES

METRES = np.float32(0.001)
FLOAT, BYTE, UINT = 5126, 5121, 5125
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
SPARSE = 0.5  # targets that move less than this share of a part's vertices are kept as sparse accessors


def write_glb(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """See :func:`surface.export.export_head`."""
    turned = [n for n, v in pose.items() if n in ANGLES and v]
    if turned:
        raise ExportError(f"{turned[0]}: angles are no morph targets", hint="export an .obj in this pose")
    content = Document(head, pieces_of(head), pose).bytes()
    new = path.with_name(path.name + ".new")
    try:
        new.write_bytes(content)
        new.replace(path)
    finally:
        if path.parent.is_dir():
            new.unlink(missing_ok=True)
    return [path]


EXPORTER = Exporter(
    api=1,
    kind="glb",
    title="all parts, materials, and one morph target a shape",
    suffixes=(".glb",),
    write=write_glb,
)


@cache
def materials() -> dict[str, Any]:
    """The table of materials beside this module."""
    return tomllib.loads(Path(__file__).with_name("materials.toml").read_text(encoding="utf-8"))


class Document:
    """A glTF document in the making."""

    def __init__(self, head: Head, pieces: list[Piece], pose: Mapping[str, float]) -> None:
        self._data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._images: list[dict[str, Any]] = []
        self._pose = pose
        meshes = [self._mesh(piece) for piece in pieces]
        nodes: list[dict[str, Any]] = [{"name": head.name, "children": list(range(1, len(pieces) + 1))}]
        for k, piece in enumerate(pieces):
            node = {"name": piece.name, "mesh": k}
            nodes.append(node | ({"translation": (METRES * piece.pivot).tolist()} if piece.pivot.any() else {}))
        self._document = {
            "asset": self._asset(head), "scene": 0, "scenes": [{"name": head.name, "nodes": [0]}], "nodes": nodes,
            "meshes": meshes, "materials": self._materials, "accessors": self._accessors, "bufferViews": self._views,
        }  # fmt: skip
        if self._images:
            self._document |= {
                "images": self._images, "textures": [{"source": 0, "sampler": 0}],
                "samplers": [{"magFilter": 9729, "minFilter": 9729, "wrapS": 10497, "wrapT": 33071}],
            }  # fmt: skip

    def bytes(self) -> bytes:
        """The whole .glb."""
        self._pad()
        document = self._document | {"buffers": [{"byteLength": len(self._data)}]}
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=True).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self._data), 0x004E4942) + bytes(self._data)
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks

    @staticmethod
    def _asset(head: Head) -> dict[str, Any]:
        provenance = {k: str(v) for k, v in head.data.provenance.items()}
        source = "; ".join(v for k, v in provenance.items() if k in ("source_name", "source_licence"))
        out: dict[str, Any] = {"version": "2.0", "generator": "omote", "extras": provenance}
        return out | ({"copyright": source} if source else {})

    def _mesh(self, piece: Piece) -> dict[str, Any]:
        local = (METRES * (piece.vertices - piece.pivot.astype(np.float32))).astype(np.float32)
        attributes = {
            "POSITION": self._floats(local, bounds=True),
            "NORMAL": self._floats(piece.normals),
            "TEXCOORD_0": self._floats(np.column_stack([piece.uv[:, 0], 1.0 - piece.uv[:, 1]]).astype(np.float32)),
        }
        if piece.colours is not None:
            attributes["COLOR_0"] = self._floats(piece.colours)
        indices = self._add(piece.triangles.astype(np.uint32).ravel(), UINT, "SCALAR", ELEMENT_BUFFER)
        primitive: dict[str, Any] = {
            "attributes": attributes, "indices": indices, "material": self._material(piece), "mode": 4,
        }  # fmt: skip
        mesh: dict[str, Any] = {"name": piece.name, "primitives": [primitive]}
        if piece.moves:
            primitive["targets"] = [
                {"POSITION": self._target(METRES * move, bounds=True), "NORMAL": self._target(piece.turns[name])}
                for name, move in piece.moves.items()
            ]
            mesh["extras"] = {"targetNames": list(piece.moves)}
            mesh["weights"] = [float(self._pose.get(name, 0.0)) for name in piece.moves]
        return mesh

    def _material(self, piece: Piece) -> int:
        table = materials().get(piece.material, materials()["skin"])
        name = f"{piece.material}_painted" if piece.colours is not None else piece.material
        for k, made in enumerate(self._materials):
            if made["name"] == name:
                return k
        colour = [1.0, 1.0, 1.0] if piece.colours is not None else table["colour"]
        surface: dict[str, Any] = {
            "baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": table["roughness"],
        }  # fmt: skip
        if "texture" in table:
            surface["baseColorTexture"] = {"index": self._eye_texture()}
        made = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": table.get("two_sided", False)}
        self._materials.append(made)
        return len(self._materials) - 1

    def _eye_texture(self) -> int:
        """Iris and pupil along v; the texture's first row is its top, where v is 1."""
        if not self._images:
            stops = materials()["eye_texture"]
            at, colours = [s["v"] for s in stops], np.array([s["colour"] for s in stops])
            v = 1.0 - (np.arange(256) + 0.5) / 256
            column = np.stack([np.interp(v, at, colours[:, k]) for k in range(3)], axis=1)
            picture = np.repeat(np.rint(255 * column).astype(np.uint8)[:, None], 4, axis=1)
            view = self._view(np.frombuffer(png_bytes(picture), np.uint8), None)
            self._images.append({"name": "eye", "mimeType": "image/png", "bufferView": view})
        return 0

    def _target(self, rows: NDArray[np.float32], *, bounds: bool = False) -> int:
        """An accessor of displacements, sparse where most vertices rest."""
        rows = rows.astype(np.float32)
        ids = np.flatnonzero(rows.any(axis=1))
        if not 0 < len(ids) < SPARSE * len(rows):
            return self._floats(rows, bounds=bounds)
        entry = {
            "componentType": FLOAT, "count": len(rows), "type": "VEC3",
            "sparse": {
                "count": len(ids),
                "indices": {"bufferView": self._view(ids.astype(np.uint32), None), "componentType": UINT},
                "values": {"bufferView": self._view(rows[ids], None)},
            },
        }  # fmt: skip
        self._accessors.append(entry | (_bounds(rows) if bounds else {}))
        return len(self._accessors) - 1

    def _floats(self, rows: NDArray[np.float32], *, bounds: bool = False) -> int:
        kind = {2: "VEC2", 3: "VEC3"}[rows.shape[1]]
        rows = np.ascontiguousarray(rows, np.float32)
        return self._add(rows, FLOAT, kind, ARRAY_BUFFER, _bounds(rows) if bounds else {})

    def _add(self, array: Array, component: int, kind: str, target: int, more: dict[str, Any] | None = None) -> int:
        entry = {"bufferView": self._view(array, target), "componentType": component, "count": len(array), "type": kind}
        self._accessors.append(entry | (more or {}))
        return len(self._accessors) - 1

    def _view(self, array: Array, target: int | None) -> int:
        self._pad()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": array.nbytes}
        self._views.append(view | ({} if target is None else {"target": target}))
        self._data += array.tobytes()
        return len(self._views) - 1

    def _pad(self) -> None:
        self._data += b"\0" * (-len(self._data) % 4)


def _bounds(rows: NDArray[np.float32]) -> dict[str, list[float]]:
    return {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
