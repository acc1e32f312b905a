"""A head of smooth forms given by formulas: what garments are made for whose figures are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.skin import Skin

#: By height, mm: half width, half depth and how far forward the middle lies. Trunk, neck, jaw, skull, crown.
SECTIONS = np.array([
    (-330, 185, 95, -10), (-200, 185, 95, -18), (-150, 140, 72, -26), (-115, 66, 56, -18), (-85, 58, 58, -12),
    (-60, 62, 74, 4), (-20, 72, 88, 6), (40, 78, 92, 0), (90, 68, 84, -4), (120, 48, 60, -6), (137, 20, 25, -6),
    (142, 1, 1, -6),
], float)  # fmt: skip


class Form:
    """Half of the head: (u, v) from one side to the other and from below upwards."""

    def __init__(self, first: float) -> None:
        self._first = first

    def places(self, uv: Floats) -> Floats:
        angle, y = self._first + np.pi * uv[:, 0], SECTIONS[0, 0] + uv[:, 1] * np.ptp(SECTIONS[:, 0])
        wide, deep, ahead = (np.interp(y, SECTIONS[:, 0], SECTIONS[:, k]) for k in (1, 2, 3))
        # noses and ears stand out
        wide = wide + 8.0 * np.exp(-(((y - 14.0) / 24.0) ** 2) - (np.cos(angle) / 0.3) ** 2)
        deep = deep + 18.0 * np.exp(-((y / 18.0) ** 2) - ((np.cos(angle) - 1.0) / 0.05) ** 2)
        return np.column_stack([wide * np.sin(angle), y, ahead + deep * np.cos(angle)])

    def derivatives(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Places and, by differences, how they move with u and v."""
        step = 1e-5
        along = [self.places(uv + d) - self.places(uv - d) for d in ([step, 0.0], [0.0, step])]
        return self.places(uv), along[0] / (2 * step), along[1] / (2 * step)


def half(
    first: float, rows: int, columns: int, above: float = 0.005, *, below: float = 0.995, flip: bool = False
) -> SimpleNamespace:
    """A part of the head between two heights, v; its samples lie unevenly, so that none is as near as another."""
    u, v = np.meshgrid(np.linspace(0.01, 0.99, rows), np.linspace(above, below, columns), indexing="ij")
    uv = np.column_stack([u.ravel(), v.ravel()])
    uv += np.random.default_rng(rows + columns).uniform(-0.004, 0.004, uv.shape)
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (k.ravel() for k in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    mesh = SimpleNamespace(uv=uv, triangles=triangles[:, ::-1] if flip else triangles, flip=flip)
    return SimpleNamespace(surface=Form(first), mesh=mesh)


def skin_of(face: SimpleNamespace, back: SimpleNamespace) -> Skin:
    """The skin of a head of two parts."""
    parts = {"face": face, "back": back}
    return Skin(SimpleNamespace(data=None, part=parts.__getitem__))  # type: ignore[arg-type]


def whole_skin() -> Skin:
    """The skin from the trunk to the crown."""
    return skin_of(half(-0.5 * np.pi, 50, 56), half(0.5 * np.pi, 49, 55))


def lower_face() -> Skin:
    """The skin from the neck to the eyes, where beards grow, and little of the back."""
    return skin_of(half(-0.5 * np.pi, 34, 34, 0.46, below=0.78), half(0.5 * np.pi, 16, 16, 0.46, below=0.78))
