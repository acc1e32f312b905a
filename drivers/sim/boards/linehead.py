"""A simulated head that takes the omote line protocol, as a small board with a short sketch does."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.base.options import option
from drivers.core.families import BOARD_BAUD
from drivers.omote.protocol import checksum
from drivers.sim.boards.board import Board
from drivers.sim.wire.line import BufferingReader
from drivers.sim.wire.simulator import Setting, Simulator

MAX_LINE = 200
SILENCE_S = 1.0
"""A head that receives nothing for so long releases all its outputs."""


class HeadReader(BufferingReader):
    """Cuts a byte stream into lines; CR and LF end one."""

    def feed(self, data: bytes) -> list[bytes]:
        """Lines completed by these bytes; empty ones are left out."""
        *lines, rest = (self._buffer + data).replace(b"\r", b"\n").split(b"\n")
        self._buffer = rest[: MAX_LINE + 1]
        return [line for line in lines if line.strip()]


class _Refusal(Exception):
    """A line that is answered with ERR."""


class LineHead(Board):
    """A head with named outputs.

    names : its outputs. simple : it does not know GET.
    values : by name; None while it is released.
    refused : lines answered with ERR.
    """

    def __init__(self, names: Sequence[str], now_s: float = 0.0, seed: int = 0, simple: bool = False) -> None:
        self._names, self.simple = list(names), simple
        super().__init__(now_s, seed=seed)

    def reset(self, now_s: float) -> None:
        """The state after power-on: everything released."""
        self.values: dict[str, float | None] = dict.fromkeys(self._names)
        self._received_s = now_s

    def make_reader(self) -> HeadReader:
        return HeadReader()

    def size(self, packet: bytes) -> int:
        return len(packet) + 1

    def answer(self, packet: bytes, now_s: float) -> list[tuple[int, bytes]]:
        self._release_after_silence(now_s)
        self._received_s = now_s
        tag, checked = "", False
        try:
            words, checked = _words(packet)
            if words and words[0].startswith("#"):
                tag, words = words[0] + " ", words[1:]
            text = f"OK {self._do(words)}"
        except _Refusal as refusal:
            self.refused += 1
            text = f"ERR {refusal}"
        data = (tag + text).encode("ascii", "replace")
        return [(0, data + (b"*%02X\n" % checksum(data) if checked else b"\n"))]

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """The value of each output."""
        self._release_after_silence(now_s)
        return [{"id": k, "name": name, "value": value} for k, (name, value) in enumerate(self.values.items())]

    def _release_after_silence(self, now_s: float) -> None:
        if now_s - self._received_s > SILENCE_S:
            self.values = dict.fromkeys(self._names)

    def _do(self, words: Sequence[str]) -> str:
        commands: dict[str, Callable[[Sequence[str]], str]] = {
            "HELLO": lambda rest: f"HELLO head protocol=1 parameters={len(self.values)} max_line={MAX_LINE}",
            "PING": lambda rest: " ".join(("PONG", *rest)),
            "SET": self._set,
            "RELEASE": self._release,
        }
        if not self.simple:
            commands["GET"] = self._get
        word = words[0].upper() if words else ""
        if word not in commands:
            raise _Refusal(f"20 there is no command {word!r} (there are {', '.join(commands)})")
        return commands[word](words[1:])

    def _set(self, words: Sequence[str]) -> str:
        if not words or len(words) % 2:
            raise _Refusal("21 SET name value [name value ...]")
        new = {self._known(name): _number(value) for name, value in zip(words[::2], words[1::2], strict=True)}
        self.values.update(new)
        return f"SET {len(new)}"

    def _release(self, words: Sequence[str]) -> str:
        names = self._names if [word.upper() for word in words] == ["ALL"] else [self._known(word) for word in words]
        self.values.update(dict.fromkeys(names))
        return f"RELEASE {len(names)}"

    def _get(self, words: Sequence[str]) -> str:
        return " ".join(("GET", *(f"{name}={self.values[self._known(name)] or 0.0:g}" for name in words)))

    def _known(self, name: str) -> str:
        if name not in self.values:
            raise _Refusal(f"23 unknown name {name!r}")
        return name


def _words(line: bytes) -> tuple[list[str], bool]:
    """The words of a line, and whether it has a checksum; raises _Refusal where that is wrong."""
    if len(line) > MAX_LINE:
        raise _Refusal(f"10 a line has at most {MAX_LINE} bytes")
    body, star, sum_ = line.rpartition(b"*")
    if not star:
        return line.decode("ascii", "replace").split(), False
    if sum_.strip().upper() != b"%02X" % checksum(body):
        raise _Refusal("13 wrong checksum")
    return body.decode("ascii", "replace").split(), True


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise _Refusal(f"22 {text!r} is not a number")
    return value


@dataclass(frozen=True, kw_only=True)
class HeadOptions:
    """Options of ``omote simulate omote``."""

    names: str = option("What the head takes, with commas; all parameters without it.", "")
    baud: int = option("Baud rate of the board.", BOARD_BAUD, at_least=300)


def _alone(options: HeadOptions, setting: Setting) -> LineHead:
    names = [name.strip() for name in options.names.split(",") if name.strip()] or setting.names
    return LineHead(names, setting.now_s, seed=setting.seed)


SIMULATOR = Simulator(
    far_end=lambda servos, options, setting: LineHead(now_s=setting.now_s, seed=setting.seed, **options),
    alone=_alone,
    options=HeadOptions,
    help="""Serve a simulated head that takes the omote line protocol, until interrupted; prints `ready PATH`.

    Example: omote simulate omote --names jawOpen,headYaw --link /tmp/head
    """,
)
