"""Visemes: what the mouth does for a sound, as data; and the tables from phonemes and Rhubarb's shapes to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean, file_error, read_toml
from controller.base.paths import config_dir
from controller.vocabulary.sides import spread

_KEYS = {"sounds", "duration", "hold", "aliases", "weights"}
_TABLES = {"visemes", "rhubarb", "phonemes", "through"}


@dataclass(frozen=True, eq=False)
class Visemes:
    """The visemes of one file, in wire order.

    Attributes
    ----------
    names : of the n visemes. matrix : (P, n) float64, parameters of each at full weight.
    hold : (n,) how firmly each keeps its shape, 0..1. duration : (n,) relative lengths.
    through : (P,) how much of the face below shows through speech; 1 where no viseme moves a parameter.
    rhubarb : mouth shape to weights (n,). phonemes : phoneme to weights (n,).
    """

    names: tuple[str, ...]
    matrix: Floats
    hold: Floats
    duration: Floats
    through: Floats
    rhubarb: dict[str, Floats]
    phonemes: dict[str, Floats]
    aliases: dict[str, str]

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None) -> Visemes:
        """Read visemes; the shipped ones without ``path``.

        Raises
        ------
        ConfigError : the file cannot be read or is wrong; every fault with its key.
        """
        path = path or config_dir() / "vocabularies" / "visemes.toml"
        table = read_toml(path)
        faults = [f"{key}: unknown key{did_you_mean(key, _TABLES)}" for key in table if key not in _TABLES]
        given: dict[str, Any] = table.get("visemes", {})
        if not given:
            raise file_error(path, [*faults, "visemes: missing"])
        visemes = _read(parameters, given, table, faults)
        if faults:
            raise file_error(path, faults)
        return visemes

    @property
    def mask(self) -> np.ndarray:
        """(P,) bool, the parameters that any viseme moves or that speech holds back."""
        moved: np.ndarray = (self.matrix != 0.0).any(axis=1) | (self.through < 1.0)
        return moved

    def weights(self, name: str) -> Floats:
        """(n,) weights of a viseme by name, or of a phoneme with or without stress digit.

        Raises
        ------
        ParameterError : neither is known.
        """
        name = self.aliases.get(name, name)
        if name in self.names:
            only: Floats = np.eye(len(self.names))[self.names.index(name)]
            return only
        found = self.phonemes.get(name.upper().rstrip("012"))
        if found is None:
            known = [*self.names, *self.phonemes]
            raise ParameterError(
                f"unknown viseme or phoneme {name!r}{did_you_mean(name, known)}",
                hint="configs/vocabularies/visemes.toml lists both",
            )
        return found


def _read(parameters: Parameters, given: dict[str, Any], table: dict[str, Any], faults: list[str]) -> Visemes:
    names = tuple(given)
    columns: list[Floats] = []
    aliases: dict[str, str] = {}
    for name, entry in given.items():
        where = f"visemes.{name}"
        faults += [f"{where}.{key}: unknown key{did_you_mean(key, _KEYS)}" for key in entry if key not in _KEYS]
        columns.append(spread(parameters, f"{where}.weights", entry.get("weights", {}), 0.0, faults))
        aliases |= dict.fromkeys(entry.get("aliases", []), name)
    matrix = np.stack(columns, axis=1)
    through = spread(parameters, "through", table.get("through", {}), np.nan, faults)
    moved = (matrix != 0.0).any(axis=1)
    through = np.where(np.isnan(through), np.where(moved, 0.0, 1.0), through)
    phonemes = {key: {str(value): 1.0} for key, value in table.get("phonemes", {}).items()}
    visemes = Visemes(
        names,
        matrix,
        _numbers(given, "hold", 1.0, faults),
        _numbers(given, "duration", 10.0, faults),
        through,
        _mixes("rhubarb", table.get("rhubarb", {}), names, faults),
        _mixes("phonemes", phonemes, names, faults),
        aliases,
    )
    for array in (visemes.matrix, visemes.hold, visemes.duration, visemes.through):
        array.flags.writeable = False
    return visemes


def _numbers(given: dict[str, Any], key: str, most: float, faults: list[str]) -> Floats:
    values = np.zeros(len(given))
    for i, (name, entry) in enumerate(given.items()):
        value = entry.get(key, 0.5)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= most:
            faults.append(f"visemes.{name}.{key}: must be a number from 0 to {most:g} (is {value!r})")
            continue
        values[i] = value
    return values


def _mixes(where: str, table: dict[str, Any], names: tuple[str, ...], faults: list[str]) -> dict[str, Floats]:
    mixes = {}
    for key, mix in table.items():
        weights = np.zeros(len(names))
        for name, value in mix.items():
            if name not in names:
                faults.append(f"{where}.{key}: unknown viseme {name!r}{did_you_mean(name, names)}")
            else:
                weights[names.index(name)] = value
        mixes[key] = weights
    return mixes
