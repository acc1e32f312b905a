"""Converts moods (points of valence, arousal and dominance) to blends of named expressions, and back.

The blend is inverse distance weighting (Shepard 1968) of the expressions at the anchors, and exact at an anchor. The
neutral face is an anchor at the origin.
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
"""Exponent of the inverse distance."""
_SAME_POINT = 1e-6
"""Distance below which a mood is the nearest anchor itself."""
_Signed = Annotated[Number, Field(ge=-1, le=1)]


class _Anchor(Settings):
    at: tuple[_Signed, _Signed, _Signed]
    source: str = ""


class _File(Settings):
    anchors: Annotated[dict[str, _Anchor], Field(min_length=1)]


class Affect:
    """The space of moods of one file.

    names : of the n expressions at the anchors, ``neutral`` first. points : (n, 3) their valence, arousal and
    dominance. faces : (n, P) their parameter values.
    """

    def __init__(self, names: tuple[str, ...], points: Floats, faces: Floats) -> None:
        self.names = names
        self.points = points
        self._faces = faces

    @classmethod
    def load(cls, expressions: Expressions, path: Path | None = None) -> Affect:
        """Read a space of moods; by default, the shipped one. Raises ConfigError that lists every fault."""

        def faults(file: _File) -> list[str]:
            return [f"anchors.{name}: unknown expression{did_you_mean(name, expressions.names)}"
                    for name in file.anchors if name not in expressions.names]  # fmt: skip

        anchors = load(path or config_dir() / "vocabularies" / "affect.toml", _File, faults).anchors
        points = {"neutral": (0.0, 0.0, 0.0)} | {name: anchor.at for name, anchor in anchors.items()}
        faces = np.stack([expressions[name].weights for name in points])
        return cls(tuple(points), np.array(list(points.values())), faces)

    def weights(self, valence: float, arousal: float, dominance: float | None = None) -> Floats:
        """Return (n,) weights of the anchors with the sum 1; if ``dominance`` is None, distances ignore it."""
        point = np.array([valence, arousal] if dominance is None else [valence, arousal, dominance])
        distance = np.linalg.norm(self.points[:, : len(point)] - point, axis=1)
        nearest = int(np.argmin(distance))
        if distance[nearest] < _SAME_POINT:
            only: Floats = np.eye(len(distance))[nearest]
            return only
        weights: Floats = distance**-_POWER
        weights /= weights.sum()
        return weights

    def expand(self, valence: float, arousal: float, dominance: float | None = None) -> Floats:
        """Return (P,) parameter values of a mood."""
        return self.weights(valence, arousal, dominance) @ self._faces

    def read(self, levels: dict[str, float]) -> Floats:
        """Return (3,) valence, arousal and dominance of a face that shows expressions at intensities 0..1."""
        shown = np.array([max(levels.get(name, 0.0), 0.0) for name in self.names])
        total = max(shown.sum(), 1.0)
        read: Floats = shown @ self.points / total
        return read
