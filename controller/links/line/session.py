"""One conversation in the line protocol: bytes in, replies out, a stream of parameters on request.

No ports here: :class:`LineSession` is fed bytes and a time, so every rule of the protocol can be tested without one.
"""

from __future__ import annotations

import math
from collections import Counter
from functools import cache, cached_property
from importlib import metadata

from controller.base.errors import OMOTE_ERRORS, ParameterError
from controller.layers.commands import CommandSink, Player
from controller.links.line.commands import COMMANDS, MAX_RATE_HZ, Grammar
from controller.links.line.protocol import (
    MAX_LINE,
    VERSION,
    Code,
    LineDecoder,
    LineError,
    format_error,
    format_frame,
    format_ok,
    format_parameters,
    number,
    pairs,
)
from controller.links.line.words import (
    Command,
    Expr,
    Gaze,
    GazeAt,
    GazeOff,
    Get,
    Hello,
    Info,
    List,
    Live,
    Measured,
    Neutral,
    Ping,
    Play,
    Read,
    Release,
    Request,
    Set,
    Status,
    Subscribe,
    Unsubscribe,
)
from controller.vocabulary.reading import Readings


class LineSession:
    """The state of one link: what was half received, what is streamed, what was counted.

    Parameters
    ----------
    sink : where accepted commands go.
    start_ns : time zero of the stream (monotonic clock, ns).

    Attributes
    ----------
    accepted : lines taken. refused : lines refused, by error code.
    """

    def __init__(self, sink: CommandSink, start_ns: int) -> None:
        self._sink = sink
        self._parameters = sink.parameters
        self._grammar = Grammar(sink.parameters, lambda name: sink.vocabulary[name].name)
        self._decoder = LineDecoder()
        self._values = sink.parameters.neutral()
        self._start_ns = start_ns
        self._stream: Request | None = None
        self._due_ns = 0
        self.accepted = 0
        self.refused: Counter[int] = Counter()

    def feed(self, data: bytes, now_ns: int) -> bytes:
        """Act on bytes that arrived at ``now_ns``; returns the replies, one line for each line that has anything."""
        return b"".join(self._line(line, now_ns) for line in self._decoder.feed(data))

    def due_ns(self) -> int | None:
        """When the next streamed line is due; None without a subscription."""
        return None if self._stream is None else self._due_ns

    def stream(self, now_ns: int) -> bytes:
        """The streamed line that is due, with the newest values; empty when none is. Missed ones are left out."""
        request = self._stream
        if request is None or now_ns < self._due_ns or not isinstance(request.command, Subscribe):
            return b""
        period = round(1e9 / request.command.rate_hz)
        self._due_ns += period * (1 + (now_ns - self._due_ns) // period)
        return self._streamed(request.command, (now_ns - self._start_ns) // 1_000_000, request.checked)

    def _streamed(self, command: Subscribe, time_ms: int, checked: bool) -> bytes:
        question, indices = command.question, command.indices
        if isinstance(question, Read):
            if not self._look(question.measured):
                return b""
            shown = self._readings.read(question.what, self._values)
            return format_parameters(time_ms, *_unzip(shown), checked=checked)
        if not self._look(question is not None):
            return b""
        indices = indices if question is None else question.indices
        if len(indices) == len(self._values):
            return format_frame(time_ms, self._values, checked=checked)
        names = [self._parameters.names[i] for i in indices]
        return format_parameters(time_ms, names, self._values[list(indices)], checked=checked)

    def _look(self, measured: bool) -> bool:
        """Take the face that is shown, or that the servos make; False when that is not known."""
        if measured:
            return self._sink.measured(self._values)
        self._sink.snapshot(self._values)
        return True

    def drop(self) -> None:
        """The other side is gone for a while: forget its half line; its subscription goes on when it is back."""
        self._decoder.clear()

    def _line(self, line: bytes, now_ns: int) -> bytes:
        try:
            request = self._grammar.parse(line)
            if request is None:
                return b""
            text = self._do(request, now_ns)
        except LineError as error:
            self.refused[int(error.code)] += 1
            return format_error(error)
        self.accepted += 1
        return format_ok(text, tag=request.tag, checked=request.checked)

    def _do(self, request: Request, now_ns: int) -> str:
        """Act on a request; returns the text of the reply."""
        try:
            if isinstance(request.command, Subscribe):
                self._stream, self._due_ns = request, now_ns
            elif isinstance(request.command, Unsubscribe):
                self._stream = None
            elif not self._act(request.command, now_ns):
                return self._answer(request.command)
            return _receipt(request.command)
        except OMOTE_ERRORS as error:
            raise LineError(Code.BUSY, str(error), tag=request.tag, checked=request.checked) from error

    def _act(self, command: Command, now_ns: int) -> bool:
        """Hand a command that changes the face to the sink; False when it is a question."""
        sink = self._sink
        match command:
            case Set(indices, values):
                sink.set_parameters(indices, values, now_ns)
            case Release(indices):
                sink.release(indices, now_ns)
            case Expr(name, intensity, duration_s):
                sink.expression(name, intensity, duration_s, now_ns)
            case Gaze(yaw, pitch):
                sink.gaze(math.radians(yaw), math.radians(pitch), now_ns)
            case GazeAt(x, y, z):
                sink.gaze_at(x, y, z, now_ns)
            case GazeOff():
                sink.gaze_off(now_ns)
            case Neutral(seconds):
                sink.neutral(seconds, now_ns)
            case Live(amount):
                sink.live(amount, now_ns)
            case Play(what, to):
                _play(sink.shows, what, to)
            case _:
                return False
        return True

    def _answer(self, command: Command) -> str:
        """Text of the reply to a question."""
        match command:
            case Get(indices):
                self._look(measured=False)
                return "GET " + self._get(indices)
            case Measured(indices):
                self._look_at_servos()
                return "MEASURED " + self._get(indices)
            case Read(what, measured):
                self._look_at_servos() if measured else self._look(measured=False)
                return f"READ {what} " + pairs(*_unzip(self._readings.read(what, self._values)))
            case Info(index):
                return "INFO " + self._info(index)
            case Status():
                return "STATUS " + " ".join(f"{key}={_word(value)}" for key, value in self._status().items())
            case List(what):
                return f"LIST {what} " + " ".join(self._list(what))
            case Hello():
                limits = f"parameters={len(self._parameters)} max_line={MAX_LINE} max_rate_hz={MAX_RATE_HZ:g}"
                return f"HELLO omote {package_version()} protocol={VERSION} {limits}"
            case Ping(text):
                return f"PONG {text}".rstrip()
        raise TypeError(f"no answer to {command!r}")

    def _look_at_servos(self) -> None:
        if not self._look(measured=True):
            raise LineError(Code.BUSY, "no servo says where it stands")

    @cached_property
    def _readings(self) -> Readings:
        return Readings(self._parameters, self._sink.vocabulary)

    def _get(self, indices: tuple[int, ...]) -> str:
        if len(indices) == len(self._values):
            return "ALL " + " ".join(map(number, self._values.tolist()))
        return pairs((self._parameters.names[i] for i in indices), (self._values[i] for i in indices))

    def _info(self, index: int) -> str:
        p = self._parameters
        self._sink.snapshot(self._values)
        text = f"{p.names[index]} value={number(self._values[index])} low={p.low[index]:g} high={p.high[index]:g}"
        text += f" region={p.regions[index]} layer={self._sink.holder(index) or 'none'}"
        full = math.degrees(p.full_scale_rad[index])
        return text if math.isnan(full) else f"{text} full_scale_deg={full:g}"

    def _status(self) -> dict[str, str | int | float]:
        show = self._sink.shows.status() if self._sink.shows is not None else "off"
        return {**self._sink.status(), "show": show, "accepted": self.accepted, "refused": self.refused.total()}

    def _list(self, what: str) -> tuple[str, ...]:
        if what == "HOLDERS":
            return tuple(self._sink.holder(i) or "none" for i in range(len(self._parameters)))
        return {
            "PARAMETERS": self._parameters.names,
            "EXPRESSIONS": self._sink.vocabulary.names,
            "LAYERS": self._sink.layer_names(),
            "COMMANDS": COMMANDS,
        }[what]


def _receipt(command: Command) -> str:
    """What an accepted command is acknowledged with."""
    match command:
        case Set(indices, _) | Release(indices):
            return f"{type(command).__name__.upper()} {len(indices)}"
        case Expr(name, intensity, _):
            return f"EXPR {name} {number(intensity)}"
        case Subscribe(rate, _, Read(what, measured)):
            return f"SUB {number(rate)} READ {what}" + (" MEASURED" if measured else "")
        case Subscribe(rate, _, Measured(indices)):
            return f"SUB {number(rate)} MEASURED {len(indices)}"
        case Subscribe(rate, indices):
            return f"SUB {number(rate)} {len(indices)}"
        case Unsubscribe():
            return "UNSUB"
        case Gaze() | GazeAt() | GazeOff():
            return "GAZE"
        case Play(what, to):
            return f"SHOW {what} {to}".rstrip()
        case Live(amount):
            return f"LIFE {number(amount)}"
    return "NEUTRAL"


def _play(shows: Player | None, what: str, to: str) -> None:
    """Raises ConfigError or ParameterError: no shows here, no such script, mark or time."""
    if shows is None:
        raise ParameterError("no shows can be played here", hint="omote run plays them")
    if what not in ("PLAY", "PAUSE", "STOP", "SEEK"):
        shows.start(what)
        return
    try:
        shows.control(what, float(to) if to else 0.0)
    except ValueError:
        shows.control(what, to)


def _unzip(shown: list[tuple[str, float]]) -> tuple[list[str], list[float]]:
    return [name for name, _ in shown], [value for _, value in shown]


def _word(value: str | int | float) -> str:
    return number(value) if isinstance(value, float) else str(value)


@cache
def package_version() -> str:
    """Version of the installed omote; ``0`` when it runs from a folder that is not installed."""
    try:
        return metadata.version("omote")
    except metadata.PackageNotFoundError:
        return "0"
