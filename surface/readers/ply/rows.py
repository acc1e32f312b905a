"""Rows of the elements of a PLY file, as text or in either binary form (Turk, The PLY Polygon File Format, 1994).

A file says in its head what rows it holds and of which numbers and lists of numbers each consists; nothing more is
known of it here. Counts are compared with the length of the file before anything is allocated for them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from surface.base.arrays import Array, Floats, Ints
from surface.base.errors import FitError
from surface.readers.meshdata import read_bytes

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
HEADER_LIMIT = 1 << 20  # bytes
MAX_PROPERTIES = 64
HINT = "save the mesh again as .ply or .obj"


@dataclass(frozen=True)
class Property:
    """One number of a row, or a list of them: ``size`` is the type of its length, "" of a single number."""

    name: str
    kind: str
    size: str = ""


@dataclass
class Element:
    """Rows of one name. numbers : (count,) by property; lists : by property the flat items and (count + 1,) where each
    row's begin."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)
    numbers: dict[str, Array] = field(default_factory=dict)
    lists: dict[str, tuple[Array, Ints]] = field(default_factory=dict)

    def columns(self, *names: str) -> Floats | None:
        """Return (count, k) float64: of k properties; None where one is missing."""
        if not all(name in self.numbers for name in names):
            return None
        return np.column_stack([self.numbers[name].astype(np.float64) for name in names])


