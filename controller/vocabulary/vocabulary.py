"""The vocabulary of a face: every expression that has a name or can be written as a formula."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Parameters, did_you_mean, fold
from controller.base.paths import config_dir
from controller.vocabulary.expression import Expression, read_expressions
from controller.vocabulary.formulas import Formulas


class Vocabulary:
    """Expressions by name or formula.

    Parameters
    ----------
    expressions : the expressions, in file order.
    aliases : folded other names to canonical ones.
    formulas : makes an expression of a formula, None of anything else; names alone without.
    """

    def __init__(
        self,
        expressions: dict[str, Expression],
        aliases: dict[str, str] | None = None,
        formulas: Formulas | None = None,
    ) -> None:
        self._expressions = expressions
        self._formulas = formulas
        self._lookup = {fold(name): name for name in expressions} | (aliases or {})

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None, more: Sequence[Path] = ()) -> Vocabulary:
        """Read a vocabulary of expressions; the shipped one without ``path``.

        Parameters
        ----------
        more : further files whose expressions are added, such as a user's own; they may mix those before them.

        Raises ConfigError: a file cannot be read or is wrong; every fault of every file with its key.
        """
        files = (path or config_dir() / "vocabularies" / "expressions.toml", *more)
        expressions, aliases = read_expressions(parameters, files)
        return cls(expressions, aliases, Formulas(parameters, cls(expressions, aliases)))

    @property
    def names(self) -> tuple[str, ...]:
        """Canonical names, in file order."""
        return tuple(self._expressions)

    def __getitem__(self, name: str) -> Expression:
        """The expression called ``name``, any case, or of a formula such as ``AU1+2+5B`` or ``VA:0.6,-0.2``.

        Raises ParameterError: unknown name, with the nearest ones, or a wrong formula.
        """
        made = self._formulas(name) if self._formulas is not None else None
        if made is not None:
            return made
        found = self._lookup.get(name) or self._lookup.get(fold(name))
        if found is None:
            raise ParameterError(
                f"unknown expression {name!r}{did_you_mean(name, self.names)}",
                hint="list the names: LIST EXPRESSIONS on the link, or configs/vocabularies/expressions.toml",
            )
        return self._expressions[found]

    def expand(self, name: str, intensity: float = 1.0) -> dict[int, float]:
        """Parameter index to value for ``name`` at ``intensity`` 0..1. Raises ParameterError."""
        weights = self[name].weights
        if not 0.0 <= intensity <= 1.0:
            raise ParameterError(f"intensity must be 0 to 1, not {intensity}", hint="0.5 is half of the expression")
        return {int(i): float(weights[i] * intensity) for i in np.flatnonzero(weights)}
