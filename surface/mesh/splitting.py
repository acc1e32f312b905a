"""Decide which cells of a quad tree to quarter.

That is those with too many control points, too far from the surface, or too large to follow a trim loop.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from surface.base import keys
from surface.base.arrays import Bools, Floats, Ints
from surface.spline.controlpoints import ControlPoints

from . import blocks, chords, loops, quadtree
from .domain import Domain
from .quadtree import Lattice, Leaves

MAX_CELLS = 4_000_000
RIM = 64  # along each side of the domain, to which cells are split where the border of the covered area runs


class Limits(NamedTuple):
    """Limits of a mesh's resolution; see :meth:`surface.DCPSurface.tessellate`."""

    max_points: int | None
    chord_error: float | None
    max_depth: int
    min_depth: int
    loop_error: float | None
    roots: tuple[int, int] | None
    measured: bool = True

    def check(self) -> None:
        """Raise ``ValueError`` for the first limit that is out of range."""
        if self.max_points is not None and self.max_points < 1:
            raise ValueError(f"max_points: must be at least 1, not {self.max_points}")
        for name, error in (("chord_error", self.chord_error), ("loop_error", self.loop_error)):
            if error is not None and not error > 0:
                raise ValueError(f"{name}: must be positive, not {error}")
        if not 0 <= self.min_depth <= self.max_depth <= 20:
            raise ValueError(f"min_depth, max_depth: need 0 <= {self.min_depth} <= {self.max_depth} <= 20")
        if self.roots is None:
            return
        if np.shape(self.roots) != (2,) or not all(int(count) == count >= 1 for count in self.roots):
            raise ValueError(f"roots: needs two whole numbers of 1 or more, got {self.roots!r}")
        if self.roots[0] * self.roots[1] > MAX_CELLS:
            raise ValueError(f"roots: {self.roots[0]} x {self.roots[1]} cells are more than {MAX_CELLS}")


