"""Reads and writes Open Sound Control 1.0: messages and bundles, as bytes.

The specification: https://opensoundcontrol.stanford.edu/spec-1_0.html. It is implemented here because one datagram of
a face holds about a hundred messages, which must be read fast, and because old senders leave out the type tags of
messages without arguments.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from controller.formats.frame import Refusals

Argument = str | float | int | bool | bytes | None
Message = tuple[str, list[Argument]]
"""Address and arguments."""

Reader = Callable[[bytes, int], tuple[Argument, int]]
"""Reads the argument that begins at an offset of a packet and returns it with the offset behind it."""

MAX_BUNDLE_DEPTH = 8
"""Greatest number of bundles nested inside each other."""
IMMEDIATELY = b"\0\0\0\0\0\0\0\1"
"""OSC time tag that means "immediately"."""

_BUNDLE = b"#bundle\0"
_BUNDLE_HEADER_BYTES = len(_BUNDLE) + len(IMMEDIATELY)
_INT, _FLOAT, _LONG, _DOUBLE = (struct.Struct(f">{code}") for code in "ifqd")


def read_packet(data: bytes, refused: Refusals, depth: int = 0) -> list[Message]:
    """Return all messages of a datagram in order, including those in bundles.

    Damaged messages are left out and counted in ``refused``. depth : number of bundles around ``data``.
    """
    if data.startswith(_BUNDLE):
        return _read_bundle(data, refused, depth)
    try:
        return [_read_message(data)]
    except (ValueError, struct.error, IndexError, KeyError):
        refused.add("not an OSC message")
        return []


def _read_bundle(data: bytes, refused: Refusals, depth: int) -> list[Message]:
    if depth >= MAX_BUNDLE_DEPTH:
        refused.add("too many bundles inside bundles")
        return []
    found: list[Message] = []
    offset = _BUNDLE_HEADER_BYTES
    while offset < len(data):
        size = int.from_bytes(data[offset : offset + 4], "big", signed=True)
        offset += 4
        if size < 0 or size % 4 or offset + size > len(data):
            refused.add("an OSC bundle with a wrong size")
            break
        found += read_packet(data[offset : offset + size], refused, depth + 1)
        offset += size
    return found


def _read_message(data: bytes) -> Message:
    address, offset = _read_text(data, 0)
    if not address.startswith("/"):
        raise ValueError("no address")
    if offset >= len(data) or data[offset] != ord(","):  # old senders leave out the tags when there are no arguments
        return address, []
    tags, offset = _read_text(data, offset)
    arguments: list[Argument] = []
    for tag in tags[1:]:
        value, offset = _READERS[tag](data, offset)
        arguments.append(value)
    return address, arguments


def _read_text(data: bytes, offset: int) -> tuple[str, int]:
    end = data.index(b"\0", offset)
    return data[offset:end].decode("utf-8", "replace"), (end & ~3) + 4


def _read_blob(data: bytes, offset: int) -> tuple[bytes, int]:
    (size,) = _INT.unpack_from(data, offset)
    offset += 4
    if size < 0 or offset + size > len(data):
        raise ValueError("a blob with a wrong size")
    return data[offset : offset + size], offset + (size + 3 & ~3)


def _number_reader(layout: struct.Struct) -> Reader:
    unpack, size = layout.unpack_from, layout.size
    return lambda data, offset: (unpack(data, offset)[0], offset + size)


def _constant_reader(value: Argument) -> Reader:
    """Return a reader for a tag that is the whole argument and has no bytes in the body."""
    return lambda data, offset: (value, offset)


# "I" (infinitum, which programs send as a trigger) is read as 1.0. The brackets around an array are read as None each,
# and the elements between them as separate arguments.
_READERS: dict[str, Reader] = {
    "i": _number_reader(_INT), "f": _number_reader(_FLOAT), "h": _number_reader(_LONG), "d": _number_reader(_DOUBLE),
    "t": _number_reader(_LONG), "c": _number_reader(_INT), "r": _number_reader(_INT), "m": _number_reader(_INT),
    "s": _read_text, "S": _read_text, "b": _read_blob,
    "T": _constant_reader(True), "F": _constant_reader(False), "N": _constant_reader(None),
    "I": _constant_reader(1.0), "[": _constant_reader(None), "]": _constant_reader(None),
}  # fmt: skip


def message(address: str, *arguments: Argument) -> bytes:
    """Return a message of strings, 32-bit floats, 32-bit integers, bools, bytes and None."""
    tags, body = ",", b""
    for each in arguments:
        tag, data = _encode_argument(each)
        tags += tag
        body += data
    return _encode_text(address) + _encode_text(tags) + body


def bundle(messages: Sequence[bytes]) -> bytes:
    """Return a bundle of messages that take effect together, on arrival."""
    return _BUNDLE + IMMEDIATELY + b"".join(_INT.pack(len(each)) + each for each in messages)


def _encode_argument(value: Argument) -> tuple[str, bytes]:
    """Return the type tag and the bytes of an argument."""
    if isinstance(value, bool):
        return "T" if value else "F", b""
    if value is None:
        return "N", b""
    if isinstance(value, str):
        return "s", _encode_text(value)
    if isinstance(value, bytes):
        return "b", _INT.pack(len(value)) + value + bytes(-len(value) % 4)
    return ("i", _INT.pack(value)) if isinstance(value, int) else ("f", _FLOAT.pack(value))


def _encode_text(text: str) -> bytes:
    data = text.encode()
    return data + bytes(4 - len(data) % 4)
