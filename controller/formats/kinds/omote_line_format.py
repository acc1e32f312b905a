"""Format of the omote line protocol, with which another omote or a device is driven (docs/line-protocol.md).

The encoder drives a device: ``FRAME`` for a whole face, ``SET`` and ``RELEASE`` for parts of it. The decoder reads the
same lines from a host, and the lines that an omote streams: ``P t name=value`` and ``F t v0 v1``. Answers ``OK`` and
``ERR`` have no effect. A checksum is checked if there is one; none is sent, because TCP has its own.
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

_NAMES_PER_LINE = 24
"""So that no line is longer than 1024 bytes."""
_MAX_VALUE = 1e6
_STREAM_HZ = 60


class LineDecoder:
    """Decodes lines; an invalid line is counted and has no effect."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters, self._held = parameters, Held(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame, the newest, for lines that set or release a parameter; else none."""
        return [frame for line in message.split(b"\n") for frame in self._read(line)][-1:]

    def _read(self, line: bytes) -> list[Frame]:
        body = _strip_checksum(line.strip())
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
        """Yield the parameter indices and values of a line. Raises ValueError: the line is refused."""
        if name in ("FRAME", "F"):
            numbers = given[name == "F" :]
            if len(numbers) != len(self._parameters):
                raise ValueError(f"lines without {len(self._parameters)} values")
            yield from enumerate(map(_parse_value, numbers))
        elif name == "SET" and given and len(given) % 2 == 0:
            words = zip(given[::2], given[1::2], strict=True)
            yield from ((self._index(word), _parse_value(text)) for word, text in words)
        elif name == "P" and given:
            parts = (each.partition("=") for each in given[1:])
            yield from ((self._index(word), _parse_value(text)) for word, _, text in parts)
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
        index = self._parameters.find(word)
        if index is None:
            raise ValueError("unknown names")
        return index


class LineEncoder:
    """Encodes lines; values are clipped to their ranges, because one outside it makes the receiver refuse the line."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._given = np.zeros(len(parameters), dtype=bool)

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message with all lines of a frame, so that a frame is never sent or dropped in part.

        It is ``FRAME`` if every parameter is given, else ``RELEASE`` of those no longer given, and ``SET`` of the rest.
        """
        mask = frame.mask if frame.face else np.zeros_like(frame.mask)
        released, self._given = np.flatnonzero(self._given & ~mask), mask.copy()
        clipped = np.clip(frame.values, self._parameters.low, self._parameters.high)
        texts = [_format_value(value) for value in clipped.tolist()]
        if mask.all():
            return [" ".join(["FRAME", *texts]).encode()]
        names = self._parameters.names
        lines = [["RELEASE", *(names[i] for i in some)] for some in _split_lines(released.tolist())]
        lines += [["SET", *(word for i in some for word in (names[i], texts[i]))]
                  for some in _split_lines(np.flatnonzero(mask).tolist())]  # fmt: skip
        return ["\n".join(" ".join(line) for line in lines).encode()] if lines else []


def _split_lines(indices: list[int]) -> list[list[int]]:
    """Split parameter indices into lists that each fit into a line."""
    return [indices[i : i + _NAMES_PER_LINE] for i in range(0, len(indices), _NAMES_PER_LINE)]


def _strip_checksum(line: bytes) -> bytes | None:
    """Return a line without its checksum; None if the checksum is wrong."""
    body, star, digits = line.rpartition(b"*")
    if not star:
        return line
    return body if digits.strip().upper() == b"%02X" % checksum(body) else None


def _parse_value(text: str) -> float:
    number = plain_number(text)
    if number is None or not abs(number) <= _MAX_VALUE:
        raise ValueError("values that are not numbers")
    return number


def _time_s(name: str, given: list[str]) -> float | None:
    """Return the time of a streamed line in seconds; None if it has none."""
    number = plain_number(given[0]) if name in ("P", "F") else None
    return None if number is None or not abs(number) < 1e15 else number / 1000.0


def _format_value(value: float) -> str:
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
