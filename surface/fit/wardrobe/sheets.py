"""Hair as sheets: smooth surfaces through guides, lines that strands follow from their roots to their tips.

Several sheets lie one over the other. The outer ones leave gaps between strands, in which the inner, darker ones show;
the innermost is closed. So the outline of the head is smooth and yet not cut with a knife, and strands are as long as
the hair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

from surface.base.arrays import Floats
from surface.fit.wardrobe.edges import Edges, frayed
from surface.fit.wardrobe.guides import Flow, Thickness, grow, resampled
from surface.fit.wardrobe.patches import BARE, Patches, greville, knots
from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.skin import Skin, unit
from surface.fit.wardrobe.styles import ACROSS, ALONG, denser, step, thinned

_CLUMPS_MM = 13.0  # how wide clumps of locks are, which are brighter or darker and end sooner or later than others
_CLUMPED = 0.4  # by how much the length differs, over which strands of clumps end one after the other
_SHADED = 0.11, 0.07  # by how much the brightness of clumps and of locks differs
_ROOTED = 0.30, 0.45  # by how much less light reaches roots, and the share of the length until it reaches all
_CLOSER = 0.45  # how much less light reaches cropped hairs, which lie on the skin
_CROPPED = 20.0  # how many times shorter the pieces are that one sees of cropped hairs
_UNEVEN = 0.35  # by how much the length that is roots differs along a hairline: an even one looks cut as with a saw
_AT_EAR, _EAR_MM = 0.65, 30.0  # by how much narrower a soft edge is over the ears, and how far off them
_BACKED = 0.6  # how much less of the innermost sheet frays: skin between the strands of an edge is a dotted line
_LINE_WANDERS_MM = 0.9  # by which hair grows in sooner or later along a soft line: more are tufts
Drape = Callable[[Floats], Floats]
"""Guides (g, k, 3), hung."""
Depth = Callable[[Floats], Floats]
"""How much of a guide is left at places (n, 3), mm: hair is cut where this first falls to 0."""


@dataclass(frozen=True)
class Layer:
    """One sheet of hair.

    share : of the hair's thickness at which it lies. cover : how much of it strands fill, from 0 to 1 and more; below
    0.5 gaps are wider than strands. openness : how much light reaches it. fray_mm : of the length, along which strands
    end one after the other. roots : how much less of the sheet its roots are, which are so along ``roots_mm``.
    cropped_mm : of the length, along which what is seen are ends of hairs, each a few mm long. edge_mm : from where
    hair is cut, over which it grows denser, whichever way strands lie there.
    """

    share: float
    cover: float
    openness: float
    fray_mm: float = 15.0
    roots: float = 0.0
    roots_mm: float = 20.0
    cropped_mm: float = 0.0
    edge_mm: float = 0.0


@dataclass(frozen=True)
class Comb:
    """How hair is combed: where guides root (g, 3), in order, and the rest as in :func:`.guides.grow`.

    cut : where guides end. ragged_mm : by how much their lengths differ, of all or of each (g,). wave_mm : how far
    sheets bulge between locks. level : share of that which is gone at the tips. pole : do all
    guides begin at the middle of their roots? drape : what becomes of guides that hang. edge : mm inside the line at
    which hair begins, where that is not the one at which it is cut.
    """

    roots: Floats
    length: Floats
    thickness: Thickness
    flow: Flow
    cut: Depth
    ragged_mm: Floats | float = 6.0
    wave_mm: float = 0.8
    level: float = 0.0
    steps: int = 40
    stiff: float = 0.5
    slack: float | Thickness = 0.6
    ears: bool = False
    pole: bool = False
    drape: Drape | None = None
    edge: Depth | None = None


@dataclass(frozen=True)
class Weave:
    """How finely a sheet is made: control points and vertices along u and v, and vertices of "fast".

    dense : how much closer together they lie at strands' tips than elsewhere, or where it is negative at their roots.
    """

    points: tuple[int, int]
    grid: tuple[int, int]
    fast: tuple[int, int]
    dense: float = 0.0

    def length(self, v: Floats) -> Floats:
        """Share of strands' length that lies before v."""
        return denser(v, self.dense)


