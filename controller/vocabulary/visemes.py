"""Reads visemes, what the mouth does for a sound, and the tables from phonemes and other names of sounds to them."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, Share, load
from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import config_dir
from controller.vocabulary.sides import spread, unknown_names

_LONGEST_LETTERS = 3


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
    ipa: dict[str, str] = {}
    sapi: dict[Annotated[str, Field(pattern=r"^\d+$")], str] = {}
    letters: dict[str, str] = {}
    through: dict[str, Share] = {}


@dataclass(frozen=True, eq=False)
class Visemes:
    """The visemes of one file, in wire order.

    names : of the n visemes. matrix : (P, n) float64, parameters of each at full weight.
    hold : (n,) how firmly each keeps its shape, 0..1. duration : (n,) relative lengths.
    through : (P,) how much of the face below shows through speech; 1 where no viseme moves a parameter.
    rhubarb : mouth shape to weights (n,). phonemes : phoneme of ARPAbet to weights (n,). aliases : other names of
    visemes. ipa : symbol of the IPA to weights (n,). sapi : viseme of SAPI, by its number, to weights (n,).
    letters : letters of a written word to weights (n,).
    """

    names: tuple[str, ...]
    matrix: Floats
    hold: Floats
    duration: Floats
    through: Floats
    rhubarb: dict[str, Floats]
    phonemes: dict[str, Floats]
    aliases: dict[str, str]
    ipa: dict[str, Floats] = field(default_factory=dict)
    sapi: dict[int, Floats] = field(default_factory=dict)
    letters: dict[str, Floats] = field(default_factory=dict)

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
        found = self._named(name)
        if found is None:
            known = [*self.names, *self.phonemes]
            raise ParameterError(
                f"unknown viseme or phoneme {name!r}{did_you_mean(name, known)}",
                hint="configs/vocabularies/visemes.toml lists both",
            )
        return found

    def viseme(self, name: str) -> str:
        """The canonical name of a viseme, in any case. Raises ParameterError: it is none."""
        known = {each.lower(): each for each in self.names} | {k.lower(): v for k, v in self.aliases.items()}
        found = known.get(name.lower())
        if found is None:
            raise ParameterError(f"unknown viseme {name!r}{did_you_mean(name, self.names)}", hint=" ".join(self.names))
        return found

    def sounds(self, names: Sequence[str], *, guess: bool = False) -> list[Floats]:
        """Weights (n,) of each sound of an alignment: visemes, phonemes of ARPAbet, or symbols of the IPA.

        All are symbols of the IPA where any of them can be nothing else: "y" is another sound there.
        guess : what is unknown is read as a symbol in small letters, as "PT".

        Raises ParameterError: a sound is unknown.
        """
        plain = {name: self._named(name) for name in names}
        if all(found is not None for found in plain.values()):
            return [self.weights(name) for name in names]
        found = {name: self._mixed(name, plain[name], guess) for name in plain}
        return [self.weights(name) if (weights := found[name]) is None else weights for name in names]

    def knows(self, name: str) -> bool:
        """Whether :meth:`sounds` knows a sound."""
        return self._named(name) is not None or self._symbol(name) is not None

    def spell(self, text: str) -> Floats:
        """(k, n) weights of the sounds of a written text, guessed from its letters; (1, n) silence without any."""
        rows, rest = [], text.lower()
        while rest:
            taken = next((rest[:size] for size in range(_LONGEST_LETTERS, 0, -1) if rest[:size] in self.letters), "")
            if taken:
                rows.append(self.letters[taken])
            rest = rest[len(taken) or 1 :]
        return np.stack(rows) if rows else self.weights(self.names[0])[None]

    def _named(self, name: str) -> Floats | None:
        name = self.aliases.get(name, name)
        if name in self.names:
            only: Floats = np.eye(len(self.names))[self.names.index(name)]
            return only
        return self.phonemes.get(name.upper().rstrip("012"))

    def _mixed(self, name: str, plain: Floats | None, guess: bool) -> Floats | None:
        """Weights of a sound among symbols of the IPA; names of ARPAbet beside them, as "DH", keep their meaning."""
        arpabet = plain is not None and name.isascii() and (len(name) > 1 or name.isupper())
        if arpabet:
            return plain
        symbol = self._symbol(name)
        if symbol is None and guess:
            symbol = self._symbol(name.lower())
        return plain if symbol is None else symbol

    def _symbol(self, name: str) -> Floats | None:
        """Weights of a symbol of the IPA, by the longest beginning that is listed."""
        bare = _bare(name)
        sizes = range(len(bare), 0, -1)
        return next((self.ipa[bare[:size]] for size in sizes if bare[:size] in self.ipa), None)


def _bare(symbol: str) -> str:
    """A symbol of the IPA without marks of stress, length, tone and articulation."""
    whole = unicodedata.normalize("NFD", symbol.strip())
    return "".join(sign for sign in whole if unicodedata.category(sign) not in ("Mn", "Lm", "Sk", "Po") or sign == "_")


def _faults(parameters: Parameters, file: _File) -> list[str]:
    """Unknown parameters, and shapes and phonemes that mean an unknown viseme."""
    faults = unknown_names(parameters, "through", file.through)
    for name, viseme in file.visemes.items():
        faults += unknown_names(parameters, f"visemes.{name}.weights", viseme.weights)
    used = [(f"rhubarb.{shape}", name) for shape, mix in file.rhubarb.items() for name in mix]
    used += [(f"phonemes.{phoneme}", name) for phoneme, name in file.phonemes.items()]
    used += [(f"sapi.{number}", name) for number, name in file.sapi.items()]
    used += [(f"{table}.{name}", name) for table in ("ipa", "letters") for name in getattr(file, table)]
    faults += [
        f"{where}: unknown viseme {name!r}{did_you_mean(name, file.visemes)}"
        for where, name in used
        if name not in file.visemes
    ]
    return faults + [
        f"letters.{name}: {letters!r} has more than {_LONGEST_LETTERS} letters"
        for name, each in file.letters.items()
        for letters in each.split()
        if len(letters) > _LONGEST_LETTERS
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
        _listed(file.ipa, given),
        {int(number): _weights({name: 1.0}, given) for number, name in file.sapi.items()},
        _listed(file.letters, given),
    )


def _listed(table: Mapping[str, str], names: Iterable[str]) -> dict[str, Floats]:
    """Weights of every word of the lists of a table."""
    return {word: _weights({name: 1.0}, names) for name, words in table.items() for word in words.split()}


def _weights(mix: Mapping[str, float], names: Iterable[str]) -> Floats:
    return np.array([mix.get(name, 0.0) for name in names])
