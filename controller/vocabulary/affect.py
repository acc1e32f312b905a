"""Converts moods, points of valence, arousal and dominance, to blends of named expressions, and back.

The blend is Shepard's (1968): weights fall with the distance to each anchor, and an anchor is met exactly. Neutral
is an anchor at the origin.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.parameters import Floats, did_you_mean
from controller.base.paths import config_dir
from controller.vocabulary.expression import Expressions

_POWER = 3.0
_NEAR = 1e-6
_Signed = Annotated[Number, Field(ge=-1, le=1)]


class _Anchor(Settings):
    at: tuple[_Signed, _Signed, _Signed]
    source: str = ""


class _File(Settings):
    anchors: Annotated[dict[str, _Anchor], Field(min_length=1)]


class Affect:
    """The space of moods of one file.

    names : expressions at the anchors, ``neutral`` first. points : (n, 3) their valence, arousal and dominance.
    faces : (n, P) their parameters.
    """

    def __init__(self, names: tuple[str, ...], points: Floats, faces: Floats) -> None:
        self.names = names
        self.points = points
        self._faces = faces

    @classmethod
    def load(cls, expressions: Expressions, path: Path | None = None) -> Affect:
        """Read a space of moods; the shipped one without ``path``. Raises ConfigError with every fault."""

        def faults(file: _File) -> list[str]:
            return [f"anchors.{name}: unknown expression{did_you_mean(name, expressions.names)}"
                    for name in file.anchors if name not in expressions.names]  # fmt: skip

        anchors = load(path or config_dir() / "vocabularies" / "affect.toml", _File, faults).anchors
        points = {"neutral": (0.0, 0.0, 0.0)} | {name: anchor.at for name, anchor in anchors.items()}
        faces = np.stack([expressions[name].weights for name in points])
        return cls(tuple(points), np.array(list(points.values())), faces)

    def weights(self, valence: float, arousal: float, dominance: float | None = None) -> Floats:
        """(n,) weights of the anchors, summing to 1; without ``dominance`` only valence and arousal count."""
        point = np.array([valence, arousal] if dominance is None else [valence, arousal, dominance])
        distance = np.linalg.norm(self.points[:, : len(point)] - point, axis=1)
        nearest = int(np.argmin(distance))
        if distance[nearest] < _NEAR:
            only: Floats = np.eye(len(distance))[nearest]
            return only
        weights: Floats = distance**-_POWER
        weights /= weights.sum()
        return weights

    def expand(self, valence: float, arousal: float, dominance: float | None = None) -> Floats:
        """(P,) parameters of a mood."""
        return self.weights(valence, arousal, dominance) @ self._faces

    def read(self, levels: dict[str, float]) -> Floats:
        """(3,) valence, arousal and dominance of a face that shows expressions at intensities 0..1."""
        shown = np.array([max(levels.get(name, 0.0), 0.0) for name in self.names])
        total = max(shown.sum(), 1.0)
        read: Floats = shown @ self.points / total
        return read
