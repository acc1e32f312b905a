"""Looks up expressions: by name, or by a formula of action units, of a mood or of a viseme."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean, fold
from controller.base.paths import config_dir
from controller.base.plain_numbers import plain_number
from controller.vocabulary.affect import Affect
from controller.vocabulary.expression import Expression, read_expressions
from controller.vocabulary.facs import Facs, is_formula
from controller.vocabulary.visemes import Visemes

_VISEME = re.compile(r"VISEME:(.*)", re.IGNORECASE)
_MOOD = re.compile(r"(VAD?):(.*)", re.IGNORECASE)


class Vocabulary:
    """Expressions by name, or by a formula: ``AU1+2+5B``, ``VA:0.6,-0.2``, ``VAD:-0.5,0.6,0.3`` or ``VISEME:aa``.

    expressions : the named expressions, in file order; moods are blended from them.
    aliases : canonical names by folded alias.
    """

    def __init__(
        self, parameters: Parameters, expressions: dict[str, Expression], aliases: dict[str, str] | None = None
    ) -> None:
        self._parameters, self._expressions = parameters, expressions
        self._lookup = {fold(name): name for name in expressions} | (aliases or {})

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None, more: Sequence[Path] = ()) -> Vocabulary:
        """Read a vocabulary of expressions; by default, the shipped one.

        ``more`` : further files whose expressions are added; each may mix expressions of the files before it.

        Raises ConfigError: a file cannot be read or is wrong; lists every fault of every file with its key.
        """
        files = (path or config_dir() / "vocabularies" / "expressions.toml", *more)
        return cls(parameters, *read_expressions(parameters, files))

    @property
    def names(self) -> tuple[str, ...]:
        """Canonical names, in file order."""
        return tuple(self._expressions)

    def faces(self) -> Floats:
        """(k, P) what each named expression adds to the neutral face at intensity 1, without those that add nothing."""
        weights = [each.weights for each in self._expressions.values() if each.weights.any()]
        return np.reshape(weights, (-1, len(self._parameters)))

    def add(self, expression: Expression) -> None:
        """Add an expression, or replace the one with its name; the next lookup finds it.

        Other threads may look expressions up meanwhile. Raises ParameterError: its name is an alias of another one.
        """
        known = self._lookup.get(fold(expression.name), expression.name)
        if known != expression.name:
            raise ParameterError(f"{expression.name!r} is a name of {known!r} already", hint="choose another name")
        self._expressions = {**self._expressions, expression.name: expression}
        self._lookup = {**self._lookup, fold(expression.name): expression.name}

    def __getitem__(self, name: str) -> Expression:
        """Return the expression called ``name``, in any case, or else the expression of the formula ``name``.

        Raises ParameterError: an unknown name (suggests similar ones) or a wrong formula. ConfigError: a file is wrong.
        """
        known = self._lookup.get(name) or self._lookup.get(fold(name))
        if known is not None:
            return self._expressions[known]
        if is_formula(name):
            return Expression(name.upper(), self._facs.expand(name), source="FACS")
        if mood := _MOOD.fullmatch(name):
            kind = mood[1].upper()
            point = _point(kind, mood[2])
            shown = ",".join(f"{value:g}" for value in point)
            return Expression(f"{kind}:{shown}", self._affect.expand(*point), source="affect")
        if viseme := _VISEME.fullmatch(name):
            shown = self._visemes.viseme(viseme[1])
            weights = self._visemes.matrix @ self._visemes.weights(shown)
            return Expression(f"VISEME:{shown}", weights, kind="gesture", source="viseme", onset_s=0.08, offset_s=0.12)
        raise ParameterError(
            f"unknown expression {name!r}{did_you_mean(name, self.names)}",
            hint="list the names: LIST EXPRESSIONS on the link, or configs/vocabularies/expressions.toml",
        )

    def expand(self, name: str, intensity: float = 1.0) -> dict[int, float]:
        """Return the parameter values of ``name`` at ``intensity`` 0..1, by index. Raises ParameterError."""
        expression = self[name]
        if not 0.0 <= intensity <= 1.0:
            raise ParameterError(f"intensity must be 0 to 1, not {intensity}", hint="0.5 is half of the expression")
        pose = self._parameters.rest + expression.pose(intensity)
        return {int(i): float(pose[i]) for i in np.flatnonzero(expression.weights)}

    @cached_property
    def _facs(self) -> Facs:
        return Facs.load(self._parameters)

    @cached_property
    def _visemes(self) -> Visemes:
        return Visemes.load(self._parameters)

    @cached_property
    def _affect(self) -> Affect:
        return Affect.load(self)


def _point(kind: str, text: str) -> list[float]:
    """Parse the numbers of a mood, each -1..1. Raises ParameterError."""
    hint = f"like {kind}:{','.join(['0.5', '-0.2', '0.1'][: len(kind)])}"
    cells = text.split(",")
    if len(cells) != len(kind):
        raise ParameterError(f"{kind}: needs {len(kind)} numbers with commas between", hint=hint)
    values = [value for cell in cells if (value := plain_number(cell)) is not None and abs(value) <= 1.0]
    if len(values) < len(cells):
        raise ParameterError(f"{kind}: takes numbers from -1 to 1, not {text!r}", hint=hint)
    return values
