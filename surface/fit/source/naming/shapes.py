"""Make ARKit's shapes out of a mesh's own: halves added up, shapes for both sides cut, moods cut into regions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.source.kinds import kind_name
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import NameMap, Source

HALF_BAND = (
    0.06  # in widths: half the band about the middle in which a shape for both sides fades from one to the other
)
MIN_MOTION = 1e-5  # of the mesh's size: a shape that moves no vertex this far is empty
MOUTH_END, EYES_BEGIN = 0.35, 0.75  # between mouth (0) and eyes (1) a mood fades from one to the other
LID_FRACTION = 0.98  # of the motion of the lids that lies below the upper end of their region
BROW_FADE = 0.25  # of the distance from mouth to eyes, over which the eyes' region fades into the brows above the lids


def empty_shapes(mesh: FitMesh) -> frozenset[int]:
    """Indices of the shapes that move nothing."""
    size = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
    return frozenset(k for k, d in enumerate(mesh.deltas) if np.abs(d).max(initial=0.0) <= MIN_MOTION * size)


def to_arkit(mesh: FitMesh, mapped: NameMap) -> FitMesh:
    """The mesh with only ARKit's shapes."""
    sides, regions = _sides(mesh), _regions(mesh, mapped)
    deltas = np.zeros((len(mapped.sources), len(mesh.vertices), 3))
    for row, every in zip(deltas, mapped.sources.values(), strict=True):
        for source in every:
            row += sides[source.side][:, None] * regions[source.region][:, None] * _own(mesh, source)
    return replace(mesh, names=tuple(mapped.sources), deltas=deltas)


def _own(mesh: FitMesh, source: Source) -> Floats:
    """(n, 3) what a shape does, less its share of another."""
    move: Floats = mesh.deltas[source.index]
    if source.less < 0:
        return move
    rest: Floats = move - share_of(mesh, source.index, source.less) * mesh.deltas[source.less]
    return rest


def share_of(mesh: FitMesh, shape: int, other: int) -> float:
    """How much of another shape is in one, by least squares, 0..1."""
    a, b = mesh.deltas[shape], mesh.deltas[other]
    power = float((b**2).sum())
    return float(np.clip(float((a * b).sum()) / power, 0.0, 1.0)) if power > 0 else 0.0


def _sides(mesh: FitMesh) -> dict[str, Floats]:
    """(n,) how much of each side every vertex belongs to; "" is both."""
    x = mesh.vertices[:, 0]
    left = _rise(x, 0.5 * (x.min() + x.max()), HALF_BAND * max(float(np.ptp(x)), 1e-9))
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
    brow = _of_kind(mesh, "brow")
    mouth, lids = (_moved(mesh, indices) for indices in (mapped.mouth, mapped.eyes))
    lids = np.where(brow, 0.0, lids)
    if not lids.sum() > 0:
        return out
    low, high = (weight @ mesh.vertices / weight.sum() for weight in (mouth, lids))
    length = float(((high - low) ** 2).sum())
    if not length > 0:
        return out
    along = (mesh.vertices - low) @ (high - low) / length
    above = _rise(along, 0.5 * (MOUTH_END + EYES_BEGIN), 0.5 * (EYES_BEGIN - MOUTH_END))
    brows = np.where(brow, 1.0, _rise(along, _brow_line(along, lids, brow), 0.5 * BROW_FADE))
    return {"": one, "mouth": 1.0 - above, "eyes": above * (1.0 - brows), "brows": brows}


def _brow_line(along: Floats, lids: Floats, brow: Bools) -> float:
    """Where eyes have faded into brows by half: a little below brows that are pieces, or else above what lids move."""
    if brow.any():
        return float(np.quantile(along[brow], 0.05)) - 0.5 * BROW_FADE
    order = np.argsort(along)
    reached = np.cumsum(lids[order]) / lids.sum()
    return float(along[order][np.searchsorted(reached, LID_FRACTION)]) + 0.5 * BROW_FADE


def _of_kind(mesh: FitMesh, kind: str) -> Bools:
    """(n,) which vertices belong to pieces of a kind."""
    out = np.zeros(len(mesh.vertices), bool)
    for k, name in enumerate(mesh.pieces):
        if kind_name(name) == kind:
            used = np.unique(mesh.faces[mesh.piece == k])
            out[used[used >= 0]] = True
    return out


def _moved(mesh: FitMesh, indices: tuple[int, ...]) -> Floats:
    """(n,) squared distance by which shapes move each vertex; the same for all where they move none."""
    out: Floats = (mesh.deltas[list(indices)] ** 2).sum(axis=(0, 2))
    return out if out.sum() > 0 else np.ones(len(mesh.vertices))
