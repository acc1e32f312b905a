"""FACS action units: formulas such as ``1+2+5B+26`` to parameters, and back from any face to units and emotions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean, file_error, read_toml
from controller.base.paths import config_dir
from controller.vocabulary.sides import sides

if TYPE_CHECKING:
    from controller.base.solve import BoundedSolver  # start-up: numba and scipy, only for reading back

LETTERS = "ABCDE"
"""Intensities of FACS, 0.2 to 1.0."""

_TERM = re.compile(r"([LR]?)(?:AU|AD)?(\d{1,2})([LR]?)([A-E]?)", re.IGNORECASE)
_KEYS = {"name", "source", "choice", "weights", "left", "right", "aliases", "read"}
_SPARSITY = 2e-3
_SHOWN = 0.05
_LEAST_INTENSITY = 0.1
_LEAST_LIKENESS = 0.35  # cosine to the nearest emotion below which a face shows none
_TOLERANCE = 1e-5


@dataclass(frozen=True)
class _Column:
    """One thing to solve for: a unit, or one side of it."""

    unit: str
    side: str
    weights: Floats
    read: bool


class Facs:
    """The action units of one file.

    Parameters
    ----------
    columns : units and their sides, in file order. aliases : other numbers of units.
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
        self._of_unit: dict[str, list[int]] = {}
        for i, column in enumerate(columns):
            self._of_unit.setdefault(column.unit, []).append(i)

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None) -> Facs:
        """Read action units; the shipped ones without ``path``.

        Raises
        ------
        ConfigError : the file cannot be read or is wrong; every fault with its key.
        """
        path = path or config_dir() / "vocabularies" / "facs.toml"
        table = read_toml(path)
        faults = [f"{key}: unknown key" for key in table if key not in ("units", "emotions")]
        columns: list[_Column] = []
        aliases: dict[str, str] = {}
        for unit, given in table.get("units", {}).items():
            columns += _columns(parameters, unit, given, faults)
            aliases |= {str(alias): unit for alias in given.get("aliases", [])}
        if not columns:
            raise file_error(path, [*faults, "units: missing"])
        facs = cls(columns, aliases, table.get("emotions", {}))
        faults += [f"emotions.{name}: {fault}" for name, fault in facs._emotion_faults()]
        if faults:
            raise file_error(path, faults)
        return facs

    def levels(self, formula: str, intensity: float = 1.0) -> Floats:
        """(n,) levels of a formula: units with optional side and letter, joined by ``+``.

        ``12`` is both sides at full intensity, ``L12B`` the face's own left side at 0.4.

        Raises
        ------
        ParameterError : a term is not understood or no unit has its number.
        """
        levels = np.zeros(len(self.names))
        for term in filter(None, formula.replace(" ", "").split("+")):
            indices, level = self._term(term)
            levels[indices] = np.maximum(levels[indices], level * intensity)
        return levels

    def expand(self, formula: str, intensity: float = 1.0) -> Floats:
        """(P,) parameters of a formula, clipped to 1. Raises ParameterError."""
        return self.parameters_of(self.levels(formula, intensity))

    def parameters_of(self, levels: Floats) -> Floats:
        """(P,) parameters of ``levels`` : (n,), clipped to 1."""
        return np.minimum(self.matrix @ levels, 1.0)

    def read(self, values: Floats) -> Floats:
        """(n,) levels 0..1 that show ``values`` : (P,) best, with few units."""
        levels: Floats = self._solver.solve(np.asarray(values, dtype=np.float64)) * self._read
        return levels

    def formula(self, levels: Floats) -> str:
        """Levels (n,) as a formula with letters; both sides as one where they agree, nothing below 0.05."""
        terms = []
        for unit, indices in self._of_unit.items():
            shown = {self.names[i].removesuffix(unit): _letter(levels[i]) for i in indices if levels[i] >= _SHOWN}
            if len(set(shown.values())) == 1 and len(shown) == len(indices):
                terms.append(unit + next(iter(shown.values())))
            else:
                terms += [side + unit + letter for side, letter in shown.items()]
        return "+".join(terms)

    def read_emotion(self, values: Floats) -> tuple[str, float]:
        """The emotion whose units ``values`` : (P,) show most, and its intensity 0..1; neutral when little shows."""
        levels = self.read(values)
        names, templates = self._templates
        sizes = np.linalg.norm(templates, axis=1)
        likeness = templates @ levels / sizes
        best = int(np.argmax(likeness))
        intensity = float(likeness[best] / sizes[best])
        if intensity < _LEAST_INTENSITY or likeness[best] < _LEAST_LIKENESS * np.linalg.norm(levels):
            return "neutral", 1.0
        return names[best], min(intensity, 1.0)

    @cached_property
    def _templates(self) -> tuple[list[str], Floats]:
        """Emotions that show something, and what a read-out of them gives: (k, n)."""
        names = [name for name, formula in self.emotions.items() if formula]
        return names, np.array([self.read(self.expand(self.emotions[name])) for name in names])

    @cached_property
    def _solver(self) -> BoundedSolver:
        from controller.base.solve import BoundedSolver  # start-up: numba and scipy, only for reading back

        high = self._read.astype(np.float64)
        return BoundedSolver(
            self.matrix, np.zeros(len(high)), high, ridge=1e-4, sparsity=_SPARSITY, tolerance=_TOLERANCE
        )

    def _term(self, term: str) -> tuple[list[int], float]:
        match = _TERM.fullmatch(term)
        if match is None:
            raise ParameterError(f"{term!r} is not an action unit", hint='write it like "12", "12B" or "L12B"')
        before, number, after, letter = (group.upper() for group in match.groups())
        unit = self._aliases.get(number, number)
        if unit not in self._of_unit:
            raise ParameterError(f"unknown action unit {number!r}{did_you_mean(number, self._of_unit)}",
                                 hint="configs/vocabularies/facs.toml lists the units")  # fmt: skip
        indices = self._of_unit[unit]
        side = before or after
        if side:
            indices = [i for i in indices if self.names[i] == side + unit]
            if not indices:
                raise ParameterError(f"action unit {unit} has no sides", hint=f"write it as {unit}")
        return indices, (LETTERS.index(letter) + 1) / 5 if letter else 1.0

    def _emotion_faults(self) -> list[tuple[str, str]]:
        faults = []
        for name, formula in self.emotions.items():
            try:
                self.levels(formula)
            except (ParameterError, AttributeError) as error:
                faults.append((name, str(error)))
        return faults


