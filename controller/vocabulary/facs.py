"""Converts FACS action units, in formulas such as ``1+2+5B+26``, to parameters, and faces to units and emotions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from controller.base.config import Number, Settings, load
from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import config_dir
from controller.base.plain_numbers import plain_number
from controller.vocabulary.sides import sides, spread, unknown_names

if TYPE_CHECKING:
    from controller.base.solve import BoundedSolver  # imported lazily: it loads numba and scipy

LETTERS = "ABCDE"
"""FACS's letters of intensity, which mean 0.2 to 1.0."""

_PREFIX = r"(?:AU|AD)"
_TERM = re.compile(rf"([LR]?){_PREFIX}?([LR]?)([0-9]{{1,2}})([LR]?)([A-E]?)(?::(.*))?", re.IGNORECASE)
_FORMULA = re.compile(rf"{_PREFIX}[LR]?[0-9]", re.IGNORECASE)
_SPARSITY = 2e-3
_MIN_INTENSITY = 0.1
_MIN_COSINE = 0.35  # cosine to the most similar emotion below which a face shows no emotion
_TOLERANCE = 1e-5
_ROTATIONS = range(51, 65)
"""Numbers of the units that turn the head and the eyes, which are ignored in emotions."""


def _not_zero(weight: float) -> float:
    if not weight:
        raise ValueError("must not be 0")
    return weight


_Number = Annotated[str, Field(pattern=r"^[1-9][0-9]?$")]
_Level = Annotated[Number, Field(ge=-1, le=1), AfterValidator(_not_zero)]


class _Unit(Settings):
    name: str = ""
    source: str = ""
    choice: str = ""
    left: dict[str, _Level] = {}
    right: dict[str, _Level] = {}
    weights: Annotated[dict[str, _Level], Field(validate_default=True)] = {}
    aliases: list[str] = []
    read: bool = True

    @field_validator("weights")
    @classmethod
    def _given(cls, weights: dict[str, float], info: ValidationInfo) -> dict[str, float]:
        halves = bool(info.data.get("left", True) or info.data.get("right", True))
        if bool(weights) is halves:
            raise ValueError("the unit has left or right, too: give one or the other" if halves else "missing")
        return weights


class _File(Settings):
    units: Annotated[dict[_Number, _Unit], Field(min_length=1)]
    emotions: dict[str, str] = {}


@dataclass(frozen=True)
class _Column:
    """One unknown of the solver: a unit, or one side of it. ``read`` : whether :meth:`Facs.read` may use it."""

    unit: str
    side: str
    weights: Floats
    read: bool


