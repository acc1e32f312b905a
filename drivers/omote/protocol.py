"""Encoding of commands and decoding of answers of the omote line protocol; see docs/line-protocol.md."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

MAX_LINE = 1024
"""Default of the longest line, in bytes, without the line end."""
MAX_TAG = 999_999_999
UNKNOWN_COMMAND, UNKNOWN_NAME = 20, 23
"""Error codes of a peer that does not know a command or a name."""

_NAME = re.compile(r"[\x21-\x22\x24-\x29\x2b-\x7e][\x21-\x29\x2b-\x7e]*\Z")
_ANSWER = re.compile(rb"(?:#(\d{1,9})[ \t]+)?(OK|ERR)(?:[ \t]+(.*))?\Z")
_CHECKED = re.compile(rb"(.*)\*([0-9A-Fa-f]{2})[ \t]*\Z", re.DOTALL)


def checksum(data: bytes) -> int:
    """Compute CRC-8/SMBUS: polynomial 0x07, start 0, not reflected. Check value of b"123456789": 0xF4."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x07 if crc & 0x80 else 0)) & 0xFF
    return crc


def is_word(name: str) -> bool:
    """Whether a name can be used in a line: printable, no blank, no ``*``, no ``#`` in front."""
    return _NAME.match(name) is not None


def number(value: float) -> str:
    """Format a value with at most 4 decimals, without trailing zeros."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def line(words: Iterable[str], tag: int, checked: bool) -> bytes:
    """Encode a line with tag, optional checksum and line end."""
    data = f"#{tag} {' '.join(words)}".encode("ascii")
    return data + (b"*%02X\n" % checksum(data) if checked else b"\n")


@dataclass(frozen=True)
class Answer:
    """An answer: the tag of its line (None without one), whether it was accepted, the error code, and the text."""

    tag: int | None
    ok: bool
    code: int
    text: str


def read_answer(data: bytes) -> Answer | None:
    """Decode an answer without its line end; None for other lines and for a wrong checksum, where there is one."""
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


def split_to_fit(words: Iterable[str], room: int) -> list[list[str]]:
    """Group words so that each group fits into ``room`` bytes with a blank before each word; a longer word is alone."""
    groups: list[list[str]] = []
    used = room + 1
    for word in words:
        used += len(word) + 1
        if used > room:
            groups.append([])
            used = len(word) + 1
        groups[-1].append(word)
    return groups
