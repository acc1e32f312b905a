"""Reads presets (the named expressions that every avatar of one format has, as VRM's) as parameter values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from controller.base.config import Fraction, Settings, load
from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, fold
from controller.base.paths import config_dir
from controller.vocabulary.sides import spread, unknown_names
from controller.vocabulary.visemes import Visemes
from controller.vocabulary.vocabulary import Vocabulary


class _Preset(Settings):
    aliases: list[str] = []
    expression: str | None = None
    viseme: str | None = None
    weights: dict[str, Fraction] = {}
    tracked: bool = False


class _File(Settings):
    presets: Annotated[dict[str, _Preset], Field(min_length=1)]


@dataclass(frozen=True, eq=False)
class Preset:
    """One preset.

    name : its canonical name. weights : (P,) float64, the parameter values of the preset at 1; read-only.
    tracked : whether ARKit's 52 parameters express the same, so that face tracking already contains it.
    """

    name: str
    weights: Floats
    tracked: bool


class Presets:
    """The presets of one file by name, in any case. ``names`` : canonical names, in file order."""

    def __init__(self, presets: list[Preset], aliases: dict[str, str]) -> None:
        self.names = tuple(preset.name for preset in presets)
        by_name = {preset.name: preset for preset in presets}
        self._lookup = {fold(name): preset for name, preset in by_name.items()}
        self._lookup |= {fold(alias): by_name[name] for alias, name in aliases.items()}

    @classmethod
    def load(cls, parameters: Parameters, path: Path | None = None) -> Presets:
        """Read presets; by default, those of VRM avatars. Raises ConfigError that lists every fault."""
        path = path or config_dir() / "vocabularies" / "vrm.toml"
        reader = _Reader(parameters)
        file = load(path, _File, reader.faults)
        aliases = {alias: name for name, preset in file.presets.items() for alias in preset.aliases}
        return cls([reader.preset(name, preset) for name, preset in file.presets.items()], aliases)

    def find(self, name: str) -> Preset | None:
        """Return the preset called ``name``, in any case, or None."""
        return self._lookup.get(fold(name))


class _Reader:
    """Resolves the expressions, visemes and parameters that presets name."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._vocabulary, self._visemes = Vocabulary.load(parameters), Visemes.load(parameters)

    def preset(self, name: str, given: _Preset) -> Preset:
        """Return a preset with its weights. Raises ParameterError: it names an unknown expression or viseme."""
        weights = spread(self._parameters, given.weights)
        if given.expression is not None:
            weights = self._vocabulary[given.expression].weights.copy()
        if given.viseme is not None:
            weights = self._visemes.matrix @ self._visemes.weights(given.viseme)
        weights.flags.writeable = False
        return Preset(name, weights, given.tracked)

    def faults(self, file: _File) -> list[str]:
        """Return the faults of a file: unknown names, and presets that are defined in more than one way."""
        faults = []
        for name, given in file.presets.items():
            faults += unknown_names(self._parameters, f"presets.{name}.weights", given.weights)
            if sum((given.expression is not None, given.viseme is not None, bool(given.weights))) > 1:
                faults.append(f"presets.{name}: give one of expression, viseme and weights")
            try:
                self.preset(name, given)
            except ParameterError as error:
                faults.append(f"presets.{name}: {error}")
        return faults
