"""Where the mouth is, and how far the lips gape, seen from the front.

The line of the lips is where the skin is torn when the jaw opens: above it nothing moves, below it everything does. So
it is found in any mesh, whether the lips are the rim of a hole or the skin goes on into the mouth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.check.raster import NOTHING, Picture, View, enclosed
from surface.check.subject import Subject

STEP_MM = 0.5  # pixel size when finding the lips, times the head's scale
FINE_STEP_MM = 0.15  # pixel size when measuring their gap, times the head's scale
MIN_STEP = 0.3  # of motion between neighbouring pixels at the line of the lips, as a fraction of the largest motion
MIN_DROP_MM = 3.0  # distance that the chin must move down when the jaw opens
DEEP_MM = 9.0  # skin at least this far behind the lips is the inside of the mouth
LIPS_MM = 15.0  # if it is no higher or lower than this
MAX_GAP_MM = 12.0  # between lips at rest: a higher opening is not the one between lips
INNER_WIDTH = 0.5  # fraction of the width of the mouth in which its gap is measured


@dataclass(frozen=True)
class Mouth:
    """The line of the lips at rest: x (k,) ascending, y (k,), z (k,), mm; ``drop`` is how far the lower lip goes
    down.
    """

    x: Floats
    y: Floats
    z: Floats
    drop: float

    @property
    def middle(self) -> Floats:
        """(3,) its middle."""
        return np.array([0.5 * (self.x[0] + self.x[-1]), np.median(self.y), self.z.max()])

    @property
    def width(self) -> float:
        """From corner to corner, mm."""
        return float(self.x[-1] - self.x[0])


def find_mouth(subject: Subject) -> Mouth | None:
    """Return the line of the lips; None where no jaw opens."""
    if "jawOpen" not in subject.claimed or not len(subject.skin):
        return None
    moves = [m[:, 1].astype(np.float64) for m in subject.moves("jawOpen")]
    drop = -min(float(moves[k].min()) for k in subject.skin)
    if drop < MIN_DROP_MM * subject.scale:
        return None
    picture = _draw_front(subject)
    down, below = _fill_gaps(_values(subject, picture, moves), round(MAX_GAP_MM / STEP_MM))
    step = np.where(np.isfinite(down[1:]) & np.isfinite(down[:-1]), down[1:] - down[:-1], 0.0)
    torn: Bools = step > MIN_STEP * np.nanmax(-down)
    columns = _longest_run(np.asarray(torn.any(axis=0)))
    if len(columns) < 5:
        return None
    rows = np.argmax(step[:, columns], axis=0)
    x, edge = picture.at(rows, columns)
    y = edge + 0.5 * (1 + below[rows + 1, columns]) * picture.view.step
    return Mouth(x, y, picture.depth[rows, columns], float(np.nanmax(-down)))


def _draw_front(subject: Subject) -> Picture:
    """Return the skin at rest from the front."""
    at = np.concatenate([subject.rest[k] for k in subject.skin])
    view = View((at[:, 0].min(), at[:, 0].max()), (at[:, 1].min(), at[:, 1].max()), STEP_MM * subject.scale)
    shapes = subject.shapes(subject.rest)
    return view.draw([s if k in subject.skin else None for k, s in enumerate(shapes)])


def _values(subject: Subject, picture: Picture, of: list[Floats]) -> Floats:
    """Return (h, w): values at the vertices (m,) of every part, averaged over the triangle at each pixel; NaN where
    none is.
    """
    out = np.full(picture.depth.shape, np.nan)
    for k in np.unique(picture.parts[picture.parts != NOTHING]):
        here = picture.parts == k
        out[here] = of[k][subject.parts[k].triangles].mean(axis=1)[picture.rows[here]]
    return out


def _fill_gaps(values: Floats, most: int) -> tuple[Floats, Ints]:
    """Return values (h, w) with what is above a gap of at most ``most`` rows in it, too, and how high the gap below is.

    Lips that are parted at rest show nothing between them; the line of the lips runs along the lower one's edge.
    """
    known = np.isfinite(values)
    rows = np.arange(len(values))[:, None]
    above = np.minimum.accumulate(np.where(known, rows, len(values))[::-1], axis=0)[::-1]
    under = np.maximum.accumulate(np.where(known, rows, -1), axis=0)
    gap = np.where((above < len(values)) & (under >= 0), above - under - 1, 0)
    narrow = ~known & (gap > 0) & (gap <= most)
    taken = np.take_along_axis(values, np.minimum(above, len(values) - 1), axis=0)
    return np.where(narrow, taken, values), np.where(narrow, gap, 0)


def _longest_run(hits: Bools, most_gap: int = 2) -> Ints:
    """Return indices of the longest run of hits, with gaps of a few filled."""
    at = np.flatnonzero(hits)
    if not len(at):
        return at
    runs = np.split(at, np.flatnonzero(np.diff(at) > most_gap) + 1)
    best = max(runs, key=len)
    return np.arange(best[0], best[-1] + 1)


def lips_gap(subject: Subject, mouth: Mouth, vertices: list[Floats32]) -> tuple[float, float]:
    """Return the largest height of the opening between the lips, mm, and the x where it is, in the middle half of the
    mouth."""
    scale, half = subject.scale, 0.5 * INNER_WIDTH * mouth.width
    centre = mouth.middle
    view = View(
        (centre[0] - half, centre[0] + half),
        (centre[1] - mouth.drop - 25.0 * scale, centre[1] + 20.0 * scale),
        FINE_STEP_MM * scale,
    )
    picture = view.draw(subject.shapes(vertices))
    inside = _values(subject, picture, [_mark_inside(v, mouth, scale) for v in subject.rest])
    solid = np.isin(picture.parts, subject.skin) & (inside < 0.5)
    height = enclosed(~solid, solid).sum(axis=0) * view.step
    column = int(height.argmax())
    return float(height[column]), picture.at(0, column)[0]


def _mark_inside(rest: Floats32, mouth: Mouth, scale: float) -> Floats:
    """Return (m,): 1 for vertices (m, 3) that at rest lie behind the lips, as the inside of the mouth does; else 0."""
    away = rest.astype(np.float64) - mouth.middle
    beside = np.abs(away[:, 0]) < 0.5 * mouth.width
    behind = away[:, 2] < -DEEP_MM * scale
    return (beside & behind & (np.abs(away[:, 1]) < LIPS_MM * scale)).astype(np.float64)
