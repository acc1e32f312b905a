"""Describes a face in other vocabularies: as action units, an emotion, visemes or a mood."""

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

_MIN_LEVEL = 0.05
_RIDGE, _SPARSITY = 1e-4, 2e-3


class Readings:
    """Finds the action units, emotions, visemes and moods that a face shows; any thread may call it."""

    def __init__(self, parameters: Parameters, expressions: Vocabulary) -> None:
        self._parameters, self._expressions = parameters, expressions
        self._lock = threading.Lock()

    def read(self, what: str, values: Floats) -> list[tuple[str, float]]:
        """Return names and values 0..1 (of moods, -1..1) of what the face ``values`` : (P,) shows.

        ``what`` : ``UNITS``, ``EMOTION``, ``VISEMES`` or ``MOOD``.

        Raises KeyError: another word. ConfigError: a vocabulary's file is wrong.
        """
        with self._lock:
            match what:
                case "UNITS":
                    return _visible(self._facs.names, self._facs.read(values))
                case "EMOTION":
                    return [self._facs.read_emotion(values)]
                case "VISEMES":
                    visemes, solver = self._visemes
                    return _visible(visemes.names, solver.solve(values * visemes.mask)[: len(visemes.names)])
                case "MOOD":
                    affect, solver = self._affect
                    levels = dict(zip(affect.names[1:], solver.solve(values).tolist(), strict=True))
                    return list(zip(("valence", "arousal", "dominance"), affect.read(levels).tolist(), strict=True))
            raise KeyError(what)

    @cached_property
    def _facs(self) -> Facs:
        return Facs.load(self._parameters)

    @cached_property
    def _visemes(self) -> tuple[Visemes, _LevelSolver]:
        """The visemes, and a solver for them and for each mouth parameter that an expression may move during speech.

        Without these parameters, a smile would be read as the viseme that is most similar to a smile.
        """
        visemes = Visemes.load(self._parameters)
        shared = np.flatnonzero(visemes.mask & (visemes.through > 0.0))
        return visemes, _LevelSolver(np.concatenate([visemes.matrix, np.eye(len(visemes.mask))[:, shared]], axis=1))

    @cached_property
    def _affect(self) -> tuple[Affect, _LevelSolver]:
        affect = Affect.load(self._expressions)
        faces = np.stack([self._expressions[name].weights for name in affect.names[1:]], axis=1)
        return affect, _LevelSolver(faces)


def _visible(names: Sequence[str], levels: Floats) -> list[tuple[str, float]]:
    return [(name, level) for name, level in zip(names, levels.tolist(), strict=True) if level >= _MIN_LEVEL]


class _LevelSolver:
    """Finds sparse levels 0..1 of the columns of a matrix (P, n).

    Columns are normalised to one length first; otherwise two long ones would be preferred to a short one that fits.
    """

    def __init__(self, matrix: Floats) -> None:
        self._size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-9)
        self._solver = BoundedSolver(
            matrix / self._size, 0.0 * self._size, self._size, ridge=_RIDGE, sparsity=_SPARSITY, tolerance=1e-5
        )

    def solve(self, values: Floats) -> Floats:
        """Return (n,) levels that reproduce ``values`` : (P,) best."""
        levels: Floats = self._solver.solve(values) / self._size
        return levels
