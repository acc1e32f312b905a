"""Draw a scan with numbered landmarks or with its errors, without OpenGL; find the place of a pixel in the picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Ints
from surface.base.error_colours import error_colours
from surface.base.extras import importing
from surface.check.raster import NOTHING, View
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.scan import Scan
from surface.fit.transfer.template import NAMES

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw  # optional: the extra view

HEIGHT = 900  # pixels
ASPECT = 0.9  # width of one view by its height
MARGIN = 1.25  # height of a picture, relative to that of the face
LIGHT = np.array([-0.3, 0.5, 0.8]) / np.linalg.norm([-0.3, 0.5, 0.8])
PAPER, DARK, BRIGHT = 236, 40, 225
RING, TEXT = 5, 17
COLOURS = {"given": (30, 90, 220), "found": (200, 30, 30), "carried": (230, 130, 0)}
FAR_MM = 20.0  # greater errors are grey


@dataclass(frozen=True)
class Frontal:
    """The front view of a scan, which maps a place in the file's coordinates to ``scale * turn @ place + shift``.

    The first coordinate of the result is the column, the negative of the second is the row, both counted from the
    middle of the upper left pixel; the third is larger for nearer places.
    """

    turn: Floats
    scale: float
    shift: Floats

    def pixels(self, places: Floats) -> Floats:
        """(..., 3) column, row and nearness of places (..., 3)."""
        out: Floats = (self.scale * places @ self.turn.T + self.shift) * [1.0, -1.0, 1.0]
        return out

    def place(self, scan: Scan, column: float, row: float) -> Floats | None:
        """(3,) the foremost place of a scan at a pixel, in the file's coordinates; None where it shows nothing."""
        at = self.pixels(scan.vertices)[scan.triangles]
        hit = (at[:, :, :2].min(axis=1) <= [column, row]) & (at[:, :, :2].max(axis=1) >= [column, row])
        depth = _depth(at[hit.all(axis=1)], np.array([column, row]))
        if not len(depth):
            return None
        found: Floats = (np.array([column, -row, depth.max()]) - self.shift) @ self.turn / self.scale
        return found


def _depth(at: Floats, pixel: Floats) -> Floats:
    """(k,) the third coordinate of triangles (t, 3, 3) where they lie over a pixel (2,); others are left out."""
    a, b, c = (at[:, k, :2] - pixel for k in range(3))
    p, q, r = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((b, c), (c, a), (a, b)))
    area = p + q + r
    over = (np.abs(area) > 1e-12) & (np.minimum(np.minimum(p * area, q * area), r * area) >= 0)
    share = np.column_stack([p, q, r])[over] / area[over, None]
    depth: Floats = (share * at[over, :, 2]).sum(axis=1)
    return depth


def frontal(found: Similarity, low: Floats, high: Floats) -> Frontal:
    """The front view of a scan that shows what lies, in the head's frame, between two corners (3,)."""
    middle, tall = 0.5 * (low + high), MARGIN * float(high[1] - low[1])
    scale = HEIGHT / tall
    corner = np.array([0.5 * ASPECT * HEIGHT, -0.5 * HEIGHT, 0.0])
    return Frontal(found.turn, scale * found.scale, scale * (found.shift - middle) + corner)


