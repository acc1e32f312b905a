"""Reads visemes (mouth shapes of sounds), and the tables from phonemes and other symbols of sounds to visemes."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Fraction, Number, Settings, load
from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean
from controller.base.paths import config_dir
from controller.vocabulary.sides import spread, unknown_names

_MAX_LETTERS = 3
"""Length of the longest group of letters that the table ``letters`` may map to a viseme."""


class _Viseme(Settings):
    sounds: str = ""
    duration: Annotated[Number, Field(ge=0, le=10)] = 0.5
    hold: Fraction = 0.5
    aliases: list[str] = []
    weights: dict[str, Fraction] = {}


class _File(Settings):
    visemes: Annotated[dict[str, _Viseme], Field(min_length=1)]
    rhubarb: dict[str, dict[str, Number]] = {}
    phonemes: dict[str, str] = {}
    ipa: dict[str, str] = {}
    sapi: dict[Annotated[str, Field(pattern=r"^\d+$")], str] = {}
    letters: dict[str, str] = {}
    through: dict[str, Fraction] = {}


@dataclass(frozen=True, eq=False)
class Visemes:
    """The visemes of one file, in the order of network formats.

    names : of the n visemes. matrix : (P, n) float64, parameter values of each at full weight.
    hold : (n,) 0..1, how strongly each keeps its shape beside its neighbours. duration : (n,) relative durations.
    through : (P,) 0..1, how much of lower layers remains during speech; by default, 1 if no viseme moves the parameter.
    rhubarb, phonemes, ipa, letters : weights (n,) by mouth shape of Rhubarb, phoneme of ARPAbet, symbol of the IPA, and
    group of written letters. sapi : weights (n,) by number of SAPI's visemes. aliases : other names of visemes.
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
        """Read visemes; by default, the shipped ones. Raises ConfigError that lists every fault."""
        path = path or config_dir() / "vocabularies" / "visemes.toml"
        return _build(parameters, load(path, _File, lambda file: _faults(parameters, file)))

    @property
    def mask(self) -> np.ndarray:
        """(P,) bool: the parameters that any viseme moves, or of which speech reduces lower layers."""
        moved: np.ndarray = (self.matrix != 0.0).any(axis=1) | (self.through < 1.0)
        return moved

    def weights(self, name: str) -> Floats:
        """Return (n,) weights of a viseme by name, or of a phoneme of ARPAbet with or without stress digit.

        Raises ParameterError: there is neither.
        """
        found = self._find_named(name)
        if found is None:
            known = [*self.names, *self.phonemes]
            raise ParameterError(
                f"unknown viseme or phoneme {name!r}{did_you_mean(name, known)}",
                hint="configs/vocabularies/visemes.toml lists both",
            )
        return found

    def viseme(self, name: str) -> str:
        """Return the canonical name of a viseme, given in any case. Raises ParameterError: no such viseme."""
        known = {each.lower(): each for each in self.names} | {k.lower(): v for k, v in self.aliases.items()}
        found = known.get(name.lower())
        if found is None:
            raise ParameterError(f"unknown viseme {name!r}{did_you_mean(name, self.names)}", hint=" ".join(self.names))
        return found

    def sounds(self, names: Sequence[str], *, guess: bool = False) -> list[Floats]:
        """Return weights (n,) of each sound of an alignment: visemes, phonemes of ARPAbet, or symbols of the IPA.

        If any name can only be a symbol of the IPA, all are read as such, because "y" is another sound there.
        guess : read an unknown sound, as "PT", as a symbol of the IPA in lower case.

        Raises ParameterError: a sound is unknown.
        """
        plain = {name: self._find_named(name) for name in names}
        if all(found is not None for found in plain.values()):
            return [self.weights(name) for name in names]
        found = {name: self._find_among_ipa(name, plain[name], guess) for name in plain}
        return [self.weights(name) if (weights := found[name]) is None else weights for name in names]

    def knows(self, name: str) -> bool:
        """Whether :meth:`sounds` knows a sound."""
        return self._find_named(name) is not None or self._find_symbol(name) is not None

    def spell(self, text: str) -> Floats:
        """Return (k, n) weights of the sounds of a written text, guessed from its letters; (1, n) silence if none."""
        rows, rest = [], text.lower()
        while rest:
            group = next((rest[:size] for size in range(_MAX_LETTERS, 0, -1) if rest[:size] in self.letters), "")
            if group:
                rows.append(self.letters[group])
            rest = rest[len(group) or 1 :]
        return np.stack(rows) if rows else self.weights(self.names[0])[None]

    def _find_named(self, name: str) -> Floats | None:
        """Return the weights of a viseme or a phoneme of ARPAbet, or None."""
        name = self.aliases.get(name, name)
        if name in self.names:
            only: Floats = np.eye(len(self.names))[self.names.index(name)]
            return only
        return self.phonemes.get(name.upper().rstrip("012"))

    def _find_among_ipa(self, name: str, plain: Floats | None, guess: bool) -> Floats | None:
        """Return the weights of a sound in a list of IPA symbols; plain names of ARPAbet, as "DH", are kept.

        plain : the weights of ``name`` as a viseme or phoneme, or None.
        """
        is_arpabet = plain is not None and name.isascii() and (len(name) > 1 or name.isupper())
        if is_arpabet:
            return plain
        symbol = self._find_symbol(name)
        if symbol is None and guess:
            symbol = self._find_symbol(name.lower())
        return plain if symbol is None else symbol

    def _find_symbol(self, name: str) -> Floats | None:
        """Return the weights of a symbol of the IPA, by its longest prefix in the table, or None."""
        bare = _strip_marks(name)
        sizes = range(len(bare), 0, -1)
        return next((self.ipa[bare[:size]] for size in sizes if bare[:size] in self.ipa), None)


def _strip_marks(symbol: str) -> str:
    """Remove the marks of stress, length, tone and articulation from a symbol of the IPA."""
    whole = unicodedata.normalize("NFD", symbol.strip())
    return "".join(sign for sign in whole if unicodedata.category(sign) not in ("Mn", "Lm", "Sk", "Po") or sign == "_")


def _faults(parameters: Parameters, file: _File) -> list[str]:
    """Return the faults of a file: unknown parameters and visemes, and groups of letters that are too long."""
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
        f"letters.{name}: {letters!r} has more than {_MAX_LETTERS} letters"
        for name, each in file.letters.items()
        for letters in each.split()
        if len(letters) > _MAX_LETTERS
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
        _weights_of_words(file.ipa, given),
        {int(number): _weights({name: 1.0}, given) for number, name in file.sapi.items()},
        _weights_of_words(file.letters, given),
    )


def _weights_of_words(table: Mapping[str, str], names: Iterable[str]) -> dict[str, Floats]:
    """Return the weights of every word in a table that lists words, separated by spaces, by viseme."""
    return {word: _weights({name: 1.0}, names) for name, words in table.items() for word in words.split()}


def _weights(mix: Mapping[str, float], names: Iterable[str]) -> Floats:
    return np.array([mix.get(name, 0.0) for name in names])
