"""Reads files of named expressions: the parameter values of each, and how fast it appears and disappears."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import BeforeValidator, Field, RootModel, ValidationInfo, field_validator

from controller.base.config import Fraction, Number, Settings, load
from controller.base.errors import ConfigError
from controller.base.parameters import TABLE_KEYS, Floats, Parameters, describes_parameters, did_you_mean, fold
from controller.vocabulary.sides import sides, unknown_names

_TRANSITION_S = 0.4
_MAX_CYCLES = 20
_Seconds = Annotated[Number, Field(ge=0, le=60)]
_Override = Literal["keep", "block", "blend"]


@dataclass(frozen=True, eq=False)
class Expression:
    """One named expression.

    name : canonical name. kind : ``"emotion"``, ``"gesture"`` or ``"user"``. source : where it comes from.
    weights : (P,) float64, what it adds to the neutral face at intensity 1; read-only.
    onset_s, offset_s : times in which it appears and disappears.
    blink, gaze, mouth : effect on blinks, gaze and speech while it shows: ``"keep"``, ``"block"`` or ``"blend"``.
    response : exponent of the intensity; below 1, low intensities show more than in proportion.
    """

    name: str
    weights: Floats
    kind: str = "user"
    source: str = ""
    onset_s: float = _TRANSITION_S
    offset_s: float = _TRANSITION_S
    blink: str = "keep"
    gaze: str = "keep"
    mouth: str = "keep"
    response: float = 1.0

    def pose(self, intensity: float) -> Floats:
        """Return (P,): what it adds to the neutral face at an intensity from 0 to 1."""
        pose: Floats = self.weights * intensity**self.response
        return pose


class Expressions(Protocol):
    """A collection of named expressions, as the player of expressions needs it."""

    @property
    def names(self) -> tuple[str, ...]:
        """Canonical names, in file order."""

    def __getitem__(self, name: str) -> Expression:
        """The expression called ``name``. Raises ParameterError."""


class _Table(Settings):
    kind: Literal["emotion", "gesture", "user"] = "user"
    aliases: list[str] = []
    source: str = ""
    onset_s: _Seconds = _TRANSITION_S
    offset_s: _Seconds = _TRANSITION_S
    blink: _Override = "keep"
    gaze: _Override = "keep"
    mouth: _Override = "keep"
    response: Annotated[Number, Field(ge=0.2, le=5)] = 1.0
    of: dict[str, Fraction] = {}
    weights: dict[str, Number] = Field(default=None, validate_default=True)

    @field_validator("weights", mode="before")
    @classmethod
    def _given(cls, weights: Any, info: ValidationInfo) -> Any:
        if weights is None and not info.data.get("of", True):
            raise ValueError("missing")
        return {} if weights is None else weights


def _without_parameters(table: Any) -> Any:
    """Return a vocabulary's table without its parameters, which :meth:`Parameters.with_files` reads."""
    if not isinstance(table, Mapping) or not describes_parameters(table):
        return table
    return {key: value for key, value in table.items() if key not in TABLE_KEYS}


_File = RootModel[Annotated[dict[str, _Table], BeforeValidator(_without_parameters)]]


def read_expressions(parameters: Parameters, files: Iterable[Path]) -> tuple[dict[str, Expression], dict[str, str]]:
    """Return the expressions of files, in order, and a table from aliases (folded) to canonical names.

    ``files`` : each may mix expressions of the files before it.

    Raises ConfigError: a file cannot be read or is wrong; lists every fault of every file with its key.
    """
    known: dict[str, Expression] = {}
    aliases: dict[str, str] = {}
    errors: list[ConfigError] = []
    for path in files:

        def faults(file: _File) -> list[str]:
            mixing = _mixing_faults(file.root, known, complete=not errors)  # noqa: B023  called before the next file
            return _faults(parameters, file.root, known, aliases) + mixing  # noqa: B023  the same

        try:
            tables = load(path, _File, faults).root
        except ConfigError as error:
            errors.append(error)
            continue
        known |= _expressions(parameters, tables, known)
        aliases |= {fold(alias): name for name, table in tables.items() for alias in table.aliases}
    if errors:
        raise errors[0] if len(errors) == 1 else ConfigError("\n".join(map(str, errors)), hint=errors[0].hint)
    return known, aliases


def _expressions(
    parameters: Parameters, tables: Mapping[str, _Table], known: Mapping[str, Expression]
) -> dict[str, Expression]:
    """Return the expressions of a file without faults, in its order."""
    weights = {name: expression.weights for name, expression in known.items()}
    for name in TopologicalSorter({name: table.of for name, table in tables.items()}).static_order():
        if name in tables:
            mixed = sum((amount * weights[part] for part, amount in tables[name].of.items()), np.zeros(len(parameters)))
            weights[name] = np.clip(mixed, parameters.low - parameters.rest, parameters.high - parameters.rest)
            for key, value in tables[name].weights.items():
                indices = sides(parameters, key)
                weights[name][indices] = value - parameters.rest[indices]
            weights[name].flags.writeable = False
    options = {"kind", "source", "onset_s", "offset_s", "blink", "gaze", "mouth", "response"}
    return {
        name: Expression(name, weights[name], **table.model_dump(include=options)) for name, table in tables.items()
    }


def _faults(
    parameters: Parameters, tables: Mapping[str, _Table], known: Iterable[str], aliases: Mapping[str, str]
) -> list[str]:
    """Return the faults of a file: names that are in use, unknown parameters, and weights out of range."""
    faults = [f"{name}: is already in an earlier file; choose another name" for name in tables if name in known]
    taken = {fold(name): name for name in (*known, *tables)} | dict(aliases)
    for name, table in tables.items():
        faults += unknown_names(parameters, f"{name}.weights", table.weights)
        for key, value in table.weights.items():
            low, high = ((ends[sides(parameters, key)[:1]]).tolist() for ends in (parameters.low, parameters.high))
            if low and not low[0] <= value <= high[0]:
                faults.append(f"{name}.weights.{key}: must be a number from {low[0]:g} to {high[0]:g} (is {value!r})")
        for alias in map(fold, table.aliases):
            if alias in taken:
                faults.append(f"{name}.aliases: {alias!r} is already a name of {taken[alias]!r}")
            taken[alias] = name
    return faults


def _mixing_faults(tables: Mapping[str, _Table], known: Iterable[str], *, complete: bool) -> list[str]:
    """Return cyclic mixtures and, if the ``known`` expressions are ``complete``, unknown expressions in mixtures.

    At most :data:`_MAX_CYCLES` cycles are searched for, because each takes a pass over the whole file.
    """
    names = {**tables, **dict.fromkeys(known)}
    faults = [f"{name}.of.{part}: unknown expression {part!r}{did_you_mean(part, names)}"
              for name, table in tables.items() for part in table.of if complete and part not in names]  # fmt: skip
    graph = {name: list(table.of) for name, table in tables.items()}
    for _ in range(_MAX_CYCLES):
        try:
            TopologicalSorter(graph).prepare()
            break
        except CycleError as error:
            cycle = error.args[1][::-1]
            faults.append(f"{cycle[0]}.of.{cycle[1]}: goes in a circle: {' -> '.join(cycle)}")
            graph[cycle[0]].remove(cycle[1])
    return faults
