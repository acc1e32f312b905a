"""Moods as points: valence, arousal and dominance to a blend of named expressions, and back.

The blend is Shepard's (1968): weights fall with the distance to each anchor, and an anchor is met exactly. Neutral
is an anchor at the origin.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.parameters import Floats, did_you_mean, file_error, read_toml
from controller.base.paths import config_dir
from controller.vocabulary.expression import Expressions

_POWER = 3.0
_NEAR = 1e-6


class Affect:
    """The space of moods of one file.

    Parameters
    ----------
    names : expressions at the anchors, ``neutral`` first. points : (n, 3) their valence, arousal and dominance.
    faces : (n, P) their parameters.
    """

    def __init__(self, names: tuple[str, ...], points: Floats, faces: Floats) -> None:
        self.names = names
        self.points = points
        self._faces = faces

    @classmethod
    def load(cls, expressions: Expressions, path: Path | None = None) -> Affect:
        """Read a space of moods; the shipped one without ``path``.

        Raises
        ------
        ConfigError : the file cannot be read or is wrong; every fault with its key.
        """
        path = path or config_dir() / "vocabularies" / "affect.toml"
        table = read_toml(path)
        faults = [f"{key}: unknown key" for key in table if key != "anchors"]
        points = {"neutral": (0.0, 0.0, 0.0)}
        for name, given in table.get("anchors", {}).items():
            at: Any = given.get("at") if isinstance(given, dict) else None
            if name not in expressions.names:
                faults.append(f"anchors.{name}: unknown expression{did_you_mean(name, expressions.names)}")
            if not _is_point(at):
                faults.append(f"anchors.{name}.at: must be [valence, arousal, dominance], each -1 to 1 (is {at!r})")
            else:
                points[name] = tuple(at)
        if len(points) < 2 and not faults:
            faults.append("anchors: missing")
        if faults:
            raise file_error(path, faults)
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


def _is_point(at: object) -> bool:
    return (
        isinstance(at, list)
        and len(at) == 3
        and all(isinstance(v, int | float) and math.isfinite(v) and abs(v) <= 1 for v in at)
    )
