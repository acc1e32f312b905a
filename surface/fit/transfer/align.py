"""Find the face in a scan of unknown axes, unit and origin: the similarity transform from the scan to a head's frame.

From landmarks it is computed directly (Umeyama, 1991). Without landmarks, many starting transforms with different axes
and sizes are refined by iterated closest points with normals (Besl and McKay, 1992). The result is the one for which
the scan is nearest to the face and the face to the scan.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from surface.base.arrays import Bools, Floats
from surface.base.errors import FitError
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.template import Template

# Lengths are relative to the height of the face, from the chin to the bridge of the nose.
COARSE, FINE = 350, 1500  # points of the template in the first and in the last search
TARGETS = 12_000  # samples of the scan that are searched
NORMAL = 0.12  # distance that a difference of normals by 1 counts as in the search for closest points
SEEN = 0.03  # width of a line of sight
CLIP = 0.12  # greater distances count as this one
EXTENTS = (1.35, 1.8, 2.6, 3.3, 4.6, 16.5)  # heights of a mask, ..., a bust, a whole body
BELOW_TOP = (0.25, 2.4)  # range in which the tip of the nose may lie below the top of a mesh
STEPS, LAST_STEPS, KEPT = 14, 40, 4  # iterations of the first search, of the last one; starts that are refined there
GOOD, POOR = 0.085, 0.135  # score below which the search ends; score above which there is no face
SHARE = 0.75  # of the pairs of closest points, the nearest ones, that an iteration uses


class NoFaceFound(FitError):
    """Nothing in a scan resembles a face."""


@dataclass(frozen=True)
class Similarity:
    """The map p -> scale * turn @ p + shift. ``score`` : mean distances both ways, added, in heights of the face."""

    turn: Floats
    scale: float
    shift: Floats
    score: float = 0.0

    def points(self, rows: Floats) -> Floats:
        """Points (..., 3) moved."""
        moved: Floats = self.scale * rows @ self.turn.T + self.shift
        return moved


def from_pairs(points: Floats, others: Floats, weight: Floats | None = None) -> Similarity:
    """The similarity that brings points (n, 3) nearest to others (n, 3) (Umeyama, 1991)."""
    w = np.ones(len(points)) if weight is None else weight
    w = w / w.sum()
    a0, b0 = w @ points, w @ others
    a, b = points - a0, others - b0
    u, size, vt = np.linalg.svd((w[:, None] * b).T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turn = u @ np.diag(sign) @ vt
    scale = float(size @ sign / max(float(w @ (a * a).sum(axis=1)), 1e-30))
    return Similarity(turn, scale, b0 - scale * turn @ a0)


def face_region(template: Template) -> Bools:
    """(n,) which of a template's points are the front of the face, from below the chin to the forehead."""
    p, h, tip = template.points, template.height, template.landmarks["nose_tip"]
    low, high = template.landmarks["chin"][1] - 0.1 * h, template.landmarks["nose_bridge"][1] + 0.45 * h
    out: Bools = (p[:, 1] > low) & (p[:, 1] < high) & (p[:, 2] > tip[2] - 0.85 * h) & (template.normals[:, 2] > -0.1)
    return out & (template.face | (template.eye >= 0))


def thinned(points: Floats, count: int) -> Floats:
    """Indices of about ``count`` of the points (n, 3), one in each occupied cube of a grid."""
    size = float(np.ptp(points, axis=0).max())
    low, high = size / 400.0, size
    for _ in range(18):
        step = 0.5 * (low + high)
        cells = np.unique(np.floor(points / step).astype(np.int64), axis=0, return_index=True)[1]
        low, high = (step, high) if len(cells) > count else (low, step)
    return np.sort(cells)


