"""Open Sound Control 1.0: messages and bundles, as bytes.

The specification: https://opensoundcontrol.stanford.edu/spec-1_0.html. Written here and not taken from a library,
because one datagram of a face holds some hundred messages, and because old senders leave out the type tags.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from controller.formats.frame import Refusals

Argument = str | float | int | bool | bytes | None
Message = tuple[str, list[Argument]]
"""Address and arguments."""

MOST_DEPTH = 8
"""Bundles inside bundles."""
IMMEDIATELY = b"\0\0\0\0\0\0\0\1"
"""Time tag of what takes effect when it arrives."""

_BUNDLE = b"#bundle\0"
_INT, _FLOAT, _LONG, _DOUBLE = (struct.Struct(f">{code}") for code in "ifqd")


def read_packet(data: bytes, refused: Refusals, depth: int = 0) -> list[Message]:
    """All messages of a datagram, those in bundles included, in order; what is damaged is left out and counted."""
    if data.startswith(_BUNDLE):
        return _read_bundle(data, refused, depth)
    try:
        return [_read_message(data)]
    except (ValueError, struct.error, IndexError, KeyError):
        refused.add("not an OSC message")
        return []


def _read_bundle(data: bytes, refused: Refusals, depth: int) -> list[Message]:
    if depth >= MOST_DEPTH:
        refused.add("too many bundles inside bundles")
        return []
    found: list[Message] = []
    at = 16
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "big", signed=True)
        at += 4
        if size < 0 or size % 4 or at + size > len(data):
            refused.add("an OSC bundle with a wrong size")
            break
        found += read_packet(data[at : at + size], refused, depth + 1)
        at += size
    return found


def _read_message(data: bytes) -> Message:
    address, at = _read_text(data, 0)
    if not address.startswith("/"):
        raise ValueError("no address")
    if at >= len(data) or data[at] != 0x2C:  # a comma; old senders leave out the tags of a message without arguments
        return address, []
    tags, at = _read_text(data, at)
    arguments: list[Argument] = []
    for tag in tags[1:]:
        value, at = _READERS[tag](data, at)
        arguments.append(value)
    return address, arguments


def _read_text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(b"\0", at)
    return data[at:end].decode("utf-8", "replace"), (end & ~3) + 4


def _read_blob(data: bytes, at: int) -> tuple[bytes, int]:
    (size,) = _INT.unpack_from(data, at)
    at += 4
    if size < 0 or at + size > len(data):
        raise ValueError("a blob with a wrong size")
    return data[at : at + size], at + (size + 3 & ~3)


def _number(layout: struct.Struct) -> Callable[[bytes, int], tuple[Argument, int]]:
    unpack, size = layout.unpack_from, layout.size
    return lambda data, at: (unpack(data, at)[0], at + size)


def _constant(value: Argument) -> Callable[[bytes, int], tuple[Argument, int]]:
    return lambda data, at: (value, at)


_READERS: dict[str, Callable[[bytes, int], tuple[Argument, int]]] = {
    "i": _number(_INT), "f": _number(_FLOAT), "h": _number(_LONG), "d": _number(_DOUBLE), "t": _number(_LONG),
    "c": _number(_INT), "r": _number(_INT), "m": _number(_INT), "s": _read_text, "S": _read_text, "b": _read_blob,
    "T": _constant(True), "F": _constant(False), "N": _constant(None), "I": _constant(1.0),
    "[": _constant(None), "]": _constant(None),
}  # fmt: skip


def message(address: str, *arguments: Argument) -> bytes:
    """A message; texts, floats (32 bit), integers (32 bit), truth values, bytes and None."""
    tags, body = ",", b""
    for each in arguments:
        tag, data = _written(each)
        tags += tag
        body += data
    return _text(address) + _text(tags) + body


def bundle(messages: Sequence[bytes]) -> bytes:
    """Messages that take effect together, at once."""
    return _BUNDLE + IMMEDIATELY + b"".join(_INT.pack(len(each)) + each for each in messages)


def _written(value: Argument) -> tuple[str, bytes]:
    if isinstance(value, bool):
        return "T" if value else "F", b""
    if value is None:
        return "N", b""
    if isinstance(value, str):
        return "s", _text(value)
    if isinstance(value, bytes):
        return "b", _INT.pack(len(value)) + value + bytes(-len(value) % 4)
    return ("i", _INT.pack(value)) if isinstance(value, int) else ("f", _FLOAT.pack(value))


def _text(text: str) -> bytes:
    data = text.encode()
    return data + bytes(4 - len(data) % 4)