def _letter(level: float) -> str:
    return LETTERS[min(max(round(float(level) * 5), 1), 5) - 1]


def _columns(parameters: Parameters, unit: str, given: dict[str, Any], faults: list[str]) -> list[_Column]:
    """The columns of a unit: one, or two when it has sides."""
    where = f"units.{unit}"
    faults += [f"{where}.{key}: unknown key{did_you_mean(key, _KEYS)}" for key in given if key not in _KEYS]
    if "left" in given or "right" in given:
        halves = {"L": given.get("left", {}), "R": given.get("right", {})}
        found = {side: _weights(parameters, where, table, "", faults) for side, table in halves.items()}
    else:
        both = given.get("weights", {})
        if not both:
            faults.append(f"{where}.weights: missing")
        plain = {key: value for key, value in both.items() if len(sides(parameters, key)) == 1}
        sided = {key: value for key, value in both.items() if key not in plain}
        if sided and not plain:
            found = {side: _weights(parameters, where, sided, side, faults) for side in "LR"}
        else:
            found = {"": _weights(parameters, where, both, "", faults)}
    return [_Column(unit, side, weights, given.get("read", True)) for side, weights in found.items()]


def _weights(parameters: Parameters, where: str, table: dict[str, Any], side: str, faults: list[str]) -> Floats:
    """(P,) weights of a table, of one side only where ``side`` is given; faults are noted."""
    weights = parameters.neutral()
    for key, value in table.items():
        positions = sides(parameters, key)
        if not positions:
            faults.append(f"{where}.weights.{key}: unknown parameter{did_you_mean(key, parameters.names)}")
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= 1:
            faults.append(f"{where}.weights.{key}: must be a number above 0, up to 1 (is {value!r})")
            continue
        chosen = {"": positions, "L": positions[:1], "R": positions[1:]}[side]
        weights[chosen] = value
    return weights