def sheets(
    skin: Skin, comb: Comb, layers: tuple[Layer, ...], weave: Weave, *, seed: int, closed: bool = False,
    sway: float = 0.0, edges: Edges = (None, None),
) -> list[Patches]:  # fmt: skip
    """Sheets along the guides of a comb, the outermost first.

    All of them bulge in the same places: the inner ones would come through the outer ones otherwise.

    closed : does the last guide meet the first? edges : over how many mm strands grow sparse at either edge.
    """
    out, bulges = [], _waves(len(comb.roots), np.random.default_rng(seed), closed)
    for k, layer in enumerate(layers):
        random = np.random.default_rng(seed + 7 * k + 1)
        paths = _guides(skin, comb, layer, comb.ragged_mm * _waves(len(bulges), random, closed), bulges)
        points = _control_points(paths, weave)
        backed = 1.0 - _BACKED * k / max(len(layers) - 1, 1)
        made = frayed(sheet(points, layer, weave, random, closed, sway), edges, backed, random)
        out.append(_thinned(made, comb.edge or comb.cut, layer.edge_mm, random) if layer.edge_mm > 0.0 else made)
    return out


def _thinned(made: Patches, inside: Depth, edge_mm: float, random: np.random.Generator) -> Patches:
    """A sheet whose cover falls to nothing over the last ``edge_mm`` before a line."""
    at = surface_at(made.points[0], made.degrees, [np.linspace(0.0, 1.0, n) for n in made.grid])
    left = inside(at.reshape(-1, 3)).reshape(made.grid)
    wanders = _LINE_WANDERS_MM * random.standard_normal((made.grid[0], 1))
    wanders[-1] = wanders[0]
    x, _, z = np.moveaxis(at, 2, 0)
    at_ear = np.exp(-((z / _EAR_MM) ** 2)) * step(np.abs(x), 50.0, 70.0)
    share = (left + wanders) / (1.0 - _AT_EAR * at_ear) / edge_mm
    strands = made.strands.copy()
    strands[0, ..., 2] = thinned(strands[0, ..., 2], share)
    return replace(made, strands=strands)


def _guides(skin: Skin, comb: Comb, layer: Layer, ragged: Floats, bulges: Floats) -> Floats:
    """(g, k, 3) guides, cut to length, each a little further out or in than its neighbours.

    ragged : (g,) mm by which each is longer. bulges : (g,) how far out it lies, in ``comb.wave_mm``.
    """
    count = len(comb.roots)
    lift = np.full(count, layer.share)
    paths, normals = grow(
        skin, comb.roots, comb.length, comb.thickness, comb.flow, lift=lift, steps=comb.steps, stiff=comb.stiff,
        slack=comb.slack, ears=comb.ears, below=0.9 * layer.share,
    )  # fmt: skip
    far = np.array([comb.cut(row) for row in paths]) + ragged[:, None]  # falls along a guide
    kept = resampled(np.array([_until(row, at) for row, at in zip(paths, far, strict=True)]), 24)
    outward = resampled(np.array([_until(row, at) for row, at in zip(normals, far, strict=True)]), 24)
    if comb.drape is not None:
        kept = comb.drape(kept)
    if comb.pole:
        kept[:, 0] = kept[:, 0].mean(axis=0)
    t = np.linspace(0.0, 1.0, 24)
    bulge = comb.wave_mm * bulges[:, None] * step(t, 0.05, 0.35) * (1.0 - comb.level * step(t, 0.55, 0.9))
    return np.asarray(kept + unit(outward) * bulge[..., None])


def tips(skin: Skin, comb: Comb) -> Floats:
    """(g, 3) where the guides of a closed sheet end."""
    raggedness, bulges = _waves(len(comb.roots), np.random.default_rng(0), True), np.zeros(len(comb.roots))
    return _guides(skin, comb, Layer(1.0, 1.0, 1.0), comb.ragged_mm * raggedness, bulges)[:, -1]


def _until(row: Floats, far: Floats) -> Floats:
    """(64, 3) rows (k, 3) up to where ``far`` first falls to 0, evenly by their number."""
    below = np.flatnonzero(far <= 0.0)
    end = len(row) - 1.0
    if len(below) and below[0] > 0:
        i = int(below[0])
        end = i - 1 + far[i - 1] / max(far[i - 1] - far[i], 1e-9)
    at = np.linspace(0.0, end, 64)
    return np.column_stack([np.interp(at, np.arange(len(row)), row[:, c]) for c in range(3)])


