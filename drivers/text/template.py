"""Templates of text boards: ``"#{ch}P{us}\\r"`` with values put in, or read out of an answer; checked when made.

=========== ==================================================================================
``ch``      channel, the servo's id (``id`` is the same)
``name``    the servo's name
``us``      pulse width in microseconds
``deg``     degrees of the shaft from the middle of its range
``deg10``   the same in tenths of a degree
``angle``   degrees of the shaft from the low end of its range, as Arduino's ``Servo.write`` takes them
``unit``    0 at the lower limit of the channel, 1 at the upper one
``time_ms`` time since the line before
=========== ==================================================================================

A format may follow, as ``{us:04d}`` or ``{deg:.2f}``.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from string import Formatter
from typing import NamedTuple

from drivers.base.errors import DriverError

VALUES = {"us": ("d", 0), "deg": (".1f", 1), "deg10": ("d", 0), "angle": ("d", 0), "unit": (".4f", 4)}
"""What a servo is told: the format without one given, and the decimals that format leaves."""
NAMES = ("ch", "id", "name")
OTHERS = {"ch": "d", "id": "d", "name": "s", "time_ms": "d"}
_FORMAT = re.compile(r"0?\d*(?:\.(\d))?([df]?)\Z")
_NUMBER = r" *([+-]?\d+(?:\.\d*)?)"


class Piece(NamedTuple):
    """Text, and the placeholder behind it; empty for none."""

    text: str
    field: str
    spec: str


def pieces_of(key: str, text: str, allowed: Iterable[str]) -> list[Piece]:
    """Take a template apart.

    Parameters
    ----------
    key : what the configuration calls it, for messages.
    allowed : placeholders that may stand in it.

    Raises
    ------
    DriverError : it is not ASCII, its braces do not pair, a placeholder is unknown, or a format does not fit.
    """
    if not text.isascii():
        raise DriverError(
            f"{key}: only ASCII goes over the wire", hint="write other characters as the board wants them"
        )
    try:
        parts = list(Formatter().parse(text))
    except ValueError as error:
        raise DriverError(f"{key}: {error}", hint="write {{ and }} for braces that are sent") from error
    return [_piece(key, *part, sorted(allowed)) for part in parts]


def _piece(
    key: str, text: str, field: str | None, spec: str | None, conversion: str | None, allowed: list[str]
) -> Piece:
    if field is None:
        return Piece(text, "", "")
    if field not in allowed:
        near = difflib.get_close_matches(field, allowed, n=1)
        raise DriverError(
            f"{key}: unknown placeholder {{{field}}}" + (f", did you mean {{{near[0]}}}?" if near else ""),
            hint="placeholders are " + ", ".join(f"{{{name}}}" for name in allowed),
        )
    if conversion or not _fits(field, spec or ""):
        given = f"!{conversion}" if conversion else spec
        raise DriverError(f"{key}: {{{field}}} cannot have the format {given!r}", hint="for example {us:04d}")
    return Piece(text, field, spec or (VALUES[field][0] if field in VALUES else OTHERS[field]))


def _fits(field: str, spec: str) -> bool:
    """Whether a placeholder can have a format: decimals need an f."""
    match = _FORMAT.match(spec)
    if field == "name" or match is None:
        return not spec
    return not spec or (match[2] == "f" if match[1] else bool(match[2]))


def decimals(piece: Piece) -> int:
    """Decimals that a value keeps in its format."""
    match = _FORMAT.match(piece.spec)
    return int(match[1] or (6 if match[2] == "f" else 0)) if match else 0


class Template:
    """A line, or a part of one, with places for values.

    Parameters
    ----------
    key : what the configuration calls it, for messages.
    text : the template.
    allowed : placeholders that may stand in it.

    Attributes
    ----------
    fields : the placeholders in it.

    Raises
    ------
    DriverError : see :func:`pieces_of`.
    """

    def __init__(self, key: str, text: str, allowed: Iterable[str]) -> None:
        self.pieces = pieces_of(key, text, allowed)
        self.fields = frozenset(piece.field for piece in self.pieces if piece.field)

    def fill(self, values: Mapping[str, float | str]) -> str:
        """The text with values in it."""
        return "".join(
            piece.text + (_shown(piece, values[piece.field]) if piece.field else "") for piece in self.pieces
        )


def _shown(piece: Piece, value: float | str) -> str:
    if isinstance(value, str):
        return value
    return format(round(value) if piece.spec.endswith("d") else value, piece.spec)


def pattern_of(pieces: Iterable[Piece]) -> re.Pattern[str]:
    """What finds a template's text, with a group for each placeholder."""
    groups = {name: r"(\S+?)" if name == "name" else _NUMBER for name in {*VALUES, *OTHERS}}
    return re.compile("".join(re.escape(piece.text) + groups.get(piece.field, "") for piece in pieces))


class AnswerPattern:
    """The inverse of a :class:`Template`: finds the values in an answer.

    Parameters
    ----------
    key, text, allowed : as for :class:`Template`. Numbers may have any format.

    Attributes
    ----------
    fields : the placeholders in it. end : the character an answer ends with.

    Raises
    ------
    DriverError : as for a template; or it ends with a placeholder, so that nobody knows where an answer ends.
    """

    def __init__(self, key: str, text: str, allowed: Iterable[str]) -> None:
        pieces = pieces_of(key, text, allowed)
        self.fields = frozenset(piece.field for piece in pieces if piece.field)
        if not pieces or pieces[-1].field:
            raise DriverError(f"{key}: an answer must end with text, as \\n", hint=r'for example "{ch}={us}\n"')
        self.end = pieces[-1].text[-1].encode()
        self._names = [piece.field for piece in pieces if piece.field]
        self._pattern = pattern_of(pieces)

    def read(self, answer: str) -> dict[str, float | str] | None:
        """The values in an answer; None where it is none."""
        match = self._pattern.fullmatch(answer)
        if match is None:
            return None
        return {
            name: text if name == "name" else float(text)
            for name, text in zip(self._names, match.groups(), strict=True)
        }


def check_texts(
    template: str, begin: str = "", separator: str = "", end: str = "", off: str = "", query: str = "", answer: str = ""
) -> tuple[Template, tuple[Template, Template], Template | None, Template | None, AnswerPattern | None]:
    """The templates of a text board, read and checked: move, (begin, end), off, query and answer.

    Raises
    ------
    DriverError : one does not fit; the message names it and what is wrong.
    """
    move = Template("template", template, (*VALUES, *NAMES, "time_ms"))
    if not move.fields & set(VALUES):
        raise DriverError("template: holds no value", hint="put one of {us}, {deg}, {deg10}, {angle}, {unit} into it")
    frame = Template("begin", begin, ("time_ms",)), Template("end", end, ("time_ms",))
    Template("separator", separator, ())
    switch = Template("off", off, NAMES) if off else None
    if bool(query) != bool(answer):
        raise DriverError("query and answer go together", hint=r'as query = "?{ch}\n", answer = "{ch}={us}\n"')
    if not query:
        return move, frame, switch, None, None
    pattern = AnswerPattern("answer", answer, (*VALUES, *NAMES))
    if not pattern.fields & set(NAMES) or len(pattern.fields & set(VALUES)) != 1:
        raise DriverError(
            "answer: must name its servo and hold one value, for answers are told apart by nothing else",
            hint=r'for example "{ch}={us}\n"',
        )
    return move, frame, switch, Template("query", query, NAMES), pattern
