"""Damages to what a file says: values of its tables, lists and arrays, written again so that the rest stays sound.

Damaged bytes seldom get past the parser of a format; these reach the checks and the computations behind it.
"""

from __future__ import annotations

import io
import json
import random
import struct
import tomllib
import zipfile
from collections.abc import Callable
from copy import deepcopy
from functools import lru_cache
from typing import Any

import numpy as np
import tomli_w

Array = np.ndarray
VALUES: tuple[Any, ...] = (
    *(0, 1, -1, 2, 3, 255, 256, 65535, 2**31 - 1, -(2**31), 2**63 - 1, 2**63, 10**30, 0.5, -0.5, 1e-320, 1e12, 1e308),
    *(float("nan"), float("inf"), -float("inf"), True, False, "", "x", "x" * 3000, "\0", "../../etc/passwd", "1", "ä"),
    *([], [[]], [0] * 300, [[0.0, 0.0]], ["x"], [1, "x"], {}, {"x": 1}, {"": {}}),
)
NOTHING: Any = object()
LARGEST = 8_000_000
"""Characters of a damaged file, about: thousands of copies of thousands of copies would fill the memory."""


def change_tree(tree: Any, draw: random.Random, values: tuple[Any, ...] = VALUES) -> Any:
    """A copy of tables and lists with one value changed, left out, repeated, or replaced by another one of the tree."""
    tree = deepcopy(tree)
    places = list(_places(tree))
    if not places:
        return draw.choice(values)
    holder, key = draw.choice(places)
    new = _changed(holder[key], draw, values, places)
    if new is NOTHING:
        del holder[key]
    elif isinstance(holder, list) and draw.random() < 0.2:
        holder[key:key] = [new] * draw.choice((1, 2, 1000))
    elif isinstance(holder, dict) and draw.random() < 0.1:
        holder[draw.choice(("x", "", "name", *map(str, holder)))] = new
    else:
        holder[key] = new
    return tree


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """Every table or list of a tree with each of its keys or positions."""
    found, left = [], [tree]
    while left:
        each = left.pop()
        keys = list(each) if isinstance(each, dict) else range(len(each)) if isinstance(each, list) else ()
        found += [(each, key) for key in keys]
        left += [each[key] for key in keys]
    return found


def _size(tree: Any) -> int:
    """About how many characters a tree takes when it is written."""
    size, left = 0, [tree]
    while left and size <= LARGEST:
        each = left.pop()
        if isinstance(each, dict):
            left += [*each.keys(), *each.values()]
        elif isinstance(each, list):
            left += each
        size += len(each) if isinstance(each, str) else 8
    return size


def _changed(old: Any, draw: random.Random, values: tuple[Any, ...], places: list[tuple[Any, Any]]) -> Any:
    number = isinstance(old, int | float) and not isinstance(old, bool)
    match draw.randrange(6):
        case 0:
            return NOTHING
        case 1:
            holder, key = draw.choice(places)
            return deepcopy(holder[key])
        case 2 if number:
            return old + draw.choice((-1, 1))
        case 3 if number:
            return old * draw.choice((-1, 10, 1000, 0.001))
        case 4 if isinstance(old, list) and old:
            return draw.choice((old[:-1], old[::-1], old + old, old[:1], [old], old[0]))
        case 5 if isinstance(old, str) and old:
            return draw.choice((old[:-1], old.upper(), old + " ", old * 2, [old]))
    return draw.choice(values)


@lru_cache(maxsize=32)
def _tree(data: bytes) -> tuple[Any, Callable[[Any], bytes] | None]:
    """The tables of a JSON, TOML or binary glTF file, and what writes them again; None for another file."""
    if data.startswith(b"glTF"):
        size = struct.unpack_from("<I", data, 12)[0]
        rest = data[20 + size :]
        return json.loads(data[20 : 20 + size]), lambda tree: _glb(json.dumps(tree).encode(), rest)
    if data.lstrip()[:1] in (b"{", b"["):
        try:
            return json.loads(data), lambda tree: json.dumps(tree).encode()
        except ValueError:
            return _json_lines(data)
    try:
        return tomllib.loads(data.decode()), lambda tree: tomli_w.dumps(tree).encode()
    except ValueError:
        return None, None


def _json_lines(data: bytes) -> tuple[Any, Callable[[Any], bytes] | None]:
    """A file with a JSON value in each line."""
    try:
        lines = [json.loads(line) for line in data.splitlines()]
    except ValueError:
        return None, None
    return lines, lambda tree: b"".join(json.dumps(line).encode() + b"\n" for line in tree)


def _glb(text: bytes, rest: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def damage_tree(data: bytes, draw: random.Random) -> bytes | None:
    """A JSON, TOML or binary glTF file with up to three values changed; None for another file."""
    tree, write = _tree(data)
    if write is None:
        return None
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        changed = change_tree(tree, draw)
        if _size(changed) > LARGEST:
            break
        tree = changed
    try:
        return write(tree)
    except (TypeError, ValueError, AttributeError):  # TOML cannot say it
        return None


def damage_array(array: Array, draw: random.Random) -> Array:
    """One array of an archive with other numbers, another shape or another type."""
    flat = array.reshape(-1).copy()
    number = flat.dtype.kind in "fiu"
    match draw.randrange(9):
        case 0 | 1 if number and len(flat):
            at = draw.randrange(len(flat))
            flat[at] = _fitting(flat.dtype, draw)
        case 2 if number and len(flat):
            flat[:] = flat[draw.randrange(len(flat))]
        case 3:
            return array[: draw.randrange(len(array) + 1)] if array.ndim else array[None]
        case 4:
            return array.reshape(-1) if draw.random() < 0.5 else array[None]
        case 5 if number:
            kind: Any = draw.choice((np.float32, np.float64, np.int8, np.uint8, np.int64, np.complex128, bool, "U3"))
            with np.errstate(all="ignore"):
                return array.astype(kind)
        case 6:
            return np.concatenate([array, array]) if array.ndim else array
        case 7 if len(flat) > 1:
            order = np.random.default_rng(draw.randrange(2**32)).permutation(len(flat))
            flat = flat[order]
        case _:
            return draw.choice((np.zeros(0), np.zeros((3, 0)), np.array("x"), np.array(1e308), array.T, np.flip(array)))
    return flat.reshape(array.shape)


def _fitting(dtype: Any, draw: random.Random) -> Any:
    if dtype.kind == "f":
        values = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1e30, -1e30, 1e308, 1e-320, 0.5]
        with np.errstate(all="ignore"):
            return np.array(draw.choice(values)).astype(dtype)
    bounds = np.iinfo(dtype)
    return np.array(draw.choice([v for v in (-1, 0, 1, 2, 1000, bounds.min, bounds.max) if v >= bounds.min])).astype(
        dtype
    )


def damage_arrays(data: bytes, draw: random.Random) -> bytes | None:
    """An archive of arrays with one or two of them changed, left out or under another name; None for another file."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, zipfile.BadZipFile):
        return None
    for _ in range(draw.choice((1, 1, 2))):
        name = draw.choice(list(arrays) or [""])
        match draw.randrange(8):
            case 0:
                arrays.pop(name, None)
            case 1:
                arrays[draw.choice([*arrays, "x"])] = arrays.get(name, np.zeros(1))
            case _ if name:
                arrays[name] = np.asarray(damage_array(np.asarray(arrays[name]), draw))
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()
