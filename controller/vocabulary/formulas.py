"""Expressions that are written down instead of named: action units and points of the space of moods."""

from __future__ import annotations

import math
import re
from functools import cached_property

from controller.base.errors import ParameterError
from controller.base.parameters import Parameters
from controller.vocabulary.affect import Affect
from controller.vocabulary.expression import Expression, Expressions
from controller.vocabulary.facs import Facs

_UNITS = re.compile(r"(AU|AD)[LR]?\d", re.IGNORECASE)
_MOOD = re.compile(r"(VAD?):(.*)", re.IGNORECASE)


class Formulas:
    """Makes expressions of ``AU1+2+5B``, ``VA:0.6,-0.2`` and ``VAD:-0.5,0.6,0.3``.

    Parameters
    ----------
    parameters : the registry. expressions : the named ones, which moods are blended from.
    """

    def __init__(self, parameters: Parameters, expressions: Expressions) -> None:
        self._parameters = parameters
        self._expressions = expressions

    def __call__(self, text: str) -> Expression | None:
        """The expression of a formula; None when ``text`` is none.

        Raises ParameterError: a formula that is wrong. ConfigError: the file behind it is.
        """
        if _UNITS.match(text):
            return Expression(text.upper(), self._facs.expand(text), source="FACS")
        mood = _MOOD.fullmatch(text)
        if mood is None:
            return None
        kind = mood[1].upper()
        point = _point(kind, mood[2])
        name = f"{kind}:" + ",".join(f"{value:g}" for value in point)
        return Expression(name, self._affect.expand(*point), source="affect")

    @cached_property
    def _facs(self) -> Facs:
        return Facs.load(self._parameters)

    @cached_property
    def _affect(self) -> Affect:
        return Affect.load(self._expressions)


def _point(kind: str, text: str) -> list[float]:
    cells = text.split(",")
    if len(cells) != len(kind):
        raise ParameterError(f"{kind}: needs {len(kind)} numbers with commas between", hint=f"like {kind}:0.5,-0.2")
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        values = [math.nan]
    if not all(abs(value) <= 1.0 for value in values):
        raise ParameterError(f"{kind}: takes numbers from -1 to 1, not {text!r}", hint=f"like {kind}:0.5,-0.2")
    return values
