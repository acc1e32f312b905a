"""What hair styles are made of: an under-cap, locks as ribbons, where they root; and the short style."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.hairline import Hairline, directions
from surface.fit.wardrobe.locks import Locks, Thickness, grow, ribbons, spread
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.skin import CENTRE, Skin, unit

ACROSS = 1.0 / 64.0  # tiles of the noise for a mm across strands, and along them
ALONG = 1.0 / 900.0
_BELOW = 0.82  # openness at the roots


@dataclass(frozen=True)
class Style:
    """A style: its patches, for :func:`surface.fit.wardrobe.patches.arrays`, and the line inside which it grows.

    hanging : patches that are seen from both sides.
    """

    patches: list[Patches]
    hairline: Hairline
    hanging: tuple[Patches, ...] = ()


def step(x: Floats, low: float, high: float) -> Floats:
    """Hermite step from 0 at ``low`` to 1 at ``high``."""
    t = np.clip((np.asarray(x, float) - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def tangent(wanted: Floats, normals: Floats) -> Floats:
    """Directions (n, 3) laid along a skin with normals (n, 3)."""
    return unit(wanted - (wanted * normals).sum(axis=1, keepdims=True) * normals)


def cap(
    skin: Skin, line: Hairline, thickness: Thickness, *, share: float = 0.93, short_mm: float = 3.0,
    openness: float = 0.52,
) -> Patches:  # fmt: skip
    """One closed patch over the whole scalp, at a share of the hair's thickness, under all locks; its edge thins out
    ``short_mm`` inside the line."""
    nu, nv, gu, gv = 32, 10, 49, 13
    points = _cap_points(skin, line, (nu, nv), thickness, share, short_mm)
    t = np.broadcast_to(np.linspace(0, 1, gv), (gu, gv))
    round_it = np.broadcast_to(np.linspace(0, 1, gu)[:, None], (gu, gv))
    cover = 2.2 - 2.0 * step(t, 0.90, 1.0)
    strands = np.stack([round_it * 560 * ACROSS, t * 160 * ALONG, cover, openness + 0.0 * t], axis=-1)
    return Patches(
        points[None], (3, 3), (gu, gv), (25, 7), strands[None], np.zeros((1, gu, gv)), np.full((1, gu, gv), 0.85),
        np.zeros((1, nu, nv)),
    )  # fmt: skip


def _cap_points(
    skin: Skin, line: Hairline, size: tuple[int, int], thickness: Thickness, share: float, short_mm: float
) -> Floats:
    """(nu, nv, 3): round the crown from behind, and from the crown to the line."""
    nu, nv = size
    round_it = np.linspace(np.pi, -np.pi, nu)
    out = np.empty((nu, nv, 3))
    for j, s in enumerate(np.linspace(0.0, 1.0, nv)):
        down = s * (line.down(round_it) - short_mm / 85.0)
        toward = directions(np.maximum(down, 1e-3), round_it)
        reach = skin.reach(toward)
        below = CENTRE + toward * reach[:, None]
        out[:, j] = CENTRE + toward * (reach + share * thickness(below))[:, None]
    return out


def lock_patches(
    locks: Locks, count: int, grid: tuple[int, int], fast: tuple[int, int], sway: Floats, *, seed: int = 3,
    tip_cover: float = 0.05, edge_cover: float = 0.45, bulge: float = 0.13, root: float = 0.8, tip: float = 0.25,
    follow: float = 0.0, below: float = _BELOW, fall_from: float = 0.30, root_fade: float = 0.5,
) -> Patches:  # fmt: skip
    """Ribbons along locks, in the order of their ``layers`` and roots from above: each lies over the roots of the next,
    so that the depth test spares what is hidden.

    sway : (n,) of the tips. tip_cover, edge_cover : how much of a ribbon's tip and sides is left; fall_from : the
    share of the length from which it thins out; root_fade : how much less of its root is left.
    """
    order = np.argsort(np.rint(-2.0 * locks.layers) * 25.0 - locks.paths[:, 0, 1], kind="stable")
    locks = Locks(*(getattr(locks, k)[order] for k in ("paths", "normals", "widths", "shades", "layers")))
    points, random = ribbons(locks, count, bulge=bulge, root=root, tip=tip), np.random.default_rng(seed)
    n, (gu, gv) = len(locks.paths), grid
    length = np.linalg.norm(np.diff(locks.paths, axis=1), axis=2).sum(axis=1)[:, None, None]
    s, t = (x[None] for x in np.meshgrid(np.linspace(-1, 1, gu), np.linspace(0, 1, gv), indexing="ij"))
    start = random.uniform(0.0, 1.0, (n, 2))[:, :, None, None]
    across = start[:, 0] + 0.5 * (s + 1.0) * locks.widths[:, None, None] * ACROSS * (1.0 - 0.35 * t)
    roots = root_fade * (1.0 - step(t, 0.0, max(0.12 * root_fade, 0.01)))
    ends = 1.2 - (1.2 - tip_cover) * step(t, fall_from, 1.0) - roots
    cover = ends - (1.0 - edge_cover) * s * s * (0.6 + 0.4 * t)
    layer = locks.layers[:, None, None]
    openness = (below + (1.0 - below) * step(t, 0.0, 0.45)) * (0.68 + 0.32 * layer) * (1.0 - 0.12 * s * s)
    whole = np.zeros((n, gu, gv))
    strands = np.stack([across + whole, start[:, 1] + t * length * ALONG, cover + whole, openness + whole], axis=-1)
    shade = locks.shades[:, None, None] + whole
    swaying = sway[order][:, None, None] * (np.linspace(0, 1, count) ** 1.5)[None, None, :] + np.zeros((n, 3, 1))
    degrees = 2, 3 if count > 3 else 2
    return Patches(points, degrees, grid, fast, strands, t**1.5 + whole, shade, swaying, follow)


def roots_inside(skin: Skin, line: Hairline, least_mm: float = 0.0) -> Floats:
    """Samples (n, 3) of the skin inside the line."""
    places = skin.points[skin.bare]
    return np.asarray(places[(line.inside(places) > least_mm) & (places[:, 1] > -70.0)])


def shades(count: int, seed: int) -> Floats:
    """Brightness of locks, each a little different."""
    return np.asarray(1.0 + 0.10 * np.random.default_rng(seed).standard_normal(count).clip(-2, 2))


def short(skin: Skin) -> Style:
    """Short at the sides and behind, longer on top and combed forwards to the side."""
    line = Hairline(skin)
    among = roots_inside(skin, line, 0.5)
    among = among[line.inside(among) > 11.0 * step(-among[:, 1], 5.0, 40.0)]  # shaved towards the nape
    inside = line.inside(among)
    roots = among[spread(skin, among, np.where(inside < 8.0, 8.0, 10.5 + 2.0 * _top(among)), 5)]
    top, inside = _top(roots), line.inside(roots)
    low = step(-roots[:, 1], -40.0, 50.0)  # towards the nape
    nape = low * step(-inside, -16.0, -4.0)
    random = np.random.default_rng(11)
    layer = random.uniform(0.0, 1.0, len(roots))
    length = (30.0 + 26.0 * top + 6.0 * top * step(roots[:, 2], 30.0, 75.0) - 8.0 * low) * (1.0 - 0.55 * nape)
    length = length * random.uniform(0.85, 1.2, len(roots))
    crown = np.array([12.0, 132.0, -42.0])

    def thickness(at: Floats) -> Floats:
        full = 3.0 + 10.0 * _top(at) + 2.5 * _top(at) * step(at[:, 2], 30.0, 75.0) - 1.6 * step(-at[:, 1], -40.0, 50.0)
        return np.asarray(1.6 + full * step(line.inside(at), -12.0, 30.0))

    def flow(at: Floats, normals: Floats, share: float) -> Floats:
        away = tangent(at - crown, normals)
        forwards = _top(at)[:, None]
        aside = tangent(np.tile([0.85, 0.0, 0.62], (len(at), 1)), normals)
        downwards = tangent(np.tile([0.0, -1.0, -0.22], (len(at), 1)), normals)
        sides = (1.0 - forwards) * 0.75
        return tangent(away * (0.55 + 0.2 * forwards) + forwards * 0.9 * aside + sides * downwards, normals)

    paths, normals = grow(
        skin, roots, length, thickness, flow, lift=1.0 + 0.22 * layer, below=0.86, stiff=0.55, slack=0.5, settle=0.3
    )
    width = (10.5 + 3.5 * top - 1.5 * low) * random.uniform(0.75, 1.25, len(roots))
    locks = Locks(paths, normals, width, shades(len(roots), 2), layer)
    return Style([lock_patches(locks, 5, (3, 5), (2, 4), 0.10 * top, bulge=0.08), cap(skin, line, thickness)], line)


def _top(at: Floats) -> Floats:
    """(n,) 1 on top of the head, 0 at its sides."""
    return step(at[:, 1] + 0.25 * at[:, 2], 78.0, 118.0)
