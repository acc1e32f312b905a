"""Lines of the omote line protocol as the commanding side writes and reads them; docs/line-protocol.md. No I/O here."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

MAX_LINE = 1024
"""Longest line to a peer that does not say otherwise, in bytes, without the line end."""
MAX_TAG = 999_999_999
UNKNOWN_COMMAND, UNKNOWN_NAME = 20, 23
"""Error codes that tell what a peer does not know."""

_NAME = re.compile(r"[\x21-\x22\x24-\x29\x2b-\x7e][\x21-\x29\x2b-\x7e]*\Z")
_ANSWER = re.compile(rb"(?:#(\d{1,9})[ \t]+)?(OK|ERR)(?:[ \t]+(.*))?\Z")
_CHECKED = re.compile(rb"(.*)\*([0-9A-Fa-f]{2})[ \t]*\Z", re.DOTALL)


def checksum(data: bytes) -> int:
    """CRC-8/SMBUS: polynomial 0x07, start 0, not reflected. Check value of b"123456789": 0xF4."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x07 if crc & 0x80 else 0)) & 0xFF
    return crc


def is_word(name: str) -> bool:
    """Whether a name can stand in a line: printable, no blank, no ``*``, no ``#`` in front."""
    return _NAME.match(name) is not None


def number(value: float) -> str:
    """A value with at most 4 decimals and no needless zeros."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def line(words: Iterable[str], tag: int, checked: bool) -> bytes:
    """A line with its end."""
    data = f"#{tag} {' '.join(words)}".encode("ascii")
    return data + (b"*%02X\n" % checksum(data) if checked else b"\n")


@dataclass(frozen=True)
class Answer:
    """An answer: to which tag (None without one), whether the line was taken, the error code, and the text."""

    tag: int | None
    ok: bool
    code: int
    text: str


def read_answer(data: bytes) -> Answer | None:
    """An answer without its line end; None where it is none, or damaged.

    Streamed lines are no answers. A checksum is checked where there is one.
    """
    checked = _CHECKED.match(data)
    if checked is not None:
        if checksum(checked[1]) != int(checked[2], 16):
            return None
        data = checked[1]
    match = _ANSWER.match(data)
    if match is None:
        return None
    tag = None if match[1] is None else int(match[1])
    text = (match[3] or b"").decode("ascii", "replace").strip()
    if match[2] == b"OK":
        return Answer(tag, True, 0, text)
    code, _, reason = text.partition(" ")
    return Answer(tag, False, int(code), reason) if code.isdecimal() else None


def parted(names: Iterable[str], room: int) -> list[list[str]]:
    """Words in groups that fit into ``room`` bytes with a blank before each; one that is too long stands alone."""
    groups: list[list[str]] = []
    used = room + 1
    for name in names:
        used += len(name) + 1
        if used > room or not groups:
            groups.append([])
            used = len(name) + 1
        groups[-1].append(name)
    return groups
