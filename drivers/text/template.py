"""Templates of text boards, as ``"#{ch}P{us}\\r"``: values formatted into lines, and read from answers.

=========== ==================================================================================
``ch``      channel, the servo's id (``id`` is the same)
``name``    the servo's name
``us``      pulse width in microseconds
``deg``     degrees of the shaft from the middle of its range
``deg10``   the same in tenths of a degree
``angle``   degrees of the shaft from the low end of its range, as for Arduino's ``Servo.write``
``unit``    0 at the lower limit of the channel, 1 at the upper one
``time_ms`` time since the last line
=========== ==================================================================================

A placeholder may have a format, as ``{us:04d}`` or ``{deg:.2f}``, of at most 99 characters.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from string import Formatter
from typing import NamedTuple

from drivers.base.errors import DriverError

VALUES = {"us": "d", "deg": ".1f", "deg10": "d", "angle": "d", "unit": ".4f"}
"""Placeholders of positions, with their default formats."""
NAMES = ("ch", "id", "name")
FORMATS = VALUES | {"ch": "d", "id": "d", "name": "s", "time_ms": "d"}
_FORMAT = re.compile(r"0?\d{0,2}(?:\.(\d))?([df]?)\Z")
_NUMBER = r" *([+-]?\d+(?:\.\d*)?)"


TEXTS = ("template", "begin", "separator", "end", "off", "query", "answer")
"""Options of a text board that are templates."""


class Piece(NamedTuple):
    """Text and the placeholder after it, which may be empty, with its format."""

    text: str
    field: str
    spec: str


def pieces_of(key: str, text: str, allowed: Iterable[str]) -> list[Piece]:
    """Parse a template; `key` is its name in the configuration, `allowed` are the placeholders that may occur.

    Raises DriverError: it is not ASCII, its braces do not match, a placeholder is unknown, or a format does not fit.
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
    return Piece(text, field, spec or FORMATS[field])


def _fits(field: str, spec: str) -> bool:
    """Whether a format is valid for a placeholder; decimals need an f."""
    match = _FORMAT.match(spec)
    if field == "name" or match is None:
        return not spec
    return not spec or (match[2] == "f" if match[1] else bool(match[2]))


def decimals(spec: str) -> int:
    """Number of decimals of a format; 6 for ``f`` alone."""
    match = _FORMAT.match(spec)
    return int(match[1] or (6 if match[2] == "f" else 0)) if match else 0


class Template:
    """A line, or a part of one, with placeholders; parameters and errors as :func:`pieces_of`.

    fields : the placeholders in it.
    """

    def __init__(self, key: str, text: str, allowed: Iterable[str]) -> None:
        self.pieces = pieces_of(key, text, allowed)
        self.fields = frozenset(piece.field for piece in self.pieces if piece.field)

    def fill(self, values: Mapping[str, float | str]) -> str:
        """Return the text with values in place of the placeholders."""
        return "".join(
            piece.text + (_formatted(piece.spec, values[piece.field]) if piece.field else "") for piece in self.pieces
        )


def _formatted(spec: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    return format(round(value) if spec.endswith("d") else value, spec)


def pattern_of(pieces: Iterable[Piece]) -> re.Pattern[str]:
    """Build a regular expression that matches a filled template, with a group for each placeholder."""
    groups = {"": "", "name": r"(\S+?)"}
    return re.compile("".join(re.escape(piece.text) + groups.get(piece.field, _NUMBER) for piece in pieces))


class AnswerPattern(Template):
    """A template that reads values from an answer; numbers may have any format.

    Its attribute ``end`` is the character an answer ends with. It must not end with a placeholder.
    """

    def __init__(self, key: str, text: str, allowed: Iterable[str]) -> None:
        super().__init__(key, text, allowed)
        if not self.pieces or self.pieces[-1].field:
            raise DriverError(f"{key}: an answer must end with text, as \\n", hint=r'for example "{ch}={us}\n"')
        self.end = self.pieces[-1].text[-1].encode()
        self._pattern = pattern_of(self.pieces)

    def read(self, answer: str) -> dict[str, float | str] | None:
        """The values in an answer; None where it does not match."""
        match = self._pattern.fullmatch(answer)
        if match is None:
            return None
        names = [piece.field for piece in self.pieces if piece.field]
        return {name: text if name == "name" else float(text) for name, text in zip(names, match.groups(), strict=True)}


def check_texts(
    template: str, begin: str = "", separator: str = "", end: str = "", off: str = "", query: str = "", answer: str = ""
) -> tuple[Template, tuple[Template, Template], Template | None, Template | None, AnswerPattern | None]:
    """Parse the templates of a text board: move, (begin, end), off, query and answer; raises DriverError."""
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
            "answer: must name its servo and hold one value, which nothing else identifies",
            hint=r'for example "{ch}={us}\n"',
        )
    return move, frame, switch, Template("query", query, NAMES), pattern
