"""A simulated text board: it parses the lines that a template makes, as the sketch on a real one would."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from drivers.base.options import option, parse_ids
from drivers.core.families import BOARD_BAUD
from drivers.sim.boards.board import Board
from drivers.sim.wire.line import BufferingReader
from drivers.sim.wire.simulator import Servos, Setting, Simulator
from drivers.text.template import VALUES, Piece, Template, check_texts, pattern_of, pieces_of

MAX_LINE = 4096
LARGEST = 1e9
"""A sketch's numbers have 32 bits."""
MAX_DIGITS = 18


class Message(NamedTuple):
    """One message: `kind` ("move", "off", "query", "frame" or "noise"), the values in it, and its size in bytes."""

    kind: str
    values: Mapping[str, str]
    size: int


class TextReader(BufferingReader):
    """Finds moves, queries and frames in a stream of text.

    forms : kind and pieces of each possible message, the more special before the more general.
    """

    def __init__(self, forms: Sequence[tuple[str, Sequence[Piece]]]) -> None:
        super().__init__()
        self._forms = [(kind, [p.field for p in pieces if p.field], pattern_of(pieces)) for kind, pieces in forms]
        self._open = {kind for kind, pieces in forms if pieces[-1].field}

    def feed(self, data: bytes) -> list[Message]:
        """Messages completed by these bytes. A number at the very end may go on, so it waits."""
        self._buffer += data
        return self._take(last=False)

    def flush(self) -> list[Message]:
        """The messages in the buffer after a pause: a number at its end is complete, and the rest is noise."""
        return self._take(last=True)

    def _take(self, last: bool) -> list[Message]:
        messages = []
        while self._buffer and (message := self._next(last)) is not None:
            messages.append(message)
            self._buffer = self._buffer[message.size :]
        return messages

    def _next(self, last: bool) -> Message | None:
        text = self._buffer.decode("latin-1")
        for kind, fields, pattern in self._forms:
            match = pattern.match(text)
            if match is None:
                continue
            if kind in self._open and match.end() == len(text) and not last:
                return None
            return Message(kind, dict(zip(fields, match.groups(), strict=True)), match.end())
        end = re.search(r"[\r\n]", text)
        if end and len(text) <= MAX_LINE:
            return Message("noise", {}, end.end())
        return Message("noise", {}, 1) if last or len(text) > MAX_LINE else None


class TextBoard(Board):
    """A text board on one port.

    texts : the templates, as :class:`drivers.text.bus.TextBus` takes them.
    ids, names : its servos.
    values : last value by servo id; None while it is off.
    """

    def __init__(
        self, texts: Mapping[str, str], ids: Sequence[int], names: Sequence[str], now_s: float = 0.0, seed: int = 0
    ) -> None:
        move, frame, off, query, _ = check_texts(**texts)
        self._answer = Template("answer", texts["answer"], (*VALUES, "ch", "id", "name")) if query else None
        forms = [("off", off.pieces if off else []), ("query", query.pieces if query else []), ("move", move.pieces)]
        forms += [("frame", part.pieces) for part in frame]
        forms.append(("frame", pieces_of("separator", texts.get("separator", ""), ())))
        self._forms = [(kind, pieces) for kind, pieces in forms if pieces]
        self._value = next(piece.field for piece in move.pieces if piece.field in VALUES)
        self._by_name = dict(zip(names, ids, strict=True))
        self._names = dict(zip(ids, names, strict=True))
        super().__init__(now_s, seed=seed)

    def reset(self, now_s: float) -> None:
        """The state after power-on: everything is off."""
        self.values: dict[int, float | None] = dict.fromkeys(self._names)

    def make_reader(self) -> TextReader:
        return TextReader(self._forms)

    def size(self, packet: Message) -> int:
        return packet.size

    def answer(self, packet: Message, now_s: float) -> list[tuple[int, bytes]]:
        if packet.kind == "frame":
            return []
        servo, value = self._servo(packet.values), float(packet.values.get(self._value, 0.0))
        if packet.kind == "noise" or servo is None or not abs(value) <= LARGEST:
            self.refused += 1
        elif packet.kind == "query" and self._answer is not None:
            named: dict[str, float | str] = {"ch": servo, "id": servo, "name": self._names[servo]}
            values = dict.fromkeys(VALUES, self.values[servo] or 0.0)
            return [(servo, self._answer.fill({**values, **named}).encode())]
        else:
            self.values[servo] = value if packet.kind == "move" else None
        return []

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """The last value of each servo."""
        return [{"id": servo, "name": self._names[servo], self._value: value} for servo, value in self.values.items()]

    def _servo(self, values: Mapping[str, str]) -> int | None:
        """The id that a message names; a board with one servo needs none."""
        if "name" in values:
            return self._by_name.get(values["name"])
        number = values.get("ch", values.get("id"))
        if number is None:
            return next(iter(self.values))
        servo = int(number) if len(number) <= MAX_DIGITS else -1
        return servo if servo in self.values else None


@dataclass(frozen=True, kw_only=True)
class TextOptions:
    """Options of ``omote simulate text``."""

    template: str = option(r"One servo's move, as in a robot file; \n and \r end a line.", r"#{ch}P{us}\r")
    off: str = option("What switches one servo off.", r"#{ch}P0\r")
    query: str = option("Request for the pulse of one servo.", "")
    answer: str = option("The board's answer to --query.", "")
    begin: str = option("Text before the moves of one line.", "")
    separator: str = option("Text between the moves.", "")
    end: str = option("Text after the moves.", "")
    ids: str = option("Ids of the servos: 1-24 or 1,3,7-9.", "1-16")
    baud: int = option("Baud rate of the board.", BOARD_BAUD, at_least=300)


TEXTS = ("template", "off", "query", "answer", "begin", "separator", "end")


def _alone(options: TextOptions, setting: Setting) -> TextBoard:
    texts = {name: getattr(options, name).replace(r"\r", "\r").replace(r"\n", "\n") for name in TEXTS}
    ids = parse_ids(options.ids)
    return TextBoard(texts, ids, [f"servo{i}" for i in ids], setting.now_s, seed=setting.seed)


def _far_end(servos: Servos, options: Mapping[str, Any], setting: Setting) -> TextBoard:
    return TextBoard(ids=[servo for servo, _ in servos], now_s=setting.now_s, seed=setting.seed, **options)


SIMULATOR = Simulator(
    far_end=_far_end,
    alone=_alone,
    options=TextOptions,
    help="""Serve a simulated board that reads lines of a template, until interrupted; prints `ready PATH`.

    Example: omote simulate text --template 'S{ch},{us}\\n' --off 'D{ch}\\n' --link /tmp/board
    """,
)