class Facs:
    """The action units of one file.

    Parameters
    ----------
    columns : units and their sides, in file order. aliases : other numbers of units, to those in use.
    emotions : formulas of emotions, by name.

    Attributes
    ----------
    names : unit or side of each column, such as ``"1"``, ``"L12"``, ``"R12"``.
    matrix : (P, n) float64, what each column does at full intensity; read-only.
    """

    def __init__(self, columns: list[_Column], aliases: dict[str, str], emotions: dict[str, str]) -> None:
        self.names = tuple(column.side + column.unit for column in columns)
        self.matrix = np.stack([column.weights for column in columns], axis=1)
        self.matrix.flags.writeable = False
        self.emotions = dict(emotions)
        self._aliases = aliases
        self._read = np.array([column.read for column in columns])
        self._facial = np.array([int(column.unit) not in _ROTATIONS for column in columns])
        self._columns_by_unit: dict[str, list[int]] = {}
        for i, column in enumerate(columns):
            self._columns_by_unit.setdefault(column.unit, []).append(i)

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None) -> Facs:
        """Read action units; by default, the shipped ones. Raises ConfigError that lists every fault."""
        path = path or config_dir() / "vocabularies" / "facs.toml"
        return cls._build(parameters, load(path, _File, lambda file: cls._faults(parameters, file)))

    @classmethod
    def _build(cls, parameters: Parameters, file: _File) -> Facs:
        columns = [column for name, unit in file.units.items() for column in _columns(parameters, name, unit)]
        aliases = {alias: name for name, unit in file.units.items() for alias in unit.aliases}
        return cls(columns, aliases, file.emotions)

    @classmethod
    def _faults(cls, parameters: Parameters, file: _File) -> list[str]:
        """Return the faults of a file: unknown parameters, and wrong formulas of emotions."""
        faults = [
            fault
            for name, unit in file.units.items()
            for table in ("weights", "left", "right")
            for fault in unknown_names(parameters, f"units.{name}.{table}", getattr(unit, table))
        ]
        facs = cls._build(parameters, file)
        for name, formula in file.emotions.items():
            try:
                facs.levels(formula)
            except ParameterError as error:
                faults.append(f"emotions.{name}: {error}")
        return faults

    def levels(self, formula: str, intensity: float = 1.0) -> Floats:
        """Return (n,) levels of a formula: units with optional side and intensity, joined by ``+``; zeros if empty.

        ``12`` is both sides at full intensity, ``L12B`` the face's own left side at 0.4, ``12:0.35`` both at 0.35. The
        side may also follow the number, ``12LB``, and each unit may begin with ``AU`` or ``AD``. All levels are
        multiplied by ``intensity``.

        Raises ParameterError: a term is not understood, or no unit has its number.
        """
        levels = np.zeros(len(self.names))
        terms = formula.replace(" ", "")
        for term in terms.split("+") if terms else ():
            indices, level = self._term(term)
            levels[indices] = np.maximum(levels[indices], level * intensity)
        return levels

    def columns_of(self, unit: str) -> list[int]:
        """Return the indices of a unit's columns: one, or one for each side; empty for an unknown unit.

        unit : its number, as "12", or one side, as "L12".
        """
        side = unit[:1] if unit[:1] in ("L", "R") else ""
        number = unit.removeprefix(side)
        number = self._aliases.get(number, number)
        return [i for i in self._columns_by_unit.get(number, []) if not side or self.names[i] == side + number]

    def expand(self, formula: str, intensity: float = 1.0) -> Floats:
        """Return (P,) parameter values of a formula, clipped to -1..1. Raises ParameterError."""
        return np.clip(self.matrix @ self.levels(formula, intensity), -1.0, 1.0)

    def read(self, values: Floats) -> Floats:
        """Return (n,) levels 0..1 of few units that reproduce ``values`` : (P,) best."""
        levels: Floats = self._solver.solve(np.asarray(values, dtype=np.float64)) * self._read
        return levels

    def read_emotion(self, values: Floats) -> tuple[str, float]:
        """Return the emotion whose units are most similar to those of ``values`` : (P,), and its intensity 0..1.

        If the face shows little, or no emotion is similar, that is ``("neutral", 1.0)``.
        """
        levels = self.read(values) * self._facial
        names, templates = self._templates
        if not names:
            return "neutral", 1.0
        sizes = np.linalg.norm(templates, axis=1)
        likeness = templates @ levels / sizes
        best = int(np.argmax(likeness))
        intensity = float(likeness[best] / sizes[best])
        if intensity < _MIN_INTENSITY or likeness[best] < _MIN_COSINE * np.linalg.norm(levels):
            return "neutral", 1.0
        return names[best], min(intensity, 1.0)

    @cached_property
    def _templates(self) -> tuple[list[str], Floats]:
        """Names of the k emotions that any unit shows, and (k, n) the levels that are read from their faces."""
        found = {name: self.read(self.expand(formula)) * self._facial for name, formula in self.emotions.items()}
        shown = {name: levels for name, levels in found.items() if levels.any()}
        return list(shown), np.array(list(shown.values())).reshape(len(shown), len(self.names))

    @cached_property
    def _solver(self) -> BoundedSolver:
        from controller.base.solve import BoundedSolver  # imported lazily: it loads numba and scipy

        high = self._read.astype(np.float64)
        return BoundedSolver(
            self.matrix, np.zeros(len(high)), high, ridge=1e-4, sparsity=_SPARSITY, tolerance=_TOLERANCE
        )

    def _term(self, term: str) -> tuple[list[int], float]:
        match = _TERM.fullmatch(term)
        number, side, letter = ("", "", "") if match is None else _parts(match)
        if match is None or not number or len(side) > 1 or (letter and match[6] is not None):
            raise ParameterError(f"{term!r} is not an action unit", hint='write it like "12", "L12B" or "12:0.35"')
        unit = self._aliases.get(number, number)
        if unit not in self._columns_by_unit:
            raise ParameterError(f"unknown action unit {number!r}{did_you_mean(number, self._columns_by_unit)}",
                                 hint="configs/vocabularies/facs.toml lists the units")  # fmt: skip
        indices = self._columns_by_unit[unit]
        if side:
            indices = [i for i in indices if self.names[i] == side + unit]
            if not indices:
                raise ParameterError(f"action unit {unit} has no sides", hint=f"write it as {unit}")
        if match[6] is not None:
            return indices, _intensity(term, match[6])
        return indices, (LETTERS.index(letter) + 1) / 5 if letter else 1.0


def is_formula(text: str) -> bool:
    """Whether a text is a formula of action units and not a name: it begins like ``AU12``."""
    return _FORMULA.match(text) is not None


def _parts(match: re.Match[str]) -> tuple[str, str, str]:
    """Return number, side and letter of a term."""
    first, second, number, third, letter = (match[i].upper() for i in range(1, 6))
    return number, first + second + third, letter


def _intensity(term: str, text: str) -> float:
    """Parse the intensity after a colon. Raises ParameterError: it is not a number from 0 to 1."""
    value = plain_number(text)
    if value is None or not 0.0 <= value <= 1.0:
        raise ParameterError(f"{term!r}: the intensity must be 0 to 1, not {text!r}", hint='write it like "12:0.35"')
    return value


def _columns(parameters: Parameters, name: str, unit: _Unit) -> list[_Column]:
    """Return the columns of a unit: one, or two if it has sides."""
    if unit.left or unit.right:
        halves = {"L": spread(parameters, unit.left), "R": spread(parameters, unit.right)}
    else:
        halves = {"": spread(parameters, unit.weights)}
        found = [sides(parameters, key) for key in unit.weights]
        if all(len(positions) == 2 for positions in found):
            halves = {side: _keep_only(halves[""], [each[i] for each in found]) for i, side in enumerate("LR")}
    return [_Column(name, side, weights, unit.read) for side, weights in halves.items()]


def _keep_only(weights: Floats, indices: list[int]) -> Floats:
    """Return (P,) weights at ``indices``, and 0 elsewhere."""
    kept = np.zeros_like(weights)
    kept[indices] = weights[indices]
    return kept
