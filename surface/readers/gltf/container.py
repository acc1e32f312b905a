"""Reader of glTF 2.0 containers and accessors; every index and length is checked before it is used.

Reads ``.glb``, ``.vrm`` and ``.gltf`` with buffers inside, beside or in data URIs; accessors of all component types,
normalised, interleaved and sparse (glTF 2.0 specification, sections 3.6, 4.4 and 5.1). Wrong content raises
:class:`surface.base.errors.FitError` with the path and the element.
"""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from surface.base.arrays import Array, Floats, Ints
from surface.base.errors import FitError
from surface.base.files import DATA_LIMIT, decode, parse_json
from surface.readers.meshdata import read_bytes

MAGIC, JSON_CHUNK, BIN_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
TYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
# Extensions without which a mesh is not read rightly: what each is, and what to do. All others that a file may require
# change colours, light, sound, bones or tables of other programs, and leave the mesh as it is.
REFUSED = {
    "KHR_draco_mesh_compression": ("Draco compression", "uncompress it: npx @gltf-transform/cli cp IN.glb OUT.glb"),
    "EXT_mesh_gpu_instancing": ("copies of one mesh", "export every copy as a mesh of its own"),
}
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
UNCOMPRESS = "uncompress it: npx gltfpack -noq -i IN.glb -o OUT.glb"
MAX_ELEMENTS = 4_000_000  # of one accessor
MAX_ITEMS = 10_000  # nodes, accessors and so on


