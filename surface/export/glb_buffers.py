"""A glTF document while it is written: its accessors, buffer views and binary chunk (glTF 2.0, sections 3.6 and 4)."""

from __future__ import annotations

import json
import struct
from typing import Any

from surface.base.arrays import Array

FLOAT, UINT, USHORT, SHORT, UBYTE, BYTE = 5126, 5125, 5123, 5122, 5121, 5120
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963


class GlbBuffers:
    """Accessors and views of one document.

    content : the document, which must have ``accessors`` and ``views`` as such; more may be added before :meth:`bytes`.
    """

    def __init__(self) -> None:
        self._data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.content: dict[str, Any] = {}

    def bytes(self) -> bytes:
        """Return the whole .glb."""
        self._pad()
        document = self.content | {"buffers": [{"byteLength": len(self._data)}]}
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=True).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(self._data), 0x004E4942) + bytes(self._data)
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks

    def accessor(self, rows: Array, component: int, kind: str, *, bounds: bool = False, **source: Any) -> int:
        """Add an accessor whose elements are in ``source``; returns its index."""
        entry = {"componentType": component, "count": len(rows), "type": kind, **source}
        if bounds:
            entry |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def view(self, array: Array, target: int | None = None, **more: int) -> int:
        """Add a buffer view with the array's bytes; returns its index."""
        self._pad()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": array.nbytes, **more}
        self.views.append(view if target is None else view | {"target": target})
        self._data += array.tobytes()
        return len(self.views) - 1

    def _pad(self) -> None:
        self._data += b"\0" * (-len(self._data) % 4)
