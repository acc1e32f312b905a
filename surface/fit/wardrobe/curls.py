"""Tightly curled hair: cropped close, or round and full."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import Thickness
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.styles import BARE, Style, cap, step

_CURL = 1.0 / 30.0  # tiles of the noise for a mm: curls of a few mm
_STEADY = 0.2  # of the shader strand.frag, which stretches the noise along strands by its reciprocal


def crop(skin: Skin) -> Style:
    """A few millimetres of curls all over."""
    line = Hairline(skin)

    def thickness(at: Floats) -> Floats:
        return np.asarray(0.6 + (3.2 + 2.4 * step(at[:, 1], 60.0, 125.0)) * step(line.inside(at), -3.0, 22.0))

    return Style(_shells(skin, line, thickness, ((1.0, 0.52), (0.72, 0.80), (0.45, 1.4)), 1.5), line)


def afro(skin: Skin) -> Style:
    """A round cloud of curls."""
    line = Hairline(skin)

    def thickness(at: Floats) -> Floats:
        full = 27.0 - 3.0 * step(at[:, 1], 60.0, 130.0)
        return np.asarray(1.0 + full * step(line.inside(at), -6.0, 46.0))

    return Style(_shells(skin, line, thickness, ((1.0, 0.42), (0.94, 0.60), (0.86, 1.4)), 0.5), line)


def _shells(
    skin: Skin, line: Hairline, thickness: Thickness, layers: tuple[tuple[float, float], ...], short_mm: float
) -> list[Patches]:
    """Closed patches one over the other, the outermost first, each with a share of the thickness and its cover."""
    out = []
    for k, (share, cover) in enumerate(layers):
        own = cap(skin, line, thickness, share=share, short_mm=short_mm, openness=1.0 - 0.22 * k)
        strands = own.strands.copy()
        u, v = strands[..., 0] / strands[..., 0].max(), np.linspace(0.0, 1.0, strands.shape[2])[None, None]
        around = 520.0 * np.sin(np.minimum(1.75 * v, 0.5 * np.pi))  # mm round the head there
        strands[..., 0] = np.rint(520.0 * _CURL) * u + 0.37 * k + 0.0 * around
        strands[..., 1] = 150.0 * v * _CURL / _STEADY + 0.21 * k
        strands[..., 2] = cover - (cover + BARE) * step(v, 0.91, 1.0)
        out.append(Patches(own.points, own.degrees, own.grid, own.fast, strands, own.tint, own.shade, own.sway))
    return out