class Gltf:
    """An opened file: its JSON document and the bytes of its buffers.

    path : .glb, .vrm or .gltf

    Raises FitError: missing, damaged, cut short, too large, or in need of an extension that is not read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._buffers: dict[int, bytes] = {}
        self._unpacked: dict[int, bytes] = {}
        raw = read_bytes(path)
        binary = raw.startswith(MAGIC)
        if not binary and raw.lstrip()[:1] != b"{":
            why = "is no glTF file: neither its binary form nor JSON" if raw else "is empty"
            raise FitError(f"{path}: {why}", hint="export the head as .glb")
        text, self._chunk = self._split_chunks(raw) if binary else (raw, None)
        try:
            self.document = parse_json(decode(text))
        except ValueError as e:
            raise self.error("JSON", str(e)) from e
        if not isinstance(self.document, dict):
            raise self.error("JSON", "is no object")
        version = self.value(self.value(self.document, "asset", dict, "JSON"), "version", str, "asset")
        if not version.startswith("2."):
            raise self.error("asset.version", f"is {version!r}", "export it as glTF 2.0")
        unread = [x for x in self.document.get("extensionsRequired") or [] if x in REFUSED]
        if unread:
            what, hint = REFUSED[unread[0]]
            raise self.error("extensionsRequired", f"{unread[0]!r} ({what}) is not read here", hint)

    def error(self, where: str, why: str, hint: str = "export the file again") -> FitError:
        """Return the error for an element of the file."""
        return FitError(f"{self.path}: {where}: {why}", hint=hint)

    def _split_chunks(self, raw: bytes) -> tuple[bytes, bytes | None]:
        """Return JSON text and binary chunk of a .glb."""
        if len(raw) < 20:
            raise self.error("header", "the file is cut short")
        _, version, length = struct.unpack_from("<III", raw)
        if version != 2:
            raise self.error("header", f"is glTF version {version}", "export it as glTF 2.0")
        if length > len(raw):
            raise self.error("header", f"the file is cut short: {len(raw)} of {length} bytes")
        found: dict[int, bytes] = {}
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", raw, at)
            if at + 8 + size > length:
                raise self.error(f"chunk at byte {at}", f"says {size} bytes, {length - at - 8} are left")
            found.setdefault(kind, raw[at + 8 : at + 8 + size])
            at += 8 + size
        if JSON_CHUNK not in found:
            raise self.error("header", "there is no JSON chunk")
        return found[JSON_CHUNK], found.get(BIN_CHUNK)

    def value(self, table: dict[str, Any], key: str, kind: type, where: str, default: Any = None) -> Any:
        """Return ``table[key]``, which must be of the kind; without a default it must be there."""
        found = table.get(key, default)
        if not isinstance(found, kind) or (kind is int and isinstance(found, bool)):
            word = {dict: "object", list: "list", int: "number", str: "text"}[kind]
            why = "is missing" if found is None else f"{str(found)[:40]!r} is no {word}"
            raise self.error(f"{where}.{key}", why)
        return found

    def items(self, key: str) -> list[Any]:
        """Return a list of the document; empty if it is missing."""
        found: list[Any] = self.value(self.document, key, list, "JSON", [])
        if len(found) > MAX_ITEMS:
            raise self.error(key, f"there are {len(found)}; {MAX_ITEMS} are the most", "export the head alone")
        return found

    def item(self, key: str, index: Any, where: str) -> dict[str, Any]:
        """Return ``document[key][index]``, an object; ``where`` is the element that refers to it."""
        found = self.items(key)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(found):
            raise self.error(where, f"points at {key}[{str(index)[:20]}], but there are {len(found)}")
        if not isinstance(found[index], dict):
            raise self.error(f"{key}[{index}]", "is no object")
        return dict(found[index])

    def floats(self, index: Any, width: int, where: str) -> Floats:
        """Return (n, width) float64: of an accessor, integers scaled where it is normalised; all finite."""
        raw = self._accessor(index, width, where)
        out = raw.astype(np.float64)
        if raw.dtype.kind != "f" and self.item("accessors", index, where).get("normalized", False):
            out = np.maximum(out / np.iinfo(raw.dtype).max, -1.0)
        wrong = np.flatnonzero(~np.isfinite(out).all(axis=1))
        if len(wrong):
            hint = "repair the mesh and export again"
            raise self.error(f"{where}, element {wrong[0]}", "is not a finite number", hint)
        return out

    def integers(self, index: Any, where: str, width: int = 1) -> Ints:
        """Return (n, width) int64: of an accessor of unsigned numbers."""
        raw = self._accessor(index, width, where)
        if raw.dtype.kind != "u":
            raise self.error(where, f"holds {raw.dtype}, not unsigned numbers")
        return raw.astype(np.int64)

    def _accessor(self, index: Any, width: int, where: str) -> Array:
        accessor, name = self.item("accessors", index, where), f"accessors[{index}] ({where})"
        shape = str(accessor.get("type"))
        if WIDTHS.get(shape) != width:
            raise self.error(name, f"is of type {shape[:20]!r}, which has not {width} numbers")
        kind = self._component_type(accessor, name)
        count = self.value(accessor, "count", int, name)
        if not 0 <= count <= MAX_ELEMENTS:
            raise self.error(name, f"says {count} elements; {MAX_ELEMENTS} are the most", "take a smaller mesh")
        if "bufferView" in accessor:
            out = self._view(accessor, kind, count, width, name)
        else:
            out = np.zeros((count, width), kind)
        if "sparse" in accessor:
            self._replace_sparse(self.value(accessor, "sparse", dict, name), out, f"{name}.sparse")
        return out

    def _component_type(self, table: dict[str, Any], name: str) -> np.dtype:
        code = self.value(table, "componentType", int, name)
        if code not in TYPES:
            raise self.error(f"{name}.componentType", f"{code} is unknown")
        return np.dtype(TYPES[code]).newbyteorder("<")

    def _view(self, table: dict[str, Any], kind: np.dtype, count: int, width: int, name: str) -> Array:
        """Return a copy (count, width) of elements in a buffer view, which may be interleaved."""
        index = table["bufferView"]
        view = self.item("bufferViews", index, name)
        where = f"bufferViews[{index}]"
        data, start, size = self._span(view, index, where)
        offset, each = self._length(table, "byteOffset", name, 0), kind.itemsize * width
        stride = self._length(view, "byteStride", where, 0) or each
        if stride < each or (count and offset + stride * (count - 1) + each > size):
            raise self.error(name, f"{count} elements do not fit into the {size} bytes of {where}")
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, data, start + offset, (stride, kind.itemsize)).copy()

    def _length(self, table: dict[str, Any], key: str, where: str, default: int | None = None) -> int:
        found = int(self.value(table, key, int, where, default))
        if found < 0:
            raise self.error(f"{where}.{key}", f"is {found}")
        return found

    def _replace_sparse(self, sparse: dict[str, Any], out: Array, where: str) -> None:
        """Replace the elements of ``out`` that a sparse accessor gives."""
        count = self._length(sparse, "count", where)
        indices, values = (self.value(sparse, key, dict, where) for key in ("indices", "values"))
        if count > len(out):
            raise self.error(where, f"replaces {count} of {len(out)} elements")
        for key, table in (("indices", indices), ("values", values)):
            if "bufferView" not in table:
                raise self.error(f"{where}.{key}.bufferView", "is missing")
        ids = self._view(indices, self._component_type(indices, where), count, 1, where).ravel().astype(np.int64)
        if len(ids) and (ids.min() < 0 or ids.max() >= len(out)):
            raise self.error(where, f"replaces element {ids.max()}, but there are {len(out)}")
        out[ids] = self._view(values, out.dtype, count, out.shape[1], where)

    def _buffer(self, index: Any, where: str) -> bytes:
        table = self.item("buffers", index, where)
        if index not in self._buffers:
            self._buffers[index] = self._load(table.get("uri"), f"buffers[{index}]", index)
            if sum(map(len, self._buffers.values())) > DATA_LIMIT:
                raise self.error("buffers", f"hold more than {DATA_LIMIT >> 20} MB", "export the head alone")
        return self._buffers[index]

    def view_bytes(self, index: Any, where: str) -> bytes:
        """Return the bytes of a buffer view."""
        data, start, size = self._span(self.item("bufferViews", index, where), index, f"bufferViews[{index}]")
        return data[start : start + size]

    def _span(self, view: dict[str, Any], index: int, where: str) -> tuple[bytes, int, int]:
        """Return bytes that hold a buffer view, where in them it starts, and its length."""
        extensions = self.value(view, "extensions", dict, where, {})
        for name in MESHOPT:
            if name in extensions:
                data = self._decompress(self.value(extensions, name, dict, where), index, f"{where}.{name}")
                return data, 0, len(data)
        return self._locate_view(view, where)

    def _locate_view(self, view: dict[str, Any], where: str) -> tuple[bytes, int, int]:
        """Return the buffer that a view lies in, where in it the view starts, and its length."""
        start, size = self._length(view, "byteOffset", where, 0), self._length(view, "byteLength", where)
        data = self._buffer(view.get("buffer"), where)
        if start + size > len(data):
            raise self.error(where, f"ends at byte {start + size}, but the buffer has {len(data)}: it is cut short")
        return data, start, size

    def _decompress(self, packed: dict[str, Any], index: int, where: str) -> bytes:
        """Return the bytes of a buffer view that meshopt has compressed."""
        if index in self._unpacked:
            return self._unpacked[index]
        count, stride = self._length(packed, "count", where), self._length(packed, "byteStride", where)
        if count > MAX_ELEMENTS or count * stride + sum(map(len, self._unpacked.values())) > DATA_LIMIT:
            raise self.error(where, f"holds {count} elements of {stride} bytes: too many", "export the head alone")
        data, start, size = self._locate_view(packed, where)
        mode = self.value(packed, "mode", str, where)
        filtered = self.value(packed, "filter", str, where, "NONE")
        from surface.readers.gltf.meshopt import decode_view  # most files need no numba to be read

        try:
            self._unpacked[index] = decode_view(data[start : start + size], mode, filtered, count, stride)
        except ValueError as e:
            raise self.error(where, str(e), UNCOMPRESS) from e
        return self._unpacked[index]

    def _load(self, uri: Any, where: str, index: int) -> bytes:
        """Return the bytes of a buffer: the binary chunk, a data URI, or a file in the folder of this one."""
        if uri is None:
            if index != 0 or self._chunk is None:
                raise self.error(where, "has neither a uri nor a binary chunk")
            return self._chunk
        return self.uri_bytes(uri, where)

    def uri_bytes(self, uri: Any, where: str) -> bytes:
        """Return the bytes behind a data URI, or of a file in the folder of this one."""
        if not isinstance(uri, str):
            raise self.error(f"{where}.uri", "is no text")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError) as e:
                raise self.error(f"{where}.uri", f"is damaged ({e})") from e
        name = unquote(uri)
        if "://" in name or "\0" in name or Path(name).is_absolute() or ".." in Path(name).parts:
            raise self.error(f"{where}.uri", f"{uri[:60]!r} is not beside the file", "export as .glb")
        return read_bytes(self.path.parent / name)
