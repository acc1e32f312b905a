"""Locks of hair: curves that grow from the skin, and the ribbons laid along them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.skin import Skin, unit

Flow = Callable[[Floats, Floats, float], Floats]
"""Directions (n, 3) in which locks at points (n, 3) over skin with normals (n, 3) grow, at a share of their length."""

RISE_MM = 14.0  # of a lock's length, in which it comes up through the hair
Thickness = Callable[[Floats], Floats]
"""How thick the hair lies, (n,) mm, over points of the skin (n, 3)."""


@dataclass(frozen=True)
class Locks:
    """Curves of n locks with k + 1 points each.

    paths, normals : (n, k + 1, 3), mm. widths : (n,) mm. shades : (n,) brightness about 1. layers : (n,) 0 lies below
    all others, 1 above.
    """

    paths: Floats
    normals: Floats
    widths: Floats
    shades: Floats
    layers: Floats

    def __add__(self, other: Locks) -> Locks:
        """Both, one after the other."""
        names = ("paths", "normals", "widths", "shades", "layers")
        return Locks(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))


def grow(
    skin: Skin, roots: Floats, lengths: Floats, thickness: Thickness, flow: Flow, *, lift: Floats, steps: int = 14,
    stiff: float = 0.5, slack: float = 1.0, ears: bool = False, below: float = 0.7, settle: float = 0.0,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Paths (n, steps + 1, 3) of locks from roots (n, 3) on the skin, and the skin's normals along them.

    lengths (n,), mm. A lock starts at the share ``below`` of the hair's thickness, inside it, and soon lies at its
    share ``lift`` (n,). stiff : how much of its direction a lock keeps at each step. slack : mm by which it may lie
    higher. ears : are ears in the way? settle : the share of its height that a lock loses towards its tip, so
    that tips lie on the hair below.
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
        least = thickness(at - height[:, None] * normals) * (below + (lift - below) * risen) * (1.0 - settle * share**2)
        at = at + normals * (np.clip(height, least, least + slack) - height)[:, None]
        paths.append(at)
        along.append(normals)
    return np.stack(paths, axis=1), np.stack(along, axis=1)


def spread(skin: Skin, among: Floats, apart: Floats, seed: int) -> Floats:
    """Indices (k,) into points ``among`` (n, 3), no two nearer than ``apart (n,)`` mm of theirs (dart throwing)."""
    random = np.random.default_rng(seed)
    kept: list[int] = []
    places = np.zeros((0, 3))
    for i in random.permutation(len(among)):
        if not len(places) or (((places - among[i]) ** 2).sum(axis=1) > apart[i] ** 2).all():
            kept.append(int(i))
            places = among[kept]
    return np.array(kept, np.int64)


def resampled(rows: Floats, count: int) -> Floats:
    """(n, count, 3) places evenly along polylines (n, k, 3)."""
    steps = np.linalg.norm(np.diff(rows, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(steps, axis=1)], axis=1)
    out = np.empty((len(rows), count, 3))
    for i, (own, at) in enumerate(zip(rows, along, strict=True)):
        where = np.linspace(0.0, at[-1], count)
        out[i] = np.column_stack([np.interp(where, at, own[:, k]) for k in range(3)])
    return out


def ribbons(locks: Locks, count: int, *, bulge: float = 0.22, root: float = 0.75, tip: float = 0.45) -> Floats:
    """Control points (n, 3, count, 3) of ribbons along locks: three across, the middle one raised.

    bulge : how far the middle stands out, in widths. root, tip : width at either end, relative to the middle.
    """
    paths, normals = resampled(locks.paths, count), unit(resampled(locks.normals, count))
    across = unit(np.cross(unit(np.gradient(paths, axis=1)), normals))
    outward = unit(np.cross(across, np.gradient(paths, axis=1)))
    t = np.linspace(0.0, 1.0, count)
    shape = np.where(t < 0.4, root + (1.0 - root) * t / 0.4, 1.0 + (tip - 1.0) * ((t - 0.4) / 0.6) ** 2)
    half = 0.5 * locks.widths[:, None, None] * shape[None, :, None]
    raised = 2.0 * bulge * half * outward
    return np.stack([paths - half * across, paths + 2.0 * raised, paths + half * across], axis=1)
