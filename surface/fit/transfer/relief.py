"""Find eyes, nose and mouth in a scan by its relief as seen from the front.

Relief is the depth minus its mean over some millimetres. It shows lips, lids and wings of the nose, and depends neither
on light and colour nor on the triangles of the scan. Patches of the template's relief are searched for in the scan's by
normalised cross-correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.fit.transfer.scan import Samples, spread
from surface.fit.transfer.template import Template

PIXEL_MM = 0.8  # size of a pixel of the height maps
FINE_MM, BROAD_MM = 1.0, 6.0  # standard deviation of the filter that removes noise; of the mean that is subtracted
COUNT = 250_000  # samples of the template
LEAST_SCORE = 0.6  # least correlation at which a landmark counts as found
SIGHT_MM = 1.6  # radius around a landmark, seen from the front, in which the foremost point of the scan gives its depth
CENTRED_MM = 16.0  # a shift by this distance lowers the score by :data:`SHIFT_COST`
SHIFT_COST = 0.15
FEATURES: tuple[tuple[tuple[str, ...], tuple[float, float]], ...] = (  # landmarks; half width and height, mm
    (("left_eye_inner", "left_eye_outer", "left_eye_upper", "left_eye_lower"), (20.0, 13.0)),
    (("right_eye_inner", "right_eye_outer", "right_eye_upper", "right_eye_lower"), (20.0, 13.0)),
    (("nose_tip",), (20.0, 14.0)),
    (("mouth_left", "mouth_right", "upper_lip", "lower_lip"), (30.0, 14.0)),
)
SINGLE = (
    "left_eye_inner", "left_eye_outer", "right_eye_inner", "right_eye_outer", "mouth_left", "mouth_right", "upper_lip",
    "lower_lip", "left_eye_upper", "left_eye_lower", "right_eye_upper", "right_eye_lower",
)  # fmt: skip
SINGLE_MM = (8.0, 8.0)
SUNK_MM = (0.0, 4.0)  # how far eyeballs lie behind their usual place: those of people, and those of sculptures


@dataclass(frozen=True)
class Relief:
    """A height map seen from the front; rows are y, columns are x.

    origin : (2,) x and y of the first pixel's middle, mm. relief : (h, w) mm. known : (h, w) 0 or 1.
    """

    origin: Floats
    relief: Floats
    known: Floats

    def pixel(self, place: Floats) -> tuple[int, int]:
        """Row and column of a place (x, y, ...)."""
        column, row = np.round((place[:2] - self.origin) / PIXEL_MM).astype(int)
        return int(row), int(column)


def make_relief(points: Floats, low: Floats, high: Floats) -> Relief:
    """The relief of points (n, 3) between two corners (2,) in x and y."""
    width, height = np.ceil((high - low) / PIXEL_MM).astype(int) + 1
    column, row = np.round((points[:, :2] - low) / PIXEL_MM).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    front = np.full((height, width), -np.inf)
    np.maximum.at(front, (row[inside], column[inside]), points[inside, 2])
    seen = np.isfinite(front)
    front[~seen] = 0.0
    fine, broad = (gaussian_filter(seen.astype(float), s / PIXEL_MM) for s in (FINE_MM, BROAD_MM))
    level = front[seen].mean() if seen.any() else 0.0
    offset = np.where(seen, front - level, 0.0)
    near = gaussian_filter(offset, FINE_MM / PIXEL_MM) / np.maximum(fine, 1e-6)
    far = gaussian_filter(offset, BROAD_MM / PIXEL_MM) / np.maximum(broad, 1e-6)
    known = (fine > 0.25).astype(float)
    return Relief(np.asarray(low, float), known * (near - far), known)


def correlate(small: Relief, large: Relief, place: Floats, half: tuple[float, float], search: float) -> Floats:
    """(k, k) normalised cross-correlation of a patch of ``small`` with ``large``, for shifts up to ``search`` mm.

    Rows are shifts in y, columns in x; -1 where too little is known. place : (3,) middle of the patch. half : half its
    width and height, mm.
    """
    row, column = small.pixel(place)
    dy, dx = (max(2, round(h / PIXEL_MM)) for h in half[::-1])
    far = max(1, round(search / PIXEL_MM))
    piece, own = _cut(small.relief, row, column, dy, dx), _cut(small.known, row, column, dy, dx)
    field, there = (
        _cut(large.relief, row, column, dy + far, dx + far),
        _cut(large.known, row, column, dy + far, dx + far),
    )
    views = np.lib.stride_tricks.sliding_window_view(field, piece.shape)
    known = np.lib.stride_tricks.sliding_window_view(there, piece.shape) * own
    count = np.maximum(known.sum(axis=(2, 3)), 1.0)
    a = (piece * known).sum(axis=(2, 3)) / count
    b = (views * known).sum(axis=(2, 3)) / count
    first, second = (piece - a[..., None, None]) * known, (views - b[..., None, None]) * known
    norm = np.sqrt((first**2).sum(axis=(2, 3)) * (second**2).sum(axis=(2, 3)))
    score = (first * second).sum(axis=(2, 3)) / np.maximum(norm, 1e-9)
    return np.where(count > 0.5 * max(own.sum(), 1.0), score, -1.0)


def _cut(image: Floats, row: int, column: int, dy: int, dx: int) -> Floats:
    """(2 dy + 1, 2 dx + 1) pixels of an image around a pixel; 0 outside the image."""
    padded = np.pad(image, ((dy, dy), (dx, dx)))
    row, column = np.clip(row, 0, image.shape[0] - 1), np.clip(column, 0, image.shape[1] - 1)
    return padded[row : row + 2 * dy + 1, column : column + 2 * dx + 1]


def _shift(score: Floats) -> tuple[Floats, float]:
    """Shift (x, y), mm, with the best of a correlation's scores (k, k), and that score; small shifts are preferred."""
    far = score.shape[0] // 2
    y, x = np.mgrid[-far : far + 1, -far : far + 1] * PIXEL_MM
    cost = score - SHIFT_COST * (x**2 + y**2) / CENTRED_MM**2
    row, column = np.unravel_index(int(cost.argmax()), cost.shape)
    return np.array([x[row, column], y[row, column]]), float(score[row, column])


