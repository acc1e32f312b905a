"""Trim loops as line segments: even-odd test, crossings with mesh edges, and how fine a mesh must follow them.

``segments`` is (k, 4) float64: u and v of the first and of the second end.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel


def _by_band(segments: Floats) -> tuple[float, float, Ints, Ints]:
    """Return segments by band of v: v0, bands per unit of v, list starts (bands + 1,), segment ids, ascending per
    band.
    """
    low, high = float(segments[:, [1, 3]].min()), float(segments[:, [1, 3]].max())
    bands = max(1, len(segments) // 2)
    scale = bands / max(high - low, 1e-300)
    ends = np.clip(((np.sort(segments[:, [1, 3]], axis=1) - low) * scale).astype(np.int64), 0, bands - 1)
    count = ends[:, 1] - ends[:, 0] + 1
    ids = np.repeat(np.arange(len(segments)), count)
    band = ends[ids, 0] + np.arange(len(ids)) - np.repeat(np.cumsum(count) - count, count)
    start = np.concatenate([[0], np.cumsum(np.bincount(band, minlength=bands))])
    return low, scale, start, ids[np.argsort(band, kind="stable")]


@kernel
def _band(v, low, scale, bands):
    return max(0, min(int((v - low) * scale), bands - 1))


def inside(segments: Floats, uv: Floats) -> np.ndarray:
    """Return (m,) bool: even-odd rule for ``uv (m, 2)``."""
    out = np.zeros(len(uv), dtype=np.bool_)
    _inside(segments, uv, *_by_band(segments), out)
    return out


@kernel
def _inside(segments, uv, low, scale, start, ids, out):
    for s in range(uv.shape[0]):
        u, v = uv[s, 0], uv[s, 1]
        b = _band(v, low, scale, start.shape[0] - 1)
        odd = False
        for q in range(start[b], start[b + 1]):
            k = ids[q]
            v0, v1 = segments[k, 1], segments[k, 3]
            if (v0 <= v) != (v1 <= v):
                at = segments[k, 0] + (v - v0) / (v1 - v0) * (segments[k, 2] - segments[k, 0])
                odd ^= u < at
        out[s] = odd


def crossings(segments: Floats, a: Floats, b: Floats) -> Floats:
    """Return where edges cross a loop, as a fraction (e,) of each, 0..1: the crossing nearest to the middle.

    ``a``, ``b`` (e, 2) float64 are the end points, one inside and one outside.
    """
    out = np.zeros(len(a))
    _crossings(segments, a, b, *_by_band(segments), out)
    return out


@kernel
def _crossings(segments, a, b, low, scale, start, ids, out):
    for e in range(a.shape[0]):
        du, dv = b[e, 0] - a[e, 0], b[e, 1] - a[e, 1]
        bands = start.shape[0] - 1
        first = _band(min(a[e, 1], b[e, 1]), low, scale, bands)
        last = _band(max(a[e, 1], b[e, 1]), low, scale, bands)
        best = 2.0
        for q in range(start[first], start[last + 1]):
            k = ids[q]
            eu, ev = segments[k, 2] - segments[k, 0], segments[k, 3] - segments[k, 1]
            det = du * ev - dv * eu
            if det == 0.0:
                continue
            pu, pv = segments[k, 0] - a[e, 0], segments[k, 1] - a[e, 1]
            t, s = (pu * ev - pv * eu) / det, (pu * dv - pv * du) / det
            within = -1e-9 <= t <= 1.0 + 1e-9 and -1e-9 <= s <= 1.0 + 1e-9
            if within and abs(t - 0.5) < abs(best - 0.5):
                best = t
        out[e] = 0.5 if best == 2.0 else min(max(best, 0.0), 1.0)


def corners(loop: Floats, scale: tuple[float, float], angle: float = 40.0) -> np.ndarray:
    """Return (k,) bool: which points of a closed polyline (k, 2) turn by more than ``angle`` degrees.

    ``scale`` turns u and v into lengths.
    """
    ring = loop * np.asarray(scale)
    into, out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    sharp: np.ndarray = np.abs(np.arctan2(cross, (into * out).sum(axis=1))) > np.radians(angle)
    return sharp


def resample(loop: Floats, scale: tuple[float, float], step: float) -> tuple[Floats, np.ndarray]:
    """Return the loop (k, 2) with points added so that no segment is longer than ``step``, and which are corners
    (k,).
    """
    after = np.roll(loop, -1, axis=0)
    length = np.linalg.norm((after - loop) * np.asarray(scale), axis=1)
    pieces = np.maximum(1, np.ceil(length / step).astype(np.int64))
    owner = np.repeat(np.arange(len(loop)), pieces)
    position = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    t = position / pieces[owner]
    ring = loop[owner] + t[:, None] * (after - loop)[owner]
    return ring, corners(loop, scale)[owner] & (position == 0)


@kernel
def wanted_size(ring, sharp, error, floor, out):
    """Largest edge that follows a loop within ``error`` and keeps its two sides apart, at every point.

    ``ring (k, 2)`` is in lengths; ``out (k,)`` gets the size, at least ``floor``.
    """
    k = ring.shape[0]
    arc = np.zeros(k + 1)
    for i in range(k):
        j = (i + 1) % k
        arc[i + 1] = arc[i] + np.hypot(ring[j, 0] - ring[i, 0], ring[j, 1] - ring[i, 1])
    for i in range(k):
        size, w = arc[k] / 4.0, 1
        open_ahead, open_behind = not sharp[i], not sharp[i]
        while w < k // 4 and open_ahead and open_behind:
            a, b = (i - w) % k, (i + w) % k
            du, dv = ring[b, 0] - ring[a, 0], ring[b, 1] - ring[a, 1]
            chord = np.hypot(du, dv)
            sag = abs(du * (ring[i, 1] - ring[a, 1]) - dv * (ring[i, 0] - ring[a, 0])) / max(chord, 1e-300)
            if sag > error:
                size = min(size, chord * np.sqrt(error / sag))
                break
            open_ahead, open_behind = not sharp[b], not sharp[a]
            w += 1
        square = size * size
        for j in range(k):
            du, dv = ring[i, 0] - ring[j, 0], ring[i, 1] - ring[j, 1]
            gap = du * du + dv * dv
            if gap < square:
                along = abs(arc[i] - arc[j])
                along = min(along, arc[k] - along)
                if along * along > 2.25 * gap and along > 0.0:
                    square = gap
        size = min(size, np.sqrt(square))
        out[i] = max(size, floor)
