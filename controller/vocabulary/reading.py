"""Reads a face in other vocabularies: action units, emotions, visemes, moods."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.vocabulary.affect import Affect
from controller.vocabulary.facs import Facs
from controller.vocabulary.visemes import Visemes
from controller.vocabulary.vocabulary import Vocabulary

_SHOWN = 0.05
_RIDGE, _SPARSITY = 1e-4, 2e-3


class Readings:
    """Says what a face shows in named expressions; can be called from any thread."""

    def __init__(self, parameters: Parameters, expressions: Vocabulary) -> None:
        self._parameters, self._expressions = parameters, expressions
        self._lock = threading.Lock()

    def read(self, what: str, values: Floats) -> list[tuple[str, float]]:
        """Names and values 0..1 (moods -1..1) of what the face ``values`` : (P,) shows.

        ``what`` : ``UNITS``, ``EMOTION``, ``VISEMES`` or ``MOOD``.

        Raises KeyError: another word. ConfigError: a vocabulary's file is wrong.
        """
        with self._lock:
            match what:
                case "UNITS":
                    return _shown(self._facs.names, self._facs.read(values))
                case "EMOTION":
                    return [self._facs.read_emotion(values)]
                case "VISEMES":
                    visemes, solver = self._visemes
                    return _shown(visemes.names, solver.solve(values * visemes.mask)[: len(visemes.names)])
                case "MOOD":
                    affect, solver = self._affect
                    levels = dict(zip(affect.names[1:], solver.solve(values).tolist(), strict=True))
                    return list(zip(("valence", "arousal", "dominance"), affect.read(levels).tolist(), strict=True))
            raise KeyError(what)

    @cached_property
    def _facs(self) -> Facs:
        return Facs.load(self._parameters)

    @cached_property
    def _visemes(self) -> tuple[Visemes, _Levels]:
        """The visemes, and a solver for them and for each mouth shape that an expression may add during speech.

        Without the latter a smile would be read as the viseme that smiles most.
        """
        visemes = Visemes.load(self._parameters)
        lent = np.flatnonzero(visemes.mask & (visemes.through > 0.0))
        return visemes, _Levels(np.concatenate([visemes.matrix, np.eye(len(visemes.mask))[:, lent]], axis=1))

    @cached_property
    def _affect(self) -> tuple[Affect, _Levels]:
        affect = Affect.load(self._expressions)
        faces = np.stack([self._expressions[name].weights for name in affect.names[1:]], axis=1)
        return affect, _Levels(faces)


def _shown(names: Sequence[str], levels: Floats) -> list[tuple[str, float]]:
    return [(name, level) for name, level in zip(names, levels.tolist(), strict=True) if level >= _SHOWN]


class _Levels:
    """Levels 0..1 of the columns of a matrix (P, n), few of them not zero.

    Columns are normalised to one length first: otherwise two long ones would be preferred to the short one that fits.
    """

    def __init__(self, matrix: Floats) -> None:
        self._size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-9)
        self._solver = BoundedSolver(
            matrix / self._size, 0.0 * self._size, self._size, ridge=_RIDGE, sparsity=_SPARSITY, tolerance=1e-5
        )

    def solve(self, values: Floats) -> Floats:
        """(n,) levels that give ``values`` : (P,) best."""
        levels: Floats = self._solver.solve(values) / self._size
        return levels
