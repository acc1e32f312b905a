"""Heads as glTF documents (glTF 2.0 specification, sections 3 and 4): a node a part, a morph target a shape."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base import files
from surface.base.arrays import Array, Floats32
from surface.export.shapes import ExportPart
from surface.head import Head

METRES = np.float32(0.001)
FLOAT, UINT = 5126, 5125
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
NEAREST, REPEAT, CLAMP_TO_EDGE = 9729, 10497, 33071
SPARSE = 0.5  # targets that move less than this share of a part's vertices are kept as sparse accessors


@cache
def materials() -> dict[str, Any]:
    """The table of materials beside this module."""
    return files.read_toml(Path(__file__).with_name("materials.toml"))


def png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """(height, width, 3) uint8, top row first, as a PNG file; without Pillow, which exporting does not need.

    (PNG specification, second edition: signature, IHDR, IDAT, IEND.)
    """
    height, width, _ = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    out = b"\x89PNG\r\n\x1a\n"
    for kind, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return out


class Document:
    """A head as a glTF document and its binary chunk, in metres.

    content : the document, to which more may be added before :meth:`bytes`.
    """

    def __init__(self, head: Head, parts: list[ExportPart], pose: Mapping[str, float],
                 extras: Mapping[str, str] = MappingProxyType({})) -> None:  # fmt: skip
        self._data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: dict[str, dict[str, Any]] = {}
        self._images: list[dict[str, Any]] = []
        self._pose = pose
        meshes = [self._mesh(part) for part in parts]
        nodes: list[dict[str, Any]] = [{"name": head.name, "children": list(range(1, len(parts) + 1))}]
        for k, part in enumerate(parts):
            nodes.append({"name": part.name, "mesh": k})
            if part.pivot.any():
                nodes[-1]["translation"] = (METRES * part.pivot).tolist()
        self.content: dict[str, Any] = {
            "asset": _asset(head, extras), "scene": 0, "scenes": [{"name": head.name, "nodes": [0]}], "nodes": nodes,
            "meshes": meshes, "materials": list(self._materials.values()), "accessors": self._accessors,
            "bufferViews": self._views,
        }  # fmt: skip
        if self._images:
            sampler = {
                "magFilter": NEAREST,
                "minFilter": NEAREST,
                "wrapS": REPEAT,
                "wrapT": CLAMP_TO_EDGE,
            }
            textures = [{"source": 0, "sampler": 0}]
            self.content |= {"images": self._images, "textures": textures, "samplers": [sampler]}

    def bytes(self) -> bytes:
        """The whole .glb."""
        self._pad()
        document = self.content | {"buffers": [{"byteLength": len(self._data)}]}
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=True).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self._data), 0x004E4942) + bytes(self._data)
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks

    def _mesh(self, part: ExportPart) -> dict[str, Any]:
        local = METRES * (part.vertices - part.pivot.astype(np.float32))
        attributes = {
            "POSITION": self._floats(local, bounds=True),
            "NORMAL": self._floats(part.normals),
            "TEXCOORD_0": self._floats(np.column_stack([part.uv[:, 0], 1.0 - part.uv[:, 1]])),
        }
        if part.colours is not None:
            attributes["COLOR_0"] = self._floats(part.colours)
        index = part.triangles.astype(np.uint32).ravel()
        indices = self.accessor(index, UINT, "SCALAR", bufferView=self.view(index, ELEMENT_BUFFER))
        primitive: dict[str, Any] = {
            "attributes": attributes, "indices": indices, "material": self._material(part), "mode": 4,
        }  # fmt: skip
        mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
        if part.displacements:
            primitive["targets"] = [
                {
                    "POSITION": self._target(METRES * rows, bounds=True),
                    "NORMAL": self._target(part.normal_changes[name]),
                }
                for name, rows in part.displacements.items()
            ]
            mesh["extras"] = {"targetNames": list(part.displacements)}
            mesh["weights"] = [float(self._pose.get(name, 0.0)) for name in part.displacements]
        return mesh

    def _material(self, part: ExportPart) -> int:
        table = materials().get(part.material, materials()["skin"])
        painted = part.colours is not None
        name = f"{part.material}_painted" if painted else part.material
        if name not in self._materials:
            colour = [1.0, 1.0, 1.0] if painted else table["colour"]
            surface: dict[str, Any] = {
                "baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": table["roughness"],
            }  # fmt: skip
            if "texture" in table:
                surface["baseColorTexture"] = {"index": 0}
                self._add_eye_texture()
            two_sided = table.get("two_sided", False)
            self._materials[name] = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": two_sided}
        return list(self._materials).index(name)

    def _add_eye_texture(self) -> None:
        """Iris and pupil along v; the texture's first row is its top, where v is 1."""
        if not self._images:
            stops = materials()["eye_texture"]
            at, colours = [s["v"] for s in stops], np.array([s["colour"] for s in stops])
            v = 1.0 - (np.arange(256) + 0.5) / 256
            column = np.stack([np.interp(v, at, colours[:, k]) for k in range(3)], axis=1)
            picture = np.repeat(np.rint(255 * column).astype(np.uint8)[:, None], 4, axis=1)
            view = self.view(np.frombuffer(png_bytes(picture), np.uint8))
            self._images.append({"name": "eye", "mimeType": "image/png", "bufferView": view})

    def _target(self, rows: Floats32, *, bounds: bool = False) -> int:
        """An accessor of displacements, sparse where most of them are zero."""
        ids = np.flatnonzero(rows.any(axis=1))
        if not 0 < len(ids) < SPARSE * len(rows):
            return self._floats(rows, bounds=bounds)
        indices = {"bufferView": self.view(ids.astype(np.uint32)), "componentType": UINT}
        sparse = {"count": len(ids), "indices": indices, "values": {"bufferView": self.view(rows[ids])}}
        return self.accessor(rows, FLOAT, "VEC3", bounds=bounds, sparse=sparse)

    def _floats(self, rows: Array, *, bounds: bool = False) -> int:
        rows = np.ascontiguousarray(rows, np.float32)
        return self.accessor(
            rows, FLOAT, f"VEC{rows.shape[1]}", bounds=bounds, bufferView=self.view(rows, ARRAY_BUFFER)
        )

    def accessor(self, rows: Array, component: int, kind: str, *, bounds: bool = False, **source: Any) -> int:
        """Add an accessor whose elements are in ``source``; returns its index."""
        entry = {"componentType": component, "count": len(rows), "type": kind, **source}
        if bounds:
            entry |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(entry)
        return len(self._accessors) - 1

    def view(self, array: Array, target: int | None = None) -> int:
        """Add a buffer view with the array's bytes; returns its index."""
        self._pad()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": array.nbytes}
        self._views.append(view if target is None else view | {"target": target})
        self._data += array.tobytes()
        return len(self._views) - 1

    def _pad(self) -> None:
        self._data += b"\0" * (-len(self._data) % 4)


def _asset(head: Head, extras: Mapping[str, str]) -> dict[str, Any]:
    provenance = {k: str(v) for k, v in head.data.provenance.items()}
    source = "; ".join(v for k, v in provenance.items() if k in ("source_name", "source_licence"))
    out: dict[str, Any] = {"version": "2.0", "generator": "omote", "extras": {**provenance, **extras}}
    return out | ({"copyright": source} if source else {})
