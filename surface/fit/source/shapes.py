"""Make ARKit's shapes out of a mesh's own: halves added up, shapes for both sides cut, moods cut into regions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import NameMap, Source

MIDDLE = 0.06  # half the band about the middle in which a shape for both sides fades from one to the other, in widths
EMPTY = 1e-5  # of the mesh's size: a shape that moves no vertex as far as this is empty
MOUTH_END, EYES_BEGIN = 0.35, 0.75  # between mouth (0) and eyes (1) a mood fades from one to the other
BROWS = 0.25  # of the same length: above the lids eyes fade into brows over this


def empty_shapes(mesh: FitMesh) -> frozenset[int]:
    """Indices of the shapes that move nothing."""
    size = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
    return frozenset(k for k, d in enumerate(mesh.deltas) if np.abs(d).max(initial=0.0) <= EMPTY * size)


def to_arkit(mesh: FitMesh, mapped: NameMap) -> FitMesh:
    """The mesh with only ARKit's shapes."""
    sides, regions = _sides(mesh), _regions(mesh, mapped)
    deltas = np.zeros((len(mapped.sources), len(mesh.vertices), 3))
    for row, every in zip(deltas, mapped.sources.values(), strict=True):
        for source in every:
            row += sides[source.side][:, None] * regions[source.region][:, None] * _own(mesh, source)
    return replace(mesh, names=tuple(mapped.sources), deltas=deltas)


def _own(mesh: FitMesh, source: Source) -> Floats:
    """(n, 3) what a shape does, less its share of another by least squares; never more than all of that one."""
    move: Floats = mesh.deltas[source.index]
    if source.less < 0:
        return move
    other = mesh.deltas[source.less]
    power = float((other**2).sum())
    return move - np.clip(float((move * other).sum()) / power, 0.0, 1.0) * other if power > 0 else move


def _sides(mesh: FitMesh) -> dict[str, Floats]:
    """(n,) how much of each side every vertex belongs to; "" is both."""
    x = mesh.vertices[:, 0]
    left = _rise(x, 0.5 * (x.min() + x.max()), MIDDLE * max(float(np.ptp(x)), 1e-9))
    return {"": np.ones(len(x)), "Left": left, "Right": 1.0 - left}


def _rise(x: Floats, middle: float, half: float) -> Floats:
    """From 0 to 1, smoothly, over ``half`` on each side of the middle."""
    t = np.clip((x - middle) / half, -1.0, 1.0)
    out: Floats = 0.5 + 0.25 * t * (3.0 - t * t)
    return out


def _regions(mesh: FitMesh, mapped: NameMap) -> dict[str, Floats]:
    """(n,) how much of each region every vertex belongs to; all of each where mouth or eyes are not known."""
    one = np.ones(len(mesh.vertices))
    out = {"": one, "mouth": one, "eyes": one, "brows": one}
    if not (mapped.mouth and mapped.eyes):
        return out
    mouth, lids = (_moved(mesh, indices) for indices in (mapped.mouth, mapped.eyes))
    low, high = (weight @ mesh.vertices / weight.sum() for weight in (mouth, lids))
    length = float(((high - low) ** 2).sum())
    if not length > 0:
        return out
    along = (mesh.vertices - low) @ (high - low) / length
    above = _rise(along, 0.5 * (MOUTH_END + EYES_BEGIN), 0.5 * (EYES_BEGIN - MOUTH_END))
    order = np.argsort(along)
    reached = np.cumsum(lids[order]) / lids.sum()
    brows = _rise(along, float(along[order][np.searchsorted(reached, 0.98)]) + 0.5 * BROWS, 0.5 * BROWS)
    return {"": one, "mouth": 1.0 - above, "eyes": above * (1.0 - brows), "brows": brows}


def _moved(mesh: FitMesh, indices: tuple[int, ...]) -> Floats:
    """(n,) squared distance by which shapes move each vertex; the same for all where they move none."""
    out: Floats = (mesh.deltas[list(indices)] ** 2).sum(axis=(0, 2))
    return out if out.sum() > 0 else np.ones(len(mesh.vertices))
