"""Place control points: a coarse net, refined where it is wanted, cut at slits.

Level (a, b) of the net has spacing ``coarse / 2**a`` in u and ``coarse / 2**b`` in v. A control point has five
equally spaced knots in u and in v (cubic blending, support four spans wide) and is kept when finer ones are
added on top of it: the surface is rational, so any set of points that covers the chart will do. No net is finer
than the samples are in that direction: on a lid they are much closer across it than along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.chart import Cut

STEPS = np.arange(-2.0, 3.0)
CORNERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])  # of a cell of the net, from its lowest


@dataclass(frozen=True)
class Net:
    """Control points without positions.

    place : (n, 4) int64: levels in u and v, then i and j in the net of that level.
    knots_u, knots_v : (n, 5) float64.
    """

    place: Ints
    knots_u: Floats
    knots_v: Floats

    def __len__(self) -> int:
        return len(self.place)

    @property
    def centres(self) -> Floats:
        """(n, 2) float64, the means of the inner knots: inside the support, next to a slit too."""
        return np.column_stack([self.knots_u[:, 1:4].mean(axis=1), self.knots_v[:, 1:4].mean(axis=1)])

    def take(self, chosen: NDArray[Any]) -> Net:
        """Some of the points, by mask or by indices."""
        return Net(*(a[chosen] for a in vars(self).values()))

    def joined(self, other: Net) -> Net:
        """This net with another's points after its own."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Net(*(np.concatenate(p) for p in pairs))


def net_at(places: Ints, coarse: float, cuts: list[Cut], uv: Floats) -> Net:
    """Control points at the places (n, 4); those whose support holds no sample are left out."""
    places = np.asarray(places, np.int64).reshape(-1, 4)
    span = coarse / 2.0 ** places[:, :2]
    knots = [(places[:, 2 + k, None] + STEPS) * span[:, k, None] for k in (0, 1)]
    net = Net(places, *knots)
    for cut in cuts:
        net = _cut(net, cut)
    return net.take(_reaches(net, uv))


def _cut(net: Net, cut: Cut) -> Net:
    """Points that straddle the slit along all of their support become one above and one below."""
    ku, kv = net.knots_u, net.knots_v
    inside = (ku[:, 0] >= cut.start) & (ku[:, -1] <= cut.end)
    straddles = inside & (kv[:, 0] < cut.v) & (kv[:, -1] > cut.v)
    rest, both = net.take(~straddles), net.take(straddles)
    above = Net(both.place, both.knots_u, np.maximum(both.knots_v, cut.v))
    below = Net(both.place, both.knots_u, np.minimum(both.knots_v, cut.v))
    return rest.joined(above).joined(below)


def _reaches(net: Net, uv: Floats) -> Bools:
    """Does the support hold a sample, well inside?"""
    out = np.zeros(len(net), bool)
    order = np.argsort(uv[:, 0])
    u, v = uv[order, 0], uv[order, 1]
    eps = 0.05 * (net.knots_u[:, 4] - net.knots_u[:, 0])
    first = np.searchsorted(u, net.knots_u[:, 0] + eps)
    last = np.searchsorted(u, net.knots_u[:, 4] - eps)
    rim = 0.05 * (net.knots_v[:, 4] - net.knots_v[:, 0])
    for k in range(len(net)):
        inside = v[first[k] : last[k]]
        out[k] = ((inside > net.knots_v[k, 0] + rim[k]) & (inside < net.knots_v[k, 4] - rim[k])).any()
    return out


def coarse_places(uv: Floats, coarse: float) -> Ints:
    """All places of level 0 around the samples."""
    low = np.floor(uv.min(axis=0) / coarse).astype(int) - 2
    high = np.ceil(uv.max(axis=0) / coarse).astype(int) + 2
    i, j = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1), indexing="ij")
    none = np.zeros(i.size, np.int64)
    return np.column_stack([none, none, i.ravel(), j.ravel()])


def wanted_places(net: Net, uv: Floats, caps: Ints, error: Floats, coarse: float) -> Ints:
    """Places (k, 4) of new points, most wanted first.

    For every sample with an error above 1 these are the four points around it, one level finer than what it has;
    ``caps (m, 2)`` are the finest levels in u and v that the samples can decide.
    """
    bad = np.flatnonzero(error > 1)
    level, finer = _next_level(net, uv[bad], caps[bad], coarse)
    bad, level = bad[finer], level[finer]
    at = uv[bad] / (coarse / 2.0**level)
    cell = np.floor(at).astype(np.int64)
    fraction = at - cell
    every = np.concatenate([np.column_stack([level, cell + corner]) for corner in CORNERS])
    wants = [np.abs(1 - corner - fraction).prod(axis=1) * error[bad] ** 2 for corner in CORNERS]
    _, first, inverse = np.unique(keys(every), return_index=True, return_inverse=True)
    want = np.bincount(inverse.ravel(), np.concatenate(wants), len(first))
    return every[first][np.argsort(-want, kind="stable")]


def level_caps(spacing: Floats, coarse: float, deepest: int) -> Ints:
    """(m, 2) finest level in u and v whose spacing is not below the samples' own ``spacing (m, 2)``."""
    finest = np.floor(np.log2(coarse / np.maximum(spacing, 1e-9)) + 1e-6)
    return np.clip(finest, 0, deepest).astype(np.int64)


def _next_level(net: Net, uv: Floats, caps: Ints, coarse: float) -> tuple[Ints, Bools]:
    """The first level (m, 2) that does not have all four points around a sample, and whether there is one."""
    have = keys(net.place)
    out, found = np.zeros((len(uv), 2), np.int64), np.zeros(len(uv), bool)
    for level in range(1, int(caps.max(initial=0)) + 1):
        left = np.flatnonzero(~found & (caps.max(axis=1) >= level))
        pair = np.minimum(level, caps[left])
        cell = np.floor(uv[left] * 2.0**pair / coarse).astype(np.int64)
        lacks = np.zeros(len(left), bool)
        for corner in CORNERS:
            lacks |= ~np.isin(keys(np.column_stack([pair, cell + corner])), have)
        out[left[lacks]], found[left[lacks]] = pair[lacks], True
    return out, found


def keys(places: Ints) -> Ints:
    """(n,) one number for each place: levels below 16, i and j within four million of the middle."""
    level, at = places[:, :2], places[:, 2:] + (1 << 22)
    return ((level[:, 0] * 16 + level[:, 1]) << 46) + (at[:, 0] << 23) + at[:, 1]
