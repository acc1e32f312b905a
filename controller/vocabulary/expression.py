"""Named expressions: what a name and an intensity mean in parameters, and how they rise and fall."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from controller.base.errors import ConfigError
from controller.base.parameters import Floats, Parameters, did_you_mean, file_error, fold, read_toml
from controller.vocabulary.sides import sides

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


class Expressions(Protocol):
    """Named expressions, as whoever mixes them sees them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Canonical names, in file order."""

    def __getitem__(self, name: str) -> Expression:
        """The expression called ``name``. Raises ParameterError."""


def read_expressions(parameters: Parameters, files: Iterable[Path]) -> tuple[dict[str, Expression], dict[str, str]]:
    """The expressions of files, in order, and folded other names to canonical ones.

    Parameters
    ----------
    files : may mix the expressions of those before them.

    Raises
    ------
    ConfigError : a file cannot be read or is wrong; every fault of every file with its key.
    """
    known: dict[str, Expression] = {}
    aliases: dict[str, str] = {}
    errors: list[ConfigError] = []
    for file in files:
        reader = _Reader(parameters, known)
        known = known | reader.read(read_toml(file))
        aliases |= reader.aliases(known, aliases)
        if reader.faults:
            errors.append(file_error(file, reader.faults))
    if errors:
        raise errors[0] if len(errors) == 1 else ConfigError("\n".join(map(str, errors)), hint=errors[0].hint)
    return known, aliases


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
