"""Lines of the omote line protocol, as another omote or a device sends and takes them (docs/line-protocol.md).

The encoder drives a far end: ``FRAME`` for a whole face, ``SET`` and ``RELEASE`` for parts. The decoder reads the
same lines of a host, and what an omote streams: ``P t name=value`` and ``F t v0 v1``. Its answers, ``OK`` and ``ERR``,
move nothing. Checksums are tested where there are any; none is sent, because TCP has its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from controller.base.parameters import Parameters
from controller.base.plain_numbers import plain_number
from controller.formats.format import API, Format, everything
from controller.formats.frame import Frame, Held, Refusals
from drivers.omote.protocol import checksum

_A_LINE = 24
"""Names in a line, so that none is longer than 1024 bytes."""
_LARGEST = 1e6
_STREAM_HZ = 60


class LineDecoder:
    """Reads lines; what is wrong in one is counted, and nothing of it is taken."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters, self._held = parameters, Held(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        """One frame for lines that give or release something."""
        return [frame for line in message.split(b"\n") for frame in self._read(line)][-1:]

    def _read(self, line: bytes) -> list[Frame]:
        body = _checked(line.strip())
        if body is None:
            self.refused.add("wrong checksums")
            return []
        words = body.decode("ascii", "replace").split()
        if words and words[0].startswith("#"):
            del words[0]
        if not words or words[0] == "OK":
            return []
        name, given = words[0].upper(), words[1:]
        if name == "RELEASE":
            return self._release(given)
        try:
            pairs = dict(self._pairs(name, given))
        except ValueError as error:
            self.refused.add(str(error))
            return []
        self._held.update(pairs)
        return [self._held.frame(time_s=_time_s(name, given))] if pairs else []

    def _pairs(self, name: str, given: list[str]) -> Iterator[tuple[int, float]]:
        """Positions and values of a line. Raises ValueError: why it is refused."""
        if name in ("FRAME", "F"):
            numbers = given[name == "F" :]
            if len(numbers) != len(self._parameters):
                raise ValueError(f"lines without {len(self._parameters)} values")
            yield from enumerate(map(_value, numbers))
        elif name == "SET" and given and len(given) % 2 == 0:
            yield from ((self._index(word), _value(text)) for word, text in zip(given[::2], given[1::2], strict=True))
        elif name == "P" and given:
            parts = (each.partition("=") for each in given[1:])
            yield from ((self._index(word), _value(text)) for word, _, text in parts)
        else:
            raise ValueError("lines that set no parameters")

    def _release(self, given: list[str]) -> list[Frame]:
        if [word.upper() for word in given] == ["ALL"]:
            self._held.mask[:] = False
        else:
            try:
                self._held.mask[[self._index(word) for word in given]] = False
            except ValueError as error:
                self.refused.add(str(error))
                return []
        face = bool(self._held.mask.any())
        return [Frame(self._held.values.copy(), self._held.mask.copy(), face=face)]

    def _index(self, word: str) -> int:
        at = self._parameters.find(word)
        if at is None:
            raise ValueError("unknown names")
        return at


class LineEncoder:
    """Writes lines; values are clipped to their ranges, because a line with another one is refused whole."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._given = np.zeros(len(parameters), dtype=bool)

    def encode(self, frame: Frame) -> list[bytes]:
        """``FRAME`` where everything is given, else ``RELEASE`` of what is not given any more, and ``SET``: all lines
        in one message, so that no face is sent or dropped in part."""
        mask = frame.mask if frame.face else np.zeros_like(frame.mask)
        gone, self._given = np.flatnonzero(self._given & ~mask), mask.copy()
        clipped = np.clip(frame.values, self._parameters.low, self._parameters.high)
        texts = [_number(value) for value in clipped.tolist()]
        if mask.all():
            return [" ".join(["FRAME", *texts]).encode()]
        names = self._parameters.names
        lines = [["RELEASE", *(names[i] for i in some)] for some in _lines_of(gone.tolist())]
        lines += [["SET", *(word for i in some for word in (names[i], texts[i]))]
                  for some in _lines_of(np.flatnonzero(mask).tolist())]  # fmt: skip
        return ["\n".join(" ".join(line) for line in lines).encode()] if lines else []


def _lines_of(places: list[int]) -> list[list[int]]:
    """Positions in runs that fit into a line each."""
    return [places[i : i + _A_LINE] for i in range(0, len(places), _A_LINE)]


def _checked(line: bytes) -> bytes | None:
    """A line without its checksum; None where that is wrong."""
    body, star, digits = line.rpartition(b"*")
    if not star:
        return line
    return body if digits.strip().upper() == b"%02X" % checksum(body) else None


def _value(text: str) -> float:
    number = plain_number(text)
    if number is None or not abs(number) <= _LARGEST:
        raise ValueError("values that are no numbers")
    return number


def _time_s(name: str, given: list[str]) -> float | None:
    """Seconds of a streamed line, which has milliseconds."""
    number = plain_number(given[0]) if name in ("P", "F") else None
    return None if number is None or not abs(number) < 1e15 else number / 1000.0


def _number(value: float) -> str:
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


FORMAT = Format(
    api=API,
    kind="omote-line",
    title="the omote line protocol, as its client",
    transports=("tcp", "serial", "lines"),
    port=9404,
    decoder=LineDecoder,
    encoder=LineEncoder,
    carries=everything,
    delimiter=b"\n",
    most=4096,
    timeout_s=math.inf,
    takes_token=True,
    greeting=f"SUB {_STREAM_HZ} ALL\n".encode(),
)
