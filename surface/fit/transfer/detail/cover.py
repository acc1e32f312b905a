"""Bring skin to places of a scan that it does not reach along its own normals.

Skin that follows a scan along its normals finds nothing where the scan has another form than the head: a pit, such as
where a sculpture is chipped, that the skin spans, or a closed surface, such as the nostrils of most sculptures, behind
which the skin has a cavity. There the scan's samples say where skin is missing. All skin around such a place that does
not lie on the scan is first spanned evenly between the skin that does, as a soap film is, which neither folds nor keeps
pockets. Then it moves along one direction, the mean of the samples' normals, as far as they lie from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.measures.closest import ClosestTree

ROUNDS = 4
BARE_MM, EDGE_MM = 1.0, 0.4  # distance from the skin of the worst sample of a bare place, and of those at its edge
APART_MM = 3.0  # greatest distance of neighbouring samples of one place
FEWEST = 3  # samples of a place
DEEP_MM = 15.0  # greatest depth of skin before or behind a bare place
WIDE_MM = 25.0  # greatest distance from it of skin that goes along
BESIDE_MM = 1.5  # greatest distance from a sample, seen along the place's direction
FLAT = 0.5  # least cosine between a sample's normal and the direction of its place
SMOOTH = 8.0  # weight of smoothness, relative to that of the goals
LESS = 0.85  # of a place's RMS distance, that may be left at most, for the skin to stay where it was brought
NEAREST = 4  # samples that give the height of the scan at a vertex


@dataclass(frozen=True)
class Sheet:
    """Skin as triangles ``(t, 3)``; ``step (n, n)`` from the mean of its neighbours to each vertex; and which vertices
    are ``free (n,)`` to go."""

    triangles: Ints
    step: csr_matrix
    free: Bools


@dataclass(frozen=True)
class Bare:
    """Samples of a scan, ``points (k, 3)`` and unit ``normals (k, 3)``, at one place that skin does not reach."""

    points: Floats
    normals: Floats

    def direction(self) -> Floats:
        """(3,) unit mean of the normals."""
        mean = self.normals.mean(axis=0)
        unit: Floats = mean / max(float(np.linalg.norm(mean)), 1e-12)
        return unit


def cover(sheet: Sheet, at: Floats, off: Bools, points: Floats, normals: Floats) -> Floats:
    """The skin's vertices ``at (n, 3)``, brought to the samples ``points (m, 3)`` of a scan that none of it is near.

    off : (n,) which vertices do not lie on the scan; the others stay. normals : (m, 3) unit normals of the samples.
    Where the skin comes no nearer to a place, it stays as it was.
    """
    off = _with_ring(off, sheet.step) & sheet.free
    spanned = np.zeros(len(at), bool)
    for _ in range(ROUNDS):
        before = at
        for place in bare_places(at, sheet.triangles, points, normals):
            region = _around(at, off, sheet.step, place)
            if not len(region):
                continue
            film = at if spanned[region].all() else _spanned(at, region, sheet.step)
            moved = _raised(film, region, sheet.step, place)
            own = sheet.triangles[np.isin(sheet.triangles, region).any(axis=1)]
            if _rms(moved, own, place) < LESS * _rms(at, own, place):
                at = moved
                spanned[region] = True
        if at is before:
            break
    return at


def bare_places(at: Floats, triangles: Ints, points: Floats, normals: Floats) -> list[Bare]:
    """The places of a scan's samples that lie more than :data:`BARE_MM` from all skin, with their surroundings."""
    far = ClosestTree(at, triangles).distances(points, np.zeros(len(points), np.int64))
    near = np.flatnonzero((far > EDGE_MM) & (far < DEEP_MM))
    if not (far[near] > BARE_MM).any():
        return []
    tree = cKDTree(points[near])
    links = tree.sparse_distance_matrix(tree, APART_MM, output_type="coo_matrix")
    count, place = connected_components(links, directed=False)
    worst = np.zeros(count)
    np.maximum.at(worst, place, far[near])
    size = np.bincount(place, minlength=count)
    chosen = np.flatnonzero((worst > BARE_MM) & (size >= FEWEST))
    return [Bare(points[near[place == k]], normals[near[place == k]]) for k in chosen[np.argsort(-worst[chosen])]]


def _with_ring(off: Bools, step: csr_matrix) -> Bools:
    """``off (n,)`` and one ring of vertices around them: among these are those that lie on the scan by chance, and
    walls of a pit would be a zigzag without them."""
    out: Bools = off | (step @ off.astype(float) != 0.0)
    return out


def _around(at: Floats, off: Bools, step: csr_matrix, place: Bare) -> Ints:
    """The vertices that are off, no further from a place than :data:`WIDE_MM`, and joined to ones before or behind
    it."""
    near: Ints = np.flatnonzero(off)
    near = near[cKDTree(place.points).query(at[near], distance_upper_bound=WIDE_MM)[0] < WIDE_MM]
    if not len(near):
        return near
    _, piece = connected_components(step[near][:, near], directed=False)
    meant = np.isfinite(heights_above(at[near], place))
    out: Ints = near[np.isin(piece, piece[meant])]
    return out


def _spanned(at: Floats, region: Ints, step: csr_matrix) -> Floats:
    """The skin with the vertices of a region in the mean of their neighbours, the others being where they are."""
    rows = step[region]
    fixed = at.copy()
    fixed[region] = 0.0
    inner = (rows[:, region] + diags(np.full(len(region), 1e-9))).tocsc()
    out = at.copy()
    out[region] = splu(inner).solve(-(rows @ fixed))
    return out


def _raised(at: Floats, region: Ints, step: csr_matrix, place: Bare) -> Floats:
    """The skin with the vertices of a region moved along a place's direction to the scan, smoothly."""
    goal = heights_above(at[region], place)
    weight = np.isfinite(goal).astype(float)
    own = step[:, region]
    system = (diags(weight) + SMOOTH * (own.T @ own) + diags(np.full(len(region), 1e-9))).tocsc()
    out = at.copy()
    out[region] += splu(system).solve(weight * np.nan_to_num(goal))[:, None] * place.direction()
    return out


def heights_above(at: Floats, place: Bare) -> Floats:
    """(n,) how far from each of ``at (n, 3)`` the scan lies along the place's direction, mm; NaN beside the place and
    further than :data:`DEEP_MM` from it."""
    way = place.direction()
    cosine = place.normals @ way
    facing = cosine > FLAT
    out = np.full(len(at), np.nan)
    if not facing.any():
        return out
    side = np.linalg.svd(way[None, :])[2][1:]
    points, normals, cosine = place.points[facing], place.normals[facing], cosine[facing]
    beside, near = cKDTree(points @ side.T).query(at @ side.T, k=min(NEAREST, len(points)))
    beside, near = beside.reshape(len(at), -1), near.reshape(len(at), -1)
    offset = points[near] - at[:, None]
    along = offset @ way
    flat = offset - along[..., None] * way
    rise = along + (flat * normals[near]).sum(axis=2) / cosine[near]  # of the sample's tangent plane
    share = 1.0 / (beside + 0.1) ** 2
    height = (share * rise).sum(axis=1) / share.sum(axis=1)
    inside = (beside[:, 0] < BESIDE_MM) & (np.abs(height) < DEEP_MM)
    out[inside] = height[inside]
    return out


def _rms(at: Floats, triangles: Ints, place: Bare) -> float:
    far = ClosestTree(at, triangles).distances(place.points, np.zeros(len(place.points), np.int64))
    return float(np.sqrt((far**2).mean()))
