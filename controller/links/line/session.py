"""Handles the lines of one far end in the line protocol, without any I/O: bytes in; replies and streamed lines out."""

from __future__ import annotations

import logging
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

from controller.base.errors import OMOTE_ERRORS, ParameterError
from controller.base.plain_numbers import plain_number
from controller.base.version import package_version
from controller.layers.commands import CommandSink, Player
from controller.links.access import same_token
from controller.links.line.checksums import ChecksumRule
from controller.links.line.commands import COMMANDS, MAX_RATE_HZ, Command, Grammar, Request, help_of
from controller.links.line.protocol import (
    MAX_LINE,
    VERSION,
    Code,
    LineDecoder,
    LineError,
    Words,
    format_error,
    format_frame,
    format_ok,
    format_pairs,
    is_stop,
    number,
    pairs,
    parse_words,
)
from controller.vocabulary.reading import Readings

log = logging.getLogger(__name__)

_MAX_LOGGED = 50
"""Number of different errors that a link logs."""
_MAX_SHOWN = 100
"""Characters of an error that its answer shows."""


class LineSession:
    """The state of one link: its incomplete line, its stream, its counts.

    Parameters
    ----------
    sink : receives accepted commands.
    start_ns : time zero of the stream (monotonic clock, ns).
    name : of the sender, for people; a STOP is reported under it.
    checksum : when lines need a checksum, one of :data:`controller.links.line.checksums.CHECKSUMS`.
    scripted : whether the lines come from a script; see :class:`controller.links.line.commands.Grammar`.
    token : that ``AUTH`` must give before anything else is accepted; None: no token is needed.

    Attributes
    ----------
    accepted : number of lines accepted. refused : number of lines refused, by error code. unanswered : number of lines
    whose answer could not be sent. faults : number of errors of omote itself; last_fault : the last one.
    locked : whether a needed token has not been given yet. wrong_tokens : number of wrong tokens.
    """

    def __init__(
        self,
        sink: CommandSink,
        start_ns: int,
        *,
        name: str = "line",
        checksum: str = "optional",
        scripted: bool = False,
        token: str | None = None,
    ) -> None:
        self._sink = self._target = self._streamed_sink = sink  # of this line, of lines without @, of the stream
        self._name = name
        self._checksums = ChecksumRule(checksum)
        self._version = package_version()  # read once at the start: later there may be no file descriptor left
        self._parameters = sink.parameters
        self._grammar = Grammar(sink.parameters, lambda name: sink.vocabulary[name].name, scripted=scripted)
        self._decoder = LineDecoder()
        self._values = sink.parameters.neutral()
        self._start_ns = start_ns
        self._stream: Request | None = None
        self._due_ns = 0
        self.accepted = 0
        self.refused: Counter[int] = Counter()
        self.unanswered = 0
        self.faults = 0
        self.last_fault = ""
        self._logged: set[str] = set()
        self._stops_waiting = 0
        self._token = token
        self.locked, self.wrong_tokens = token is not None, 0

    def feed(self, data: bytes, now_ns: int) -> bytes:
        """Act on bytes that arrived at ``now_ns`` and return the replies, one for each line that is not empty."""
        return b"".join(self.answers(data, now_ns))

    def answers(self, data: bytes, now_ns: int) -> Iterator[bytes]:
        """Like :meth:`feed`, but yield each reply as soon as its line has been acted on; a STOP acts first."""
        lines = self._decoder.feed(data)
        self._stops_waiting = 0 if self.locked else sum(map(is_stop, lines))
        if self._stops_waiting:
            self._sink.stop_latch.stop(self._name, now_ns)
        for line in lines:
            yield self._line(line, now_ns)

    def due_ns(self) -> int | None:
        """Return when the next streamed line is due; None without a subscription."""
        return None if self._stream is None else self._due_ns

    def stream(self, now_ns: int) -> bytes:
        """Return the streamed line that is due, with the newest values; else empty. Missed lines are skipped."""
        request = self._stream
        if request is None or request.command.question is None or now_ns < self._due_ns:
            return b""
        period = round(1e9 / request.command.values[0])
        self._due_ns += period * (1 + (now_ns - self._due_ns) // period)
        try:
            return self._stream_line(request.command.question, (now_ns - self._start_ns) // 1_000_000, request.checked)
        except Exception as error:  # noqa: BLE001  it ends this stream and nothing else
            self._stream = None
            self.fault(error, "it ends the stream")
            return b""

    def _stream_line(self, question: Command, time_ms: int, checked: bool) -> bytes:
        self._sink = self._streamed_sink
        if not self._read_face(question.measured):
            return b""
        if question.name == "READ":
            return format_pairs(time_ms, self._readings.read(question.words[0], self._values), checked=checked)
        if len(question.indices) == len(self._values):
            return format_frame(time_ms, self._values, checked=checked)
        return format_pairs(time_ms, self._named(question.indices), checked=checked)

    def _read_face(self, measured: bool) -> bool:
        """Read the commanded face, or the one that the servos show; return False if that is not known."""
        if measured:
            return self._sink.measured(self._values)
        self._sink.snapshot(self._values)
        return True

    def drop(self) -> None:
        """Discard an incomplete line after the port was lost; a subscription continues."""
        self._decoder.clear()

    def _line(self, line: bytes, now_ns: int) -> bytes:
        words = None
        try:
            words = self._words(line)
            if words is None:
                return b""
            if self.locked:
                self._check_token(words)
            request = self._grammar.request(words)
            self._sink = self._find(words.to) if words.to else self._target
            text = self._do(request, now_ns)
        except Exception as error:  # noqa: BLE001  one line must not cost another its answer
            refusal = self._refusal(error)
            if words is not None:
                refusal.tag, refusal.checked = words.tag, words.checked
            self.refused[int(refusal.code)] += 1
            return format_error(refusal)
        self.accepted += 1
        return format_ok(text, tag=words.tag, checked=words.checked)

    def _words(self, line: bytes) -> Words | None:
        """Return the words of a line; None if it is empty. A STOP counts however damaged its line is.

        Raises LineError: the line is refused.
        """
        stop = is_stop(line)
        try:
            words = parse_words(line)
        except LineError as error:
            if not stop:
                raise
            return Words(("STOP",), checked=error.checked)
        if words is not None and not stop:
            self._checksums.check(words)
        return words

    def _find(self, name: str) -> CommandSink:
        """Return the head or group of a name. Raises LineError: unknown name."""
        try:
            return self._sink.heads.find(name)
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error

    def _check_token(self, words: Words) -> None:
        """Unlock the session if the words are ``AUTH`` and the token. Raises LineError for anything else."""
        command, *rest = words.words
        if command.upper() == "AUTH" and len(rest) == 1 and same_token(rest[0], self._token or ""):
            self.locked = False
            return
        self.wrong_tokens += command.upper() == "AUTH"
        raise LineError(Code.TOKEN, "a token is needed first: AUTH token")

    def _refusal(self, error: Exception) -> LineError:
        if isinstance(error, LineError):
            return error
        if isinstance(error, OMOTE_ERRORS):
            return LineError(Code.BUSY, str(error))
        self.fault(error, "the link continues with the next line")
        return LineError(Code.FAULT, f"an error in omote, see its log: {self.last_fault[:_MAX_SHOWN]}")

    def _do(self, request: Request, now_ns: int) -> str:
        """Act on a request and return the text of the reply."""
        command = request.command
        match command.name:
            case "SUB" | "UNSUB":
                self._stream, self._due_ns = (request if command.question else None), now_ns
                self._streamed_sink = self._sink
            case "TO":
                self._target = self._find(command.words[0])
            case "STOP":
                self._stops_waiting = max(0, self._stops_waiting - 1)
                self._sink.stop_latch.stop(self._name, now_ns)
            case "START":
                self._start()
            case "AUTH":
                return "AUTH"
            case "HELLO":
                for mode in command.words:
                    self._checksums.change(mode, checked=request.checked)
                return self._answer(command, now_ns)
            case _:
                return _receipt(command) if self._act(command, now_ns) else self._answer(command, now_ns)
        return _receipt(command)

    def fault(self, error: Exception, consequence: str) -> None:
        """Count an error of omote itself; log each different one once, up to 50."""
        self.faults, self.last_fault = self.faults + 1, f"{type(error).__name__}: {error}"
        if self.last_fault not in self._logged and len(self._logged) < _MAX_LOGGED:
            self._logged.add(self.last_fault)
            shown = error if os.environ.get("OMOTE_DEBUG") else None
            log.error("%s: %s; %s", self._name, self.last_fault, consequence, exc_info=shown)

    def _act(self, command: Command, now_ns: int) -> bool:
        """Pass a command that changes the face to the sink; return False if it is a query."""
        sink, values = self._sink, command.values
        match command.name:
            case "SET":
                sink.set_parameters(command.indices, values, now_ns)
            case "RELEASE":
                sink.release(command.indices, now_ns)
            case "EXPR":
                sink.expression(command.words[0], values[0], values[1] if values[1:] else None, now_ns)
            case "VISEME":
                sink.viseme(command.words, values, now_ns)
            case "GAZE" | "GAZE AT" | "GAZE ROOM" | "GAZE HEAD" | "GAZE OFF":
                self._gaze(command, now_ns)
            case "TURN":
                self._turn(command.words[0], now_ns)
            case "NEUTRAL":
                sink.neutral(values[0], now_ns)
            case "LIFE":
                sink.live(values[0], now_ns, *(word.lower() for word in command.words))
            case "SHOW":
                _play(sink.shows, *command.words)
            case _:
                return False
        return True

    def _gaze(self, command: Command, now_ns: int) -> None:
        match command.name, command.values:
            case "GAZE HEAD", _:
                self._sink.gaze_head(command.words[0], now_ns)
            case "GAZE ROOM", (x, y, z):
                self._sink.gaze_room(x, y, z, now_ns)
            case _, (x, y, z):
                self._sink.gaze_at(x, y, z, now_ns)
            case _, (yaw, pitch):
                self._sink.gaze(math.radians(yaw), math.radians(pitch), now_ns)
            case _:
                self._sink.gaze_off(now_ns)

    def _turn(self, name: str, now_ns: int) -> None:
        turns = self._sink.heads.turns
        if turns is None:
            raise LineError(Code.NAME, "there is one head here: nobody to take turns with")
        turns.give(None if name.upper() == "OFF" else name, now_ns)

    def _start(self) -> None:
        """Let the servos move again, unless a STOP has arrived after this line."""
        if self._stops_waiting > 0:
            raise LineError(Code.BUSY, "a STOP follows this line, and stops first; send START after its answer")
        self._sink.stop_latch.start()

    def _answer(self, command: Command, now_ns: int) -> str:
        """Return the text of the reply to a query."""
        name, words = command.name, command.words
        if name in ("GET", "MEASURED", "READ", "INFO") and not self._read_face(command.measured):
            raise LineError(Code.BUSY, "no servo reports its position")
        match name:
            case "GET" | "MEASURED":
                return f"{name} {self._get(command.indices)}"
            case "READ":
                return f"READ {words[0]} " + pairs(self._readings.read(words[0], self._values))
            case "INFO":
                return "INFO " + self._info(command.indices[0])
            case "STATUS":
                return "STATUS " + " ".join(f"{key}={_word(value)}" for key, value in self._status(now_ns).items())
            case "HELP":
                return f"HELP {help_of(words[0] if words else None)}"
            case "LIST":
                return f"LIST {words[0]} " + " ".join(self._list(words[0]))
            case "HELLO":
                limits = f"parameters={len(self._parameters)} max_line={MAX_LINE} max_rate_hz={MAX_RATE_HZ:g}"
                return f"HELLO omote {self._version} protocol={VERSION} {limits} checksum={self._checksums.mode}"
        return " ".join(["PONG", *words])

    @cached_property
    def _readings(self) -> Readings:
        return Readings(self._parameters, self._sink.vocabulary)

    def _get(self, indices: tuple[int, ...]) -> str:
        if len(indices) == len(self._values):
            return "ALL " + " ".join(map(number, self._values.tolist()))
        return pairs(self._named(indices))

    def _named(self, indices: tuple[int, ...]) -> list[tuple[str, float]]:
        return [(self._parameters.names[i], float(self._values[i])) for i in indices]

    def _info(self, index: int) -> str:
        p = self._parameters
        text = f"{p.names[index]} value={number(self._values[index])} low={p.low[index]:g} high={p.high[index]:g}"
        text += f" rest={p.rest[index]:g}" if p.rest[index] else ""
        text += f" region={p.regions[index]} layer={self._sink.holder(index) or 'none'}"
        full = math.degrees(p.full_scale_rad[index])
        return text if math.isnan(full) else f"{text} full_scale_deg={full:g}"

    def _status(self, now_ns: int) -> dict[str, str | int | float]:
        show = self._sink.shows.status() if self._sink.shows is not None else "off"
        counts = {"accepted": self.accepted, "refused": self.refused.total(), "unanswered": self.unanswered}
        return {**self._sink.status(), "show": show, **self._stopped(now_ns), **counts}

    def _stopped(self, now_ns: int) -> dict[str, str | float]:
        """Return who stopped the servos, as one word, and how long ago (s)."""
        stopped = self._sink.stop_latch.stopped
        if stopped is None:
            return {"stopped": "no"}
        return {"stopped": "_".join(stopped.who.split()), "stopped_s": max(0.0, (now_ns - stopped.at_ns) * 1e-9)}

    def _list(self, what: str) -> Sequence[str]:
        lists: dict[str, Callable[[], Sequence[str]]] = {
            "PARAMETERS": lambda: self._parameters.names,
            "EXPRESSIONS": lambda: self._sink.vocabulary.names,
            "LAYERS": self._sink.layer_names,
            "VISEMES": lambda: self._grammar.visemes.names,
            "SHOWS": lambda: self._sink.shows.names() if self._sink.shows is not None else (),
            "HEADS": lambda: self._sink.heads.names,
            "GROUPS": lambda: self._sink.heads.groups,
            "HOLDERS": lambda: [self._sink.holder(i) or "none" for i in range(len(self._parameters))],
            "COMMANDS": lambda: COMMANDS,
        }
        return lists[what]()


def _receipt(command: Command) -> str:
    """Return the text of the reply to a command that was carried out."""
    name, question = command.name, command.question
    if question is not None:
        kind = [] if question.name == "GET" else [question.name]
        return " ".join([name, number(command.values[0]), *kind, *(question.words or (str(len(question.indices)),))])
    if name in ("SET", "RELEASE"):
        return f"{name} {len(command.indices)}"
    if name == "EXPR":
        return " ".join([name, *command.words, number(command.values[0])])
    if name == "VISEME":
        pairs_of = zip(command.words, map(number, command.values), strict=True)
        return " ".join([name, *(word for pair in pairs_of for word in pair)])
    if name == "LIFE":
        return " ".join([name, number(command.values[0]), *command.words])
    return " ".join([name.partition(" ")[0], *command.words])


def _play(shows: Player | None, what: str, to: str = "0") -> None:
    """Start or control a show. Raises ConfigError or ParameterError: no player, or no such script, mark or time."""
    if shows is None:
        raise ParameterError("no shows can be played here", hint="omote run plays them")
    if what not in ("PLAY", "PAUSE", "STOP", "SEEK"):
        shows.start(what)
        return
    seconds = plain_number(to)
    shows.control(what, to if seconds is None else seconds)


def _word(value: str | int | float) -> str:
    return number(value) if isinstance(value, float) else str(value)