def _waves(count: int, random: np.random.Generator, closed: bool) -> Floats:
    """(count,) smooth noise about 0, of deviation about 1: locks lie side by side."""
    raw = random.standard_normal(count)
    near = 0.5 * np.roll(raw, 1) + raw + 0.5 * np.roll(raw, -1)
    if closed:
        near[-1] = near[0]
    return np.asarray(near / np.sqrt(1.5)).clip(-1.8, 1.8)


def _control_points(paths: Floats, weave: Weave) -> Floats:
    """(nu, nv, 3) control points of a cubic surface through guides (g, k, 3), so that none of it sinks into the skin
    that they lie on; u and v grow evenly with the way."""
    nu, nv = weave.points
    rows = resampled(paths, nv, weave.length(greville(nv, 3)))
    at = np.linspace(0.0, 1.0, len(rows))
    return _through(_through(CubicSpline(at, rows, axis=0)(greville(nu, 3)), 0), 1)


def _through(places: Floats, axis: int) -> Floats:
    """Control points of a cubic spline along an axis that goes through places where each of them acts most."""
    count = places.shape[axis]
    own = knots(count, 3)
    every = np.concatenate([own[:, 0], own[-1, 1:]])
    return np.moveaxis(make_interp_spline(greville(count, 3), places, k=3, t=every, axis=axis).c, 0, axis)


def sheet(
    points: Floats, layer: Layer, weave: Weave, random: np.random.Generator, closed: bool, sway: float
) -> Patches:
    """One sheet over control points (nu, nv, 3), whose strands run along v; see :func:`sheets`."""
    (nu, nv), (gu, gv) = weave.points, weave.grid
    t = np.broadcast_to(weave.length(np.linspace(0, 1, gv)), (gu, gv))
    u = np.broadcast_to(np.linspace(0, 1, gu)[:, None], (gu, gv))
    wide = np.linalg.norm(np.diff(points, axis=0), axis=2).sum(axis=0).max()
    tiles = max(1.0, np.rint(wide * ACROSS)) if closed else wide * ACROSS
    start = random.uniform(0.0, 1.0, 2)
    locks = np.interp(u[:, 0], np.linspace(0, 1, 4 * nu), _waves(4 * nu, random, closed))[:, None]
    many = max(4, round(float(wide) / _CLUMPS_MM))
    clumps = np.interp(u[:, 0], np.linspace(0, 1, many), _waves(many, random, closed))[:, None]
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    own = np.interp(u[:, 0], np.linspace(0, 1, nu), lengths)[:, None]
    longer = 1.0 - 0.3 * locks.clip(-1, 1) - _CLUMPED * clumps.clip(-1, 1)
    fray = np.minimum(layer.fray_mm * longer / own, 0.9)
    cover = layer.cover * (1.0 + 0.10 * locks) - (layer.cover + BARE) * np.clip((t - 1.0 + fray) / fray, 0.0, 1.0)
    if layer.roots > 0.0:
        uneven = 1.0 + _UNEVEN * _waves(gu, random, closed)[:, None]
        cover = cover - layer.roots * (1.0 - step(t * own / uneven, 0.0, layer.roots_mm))
    opened = layer.openness * (1.0 - _ROOTED[0] * (1.0 - step(t, 0.0, _ROOTED[1]))) * (1.0 + 0.05 * locks)
    ends = np.exp(-(1.0 - t) * own / max(layer.cropped_mm, 1e-9))
    opened = opened * (1.0 - _CLOSER * ends) if layer.cropped_mm > 0.0 else opened
    along = start[1] + ALONG * (float(np.median(lengths)) * t + _CROPPED * layer.cropped_mm * ends)
    strands = np.stack([start[0] + tiles * u, along, cover, opened + 0.0 * t], axis=-1)
    shade = 1.0 + _SHADED[0] * clumps + _SHADED[1] * locks + 0.0 * t
    moved = np.broadcast_to(sway * np.linspace(0, 1, nv) ** 1.5, (nu, nv))
    return Patches(
        points[None], (3, 3), weave.grid, weave.fast, strands[None], (t**1.5)[None], shade[None], moved[None]
    )  # fmt: skip
