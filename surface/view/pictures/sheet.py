"""Contact sheets: many labelled pictures of one head on one page, and single PNG files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surface.base.errors import ViewError
from surface.view.pictures.imagefile import as_image, replacing
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera
from surface.view.scene.parts import ViewHead
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    from PIL.Image import Image

Entry = tuple[str, np.ndarray]
_PAPER = (24, 26, 29)
_INK = (232, 233, 235)
_GAP = 4
_LEGIBLE = 9.0
_LIFT_MM, _CLOSER, _LONGER = 30.0, 1.36, 0.2  # a head is longer than it is wide


@dataclass(frozen=True)
class Layout:
    """Where things go on a sheet, pixels.

    Parameters
    ----------
    tile : (width, height) of one picture.
    columns, rows : entries across and down.
    label : height of the line under each entry.
    """

    tile: tuple[int, int]
    columns: int
    rows: int
    label: int

    @property
    def cell(self) -> tuple[int, int]:
        """Width and height of one entry with its gap."""
        return self.tile[0] + _GAP, self.tile[1] + self.label + _GAP

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the sheet."""
        return self.cell[0] * self.columns + _GAP, self.cell[1] * self.rows + _GAP

    def corner(self, index: int) -> tuple[int, int]:
        """Upper left corner of entry `index`."""
        row, column = divmod(index, self.columns)
        return _GAP + column * self.cell[0], _GAP + row * self.cell[1]


def contact_sheet(
    head: ViewHead,
    entries: Sequence[Entry],
    *,
    views: Sequence[Camera] | None = None,
    tile: tuple[int, int] = (300, 320),
    columns: int | None = None,
    quality: str = "full",
    theme: str | Theme = "skin",
    progress: Callable[[int, int], None] | None = None,
) -> Image:
    """Draw one picture per entry and view and put them on one labelled page.

    Parameters
    ----------
    entries : (label, values (P,)) in `head.parameters` order.
    views : cameras; the front when not given. Each entry's views stand side by side, moved closer since tiles
        are small.
    tile : (width, height) of one picture, pixels.
    columns : entries across; about square when not given.
    progress : called with (done, total) after each entry.

    Raises
    ------
    ViewError : no entries, no OpenGL, no Pillow.
    """
    cameras = [closer(camera) for camera in views or (Camera.front(),)]
    pictures = []
    with Offscreen(head, tile, quality=quality, theme=theme) as screen:
        for index, (_, values) in enumerate(entries):
            pictures.append(np.hstack([screen.render(values, camera) for camera in cameras]))
            if progress is not None:
                progress(index + 1, len(entries))
    return compose(pictures, [label for label, _ in entries], columns=columns)


def closer(camera: Camera) -> Camera:
    """The camera moved nearer, so that the head without its shoulders fills a small picture."""
    x, y, z = camera.target
    side = abs(np.sin(np.radians(camera.yaw_deg)))
    return camera.aimed((x, y + _LIFT_MM, z)).zoom(_CLOSER - _LONGER * side)


def compose(pictures: Sequence[np.ndarray], labels: Sequence[str], *, columns: int | None = None) -> Image:
    """Put pictures on one page, each with its label under it, as a Pillow image.

    Parameters
    ----------
    pictures : (height, width, 3) uint8 each, all of one size.
    labels : one per picture.
    columns : pictures across; about square when not given.

    Raises
    ------
    ViewError : no pictures, or Pillow is missing.
    ValueError : sizes differ, or the labels are not as many as the pictures.
    """
    if len(pictures) == 0:
        raise ViewError("a contact sheet needs at least one picture", hint="name a parameter or an emotion")
    if len(labels) != len(pictures):
        raise ValueError(f"{len(labels)} labels for {len(pictures)} pictures")
    height, width = pictures[0].shape[:2]
    layout = _layout(len(pictures), (width, height), columns)
    page = np.full((layout.size[1], layout.size[0], 3), _PAPER, np.uint8)
    for index, picture in enumerate(pictures):
        if picture.shape[:2] != (height, width):
            raise ValueError(f"pictures[{index}] is {picture.shape[:2]}, the first is {(height, width)}")
        x, y = layout.corner(index)
        page[y : y + height, x : x + width] = picture
    sheet = as_image(page)
    for index, label in enumerate(labels):
        _write_label(sheet, label, index, layout)
    return sheet


def write_png(picture: np.ndarray | Image, path: str | Path) -> None:
    """Write (height, width, 3) uint8 pixels or a Pillow image as PNG, whole or not at all.

    Raises
    ------
    ViewError : the file cannot be written, or Pillow is missing.
    """
    image = as_image(picture) if isinstance(picture, np.ndarray) else picture
    with replacing(Path(path)) as temporary:
        image.save(temporary, format="PNG")


def _layout(count: int, tile: tuple[int, int], columns: int | None) -> Layout:
    """Layout for `count` pictures: `columns` across, or so many that the sheet is about square."""
    label = max(18, tile[1] // 13)
    if columns is None:
        columns = max(1, round((count * (tile[1] + label) / tile[0]) ** 0.5))
    columns = max(1, min(columns, count))
    return Layout(tile, columns, -(-count // columns), label)


def _write_label(sheet: Image, label: str, index: int, layout: Layout) -> None:
    """Write `label` centred in the line under a picture, smaller when it would not fit."""
    from PIL import ImageDraw, ImageFont  # optional: the extra view

    draw: ImageDraw.ImageDraw = ImageDraw.Draw(sheet)
    label = label.replace("\N{MINUS SIGN}", "-")  # Pillow's own font has no such sign
    x, y = layout.corner(index)
    size, room = layout.label * 0.72, layout.tile[0] - 6
    while size > _LEGIBLE and draw.textlength(label, font=ImageFont.load_default(size)) > room:
        size *= 0.9
    font = ImageFont.load_default(size)
    while len(label) > 2 and draw.textlength(label, font=font) > room:
        label = label[:-3] + ".."
    middle = (x + layout.tile[0] // 2, y + layout.tile[1] + layout.label // 2)
    draw.text(middle, label, fill=_INK, font=font, anchor="mm")