def draw_landmarks(scan: Scan, view: Frontal, marks: Mapping[str, tuple[Floats, str]], path: Path) -> None:
    """Write a PNG: the scan from the front with its landmarks, numbered as in :data:`NAMES`; from the left beside it.

    scan and marks (place (3,) and how it was found) are in the file's coordinates.

    Raises MissingPackage: Pillow is not installed. OSError: the picture cannot be written.
    """
    with importing("a picture of landmarks", "PIL"):
        from PIL import Image as Pillow  # optional: the extra view
        from PIL import ImageDraw

    width = round(ASPECT * HEIGHT)
    pictures, places = [], {n: view.pixels(p) for n, (p, _) in marks.items()}
    nose = places["nose_tip"] if "nose_tip" in places else _foremost(view.pixels(scan.vertices), width)
    for side in (False, True):
        at = _from_the_left(view.pixels(scan.vertices), nose, width) if side else view.pixels(scan.vertices)
        pictures.append(_relief(at, scan.triangles, width, np.ones((len(scan.triangles), 3))))
    image = Pillow.fromarray(np.hstack(pictures))
    draw = ImageDraw.Draw(image)
    for name, at in places.items():
        how = marks[name][1]
        _mark(draw, at[:2], NAMES.index(name) + 1, COLOURS[how])
        beside = _from_the_left(at[None], nose, width)[0]
        if 0 <= beside[0] < width:
            _mark(draw, beside[:2] + np.array([width, 0.0]), NAMES.index(name) + 1, COLOURS[how])
    _legend(draw, marks)
    image.save(path, format="PNG")


def draw_distances(scan: Scan, view: Frontal, distance: Floats, path: Path) -> None:
    """Write a PNG: a scan from the front, its triangles coloured by distances (t,), mm. Raises as
    :func:`draw_landmarks` does."""
    with importing("a picture of errors", "PIL"):
        from PIL import Image as Pillow  # optional: the extra view

    colour = error_colours(distance) ** (1 / 2.2)
    colour[distance > FAR_MM] = 0.5
    picture = _relief(view.pixels(scan.vertices), scan.triangles, round(ASPECT * HEIGHT), colour)
    Pillow.fromarray(picture).save(path, format="PNG")


def _foremost(pixels: Floats, width: int) -> Floats:
    """(3,) the nearest of pixels (m, 3) that lie in the picture, or the nearest of all if none does."""
    shown = (pixels[:, :2] > 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < HEIGHT)
    own = pixels[shown] if shown.any() else pixels
    nearest: Floats = own[own[:, 2].argmax()]
    return nearest


def _from_the_left(pixels: Floats, nose: Floats, width: int) -> Floats:
    """Pixels (m, 3) as the subject's left side shows them, the nose's tip near the picture's left."""
    out: Floats = np.column_stack([0.2 * width + nose[2] - pixels[:, 2], pixels[:, 1], pixels[:, 0]])
    return out


def _relief(pixels: Floats, triangles: Ints, width: int, colour: Floats) -> NDArray[np.uint8]:
    """(h, w, 3) uint8: triangles over pixels (m, 3), of colours (t, 3), lit from above."""
    points = pixels * [1.0, -1.0, 1.0]
    view = View((0.0, width - 1.0), (-(HEIGHT - 1.0), 0.0), 1.0)
    picture = view.draw([(points.astype(np.float32), triangles.astype(np.int32))])
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    light = np.clip(np.abs(normal @ LIGHT), 0.0, 1.0)
    seen = picture.parts != NOTHING
    out = np.full((*seen.shape, 3), PAPER, np.uint8)
    rows = picture.rows[seen]
    out[seen] = (colour[rows] * (DARK + (BRIGHT - DARK) * light[rows])[:, None]).astype(np.uint8)
    return out[::-1]


def _mark(draw: ImageDraw, at: Floats, number: int, colour: tuple[int, int, int]) -> None:
    from PIL import ImageFont  # optional: the extra view

    x, y = at.tolist()
    draw.ellipse((x - RING, y - RING, x + RING, y + RING), outline=colour, width=2)
    draw.point((x, y), fill=colour)
    draw.text((x + RING + 1, y - TEXT), str(number), fill=colour, font=ImageFont.load_default(TEXT))


def _legend(draw: ImageDraw, marks: Mapping[str, tuple[Floats, str]]) -> None:
    from PIL import ImageFont  # optional: the extra view

    font = ImageFont.load_default(TEXT - 3)
    for row, name in enumerate(n for n in NAMES if n in marks):
        how = marks[name][1]
        draw.text((8, 6 + (TEXT + 1) * row), f"{NAMES.index(name) + 1} {name}, {how}", fill=COLOURS[how], font=font)