class Finder:
    """Looks for a template's landmarks in a scan, which is aligned with it."""

    def __init__(self, template: Template, samples: Samples) -> None:
        front = template.points[template.face]
        margin = 25.0
        self._low, self._high = front[:, :2].min(axis=0) - margin, front[:, :2].max(axis=0) + margin
        self._low[1] = template.landmarks["chin"][1] - 60.0
        seen = (samples.normals[:, 2] > 0.0) & (samples.points[:, 2] > front[:, 2].min())
        self._points = samples.points[seen]
        self._tree = cKDTree(self._points[:, :2])
        self._scan = make_relief(self._points, self._low, self._high)
        tri = template.triangles[(template.normals[template.triangles, 2] > 0.0).all(axis=1)]
        face, self._share = spread(template.points, tri, COUNT)
        self._corners = tri[face]
        self._behind: dict[str, float] = {}
        self._eye, self._sunk = template.eye >= 0, SUNK_MM[0]

    def find(self, at: Floats, marks: dict[str, Floats], search: float) -> dict[str, tuple[Floats, float]]:
        """Places (3,) of landmarks in the scan, with the confidence in each, 0..1; those of a feature together.

        at, marks : the template's points (n, 3), and its landmarks, where a map puts them near the scan.
        search : greatest distance of a landmark from there, mm.
        """
        found: dict[str, tuple[Floats, float]] = {}
        eyes = {}
        for sunk in SUNK_MM:
            own = self._relief_of(at, marks, sunk)
            pair = [correlate(own, self._scan, _middle(marks, names), half, search) for names, half in FEATURES[:2]]
            eyes[sunk] = 0.5 * (pair[0] + pair[1][:, ::-1])  # they are found together: a face is symmetric
        self._sunk = max(SUNK_MM, key=lambda sunk: _shift(eyes[sunk])[1])
        rest = [correlate(own, self._scan, _middle(marks, names), half, search) for names, half in FEATURES[2:]]
        both = eyes[self._sunk]
        for (names, _), score, mirrored in zip(FEATURES, (both, both, *rest), (1, -1, 1, 1), strict=True):
            shift, sure = _shift(score)
            self._add(found, marks, names, shift * [mirrored, 1.0], sure)
        return found

    def refine(self, at: Floats, marks: dict[str, Floats], search: float) -> dict[str, tuple[Floats, float]]:
        """As :meth:`find`, but each landmark by itself.

        Landmarks of sunken eyes are left out, because their lids have another form than lids that lie on an eyeball.
        """
        own = self._relief_of(at, marks, self._sunk)
        found: dict[str, tuple[Floats, float]] = {}
        for name in (n for n in SINGLE if not (self._sunk and "_eye_" in n)):
            score = correlate(own, self._scan, marks[name], SINGLE_MM, search)
            if (other := mirrored(name)) != name:  # a face is symmetric: both sides are found together
                score = 0.5 * (score + correlate(own, self._scan, marks[other], SINGLE_MM, search)[:, ::-1])
            shift, sure = _shift(score)
            self._add(found, marks, (name,), shift, sure)
        return found

    def _relief_of(self, at: Floats, marks: dict[str, Floats], sunk: float) -> Relief:
        at = at - np.outer(self._eye, [0.0, 0.0, sunk])
        points = np.einsum("mk,mkc->mc", self._share, at[self._corners])
        tree = cKDTree(points[:, :2])
        self._behind = {}
        for name, mark in marks.items():  # rims of lips and lids may lie behind what is visible there
            near = points[tree.query_ball_point(mark[:2], SIGHT_MM)]
            self._behind[name] = float(mark[2] - near[:, 2].max()) if len(near) else 0.0
        return make_relief(points, self._low, self._high)

    def _add(
        self, found: dict[str, tuple[Floats, float]], marks: dict[str, Floats], names: Sequence[str], shift: Floats,
        sure: float,
    ) -> None:  # fmt: skip
        """Add landmarks, shifted, on the scan's surface; none where the correlation is poor or there is no surface."""
        if sure < LEAST_SCORE:
            return
        for name in names:
            place = marks[name][:2] + shift
            near = self._points[self._tree.query_ball_point(place, SIGHT_MM)]
            if len(near):
                found[name] = np.array([*place, near[:, 2].max() + self._behind[name]]), sure


def mirrored(name: str) -> str:
    """The name of the landmark on the other side of the face; its own in the middle."""
    return name.replace("left", "*").replace("right", "left").replace("*", "right")


def _middle(marks: dict[str, Floats], names: Sequence[str]) -> Floats:
    middle: Floats = np.mean([marks[n] for n in names], axis=0)
    return middle
