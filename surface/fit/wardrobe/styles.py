"""What hair styles are made of, beside sheets: an under-cap, and the line inside which hair grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import Thickness
from surface.fit.wardrobe.hairline import Hairline, directions
from surface.fit.wardrobe.patches import BARE, Patches
from surface.fit.wardrobe.skin import CENTRE, Skin, unit

ACROSS = 1.0 / 46.0  # tiles of the noise for a mm across strands, and along them
ALONG = 1.0 / 900.0
_CAP = 2.2  # cover of an under-cap


@dataclass(frozen=True)
class Style:
    """A style: its patches, for :func:`surface.fit.wardrobe.patches.arrays`, and the line inside which it grows.

    hanging : patches that are seen from both sides. strays : fins of stray hairs, seen from both sides, too. fade : mm
    inside the line, from where the skin begins to have the colour of hair to where it has it.
    """

    patches: list[Patches]
    hairline: Hairline
    hanging: tuple[Patches, ...] = ()
    fade: tuple[float, float] = (-6.0, 8.0)
    strays: tuple[Patches, ...] = ()


def step(x: Floats, low: float, high: float) -> Floats:
    """Hermite step from 0 at ``low`` to 1 at ``high``."""
    t = np.clip((np.asarray(x, float) - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def thinned(cover: Floats, left: Floats) -> Floats:
    """Cover of hair, less where it ends: ``left`` is the share of the way from where nothing grows to where all does.

    As strands' heights lie between 0 and 1, the eye sees cover between these alone: that of a closed sheet, which is
    far above 1, would fall through them all at once, in a line.
    """
    most = np.where(left < 0.0, left, left + (left >= 1.0) * 1e3)
    return np.asarray(np.maximum(np.minimum(cover, most), -BARE))


def denser(t: Floats, dense: float) -> Floats:
    """Shares of a way, 0..1, at t, 0..1: by ``dense`` closer together at the end, or where it is negative at the
    beginning."""
    return np.asarray(t + dense * t * (1.0 - t))


def tangent(wanted: Floats, normals: Floats) -> Floats:
    """Directions (n, 3) laid along a skin with normals (n, 3)."""
    return unit(wanted - (wanted * normals).sum(axis=1, keepdims=True) * normals)


def cap(
    skin: Skin, line: Hairline, thickness: Thickness, *, share: float = 0.93, short_mm: float = 3.0,
    openness: float = 0.52, dense: float = 0.0,
) -> Patches:  # fmt: skip
    """One closed patch over the whole scalp, at a share of the hair's thickness, under all sheets; its edge thins out
    ``short_mm`` inside the line, towards which rows lie closer together by ``dense``."""
    rows = 1.0 + dense  # where they lie closer together they are as far apart as before elsewhere
    nu, nv, gu, gv = 32, round(10 * rows), 49, round(13 * rows)
    points = _cap_points(skin, line, (nu, nv), thickness, share, short_mm, dense)
    t = np.broadcast_to(np.linspace(0, 1, gv), (gu, gv))
    round_it = np.broadcast_to(np.linspace(0, 1, gu)[:, None], (gu, gv))
    cover = _CAP - (_CAP + BARE) * step(t, 0.88, 1.0)
    strands = np.stack([round_it * 560 * ACROSS, t * 160 * ALONG, cover, openness + 0.0 * t], axis=-1)
    return Patches(
        points[None], (3, 3), (gu, gv), (25, round(7 * rows)), strands[None], np.zeros((1, gu, gv)),
        np.full((1, gu, gv), 0.85), np.zeros((1, nu, nv)),
    )  # fmt: skip


def _cap_points(
    skin: Skin, line: Hairline, size: tuple[int, int], thickness: Thickness, share: float, short_mm: float, dense: float
) -> Floats:
    """(nu, nv, 3): round the crown from behind, and from the crown to the line."""
    nu, nv = size
    round_it = np.linspace(np.pi, -np.pi, nu)
    out = np.empty((nu, nv, 3))
    for j, s in enumerate(denser(np.linspace(0.0, 1.0, nv), dense)):
        down = s * (line.down(round_it) - short_mm / 85.0)
        toward = directions(np.maximum(down, 1e-3), round_it)
        reach = skin.reach(toward)
        below = CENTRE + toward * reach[:, None]
        out[:, j] = CENTRE + toward * (reach + share * thickness(below))[:, None]
    pole = unit(out[:, 0].mean(axis=0) - CENTRE)
    out[:, 1] += ((out[0, 0] - out[:-1, 1].mean(axis=0)) @ pole) * pole  # level with the crown, which is no peak then
    return out