class PlyFile:
    """An opened file. path : .ply. elements : by name. comments : lines, in order.

    Raises FitError: missing, too large, damaged or cut short; names the element.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.elements: dict[str, Element] = {}
        self.comments: list[str] = []
        data = read_bytes(path)
        start = self._read_head(data)
        if self._order:
            self._read_binary(data, start)
        else:
            self._read_text(data[start:])

    def error(self, where: str, why: str) -> FitError:
        """Return the error for an element of the file."""
        return FitError(f"{self.path}: {where}: {why}", hint=HINT)

    def _read_head(self, data: bytes) -> int:
        """Fill elements and comments; returns where the rows begin."""
        if not data.startswith(b"ply"):
            raise self.error("header", "is damaged or no PLY file: it does not begin with ply")
        end = data.find(b"end_header", 0, HEADER_LIMIT)
        stop = data.find(b"\n", end)
        if end < 0 or stop < 0:
            raise self.error("header", "is damaged: it has no end_header")
        self._order: str | None = None
        for line in data[:end].decode("utf-8", "replace").splitlines()[1:]:
            self._read_line(line.strip())
        if self._order is None:
            raise self.error("header", "is damaged: it names no format")
        return stop + 1

    def _read_line(self, line: str) -> None:
        match line.split():
            case ["format", order, *_] if order in ORDERS:
                self._order = ORDERS[order]
            case ["comment" | "obj_info", *_]:
                self.comments.append(line.partition(" ")[2])
            case ["element", name, count] if count.isdecimal() and len(count) < 12 and name not in self.elements:
                self.elements[name] = Element(name, int(count))
            case ["property", "list", size, kind, name] if TYPES.get(size, "f")[0] != "f" and kind in TYPES:
                self._add(Property(name, TYPES[kind], TYPES[size]))
            case ["property", kind, name] if kind in TYPES:
                self._add(Property(name, TYPES[kind]))
            case []:
                pass
            case _:
                raise self.error("header", f"is damaged: {line[:60]!r} is no line of it")

    def _add(self, one: Property) -> None:
        own = list(self.elements.values())
        if not own or len(own[-1].properties) >= MAX_PROPERTIES or one.name in {p.name for p in own[-1].properties}:
            raise self.error("header", f"is damaged: property {one.name[:40]!r} is out of place")
        own[-1].properties.append(one)

    def _cut(self, element: Element) -> FitError:
        return self.error(f"element {element.name}", f"the file is cut short: it says {element.count} rows")

    def _read_text(self, data: bytes) -> None:
        words, at = data.split(), 0
        for element in self.elements.values():
            if element.count > len(words) - at and element.properties:
                raise self._cut(element)
            try:
                at = _text_rows(element, words, at)
            except IndexError:
                raise self._cut(element) from None
            except (ValueError, OverflowError):
                raise self.error(f"element {element.name}", "is damaged: a word in it is no number") from None

    def _read_binary(self, data: bytes, at: int) -> None:
        order = str(self._order)
        for element in self.elements.values():
            least = sum(np.dtype(p.size or p.kind).itemsize for p in element.properties)
            if element.count * least > len(data) - at:
                raise self._cut(element)
            try:
                at = _even_rows(element, data, at, order) or _uneven_rows(element, data, at, order)
            except (IndexError, ValueError):
                raise self._cut(element) from None


def _text_rows(element: Element, words: list[bytes], at: int) -> int:
    """Read the rows of an element out of words from ``at`` on; returns where the next begin.

    Raises IndexError: there are too few words. ValueError: one is no number.
    """
    if all(not p.size for p in element.properties):
        width = len(element.properties)
        own = words[at : at + width * element.count]
        if len(own) < width * element.count:
            raise IndexError
        table = np.array(own, np.float64).reshape(element.count, width) if width else np.zeros((element.count, 0))
        element.numbers = {p.name: table[:, k] for k, p in enumerate(element.properties)}
        return at + len(own)
    numbers: dict[str, list[float]] = {p.name: [] for p in element.properties if not p.size}
    lists: dict[str, list[list[bytes]]] = {p.name: [] for p in element.properties if p.size}
    for _ in range(element.count):
        for p in element.properties:
            if not p.size:
                numbers[p.name].append(float(words[at]))
                at += 1
                continue
            count = int(words[at])
            if count < 0 or at + 1 + count > len(words):
                raise IndexError
            lists[p.name].append(words[at + 1 : at + 1 + count])
            at += 1 + count
    element.numbers = {name: np.array(rows, np.float64) for name, rows in numbers.items()}
    for name, rows in lists.items():
        flat = np.array([word for row in rows for word in row], np.float64)
        element.lists[name] = flat, _starts([len(row) for row in rows])
    return at


def _starts(lengths: list[int]) -> Ints:
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(np.array(lengths, np.int64))])


def _even_rows(element: Element, data: bytes, at: int, order: str) -> int:
    """Read rows whose lists are all as long as the first row's, as those of triangles are; 0 where they are not."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    row, where = {}, at
    for k, p in enumerate(element.properties):
        kind = np.dtype(order + p.kind)
        if p.size and element.count:
            size = np.dtype(order + p.size)
            row[k] = int(np.frombuffer(data, size, 1, where)[0])
            where += size.itemsize + row[k] * kind.itemsize
            if not 0 <= row[k] <= len(data) // kind.itemsize or where > len(data):
                return 0
            fields += [(f"n{k}", order + p.size), (f"v{k}", order + p.kind, (row[k],))]
        else:
            row.setdefault(k, 0)
            where += kind.itemsize
            fields.append((f"v{k}", order + p.kind))
    layout = np.dtype(fields)
    if at + layout.itemsize * element.count > len(data):
        return 0
    table = np.frombuffer(data, layout, element.count, at) if layout.itemsize else np.zeros(element.count, layout)
    for k, p in enumerate(element.properties):
        if p.size and element.count and (table[f"n{k}"] != row[k]).any():
            return 0
    for k, p in enumerate(element.properties):
        if p.size:
            starts = np.arange(element.count + 1, dtype=np.int64) * row[k]
            element.lists[p.name] = table[f"v{k}"].reshape(-1), starts
        else:
            element.numbers[p.name] = table[f"v{k}"]
    return at + layout.itemsize * element.count


def _uneven_rows(element: Element, data: bytes, at: int, order: str) -> int:
    """Read rows one by one; returns where the next element begins. Raises ValueError: the file ends before."""
    kinds = [(p, np.dtype(order + p.size) if p.size else None, np.dtype(order + p.kind)) for p in element.properties]
    found: dict[str, list[Array]] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        for p, size, kind in kinds:
            count = 1
            if size is not None:
                count = int(np.frombuffer(data, size, 1, at)[0])
                at += size.itemsize
            if count < 0:
                raise ValueError
            found[p.name].append(np.frombuffer(data, kind, count, at) if count else np.zeros(0, kind))
            at += count * kind.itemsize
    for p, size, kind in kinds:
        rows = found[p.name]
        flat = np.concatenate(rows) if rows else np.zeros(0, kind)
        if size is None:
            element.numbers[p.name] = flat
        else:
            element.lists[p.name] = flat, _starts([len(row) for row in rows])
    return at
