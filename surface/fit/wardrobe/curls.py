"""Tightly curled hair: cropped close, or round and full."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import Thickness
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.styles import Style, cap, step, thinned

_CURL = 1.0 / 30.0  # tiles of the noise for a mm: curls of a few mm
_FLAT_MM = 6.0  # inside the line, over which curls lie on the skin and begin to cover it
_ROUND_MM = 40.0  # further inside, over which a cloud of curls grows round
_FADE_MM = -4.0, 20.0  # black hair darkens skin at once: a line that is soft to the eye is wide
_UNEVEN, _SHADED = 0.05, 0.10  # of the width over which curls run out, and of their brightness, by which they differ
_STEADY = 0.2  # of the shader strand.frag, which stretches the noise along strands by its reciprocal


def crop(skin: Skin) -> Style:
    """A few millimetres of curls all over."""
    line = Hairline(skin)

    def thickness(at: Floats) -> Floats:
        return np.asarray(0.6 + (3.2 + 2.4 * step(at[:, 1], 60.0, 125.0)) * step(line.inside(at), -3.0, 22.0))

    layers = (1.0, 0.52), (0.72, 0.80), (0.45, 1.4)
    return Style(_shells(skin, line, thickness, layers, short_mm=0.5, edge_mm=17.0, dense=0.3), line, fade=_FADE_MM)


def afro(skin: Skin) -> Style:
    """A round cloud of curls."""
    line = Hairline(skin)

    def thickness(at: Floats) -> Floats:
        full = 8.0 + 15.0 * step(at[:, 1], 15.0, 95.0)  # close round the ears and at the nape
        within = np.clip((line.inside(at) - _FLAT_MM) / _ROUND_MM, 0.0, 1.0)
        return np.asarray(0.8 + full * within * (2.0 - within))  # rises at once, at half a right angle: no brim

    layers = (1.0, 0.42), (0.92, 0.72), (0.66, 1.4)
    return Style(_shells(skin, line, thickness, layers, short_mm=0.5, edge_mm=13.0, dense=0.45), line, fade=_FADE_MM)


def _shells(
    skin: Skin, line: Hairline, thickness: Thickness, layers: tuple[tuple[float, float], ...], *, short_mm: float,
    edge_mm: float, dense: float = 0.0,
) -> list[Patches]:  # fmt: skip
    """Closed patches one over the other, the outermost first, each with a share of the thickness and its cover, which
    fades over the last ``edge_mm`` before the line: what fades where it stands off the skin is seen through."""
    out, random = [], np.random.default_rng(71)
    for k, (share, cover) in enumerate(layers):
        own = cap(skin, line, thickness, share=share, short_mm=short_mm, openness=1.0 - 0.22 * k, dense=dense)
        strands = own.strands.copy()
        u, v = strands[..., 0] / strands[..., 0].max(), np.linspace(0.0, 1.0, strands.shape[2])[None, None]
        around = 520.0 * np.sin(np.minimum(1.75 * v, 0.5 * np.pi))  # mm round the head there
        strands[..., 0] = np.rint(520.0 * _CURL) * u + 0.37 * k + 0.0 * around
        strands[..., 1] = 150.0 * v * _CURL / _STEADY + 0.21 * k
        places = surface_at(own.points[0], own.degrees, [np.linspace(0.0, 1.0, n) for n in own.grid])
        wanders = _UNEVEN * np.abs(random.standard_normal((len(places), 1)))
        wanders[-1] = wanders[0]
        inside = line.inside(places.reshape(-1, 3)).reshape(own.grid) / edge_mm
        inside = inside - wanders * (inside < 1.5)
        inside[:, -1] = -1.0
        strands[..., 2] = thinned(np.full_like(inside, cover), inside)
        shade = own.shade * (1.0 + _SHADED * random.standard_normal(own.shade.shape).clip(-2.0, 2.0))
        shade[:, -1] = shade[:, 0]
        out.append(Patches(own.points, own.degrees, own.grid, own.fast, strands, own.tint, shade, own.sway))
    return out
