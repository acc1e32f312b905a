"""Colours a head by the distance of its surface from the mesh that it was fitted to, and restores its colours.

This module does not depend on any window library.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Array, Floats
from surface.base.error_colours import error_colours
from surface.head import Head
from surface.head.model.face import face_of
from surface.head.posing.fit_error import ATTRIBUTE
from surface.head.posing.part import HeadPart
from surface.view.scene.theme import Theme, find_theme

NOT_MEASURED = np.array([0.30, 0.30, 0.30])
"""Linear RGB of skin that was not measured."""
_TINTS = ("lips", "freckles")  # attributes that would tint the colours


@dataclass(frozen=True)
class FitFigures:
    """Distances (mm) of the vertices of a part at rest from the mesh that it was fitted to.

    rms : root mean square. p99 : 99th percentile. most : maximum.
    """

    part: str
    rms: float
    p99: float
    most: float

    def __str__(self) -> str:
        return f"{self.part}: RMS {self.rms:.2f} mm, 99 % within {self.p99:.2f} mm, most {self.most:.2f} mm"


def figures_of(head: Head) -> FitFigures | None:
    """Return the distances of the face, or, if the face was not measured, of other skin; None without measured skin."""
    part = face_of([each for each in head.parts if np.isfinite(_mm(each)).any()], head.data.contacts)
    if part is None:
        return None
    mm = _mm(part)
    mm = mm[np.isfinite(mm)]
    return FitFigures(part.name, float(np.sqrt(np.mean(mm**2))), float(np.percentile(mm, 99.0)), float(mm.max()))


def unmeasured(head: Head) -> bool:
    """Whether some of the skin was not measured."""
    return any(not np.isfinite(_mm(part)).all() for part in head.parts if part.material == "skin")


def plain_theme(theme: Theme) -> Theme:
    """Return a theme that shows the distance colours unchanged, on the background of ``theme``."""
    skin = find_theme("skin")
    even = (skin.wrap[0],) * 3
    return replace(
        skin, wrap=even, gloss=0.2, detail=0.0, through=(0.0, 0.0, 0.0),
        background_top=theme.background_top, background_bottom=theme.background_bottom,
    )  # fmt: skip


class FitColours:
    """The distance colours of one head."""

    def __init__(self) -> None:
        self._own: list[tuple[HeadPart, dict[str, Array]]] = []

    def paint(self, head: Head) -> bool:
        """Colour the skin of a head, which must be loaded into a renderer afterwards; return False if not measured."""
        self.clear()
        if figures_of(head) is None:
            return False
        for part in head.parts:
            if part.material == "skin":
                self._own.append((part, part.attributes))
                plain = {name: np.zeros_like(part.attributes[name]) for name in _TINTS if name in part.attributes}
                part.attributes = {**part.attributes, **plain, "albedo": _colours(_mm(part))}
        return True

    def clear(self) -> None:
        """Restore the original colours."""
        for part, attributes in self._own:
            part.attributes = attributes
        self._own = []


def _mm(part: HeadPart) -> Floats:
    """Return the distances (m,) mm; NaN where a vertex was not measured."""
    mm: Floats = np.asarray(part.attributes.get(ATTRIBUTE, np.full(len(part.vertices), np.nan)), np.float64)
    return mm


def _colours(mm: Floats) -> Array:
    """Return the colours (m, 3) float32, linear RGB, of distances (m,) mm."""
    colours = error_colours(np.nan_to_num(mm))
    colours[np.isnan(mm)] = NOT_MEASURED
    return colours.astype(np.float32)
