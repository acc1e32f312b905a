"""Reads visemes, what the mouth does for a sound, and the tables from phonemes and Rhubarb's shapes to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, Share, load
from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import config_dir
from controller.vocabulary.sides import spread, unknown_names


class _Viseme(Settings):
    sounds: str = ""
    duration: Annotated[Number, Field(ge=0, le=10)] = 0.5
    hold: Share = 0.5
    aliases: list[str] = []
    weights: dict[str, Share] = {}


class _File(Settings):
    visemes: Annotated[dict[str, _Viseme], Field(min_length=1)]
    rhubarb: dict[str, dict[str, Number]] = {}
    phonemes: dict[str, str] = {}
    through: dict[str, Share] = {}


@dataclass(frozen=True, eq=False)
class Visemes:
    """The visemes of one file, in wire order.

    names : of the n visemes. matrix : (P, n) float64, parameters of each at full weight.
    hold : (n,) how firmly each keeps its shape, 0..1. duration : (n,) relative lengths.
    through : (P,) how much of the face below shows through speech; 1 where no viseme moves a parameter.
    rhubarb : mouth shape to weights (n,). phonemes : phoneme to weights (n,). aliases : other names of visemes.
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
        """Read visemes; the shipped ones without ``path``. Raises ConfigError with every fault."""
        path = path or config_dir() / "vocabularies" / "visemes.toml"
        return _build(parameters, load(path, _File, lambda file: _faults(parameters, file)))

    @property
    def mask(self) -> np.ndarray:
        """(P,) bool, the parameters that any viseme moves or that speech holds back."""
        moved: np.ndarray = (self.matrix != 0.0).any(axis=1) | (self.through < 1.0)
        return moved

    def weights(self, name: str) -> Floats:
        """(n,) weights of a viseme by name, or of a phoneme with or without stress digit.

        Raises ParameterError: neither is known.
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


def _faults(parameters: Parameters, file: _File) -> list[str]:
    """Unknown parameters, and shapes and phonemes that mean an unknown viseme."""
    faults = unknown_names(parameters, "through", file.through)
    for name, viseme in file.visemes.items():
        faults += unknown_names(parameters, f"visemes.{name}.weights", viseme.weights)
    used = {f"rhubarb.{shape}": name for shape, mix in file.rhubarb.items() for name in mix}
    used |= {f"phonemes.{phoneme}": name for phoneme, name in file.phonemes.items()}
    return faults + [
        f"{where}: unknown viseme {name!r}{did_you_mean(name, file.visemes)}"
        for where, name in used.items()
        if name not in file.visemes
    ]


def _build(parameters: Parameters, file: _File) -> Visemes:
    given = file.visemes
    matrix = np.stack([spread(parameters, viseme.weights) for viseme in given.values()], axis=1)
    hold, duration = (np.array([getattr(viseme, key) for viseme in given.values()]) for key in ("hold", "duration"))
    through = np.where((matrix != 0.0).any(axis=1), 0.0, 1.0)
    listed = spread(parameters, file.through, np.nan)
    through = np.where(np.isnan(listed), through, listed)
    for array in (matrix, hold, duration, through):
        array.flags.writeable = False
    return Visemes(
        tuple(given),
        matrix,
        hold,
        duration,
        through,
        {shape: _weights(mix, given) for shape, mix in file.rhubarb.items()},
        {phoneme: _weights({name: 1.0}, given) for phoneme, name in file.phonemes.items()},
        {alias: name for name, viseme in given.items() for alias in viseme.aliases},
    )


def _weights(mix: Mapping[str, float], names: Iterable[str]) -> Floats:
    return np.array([mix.get(name, 0.0) for name in names])