@dataclass
class SplitTests:
    """Tests of which cells to quarter; ``scale`` are lengths per unit of u and of v."""

    surface: ControlPoints
    domain: Domain
    lattice: Lattice
    scale: tuple[float, float]
    limits: Limits
    rings: list[tuple[Floats, Floats]] = field(default_factory=list)
    anchors: tuple[Floats, Floats] | None = None

    def follow_loops(self, error: float) -> None:
        """Require cells small enough for edges to follow the loops within ``error``."""
        for loop in self.domain.loops:
            ring = np.asarray(loop)
            around = np.linalg.norm((np.roll(ring, -1, axis=0) - ring) * self.scale, axis=1).sum()
            step = max(2.0 * error, float(around) / 2000)
            points, sharp = loops.resample(ring, self.scale, step)
            size = np.zeros(len(points))
            loops.wanted_size(points * np.asarray(self.scale), sharp, error, 3.0 * error, size)
            self.rings.append((points, size))

    def split(self, level: int, cells: Ints) -> np.ndarray:
        """Return which cells of a level to quarter, (n,) bool."""
        if len(cells) > MAX_CELLS:
            raise ValueError(
                f"max_depth: {len(cells)} cells at level {level}; ask for a larger chord_error or max_points"
            )
        rect = self._rects(level, cells)
        active, along_loop = self._active(rect, cells, level)
        chosen = along_loop | (active & (level < self.limits.min_depth))
        left = np.flatnonzero(active & ~chosen)
        if self.limits.max_points is not None and len(left):
            chosen[left] = self._counts(rect[left]) > self.limits.max_points
            left = np.flatnonzero(active & ~chosen)
        if self.limits.chord_error is not None and len(left):
            chosen[left] = self._errors(level, cells[left]) > self.limits.chord_error
        return chosen

    def _rects(self, level: int, cells: Ints) -> Floats:
        """Return the rectangles u0, u1, v0, v1 of cells, (n, 4)."""
        shift = self.lattice.depth - level
        low = self.lattice.uv(cells[:, 0] << shift, cells[:, 1] << shift)
        high = self.lattice.uv((cells[:, 0] + 1) << shift, (cells[:, 1] + 1) << shift)
        return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)

    def _active(self, rect: Floats, cells: Ints, level: int) -> tuple[np.ndarray, np.ndarray]:
        """Return which cells overlap the domain, and which are too large for a loop that runs through them."""
        coarse = np.zeros(len(cells), dtype=bool)
        if not self.rings:
            return np.ones(len(cells), dtype=bool), coarse
        middle = np.stack([rect[:, :2].mean(axis=1), rect[:, 2:].mean(axis=1)], axis=1)
        active = self.domain.inside(middle)
        size = np.maximum((rect[:, 1] - rect[:, 0]) * self.scale[0], (rect[:, 3] - rect[:, 2]) * self.scale[1])
        code = quadtree.codes(self.lattice, level, cells)
        for ring, wanted in self.rings:
            place = keys.find(code, self._find(level, ring))
            hit = place >= 0
            cell, limit = place[hit], wanted[hit]
            active[cell] = True
            coarse[cell[size[cell] > limit]] = True
        return active, coarse

    def _find(self, level: int, uv: Floats) -> Ints:
        """Return the codes of the cells that hold ``uv``; -1 outside the rectangle."""
        index = []
        for k, lines in enumerate((self.lattice.lines_u, self.lattice.lines_v)):
            root = np.searchsorted(lines, uv[:, k], side="right") - 1
            inner = np.clip(root, 0, len(lines) - 2)
            part = (uv[:, k] - lines[inner]) / (lines[inner + 1] - lines[inner])
            index.append(np.where(root == inner, (inner << level) + (part * (1 << level)).astype(np.int64), -1))
        return quadtree.codes(self.lattice, level, np.stack(index, axis=1))

    def _counts(self, rect: Floats) -> Ints:
        """Return the number (n,) of points whose subdomain shares an area, not only an edge, with each rectangle."""
        out, inner = np.zeros(len(rect), dtype=np.int64), np.nextafter(rect, [np.inf, -np.inf, np.inf, -np.inf])
        blocks.count_points(inner, *self.surface.arrays()[:2], *self.surface.bin_arrays(), out)
        return out

    def tighten(self, leaves: Leaves, inner: list[Ints], error: float) -> tuple[Leaves, list[Ints]]:
        """Quarter leaves until the surface is nowhere further than ``error`` from their triangles.

        Leaves of the deepest level stay. ``inner`` and the results are as of :func:`.quadtree.grow`.
        """
        passed, creases = np.zeros(0, dtype=np.int64), chords.crease_lines(self.surface)
        while True:
            pattern = quadtree.patterns(self.lattice, leaves, inner)
            key = self._keys(leaves) * len(quadtree.TEMPLATES) + pattern
            left = np.flatnonzero((leaves.level < self.lattice.depth) & ~np.isin(key, passed))
            far = self._too_far(leaves, pattern, left, error, creases)
            passed = np.concatenate([passed, key[left[~far]]])
            if not far.any():
                return leaves, inner
            leaves, inner = quadtree.quarter(self.lattice, leaves, inner, left[far])

    def _keys(self, leaves: Leaves) -> Ints:
        """Return one integer (n,) per leaf, unique over all levels."""
        shift = self.lattice.depth - leaves.level
        corner = self.lattice.key(leaves.cell[:, 0] << shift, leaves.cell[:, 1] << shift)
        return corner * (self.lattice.depth + 1) + leaves.level

    def _too_far(
        self, leaves: Leaves, pattern: Ints, which: Ints, error: float, creases: tuple[Floats, Floats]
    ) -> Bools:
        """Return of which of the leaves ``which (k,)`` the surface is too far from the triangles, (k,) bool."""
        far = np.zeros(len(which), dtype=bool)
        for level in np.unique(leaves.level[which]):
            at = np.flatnonzero(leaves.level[which] == level)
            cells = leaves.cell[which[at]]
            rect = self._rects(int(level), cells)
            at = at[active := self._active(rect, cells, int(level))[0]]
            uv = chords.sample_places(rect[active], creases)
            side = inner_side(uv, uv[:, 12], self.domain)
            far[at] = chords.measure_errors(self.surface, uv, side, pattern[which[at]]) > error
        return far

    def _errors(self, level: int, cells: Ints) -> Floats:
        """Return the greatest distance of the surface from each cell's chords; 0 if uncovered.

        It is measured at edge middles and the centre, and at control points in the cell.
        """
        shift = self.lattice.depth - level
        step = 1 << shift
        corner = cells << shift
        grid = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2], [2, 2]]) * (step // 2)
        x, y = corner[:, :1] + grid[:, 0], corner[:, 1:] + grid[:, 1]
        side = np.zeros(x.shape, dtype=np.int64)
        if self.domain.slits:
            uv = self.lattice.uv(x, y)
            side = inner_side(uv, uv[:, 4], self.domain)
        first, back = keys.number(self.lattice.key(x, y) * 4 + side)
        places = self.lattice.uv(x.reshape(-1)[first], y.reshape(-1)[first])  # neighbours share most samples
        corners = self.surface.sample(places, side.reshape(-1)[first])[2][back]
        worst = _chord_errors(corners)
        self._add_anchors(level, cells, corners, worst)
        held = np.isfinite(corners[:, :, 0])
        partly = held.any(axis=1) & ~held.all(axis=1)
        worst[partly & (self.lattice.shape[0] << level < RIM) & (self.lattice.shape[1] << level < RIM)] = np.inf
        return worst

    def _add_anchors(self, level: int, cells: Ints, p: Floats, worst: Floats) -> None:
        """Raise ``worst`` to the error of the cell near control points.

        Thus features between the samples of a large cell are found: where there is detail, there are control points.
        """
        if self.anchors is None:
            self.anchors = _anchors(self.surface, self.domain)
        uv, points = self.anchors
        place = keys.find(quadtree.codes(self.lattice, level, cells), self._find(level, uv))
        hit = np.flatnonzero(place >= 0)
        cell = place[hit]
        rect = self._rects(level, cells[cell])
        s = ((uv[hit, 0] - rect[:, 0]) / (rect[:, 1] - rect[:, 0]))[:, None]
        t = ((uv[hit, 1] - rect[:, 2]) / (rect[:, 3] - rect[:, 2]))[:, None]
        a, b, c, d = (p[cell, k] for k in (0, 2, 6, 8))
        normal = np.cross(d - a, c - b)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        offset = points[hit] - (1 - t) * ((1 - s) * a + s * b) - t * ((1 - s) * c + s * d)
        np.fmax.at(worst, cell, np.abs((offset * normal).sum(axis=1)))


def _anchors(surface: ControlPoints, domain: Domain) -> tuple[Floats, Floats]:
    """Return the (u, v) near the maxima of the points' blending functions, (k, 2), and the surface there, (k, 3)."""
    knots, degrees = surface.padded, surface.degrees
    uv = np.zeros((surface.n, 2))
    for k in range(2):
        column = np.arange(knots[k].shape[1])
        inner = (column >= 1) & (column <= degrees[k][:, None])
        total = np.where(inner, knots[k], 0).sum(axis=1)
        middle = (knots[k][:, 0] + knots[k][:, -1]) / 2
        uv[:, k] = np.where(degrees[k] > 0, total / np.maximum(degrees[k], 1), middle)  # Greville abscissa
    uv = uv[domain.inside(uv)]
    points = surface.sample(uv, None)[2]
    covered = np.isfinite(points[:, 0])
    return uv[covered], points[covered]


def inner_side(uv: Floats, centre: Floats, domain: Domain) -> Ints:
    """Return the limits (n, k) that points of cells (n, k, 2) take to belong to their cell's side of every slit."""
    side = np.zeros(uv.shape[:-1], dtype=np.int64)
    for slit in domain.slits:
        axis, bit = (1, 2) if slit.axis == "u" else (0, 1)
        on = slit.holds(uv.reshape(-1, 2)).reshape(side.shape)
        side[on & (centre[:, None, axis] < slit.at)] |= bit
    return side


def _chord_errors(p: Floats) -> Floats:
    """Return the chord errors (n,) of cells with nine points ``p (n, 9, 3)``, rows of three from the low corner."""
    worst = np.zeros(len(p))
    for a, middle, b in ((0, 1, 2), (0, 3, 6), (2, 5, 8), (6, 7, 8)):
        worst = np.fmax(worst, _off_line(p[:, a], p[:, middle], p[:, b]))
    bow = np.fmin(_off_line(p[:, 0], p[:, 4], p[:, 8]), _off_line(p[:, 2], p[:, 4], p[:, 6]))
    return np.fmax(worst, bow)


def _off_line(a: Floats, middle: Floats, b: Floats) -> Floats:
    """Return the distance of ``middle`` from the line a-b."""
    along, offset = b - a, middle - a
    length = np.maximum((along * along).sum(axis=1), 1e-300)
    part = np.clip((offset * along).sum(axis=1) / length, 0, 1)
    distance: Floats = np.linalg.norm(offset - part[:, None] * along, axis=1)
    return distance
