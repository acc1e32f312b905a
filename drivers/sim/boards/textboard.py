"""A simulated text board: it understands the lines that a template makes, as the sketch on a real one would."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from drivers.base.options import option, parse_ids
from drivers.core.families import BOARD_BAUD
from drivers.sim.boards.board import Board
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.simulator import Servos, Setting, Simulator
from drivers.text.template import VALUES, Piece, Template, check_texts, pattern_of, pieces_of

MAX_LINE = 4096


class Said(NamedTuple):
    """One thing that was said: ``what`` ("move", "off", "query", "frame" or "noise") and the values in it."""

    what: str
    values: Mapping[str, str]
    size: int


class TextReader:
    """Finds moves, questions and frames in a stream of text.

    Parameters
    ----------
    forms : the pieces of each thing that may be said, the more special before the more general.
    """

    def __init__(self, forms: Sequence[tuple[str, Sequence[Piece]]]) -> None:
        self._forms = [(what, [p.field for p in pieces if p.field], pattern_of(pieces)) for what, pieces in forms]
        self._open = {what for what, pieces in forms if pieces[-1].field}
        self._buffer = ""

    @property
    def pending(self) -> int:
        """Characters of what is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Said]:
        """What these bytes complete. A number at the very end may go on, so it waits."""
        self._buffer += data.decode("latin-1")
        said = []
        while self._buffer and (found := self._next()) is not None:
            said.append(found)
            self._buffer = self._buffer[found.size :]
        return said

    def flush(self) -> list[Said]:
        """After a pause what is there is all there is."""
        said = []
        while self._buffer:
            found = self._next(last=True) or Said("noise", {}, 1)
            said.append(found)
            self._buffer = self._buffer[found.size :]
        return said

    def take_pending(self) -> bytes:
        """Forget what is not complete."""
        data, self._buffer = self._buffer.encode("latin-1"), ""
        return data

    def _next(self, last: bool = False) -> Said | None:
        for what, fields, pattern in self._forms:
            match = pattern.match(self._buffer)
            if match is None:
                continue
            if what in self._open and match.end() == len(self._buffer) and not last:
                return None
            return Said(what, dict(zip(fields, match.groups(), strict=True)), match.end())
        return Said("noise", {}, 1) if len(self._buffer) > MAX_LINE else self._skip()

    def _skip(self) -> Said | None:
        """Past a line that nobody understands, once its end is there."""
        end = re.search(r"[\r\n]", self._buffer)
        return Said("noise", {}, end.end()) if end else None


class TextBoard(Board):
    """A text board on one port.

    Parameters
    ----------
    texts : the templates, as :class:`drivers.text.bus.TextBus` takes them.
    ids, names : its servos.
    now_s : time. faults : see :data:`drivers.sim.boards.board.FAULTS`. seed : of random faults.

    Attributes
    ----------
    told : last value by servo id; None while it is off.
    refused : things it did not understand.
    """

    def __init__(
        self,
        texts: Mapping[str, str],
        ids: Sequence[int],
        names: Sequence[str],
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        seed: int = 0,
    ) -> None:
        move, frame, off, query, _ = check_texts(**texts)
        self._answer = Template("answer", texts["answer"], (*VALUES, "ch", "id", "name")) if query else None
        forms = [("off", off.pieces if off else []), ("query", query.pieces if query else []), ("move", move.pieces)]
        forms += [("frame", part.pieces) for part in frame]
        forms.append(("frame", pieces_of("separator", texts.get("separator", ""), ())))
        self._forms = [(what, pieces) for what, pieces in forms if pieces]
        self._value = next(piece.field for piece in move.pieces if piece.field in VALUES)
        self._by_name = dict(zip(names, ids, strict=True))
        self._names = dict(zip(ids, names, strict=True))
        self.refused = 0
        self.reset(now_s)
        super().__init__(now_s, faults, seed)

    def reset(self, now_s: float) -> None:
        """Begin as after power-on: nothing is on."""
        self.told: dict[int, float | None] = dict.fromkeys(self._names)

    def make_reader(self) -> TextReader:
        """A reader of what is said."""
        return TextReader(self._forms)

    def size(self, packet: Said) -> int:
        """Bytes of it on the wire."""
        return packet.size

    def answer(self, packet: Said, now_s: float) -> list[tuple[int, bytes]]:
        """Do what was said."""
        if packet.what == "frame":
            return []
        servo = self._servo(packet.values)
        if packet.what == "noise" or servo is None:
            self.refused += 1
        elif packet.what == "query" and self._answer is not None:
            value = self.told[servo] or 0.0
            named: dict[str, float | str] = {"ch": servo, "id": servo, "name": self._names[servo]}
            return [(servo, self._answer.fill({**dict.fromkeys(VALUES, value), **named}).encode())]
        else:
            self.told[servo] = float(packet.values[self._value]) if packet.what == "move" else None
        return []

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """The last value of each servo."""
        return [{"id": servo, "name": self._names[servo], self._value: value} for servo, value in self.told.items()]

    def _servo(self, values: Mapping[str, str]) -> int | None:
        """Whom it is about; a board with one servo needs not be told."""
        if "name" in values:
            return self._by_name.get(values["name"])
        number = values.get("ch", values.get("id"))
        servo = int(number) if number is not None else next(iter(self.told))
        return servo if servo in self.told else None


@dataclass(frozen=True, kw_only=True)
class TextOptions:
    """What ``omote simulate text`` can be told."""

    template: str = option(r"One servo's move, as in a robot file; \n and \r end a line.", r"#{ch}P{us}\r")
    off: str = option("What switches one servo off.", r"#{ch}P0\r")
    query: str = option("What asks for one servo.", "")
    answer: str = option("What comes back; it goes with --query.", "")
    begin: str = option("What stands before the moves of one line.", "")
    separator: str = option("What stands between them.", "")
    end: str = option("What stands behind them.", "")
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