class Aligner:
    """Searches the samples of a scan for the face of a template."""

    def __init__(self, template: Template, samples: Samples) -> None:
        front = np.flatnonzero(face_region(template))
        self._template, self._height = template, template.height
        self._fine = front[thinned(template.points[front], FINE)]
        self._coarse = front[thinned(template.points[front], COARSE)]
        chosen = np.linspace(0, len(samples.points) - 1, min(TARGETS, len(samples.points))).astype(int)
        self._at, self._out = samples.points[chosen], samples.normals[chosen]

    def search(self, up: Floats | None, forward: Floats | None) -> Similarity | None:
        """The best similarity from the scan to the template; ``up`` and ``forward`` are directions, if known. None
        where no rotation that is tried agrees with them, or the scan has no height in any."""
        found: list[Similarity] = []
        turns = list(axis_turns(up, forward))
        others = [t for t in tilted_turns() if _agrees(t, up, forward)]
        for more in (turns[:1], turns[1:], others):  # first y up and z forward, as in most files, if that agrees
            if more and all(s.score > GOOD for s in found) and (best := self._best(more)) is not None:
                found.append(best)
        return min(found, key=lambda s: s.score, default=None)

    def _best(self, turns: list[Floats]) -> Similarity | None:
        """The best of the similarities that start with some rotations; None where none has a start."""
        starts = [self.refine(s, self._coarse, STEPS) for turn in turns for s in self._starts(turn)]
        starts.sort(key=lambda s: s.score)
        refined = (self.refine(s, self._fine, LAST_STEPS) for s in starts[:KEPT])
        return min(refined, key=lambda s: s.score, default=None)

    def _starts(self, turn: Floats) -> Iterator[Similarity]:
        """Starts with one rotation, one for each of :data:`EXTENTS`; the foremost point near the middle is the nose."""
        at = self._at @ turn.T
        top, height = at[:, 1].max(), float(np.ptp(at[:, 1]))
        tip = self._template.landmarks["nose_tip"]
        for extent in EXTENTS:
            unit = height / extent
            band = (at[:, 1] < top - BELOW_TOP[0] * unit) & (at[:, 1] > top - BELOW_TOP[1] * unit)
            if not band.any():
                continue
            x = at[band, 0]
            middle = np.abs(x - 0.5 * (x.min() + x.max())) < 0.5 * unit
            nose = at[band][middle][at[band][middle, 2].argmax()] if middle.any() else at[band][at[band, 2].argmax()]
            scale = self._height / unit
            yield Similarity(turn, scale, tip - scale * nose)

    def refine(self, start: Similarity, chosen: Floats, steps: int) -> Similarity:
        """A starting transform refined by iterated closest points, with its score."""
        p, n = self._template.points[chosen], self._template.normals[chosen]
        unit = self._height / start.scale
        tree = cKDTree(np.hstack([self._at, NORMAL * unit * self._out]))
        now = start
        for _ in range(steps):
            place = (p - now.shift) @ now.turn / now.scale
            distance, near = tree.query(np.hstack([place, NORMAL * unit * (n @ now.turn)]))
            kept = distance <= np.quantile(distance, SHARE)
            new = from_pairs(self._at[near[kept]], p[kept])
            scale = float(np.clip(new.scale, 0.55 * start.scale, 1.8 * start.scale))
            middle = self._at[near[kept]].mean(axis=0)
            now = Similarity(new.turn, scale, new.points(middle) - scale * new.turn @ middle)
        return Similarity(now.turn, now.scale, now.shift, self.score(now, chosen))

    def score(self, found: Similarity, chosen: Floats) -> float:
        """Mean distances from the template's face to the scan and back, with normals, added; in heights of the face."""
        p, n, h = self._template.points[chosen], self._template.normals[chosen], self._height
        at, out = found.points(self._at), self._out @ found.turn.T
        own = np.hstack([p, NORMAL * h * n])
        before = np.array([0.0, 0.0, 0.3 * h])
        inside = ((at > p.min(axis=0)) & (at < p.max(axis=0) + before)).all(axis=1) & (out[:, 2] > 0.0)
        if inside.sum() < 30:
            return 1.0
        inside[inside] = foremost(at[inside], SEEN * h)
        there = np.hstack([at, NORMAL * h * out])
        forth = cKDTree(there).query(own, distance_upper_bound=CLIP * h)[0]
        back = cKDTree(own).query(there[inside], distance_upper_bound=CLIP * h)[0]
        return float(sum(np.minimum(d, CLIP * h).mean() for d in (forth, back)) / h)


def foremost(points: Floats, size: float) -> Bools:
    """(n,) which points (n, 3) are visible from the front: no other point nearby is much further forward.

    size : width of the columns in which points are compared.
    """
    if not len(points):
        return np.zeros(0, bool)
    column = np.floor(points[:, :2] / size).astype(np.int64)
    column -= column.min(axis=0)
    key = column[:, 0] * (column[:, 1].max() + 1) + column[:, 1]
    front = np.full(key.max() + 1, -np.inf)
    np.maximum.at(front, key, points[:, 2])
    seen: Bools = points[:, 2] > front[key] - 2.0 * size
    return seen


def axis_turns(up: Floats | None, forward: Floats | None) -> Iterator[Floats]:
    """The rotations (3, 3) that map axes to axes, the identity first, as far as they agree with known directions."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0 and _agrees(turn, up, forward):
                yield turn


def tilted_turns() -> Iterator[Floats]:
    """Further rotations (3, 3) for scans that stand at an angle to the axes: random ones, about 30 degrees apart."""
    for q in Rotation.random(96, rng=np.random.default_rng(0)):
        yield q.as_matrix()


def _agrees(turn: Floats, up: Floats | None, forward: Floats | None) -> bool:
    """Whether a rotation turns the known direction ``up`` to y and ``forward`` to z."""
    pairs = [(up, turn[1]), (forward, turn[2])]
    return all(wanted is None or float(row @ wanted) > 0.9 for wanted, row in pairs)


def align(template: Template, samples: Samples, up: Floats | None, forward: Floats | None, where: str) -> Similarity:
    """The similarity from a scan to the template's frame.

    Raises NoFaceFound: nothing in the scan resembles a face. ``where`` names the scan in the message.
    """
    found = Aligner(template, samples).search(up, forward)
    if found is None or found.score > POOR:
        hint = (
            f"say where it is: omote landmarks {where} -o landmarks.toml draws a picture to take nose_tip, chin and "
            "the corners of eyes and mouth from, for --landmarks landmarks.toml"
        )
        raise NoFaceFound(f"{where}: no face was found in it", hint=hint)
    return found
