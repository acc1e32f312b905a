"""The commands of the omote line protocol: what the words of a line mean, and the words of a command.

:class:`Grammar` is pure: it knows names and ranges, and makes ``Set((17,), (0.8,))`` of ``SET jawOpen 0.8``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

from controller.base.errors import ParameterError
from controller.base.parameters import Parameters, did_you_mean
from controller.links.line.protocol import Code, LineError, Words, format_words, parse_words
from controller.links.line.words import (
    READINGS,
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

MAX_RATE_HZ = 200.0
MIN_RATE_HZ = 0.1
GAZE_YAW_DEG = 95.0
GAZE_PITCH_DEG = 70.0
MAX_DISTANCE_MM = 1e6
MIN_DURATION_S = 0.05
MAX_DURATION_S = 3600.0
MAX_FADE_S = 60.0
LISTS = ("COMMANDS", "EXPRESSIONS", "HOLDERS", "LAYERS", "PARAMETERS")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")


class Grammar:
    """Parses and formats the lines of one vocabulary.

    Parameters
    ----------
    parameters : the registry. find_expression : canonical name of an expression; raises ParameterError.
    """

    def __init__(self, parameters: Parameters, find_expression: Callable[[str], str]) -> None:
        self._parameters = parameters
        self._find_expression = find_expression
        self._all = tuple(range(len(parameters)))

    def parse(self, line: bytes) -> Request | None:
        """The request of a line without its line end; None for an empty line.

        Raises
        ------
        LineError : the line is refused; it carries code, reason and tag.
        """
        words = parse_words(line)
        if words is None:
            return None
        try:
            return Request(self._command(words), words.tag, words.checked)
        except LineError as error:
            error.tag, error.checked = words.tag, words.checked
            raise

    def format(self, request: Request) -> bytes:
        """The line of a request, with its line end (LF)."""
        words = self._words(request.command)
        return format_words(words, tag=request.tag, checked=request.checked)

    def _command(self, words: Words) -> Command:
        name = words.words[0].upper()
        rule = _RULES.get(name)
        if rule is None:
            shown = words.words[0][:32]
            raise LineError(Code.COMMAND, f"unknown command {shown!r}{did_you_mean(shown, COMMANDS)}")
        least, most, read = rule
        given = words.words[1:]
        if len(given) < least or (most is not None and len(given) > most):
            raise LineError(Code.ARGUMENTS, f"{len(given)} arguments; usage: {USAGE[name]}")
        return read(self, given)

    # What the rules call

    def read_set(self, given: Sequence[str]) -> Set:
        if len(given) % 2:
            raise LineError(Code.ARGUMENTS, f"a name without a value; usage: {USAGE['SET']}")
        indices = self.names(given[0::2])
        return Set(indices, tuple(self.value(i, text) for i, text in zip(indices, given[1::2], strict=True)))

    def read_frame(self, given: Sequence[str]) -> Set:
        if len(given) != len(self._all):
            raise LineError(Code.ARGUMENTS, f"{len(given)} values; FRAME needs all {len(self._all)}")
        return Set(self._all, tuple(self.value(i, text) for i, text in enumerate(given)))

    def read_expr(self, given: Sequence[str]) -> Expr:
        name = self.expression(given[0])
        intensity = in_range("intensity", given[1], 0.0, 1.0) if len(given) > 1 else 1.0
        duration = in_range("duration_s", given[2], MIN_DURATION_S, MAX_DURATION_S) if len(given) > 2 else None
        return Expr(name, intensity, duration)

    def read_gaze(self, given: Sequence[str]) -> Command:
        first = given[0].upper()
        if first == "OFF" and len(given) == 1:
            return GazeOff()
        if first == "AT" and len(given) == 4:
            return _gaze_at(given[1:])
        if first in ("OFF", "AT") or len(given) != 2:
            raise LineError(Code.ARGUMENTS, f"usage: {USAGE['GAZE']}")
        yaw = in_range("yaw", given[0], -GAZE_YAW_DEG, GAZE_YAW_DEG)
        return Gaze(yaw, in_range("pitch", given[1], -GAZE_PITCH_DEG, GAZE_PITCH_DEG))

    def read_subscribe(self, given: Sequence[str]) -> Subscribe:
        rate, first = in_range("rate_hz", given[0], MIN_RATE_HZ, MAX_RATE_HZ), given[1].upper() if given[1:] else "ALL"
        if first == "READ":
            return Subscribe(rate, question=_read(self, given[2:]))
        if first == "MEASURED":
            return Subscribe(rate, question=Measured(self.names_or_all(given[2:] or ("ALL",))))
        return Subscribe(rate, self.names_or_all(given[1:] or ("ALL",)))

    def names_or_all(self, given: Sequence[str]) -> tuple[int, ...]:
        return self._all if len(given) == 1 and given[0].upper() == "ALL" else self.names(given)

    def names(self, given: Sequence[str]) -> tuple[int, ...]:
        """Positions of names that must all be known and differ."""
        indices = tuple(self.name(text) for text in given)
        if len(set(indices)) < len(indices):
            twice = next(i for n, i in enumerate(indices) if i in indices[:n])
            raise LineError(Code.ARGUMENTS, f"{self._parameters.names[twice]} is named twice")
        return indices

    def name(self, text: str) -> int:
        try:
            return self._parameters.index(text)
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error

    def expression(self, text: str) -> str:
        try:
            return self._find_expression(text)
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error

    def value(self, index: int, text: str) -> float:
        p = self._parameters
        return in_range(p.names[index], text, float(p.low[index]), float(p.high[index]))

    # The way back

    def _words(self, command: Command) -> list[str]:
        match command:
            case Set(indices, values):
                return [
                    "SET",
                    *(w for i, v in zip(indices, values, strict=True) for w in (self._name(i), repr(v))),
                ]
            case Release(indices):
                return ["RELEASE", *self._names(indices)]
            case Get(indices):
                return ["GET", *self._names(indices)]
            case Measured(indices):
                return ["MEASURED", *self._names(indices)]
            case Subscribe(rate, indices, None):
                return ["SUB", repr(rate), *self._names(indices)]
            case Subscribe(rate, _, question) if question is not None:
                return ["SUB", repr(rate), *self._words(question)]
            case Info(index):
                return ["INFO", self._name(index)]
            case Read(what, measured):
                return ["READ", what, *(["MEASURED"] if measured else [])]
            case Play(what, to):
                return ["SHOW", what, *([to] if to else [])]
            case _:
                return _plain_words(command)

    def _name(self, index: int) -> str:
        return self._parameters.names[index]

    def _names(self, indices: Sequence[int]) -> list[str]:
        return ["ALL"] if tuple(indices) == self._all else [self._name(i) for i in indices]


def _plain_words(command: Command) -> list[str]:
    """Words of a command that names no parameter."""
    match command:
        case Expr(name, intensity, duration):
            return ["EXPR", name, repr(intensity), *([] if duration is None else [repr(duration)])]
        case Gaze(yaw, pitch):
            return ["GAZE", repr(yaw), repr(pitch)]
        case GazeAt(x, y, z):
            return ["GAZE", "AT", repr(x), repr(y), repr(z)]
        case GazeOff():
            return ["GAZE", "OFF"]
        case Neutral(seconds):
            return ["NEUTRAL", repr(seconds)]
        case Live(amount):
            return ["LIFE", repr(amount)]
        case Ping(text):
            return ["PING", text] if text else ["PING"]
        case List(what):
            return ["LIST", what]
    return [{Hello: "HELLO", Status: "STATUS", Unsubscribe: "UNSUB"}[type(command)]]


def finite(what: str, text: str) -> float:
    """A number in plain decimal notation. Raises LineError for anything else, NaN and infinity too."""
    if _NUMBER.fullmatch(text) is None or not math.isfinite(value := float(text)):
        raise LineError(Code.NUMBER, f"{what}: {text[:32]!r} is not a finite number")
    return value


def in_range(what: str, text: str, low: float, high: float) -> float:
    """A number from ``low`` to ``high``. Raises LineError; nothing is clipped in silence."""
    value = finite(what, text)
    if not low <= value <= high:
        raise LineError(Code.RANGE, f"{what} must be {low:g} to {high:g}, not {value:g}")
    return value


def _gaze_at(given: Sequence[str]) -> GazeAt:
    at = [in_range(axis, text, -MAX_DISTANCE_MM, MAX_DISTANCE_MM) for axis, text in zip("xyz", given, strict=True)]
    if math.hypot(*at) < 1.0:
        raise LineError(Code.RANGE, "the point must be at least 1 mm from the middle between the eyes")
    return GazeAt(*at)


def _show(_: Grammar, given: Sequence[str]) -> Play:
    word = given[0].upper()
    if (word == "SEEK") != (len(given) == 2):
        raise LineError(Code.ARGUMENTS, f"usage: {USAGE['SHOW']}")
    return Play(word, *given[1:]) if word in ("PLAY", "PAUSE", "STOP", "SEEK") else Play(given[0])


def _read(_: Grammar, given: Sequence[str]) -> Read:
    words = [word.upper() for word in given]
    if not words or words[0] not in READINGS or words[1:] not in ([], ["MEASURED"]):
        raise LineError(Code.ARGUMENTS, f"usage: {USAGE['READ']}")
    return Read(words[0], len(words) > 1)


def _list(_: Grammar, given: Sequence[str]) -> List:
    what = given[0].upper()
    if what not in LISTS:
        raise LineError(Code.NAME, f"unknown list {given[0][:32]!r}; usage: {USAGE['LIST']}")
    return List(what)


def _neutral(_: Grammar, given: Sequence[str]) -> Neutral:
    return Neutral(in_range("seconds", given[0], 0.0, MAX_FADE_S)) if given else Neutral()


Rule = tuple[int, int | None, Callable[[Grammar, Sequence[str]], Command]]

_RULES: dict[str, Rule] = {
    "HELLO": (0, 0, lambda _, given: Hello()),
    "VERSION": (0, 0, lambda _, given: Hello()),
    "PING": (0, None, lambda _, given: Ping(" ".join(given))),
    "SET": (2, None, Grammar.read_set),
    "FRAME": (1, None, Grammar.read_frame),
    "RELEASE": (1, None, lambda g, given: Release(g.names_or_all(given))),
    "EXPR": (1, 3, Grammar.read_expr),
    "GAZE": (1, 4, Grammar.read_gaze),
    "NEUTRAL": (0, 1, _neutral),
    "LIFE": (1, 1, lambda _, given: Live(in_range("amount", given[0], 0.0, 1.0))),
    "SHOW": (1, 2, _show),
    "GET": (1, None, lambda g, given: Get(g.names_or_all(given))),
    "MEASURED": (1, None, lambda g, given: Measured(g.names_or_all(given))),
    "READ": (1, 2, _read),
    "INFO": (1, 1, lambda g, given: Info(g.name(given[0]))),
    "STATUS": (0, 0, lambda _, given: Status()),
    "SUB": (1, None, Grammar.read_subscribe),
    "UNSUB": (0, 0, lambda _, given: Unsubscribe()),
    "LIST": (1, 1, _list),
}  # fmt: skip

COMMANDS = tuple(_RULES)
"""Every command word."""

USAGE = {
    "HELLO": "HELLO",
    "VERSION": "VERSION",
    "PING": "PING [word ...]",
    "SET": "SET name value [name value ...]",
    "FRAME": "FRAME value value ... (one for each parameter, in the order of LIST PARAMETERS)",
    "RELEASE": "RELEASE name ... or RELEASE ALL",
    "EXPR": "EXPR name [intensity [duration_s]]",
    "GAZE": "GAZE yaw_deg pitch_deg, GAZE AT x_mm y_mm z_mm, or GAZE OFF",
    "NEUTRAL": "NEUTRAL [seconds]",
    "LIFE": "LIFE amount",
    "SHOW": "SHOW name, SHOW PLAY, SHOW PAUSE, SHOW STOP, or SHOW SEEK mark (or seconds)",
    "GET": "GET name ... or GET ALL",
    "MEASURED": "MEASURED name ... or MEASURED ALL",
    "READ": f"READ {', '.join(READINGS[:-1])} or {READINGS[-1]}, and MEASURED for what the servos show",
    "INFO": "INFO name",
    "STATUS": "STATUS",
    "SUB": "SUB rate_hz [ALL], SUB rate_hz name ..., SUB rate_hz READ ..., or SUB rate_hz MEASURED [name ...]",
    "UNSUB": "UNSUB",
    "LIST": "LIST COMMANDS, EXPRESSIONS, HOLDERS, LAYERS or PARAMETERS",
}
"""How each command is written, for messages."""
