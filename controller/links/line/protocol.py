"""Encodes and decodes lines of the omote line protocol (framing, checksums, tags, replies), without any I/O.

docs/line-protocol.md specifies it; :mod:`controller.links.line.commands` parses the commands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

import numpy as np

from controller.base.errors import LinkError

VERSION = 1
"""Version of the protocol that HELLO reports."""

MAX_LINE = 1024
"""Longest line to omote, in bytes, with tag and checksum but without the line end."""

MAX_REPLY = 2048
"""Longest line from omote, in bytes, without the line end."""

KNOWN_LINES = 256
"""Size of the cache of parsed lines, of a few kB each, because robots repeat themselves."""

_TAG = re.compile(r"#(\d{1,9})")
_REPLY = re.compile(r"(?:#(\d{1,9}) )?(?:(OK|P|F)|ERR ([0-9]+))(?: (.*))?", re.DOTALL)
_CHECKSUM = re.compile(rb"\*([0-9A-Fa-f]{2})[ \t]*\Z")
_UNPRINTABLE = re.compile(rb"[^\x20-\x7e\t]")
_NOT_SENT = re.compile(rb"[^\x20-\x7e]")
_STOP = re.compile(
    rb"[^\x21-\x7e]*(?:#[0-9]*[^\x21-\x7e]+)?(?:@[\x21-\x7e]*[^\x21-\x7e]+)?STOP(?![\x21-\x29\x2b-\x7e])", re.IGNORECASE
)


class Code(IntEnum):
    """Why a line was refused: 1x because of the line itself, 2x its words, 3x the state of omote."""

    TOO_LONG = 10
    NOT_ASCII = 11
    BINARY = 12
    CHECKSUM = 13
    TAG = 14
    COMMAND = 20
    ARGUMENTS = 21
    NUMBER = 22
    NAME = 23
    RANGE = 24
    BUSY = 30
    FAULT = 31
    TOKEN = 32


class LineError(LinkError):
    """A refused line.

    code : why, for programs. tag : of the line; None if it has none. checked : whether the line had a checksum.
    """

    def __init__(self, code: Code, reason: str, *, tag: int | None = None, checked: bool = False) -> None:
        super().__init__(reason, hint="the scripts in omote's folder configs/scripts hold examples of commands")
        self.code = code
        self.tag = tag
        self.checked = checked


@dataclass(frozen=True)
class Words:
    """A parsed line: its words, its tag, and whether it had a checksum.

    to : the head or group that it is for, without the ``@``; empty for the current target of the link.
    """

    words: tuple[str, ...]
    tag: int | None = None
    checked: bool = False
    to: str = ""


@dataclass(frozen=True)
class Reply:
    """A parsed line from omote.

    kind : ``"OK"``, ``"ERR"``, or ``"P"``/``"F"`` for streamed parameters.
    text : the rest. tag : that of the line it answers. code : of an ERR. checked : whether it had a checksum.
    """

    kind: str
    text: str = ""
    tag: int | None = None
    code: int | None = None
    checked: bool = False

    @property
    def ok(self) -> bool:
        """Whether the command was accepted."""
        return self.kind == "OK"


def _crc(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1 ^ (0x07 if byte & 0x80 else 0)) & 0xFF
    return byte


_CRC = tuple(map(_crc, range(256)))


def checksum(data: bytes) -> int:
    """Return the CRC-8/SMBUS of ``data``: polynomial 0x07, start 0, not reflected; 0xF4 for b"123456789".

    Unlike the XOR of NMEA it detects every swap of adjacent ASCII characters and every error burst of up to 8 bits.
    """
    crc = 0
    for byte in data:
        crc = _CRC[crc ^ byte]
    return crc


@lru_cache(maxsize=KNOWN_LINES)
def parse_words(line: bytes) -> Words | None:
    """Parse a line without its line end; return None for an empty one. Recent lines are cached.

    Raises LineError: not printable ASCII, too long, reserved for binary frames, or a wrong checksum or tag.
    """
    if not line.strip(b" \t"):
        return None
    _check_bytes(line)
    if line.count(b"*") > 1:
        raise LineError(Code.CHECKSUM, "there is more than one * in the line; only the checksum begins with one")
    body, checked = _strip_checksum(line)
    words = body.decode("ascii").split()
    tag = None
    if words and words[0].startswith("#"):
        match = _TAG.fullmatch(words[0])
        if match is None:
            raise LineError(Code.TAG, "a tag is # and 1 to 9 digits", checked=checked)
        tag = int(match[1])
        words = words[1:]
    to = words.pop(0)[1:] if words and words[0].startswith("@") else ""
    if not words:
        raise LineError(Code.COMMAND, "no command in this line", tag=tag, checked=checked)
    return Words(tuple(words), tag, checked, to)


def _check_bytes(line: bytes) -> None:
    if line[0] >= 0x80:
        raise LineError(Code.BINARY, "binary frames are reserved for a later version; send ASCII lines")
    if len(line) > MAX_LINE:
        raise LineError(Code.TOO_LONG, f"a line has at most {MAX_LINE} bytes")
    if found := _UNPRINTABLE.search(line):
        what = f"byte {found.start() + 1} of the line is 0x{found[0][0]:02X}"
        raise LineError(Code.NOT_ASCII, f"{what}; only printable ASCII (0x20 to 0x7E) and tab are allowed")


def is_stop(line: bytes) -> bool:
    """Whether a line begins with the command STOP, perhaps after a tag or noise, however damaged the rest is."""
    return _STOP.match(line) is not None


def _strip_checksum(line: bytes) -> tuple[bytes, bool]:
    if b"*" not in line:
        return line, False
    match = _CHECKSUM.search(line)
    if match is None:
        reason = "* must be followed by two hexadecimal digits at the end of the line"
        raise LineError(Code.CHECKSUM, reason, checked=True)
    body = line[: match.start()]
    want = checksum(body)
    if int(match[1], 16) != want:
        reason = f"checksum is {match[1].decode().upper()} but the line sums up to {want:02X}"
        raise LineError(Code.CHECKSUM, reason, checked=True)
    return body, True


def format_words(words: Iterable[str], *, tag: int | None = None, checked: bool = False) -> bytes:
    """Return a line of words with its line end (LF)."""
    text = " ".join(words)
    return _finish(text if tag is None else f"#{tag} {text}", checked)


def format_ok(text: str, *, tag: int | None = None, checked: bool = False) -> bytes:
    """Return the reply to an accepted command."""
    return format_words(["OK", text] if text else ["OK"], tag=tag, checked=checked)


def format_error(error: LineError) -> bytes:
    """Return the reply to a refused line."""
    reason = _one_line(str(error))
    return format_words(["ERR", str(int(error.code)), reason], tag=error.tag, checked=error.checked)


def _one_line(text: str) -> str:
    """Join the lines of a text, such as the faults of a file, into one."""
    return re.sub(r"\s*\n\s*", "; ", re.sub(r":\s*\n\s*", ": ", text.strip()))


def _finish(text: str, checked: bool) -> bytes:
    """Return the bytes of a line; one with ``*`` always gets a checksum, so that its last ``*`` begins a checksum."""
    data = _NOT_SENT.sub(b"?", text.encode("ascii", "replace"))[: MAX_REPLY - 3]
    return data + (b"*%02X\n" % checksum(data) if checked or b"*" in data else b"\n")


def parse_reply(line: bytes) -> Reply | None:
    """Parse a line from omote; return None for an empty one. Raises LineError: it is damaged."""
    if not line.strip(b" \t"):
        return None
    body, checked = _strip_checksum(line)
    match = _REPLY.fullmatch(body.decode("ascii", "replace"))
    if match is None:
        raise LineError(Code.COMMAND, f"not a reply: {body[:32]!r}")
    tag, kind, code, text = match.groups()
    number = None if code is None else int(code)
    return Reply(kind or "ERR", text or "", None if tag is None else int(tag), number, checked)


class LineDecoder:
    """Splits a byte stream into lines.

    CR and LF both end a line. A line longer than ``limit`` is cut off to ``limit`` + 1 bytes, by which the parser
    recognises that it is too long.
    """

    def __init__(self, limit: int = MAX_LINE) -> None:
        self._limit = limit
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Return the lines that ``data`` completes, without line ends; empty lines are left out."""
        pieces = data.replace(b"\r", b"\n").split(b"\n")
        lines = []
        for piece in pieces[:-1]:
            self._take(piece)
            if self._buffer:
                lines.append(bytes(self._buffer))
            self._buffer.clear()
        self._take(pieces[-1])
        return lines

    def clear(self) -> None:
        """Discard an incomplete line, for instance after the port was lost."""
        self._buffer.clear()

    def _take(self, piece: bytes) -> None:
        room = self._limit + 1 - len(self._buffer)
        self._buffer += piece[:room]


def format_frame(time_ms: int, values: np.ndarray, *, checked: bool = False) -> bytes:
    """Return a line with every parameter in order: ``F t v0 v1 ...``. values : (P,) float64."""
    return _finish(f"F {time_ms} " + " ".join(map(number, values.tolist())), checked)


def format_pairs(time_ms: int, items: Iterable[tuple[str, float]], *, checked: bool = False) -> bytes:
    """Return a line with some values by name: ``P t name=value ...``."""
    return _finish(f"P {time_ms} {pairs(items)}", checked)


def pairs(items: Iterable[tuple[str, float]]) -> str:
    """Return ``name=value name=value ...``."""
    return " ".join(f"{name}={number(value)}" for name, value in items)


def number(value: float) -> str:
    """Return a value as text with at most 4 decimals and no trailing zeros."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
