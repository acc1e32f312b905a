"""Guides of hair: curves that grow from the skin, which the strands beside them follow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.skin import Skin, unit

Flow = Callable[[Floats, Floats, float], Floats]
"""Directions (n, 3) in which guides at points (n, 3) over skin with normals (n, 3) grow, at a share of their length."""

RISE_MM = 14.0  # of a guide's length, in which it comes up through the hair
Thickness = Callable[[Floats], Floats]
"""How thick the hair lies, (n,) mm, over points of the skin (n, 3)."""


def grow(
    skin: Skin, roots: Floats, lengths: Floats, thickness: Thickness, flow: Flow, *, lift: Floats, steps: int = 14,
    stiff: float = 0.5, slack: float | Thickness = 1.0, ears: bool = False, below: float = 0.7,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Paths (n, steps + 1, 3) of guides from roots (n, 3) on the skin, and the skin's normals along them.

    lengths (n,), mm. A guide starts at the share ``below`` of the hair's thickness, inside it, and soon lies at its
    share ``lift`` (n,). stiff : how much of its direction a guide keeps at each step. slack : mm by which it may lie
    higher, everywhere or by place. ears : are ears in the way?
    """
    normals, _ = skin.nearest(roots, ears=ears)
    at = roots + (below * thickness(roots))[:, None] * normals
    paths, along, ahead = [at], [normals], np.zeros_like(roots)
    for k in range(steps):
        share = (k + 1.0) / steps
        wanted = unit(flow(at, normals, share))
        ahead = wanted if k == 0 else unit(stiff * ahead + (1.0 - stiff) * wanted)
        at = at + ahead * (lengths / steps)[:, None]
        normals, height = skin.nearest(at, ears=ears)
        risen = np.minimum(share * lengths / RISE_MM, 1.0) ** 0.7
        least = thickness(at - height[:, None] * normals) * (below + (lift - below) * risen)
        free = slack(at) if callable(slack) else slack
        at = at + normals * (np.clip(height, least, least + free) - height)[:, None]
        paths.append(at)
        along.append(normals)
    return np.stack(paths, axis=1), np.stack(along, axis=1)


def way(at: Floats, axis: int) -> Floats:
    """(n, k) mm from the first of places (n, k, 3) on, along an axis of them, 0 or 1."""
    steps = np.linalg.norm(np.diff(at, axis=axis), axis=2)
    return np.asarray(np.insert(np.cumsum(steps, axis=axis), 0, 0.0, axis=axis))


def resampled(rows: Floats, count: int, shares: Floats | None = None) -> Floats:
    """(n, count, 3) places along polylines (n, k, 3): evenly, or at shares (count,) of their length."""
    along = way(rows, 1)
    shares = np.linspace(0.0, 1.0, count) if shares is None else shares
    out = np.empty((len(rows), count, 3))
    for i, (own, at) in enumerate(zip(rows, along, strict=True)):
        where = at[-1] * shares
        out[i] = np.column_stack([np.interp(where, at, own[:, k]) for k in range(3)])
    return out
