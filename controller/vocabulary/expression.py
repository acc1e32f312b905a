"""Named expressions: what a name and an intensity mean in parameters, and how they rise and fall."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean, file_error, fold, read_toml
from controller.base.paths import config_dir

KINDS = ("emotion", "gesture", "user")
OVERRIDES = ("keep", "block", "blend")
_KEYS = {"kind", "aliases", "source", "onset_s", "offset_s", "blink", "gaze", "mouth", "weights", "of"}
_RISE_S = 0.4


@dataclass(frozen=True, eq=False)
class Expression:
    """One named expression.

    Attributes
    ----------
    name : canonical name. kind : one of :data:`KINDS`. source : where it comes from.
    weights : (P,) float64, the parameters at intensity 1; read-only.
    onset_s, offset_s : times to rise and to fall.
    blink, gaze, mouth : what it does to blinks, to the gaze and to speech meanwhile, one of :data:`OVERRIDES`.
    """

    name: str
    weights: Floats
    kind: str = "user"
    source: str = ""
    onset_s: float = _RISE_S
    offset_s: float = _RISE_S
    blink: str = "keep"
    gaze: str = "keep"
    mouth: str = "keep"


class Vocabulary:
    """The expressions of one file, by name.

    Parameters
    ----------
    expressions : the expressions, in file order.
    aliases : folded other names to canonical ones.
    formulas : makes an expression of a formula, None of anything else; see :mod:`controller.vocabulary.formulas`.
    """

    def __init__(
        self,
        expressions: dict[str, Expression],
        aliases: dict[str, str] | None = None,
        formulas: Callable[[str], Expression | None] | None = None,
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

        Raises
        ------
        ConfigError : a file cannot be read or is wrong; every fault of every file with its key.
        """
        known: dict[str, Expression] = {}
        aliases: dict[str, str] = {}
        errors: list[ConfigError] = []
        for file in (path or config_dir() / "vocabularies" / "expressions.toml", *more):
            reader = _Reader(parameters, known)
            known = known | reader.read(read_toml(file))
            aliases |= reader.aliases(known, aliases)
            if reader.faults:
                errors.append(file_error(file, reader.faults))
        if errors:
            raise errors[0] if len(errors) == 1 else ConfigError("\n".join(map(str, errors)), hint=errors[0].hint)
        from controller.vocabulary.formulas import Formulas  # it needs this module

        vocabulary = cls(known, aliases)
        vocabulary._formulas = Formulas(parameters, vocabulary)
        return vocabulary

    @property
    def names(self) -> tuple[str, ...]:
        """Canonical names, in file order."""
        return tuple(self._expressions)

    def __getitem__(self, name: str) -> Expression:
        """The expression called ``name``, any case, or of a formula such as ``AU1+2+5B`` or ``VA:0.6,-0.2``.

        Raises
        ------
        ParameterError : unknown name, with the nearest ones, or a wrong formula.
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


class _Reader:
    """Turns the tables of one file into expressions and collects every fault on the way.

    Parameters
    ----------
    known : expressions of files before this one.
    """

    def __init__(self, parameters: Parameters, known: Mapping[str, Expression]) -> None:
        self._parameters, self._known = parameters, known
        self._tables: dict[str, dict[str, Any]] = {}
        self._made: dict[str, Floats] = {}
        self.faults: list[str] = []

    def read(self, tables: dict[str, Any]) -> dict[str, Expression]:
        """The expressions of a file."""
        for name, given in tables.items():
            if not isinstance(given, dict):
                self.faults.append(f"{name}: must be a table with weights")
            elif name in self._known:
                self.faults.append(f"{name}: is already an expression of a file before this one; choose another name")
            self._tables[name] = given if isinstance(given, dict) else {"weights": {}}
        return {name: self._expression(name, given) for name, given in self._tables.items()}

    def _expression(self, name: str, given: dict[str, Any]) -> Expression:
        self.faults += [f"{name}.{key}: unknown key{did_you_mean(key, _KEYS)}" for key in given if key not in _KEYS]
        weights = self._weights(name, ()).copy()
        weights.flags.writeable = False
        return Expression(
            name,
            weights,
            self._choice(name, given, "kind", KINDS, "user"),
            str(given.get("source", "")),
            self._seconds(name, given, "onset_s"),
            self._seconds(name, given, "offset_s"),
            *(self._choice(name, given, key, OVERRIDES, "keep") for key in ("blink", "gaze", "mouth")),
        )

    def aliases(self, known: Mapping[str, Expression], taken: Mapping[str, str]) -> dict[str, str]:
        """Folded other names to canonical ones."""
        table: dict[str, str] = {}
        names = {fold(name): name for name in known}
        for name, given in ((name, table.get("aliases", [])) for name, table in self._tables.items()):
            if not (isinstance(given, list) and all(isinstance(a, str) for a in given)):
                self.faults.append(f"{name}.aliases: must be a list of names")
                continue
            for alias in map(fold, given):
                holder = table.get(alias) or taken.get(alias) or names.get(alias)
                if holder is not None:
                    self.faults.append(f"{name}.aliases: {alias!r} is already a name of {holder!r}")
                table[alias] = name
        return table

    def _weights(self, name: str, path: tuple[str, ...]) -> Floats:
        """(P,) weights of an expression of this file, with those of what it is mixed of."""
        if name in self._made:
            return self._made[name]
        given = self._tables[name]
        weights = self._mix(name, given.get("of", {}), (*path, name))
        own = given.get("weights", {} if "of" in given else None)
        if not isinstance(own, dict):
            self.faults.append(f"{name}.weights: missing")
            own = {}
        for key, value in own.items():
            self._put(f"{name}.weights.{key}", key, value, weights)
        self._made[name] = weights
        return weights

    def _mix(self, name: str, parts: Any, path: tuple[str, ...]) -> Floats:
        """(P,) sum of other expressions, kept in range."""
        total = self._parameters.neutral()
        if not isinstance(parts, dict):
            self.faults.append(f"{name}.of: must be a table of expressions, like {{ smile = 0.5 }}")
            return total
        for key, share in parts.items():
            where = f"{name}.of.{key}"
            if key in path:
                self.faults.append(f"{where}: goes in a circle: {' -> '.join((*path[path.index(key) :], key))}")
            elif isinstance(share, bool) or not isinstance(share, int | float) or not 0.0 <= share <= 1.0:
                self.faults.append(f"{where}: must be a number from 0 to 1 (is {share!r})")
            elif key in self._tables:
                total += share * self._weights(key, path)
            elif key in self._known:
                total += share * self._known[key].weights
            else:
                self.faults.append(f"{where}: unknown expression{did_you_mean(key, [*self._tables, *self._known])}")
        return np.clip(total, self._parameters.low, self._parameters.high)

    def _put(self, where: str, key: str, value: Any, weights: Floats) -> None:
        positions = sides(self._parameters, key)
        if not positions:
            self.faults.append(f"{where}: unknown parameter{did_you_mean(key, self._parameters.names)}")
            return
        low, high = self._parameters.low[positions[0]], self._parameters.high[positions[0]]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            self.faults.append(f"{where}: must be a number from {low:g} to {high:g} (is {value!r})")
            return
        weights[positions] = value

    def _seconds(self, name: str, given: dict[str, Any], key: str) -> float:
        value = given.get(key, _RISE_S)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 60:
            self.faults.append(f"{name}.{key}: must be 0 to 60 seconds (is {value!r})")
            return _RISE_S
        return float(value)

    def _choice(self, name: str, given: dict[str, Any], key: str, known: tuple[str, ...], default: str) -> str:
        value = given.get(key, default)
        if value not in known:
            self.faults.append(f"{name}.{key}: must be one of {', '.join(known)} (is {value!r})")
            return default
        return str(value)


def sides(parameters: Parameters, name: str) -> list[int]:
    """Positions that ``name`` means: itself, or its left and right; empty when unknown."""
    found = []
    for spelling in (name, f"{name}Left", f"{name}Right"):
        try:
            found.append(parameters.index(spelling))
        except ParameterError:
            continue
        if spelling == name:
            break
    return found
