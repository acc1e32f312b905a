"""Parses the commands of the omote line protocol, without any I/O.

:class:`Grammar` knows names and ranges, and makes ``Command("SET", (17,), (0.8,))`` of ``SET jawOpen 0.8``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from controller.base.errors import ParameterError
from controller.base.parameters import Parameters, did_you_mean
from controller.base.plain_numbers import plain_number
from controller.layers.idle.settings import AUTO, MANNERS
from controller.links.line.checksums import CHECKSUMS
from controller.links.line.protocol import KNOWN_LINES, Code, LineError, Words, parse_words
from controller.vocabulary.visemes import Visemes

MAX_RATE_HZ = 200.0
MIN_RATE_HZ = 0.1
GAZE_YAW_DEG = 95.0
GAZE_PITCH_DEG = 70.0
MAX_DISTANCE_MM = 1e6
MIN_DURATION_S = 0.05
MAX_DURATION_S = 3600.0
MAX_FADE_S = 60.0
READINGS = ("UNITS", "EMOTION", "VISEMES", "MOOD")
"""What a face can be read as: action units, the most similar emotion, mouth shapes, valence-arousal-dominance."""
LISTS = ("COMMANDS", "EXPRESSIONS", "GROUPS", "HEADS", "HOLDERS", "LAYERS", "PARAMETERS", "SHOWS", "VISEMES")
_MAX_QUOTED = 32  # characters of a word that an error quotes


@dataclass(frozen=True)
class Command:
    """A command whose names and numbers are valid.

    name : its first word, or two for ``GAZE AT``, ``GAZE ROOM``, ``GAZE HEAD`` and ``GAZE OFF``; FRAME becomes SET and
        VERSION becomes HELLO.
    indices : of the parameters that it names. values : its numbers; those of SET belong to ``indices``.
    words : other names in it: of an expression, visemes, a list, a reading, a script or a mark; for HELLO
        one of :data:`controller.links.line.checksums.CHECKSUMS`.
    question : the query that SUB repeats: a command GET, MEASURED or READ.
    """

    name: str
    indices: tuple[int, ...] = ()
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()
    question: Command | None = None

    @property
    def measured(self) -> bool:
        """Whether it requests the measured values of the servos."""
        return self.name == "MEASURED" or (self.name == "READ" and len(self.words) > 1)


@dataclass(frozen=True)
class Request:
    """A command with the tag of its line, whether that had a checksum, and the head or group it is for."""

    command: Command
    tag: int | None = None
    checked: bool = False
    to: str = ""


class Grammar:
    """Parses lines.

    find_expression : returns the canonical name of an expression, or raises ParameterError. scripted : whether the
    lines come from a script; START is refused then, so that a script cannot undo a person's STOP.
    """

    def __init__(
        self, parameters: Parameters, find_expression: Callable[[str], str], *, scripted: bool = False
    ) -> None:
        self._parameters = parameters
        self._find_expression = find_expression
        self._scripted = scripted
        self._all = tuple(range(len(parameters)))

    def parse(self, line: bytes) -> Request | None:
        """Return the request of a line without its line end; None for an empty line.

        Raises LineError: the line is refused; it carries code, reason and tag.
        """
        words = parse_words(line)
        return None if words is None else self.request(words)

    def request(self, words: Words) -> Request:
        """Return the request that the words of a line make. Raises LineError, like :meth:`parse`."""
        try:
            return Request(self._command(words.words), words.tag, words.checked, words.to)
        except LineError as error:
            error.tag, error.checked = words.tag, words.checked
            raise

    @cached_property
    def _command(self) -> Callable[[tuple[str, ...]], Command]:
        return lru_cache(maxsize=KNOWN_LINES)(self._read)

    def _read(self, words: tuple[str, ...]) -> Command:
        text = words[0]
        rule = _RULES.get(text.upper())
        if rule is None:
            raise LineError(Code.COMMAND, f"unknown command {quoted(text)}{did_you_mean(text[:_MAX_QUOTED], COMMANDS)}")
        least, most, usage, read = rule
        given = words[1:]
        if len(given) < least or (most is not None and len(given) > most):
            raise LineError(Code.ARGUMENTS, f"{_count(len(given), 'argument')}; usage: {usage}")
        return read(self, given)

    def read_start(self, _: Sequence[str]) -> Command:
        if self._scripted:
            raise LineError(Code.BUSY, "START is not for scripts: a person or a robot sends it on a link")
        return Command("START")

    def read_set(self, given: Sequence[str]) -> Command:
        if len(given) % 2:
            raise LineError(Code.ARGUMENTS, f"a name without a value; {_usage('SET')}")
        indices = self.names(given[0::2])
        return Command("SET", indices, self.values(indices, given[1::2]))

    def read_frame(self, given: Sequence[str]) -> Command:
        if len(given) != len(self._all):
            raise LineError(Code.ARGUMENTS, f"{_count(len(given), 'value')}; FRAME needs all {len(self._all)}")
        return Command("SET", self._all, self.values(self._all, given))

    def read_expr(self, given: Sequence[str]) -> Command:
        try:
            name = self._find_expression(given[0])
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error
        intensity = in_range("intensity", given[1], 0.0, 1.0) if len(given) > 1 else 1.0
        duration = [in_range("duration_s", text, MIN_DURATION_S, MAX_DURATION_S) for text in given[2:]]
        return Command("EXPR", values=(intensity, *duration), words=(name,))

    def read_viseme(self, given: Sequence[str]) -> Command:
        if len(given) % 2 and len(given) > 1:
            raise LineError(Code.ARGUMENTS, f"a viseme without a weight; {_usage('VISEME')}")
        try:
            names = tuple(self.visemes.viseme(text) for text in given[::2])
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error
        weights = [in_range("weight", text, 0.0, 1.0) for text in given[1::2]] or [1.0]
        return Command("VISEME", values=tuple(weights), words=names)

    @cached_property
    def visemes(self) -> Visemes:
        """The visemes that VISEME may name, read at the first use."""
        return Visemes.load(self._parameters)

    def read_sub(self, given: Sequence[str]) -> Command:
        rate = in_range("rate_hz", given[0], MIN_RATE_HZ, MAX_RATE_HZ)
        first = given[1].upper() if given[1:] else "ALL"
        if first == "READ":
            question = _read(self, given[2:])
        elif first == "MEASURED":
            question = Command(first, self.names_or_all(given[2:]))
        else:
            question = Command("GET", self.names_or_all(given[1:]))
        return Command("SUB", values=(rate,), question=question)

    def names_or_all(self, given: Sequence[str]) -> tuple[int, ...]:
        """Return the indices of names; of all parameters for ``ALL`` or no names."""
        return self._all if [word.upper() for word in given] in ([], ["ALL"]) else self.names(given)

    def names(self, given: Sequence[str]) -> tuple[int, ...]:
        """Return the indices of names. Raises LineError: a name is unknown or repeated."""
        try:
            indices = tuple(self._parameters.index(text) for text in given)
        except ParameterError as error:
            raise LineError(Code.NAME, str(error)) from error
        for n, i in enumerate(indices):
            if i in indices[:n]:
                raise LineError(Code.ARGUMENTS, f"{self._parameters.names[i]} is named twice")
        return indices

    def values(self, indices: Sequence[int], given: Sequence[str]) -> tuple[float, ...]:
        """Parse values. Raises LineError: one is outside the range of its parameter."""
        p = self._parameters
        return tuple(
            in_range(p.names[i], text, float(p.low[i]), float(p.high[i]))
            for i, text in zip(indices, given, strict=True)
        )


def in_range(what: str, text: str, low: float, high: float) -> float:
    """Parse a number in plain decimal notation. Raises LineError: it is not from ``low`` to ``high``."""
    value = plain_number(text)
    if value is None:
        raise LineError(Code.NUMBER, f"{what}: {quoted(text)} is not a finite number")
    if not low <= value <= high:
        raise LineError(Code.RANGE, f"{what} must be {low:g} to {high:g}, not {_cut(text)}")
    return value


def quoted(text: str) -> str:
    """Return a word in quotes; of a long one, only the beginning."""
    return f"'{_cut(text)}'"


def _cut(text: str) -> str:
    return text if len(text) <= _MAX_QUOTED else f"{text[:_MAX_QUOTED]}..."


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _usage(name: str) -> str:
    return f"usage: {_RULES[name][2]}"


def _gaze(_: Grammar, given: Sequence[str]) -> Command:
    first = given[0].upper()
    if first == "OFF" and len(given) == 1:
        return Command("GAZE OFF")
    if first == "HEAD" and len(given) == 2:
        return Command("GAZE HEAD", words=(given[1],))
    if first in ("AT", "ROOM") and len(given) == 4:
        limit = MAX_DISTANCE_MM
        point = tuple(in_range(axis, text, -limit, limit) for axis, text in zip("xyz", given[1:], strict=True))
        if first == "AT" and math.hypot(*point) < 1.0:
            raise LineError(Code.RANGE, "the point must be at least 1 mm from the middle between the eyes")
        return Command(f"GAZE {first}", values=point)
    if first in ("OFF", "AT", "ROOM", "HEAD") or len(given) != 2:
        raise LineError(Code.ARGUMENTS, _usage("GAZE"))
    yaw = in_range("yaw", given[0], -GAZE_YAW_DEG, GAZE_YAW_DEG)
    return Command("GAZE", values=(yaw, in_range("pitch", given[1], -GAZE_PITCH_DEG, GAZE_PITCH_DEG)))


def _hello(_: Grammar, given: Sequence[str]) -> Command:
    asked = tuple(word.lower().removeprefix("checksum=") for word in given if word.lower().startswith("checksum="))
    if len(asked) != len(given) or not set(asked) <= set(CHECKSUMS):
        raise LineError(Code.ARGUMENTS, _usage("HELLO"))
    return Command("HELLO", words=asked)


def _show(_: Grammar, given: Sequence[str]) -> Command:
    word = given[0].upper()
    if (word == "SEEK") != (len(given) == 2):
        raise LineError(Code.ARGUMENTS, _usage("SHOW"))
    return Command("SHOW", words=(word if word in ("PLAY", "PAUSE", "STOP", "SEEK") else given[0], *given[1:]))


def _read(_: Grammar, given: Sequence[str]) -> Command:
    words = tuple(word.upper() for word in given)
    if words[:1] not in [(reading,) for reading in READINGS] or words[1:] not in ((), ("MEASURED",)):
        raise LineError(Code.ARGUMENTS, _usage("READ"))
    return Command("READ", words=words)


def _list(_: Grammar, given: Sequence[str]) -> Command:
    (what,) = given
    if what.upper() not in LISTS:
        raise LineError(Code.NAME, f"unknown list {quoted(what)}; {_usage('LIST')}")
    return Command("LIST", words=(what.upper(),))


def _help(_: Grammar, given: Sequence[str]) -> Command:
    (what,) = given or ("HELP",)
    if what.upper() not in _RULES:
        raise LineError(Code.NAME, f"unknown command {quoted(what)}{did_you_mean(what[:_MAX_QUOTED], COMMANDS)}")
    return Command("HELP", words=(what.upper(),) if given else ())


def _neutral(_: Grammar, given: Sequence[str]) -> Command:
    return Command("NEUTRAL", values=(in_range("seconds", given[0], 0.0, MAX_FADE_S) if given else 0.5,))


def _life(_: Grammar, given: Sequence[str]) -> Command:
    words = tuple(word.upper() for word in given[1:])
    if words and words[0].lower() not in (AUTO, *MANNERS):
        raise LineError(Code.NAME, f"unknown manner {quoted(given[1])}; {_usage('LIFE')}")
    return Command("LIFE", values=(in_range("amount", given[0], 0.0, 1.0),), words=words)


def _named(name: str) -> Callable[[Grammar, Sequence[str]], Command]:
    """Return the reader of a command that has names of parameters, or ALL."""
    return lambda grammar, given: Command(name, grammar.names_or_all(given))


Rule = tuple[int, int | None, str, Callable[[Grammar, Sequence[str]], Command]]
"""Smallest and largest number of arguments, the usage of the command, and the reader of its arguments."""

_RULES: dict[str, Rule] = {
    "HELLO": (0, 1, f"HELLO [checksum={'|'.join(CHECKSUMS)}]", _hello),
    "VERSION": (0, 0, "VERSION", lambda _, given: Command("HELLO")),
    "PING": (0, None, "PING [word ...]", lambda _, given: Command("PING", words=tuple(given))),
    "SET": (2, None, "SET name value [name value ...]", Grammar.read_set),
    "FRAME": (1, None, "FRAME value value ... (one for each parameter, in the order of LIST PARAMETERS)",
              Grammar.read_frame),
    "RELEASE": (1, None, "RELEASE name ... or RELEASE ALL", _named("RELEASE")),
    "EXPR": (1, 3, "EXPR name [intensity [duration_s]]", Grammar.read_expr),
    "VISEME": (1, 30, "VISEME name [weight [name weight ...]]", Grammar.read_viseme),
    "GAZE": (1, 4,
             "GAZE yaw_deg pitch_deg, GAZE AT x_mm y_mm z_mm, GAZE ROOM x_mm y_mm z_mm, GAZE HEAD name, or GAZE OFF",
             _gaze),
    "NEUTRAL": (0, 1, "NEUTRAL [seconds]", _neutral),
    "LIFE": (1, 2, "LIFE amount [AUTO|ALONE|LISTEN|SPEAK]", _life),
    "SHOW": (1, 2, "SHOW name, SHOW PLAY, SHOW PAUSE, SHOW STOP, or SHOW SEEK mark (or seconds)", _show),
    "TO": (1, 1, "TO head, TO group, or TO ALL", lambda _, given: Command("TO", words=tuple(given))),
    "TURN": (1, 1, "TURN head, or TURN OFF", lambda _, given: Command("TURN", words=tuple(given))),
    "GET": (1, None, "GET name ... or GET ALL", _named("GET")),
    "MEASURED": (1, None, "MEASURED name ... or MEASURED ALL", _named("MEASURED")),
    "READ": (1, 2, f"READ {', '.join(READINGS[:-1])} or {READINGS[-1]}, and MEASURED for what the servos show", _read),
    "INFO": (1, 1, "INFO name", lambda grammar, given: Command("INFO", grammar.names(given))),
    "STATUS": (0, 0, "STATUS", lambda _, given: Command("STATUS")),
    "SUB": (1, None,
            "SUB rate_hz [ALL], SUB rate_hz name ..., SUB rate_hz READ ..., or SUB rate_hz MEASURED [name ...]",
            Grammar.read_sub),
    "UNSUB": (0, 0, "UNSUB", lambda _, given: Command("UNSUB")),
    "LIST": (1, 1, f"LIST {', '.join(LISTS[:-1])} or {LISTS[-1]}", _list),
    "HELP": (0, 1, "HELP [command]", _help),
    "AUTH": (1, 1, "AUTH token", lambda _, given: Command("AUTH", words=tuple(given))),
    "STOP": (0, None, "STOP", lambda _, given: Command("STOP")),
    "START": (0, 0, "START", Grammar.read_start),
}  # fmt: skip

COMMANDS = tuple(_RULES)
"""Every command word."""


def help_of(name: str | None) -> str:
    """Return the usage of a command; ``name`` None: the words of all commands."""
    return _RULES[name][2] if name else f"[command]: {' '.join(COMMANDS)}"
