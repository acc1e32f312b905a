"""Contact sheets: many labelled pictures of one head on one page, and single PNG files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surface.base.errors import ViewError
from surface.view.pictures.imagefile import as_image, replacing
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framed
from surface.view.scene.parts import ViewHead
from surface.view.scene.theme import Theme, find_theme

if TYPE_CHECKING:
    from PIL.Image import Image

    from surface.head.posing.crowd import Crowd  # compiled: who has one has loaded it

_PAPER = (24, 26, 29)
_INK = (232, 233, 235)
_GAP = 4
_LEAST_TEXT = 9.0
_LIFT_MM, _ZOOM, _ZOOM_LESS = 30.0, 1.36, 0.2  # less from the side: a head is longer than it is wide


def contact_sheet(
    head: ViewHead,
    entries: Sequence[tuple[str, np.ndarray]],
    *,
    views: Sequence[Camera] | None = None,
    tile: tuple[int, int] = (300, 320),
    columns: int | None = None,
    quality: str = "full",
    theme: str | Theme = "skin",
    progress: Callable[[int, int], None] | None = None,
) -> Image:
    """Draw one picture per entry and view and put them on one labelled page.

    entries : (label, values (P,)) in `head.parameters` order.
    views : cameras; the head's front if None. Each entry's views are side by side, zoomed in since tiles are small.
    tile : (width, height) of one picture, pixels.
    columns : entries across; about square if None.
    progress : called with (done, total) after each entry.

    Raises ViewError: no entries, no OpenGL, no Pillow.
    """
    front = framed(Camera.front(), head, worn=find_theme(theme).dressed)
    cameras = [zoom_to_head(camera) for camera in views or (front,)]
    pictures = []
    with Offscreen(head, tile, quality=quality, theme=theme) as screen:
        for index, (_, values) in enumerate(entries):
            pictures.append(np.hstack([screen.render(values, camera) for camera in cameras]))
            if progress is not None:
                progress(index + 1, len(entries))
    return compose(pictures, [label for label, _ in entries], columns=columns)


def crowd_sheet(
    crowd: Crowd,
    labels: Sequence[str],
    *,
    camera: Camera | None = None,
    tile: tuple[int, int] = (160, 176),
    columns: int | None = None,
    quality: str = "full",
    theme: str | Theme = "skin",
    progress: Callable[[int, int], None] | None = None,
) -> Image:
    """Draw every head of a crowd as it is posed and put the pictures on one page; the rest as :func:`contact_sheet`.

    labels : one for each head. camera : zoomed in, since tiles are small; the front if None.
    """
    camera = zoom_to_head(camera or framed(Camera.front(), crowd.head, worn=find_theme(theme).dressed))
    pictures = []
    with Offscreen(crowd.head, tile, quality=quality, theme=theme, evaluator="cpu") as screen:
        for k in range(len(crowd)):
            crowd.show(k)
            pictures.append(screen.render_present(camera, crowd.values[k]))
            if progress is not None:
                progress(k + 1, len(crowd))
    return compose(pictures, labels, columns=columns)


def zoom_to_head(camera: Camera) -> Camera:
    """The camera moved nearer, so that the head without its shoulders fills a small picture."""
    x, y, z = camera.target
    side = abs(np.sin(np.radians(camera.yaw_deg)))
    return camera.aimed((x, y + _LIFT_MM * camera.near / Camera.near, z)).zoom(_ZOOM - _ZOOM_LESS * side)


def compose(pictures: Sequence[np.ndarray], labels: Sequence[str], *, columns: int | None = None) -> Image:
    """Put pictures on one page, each with its label under it, as a Pillow image.

    pictures : (height, width, 3) uint8 each, all of one size.
    labels : one per picture.
    columns : pictures across; about square if None.

    Raises ViewError: no pictures, or Pillow is missing. ValueError: sizes differ, or the numbers of labels and pictures
    do.
    """
    count = len(pictures)
    if count == 0:
        raise ViewError("a contact sheet needs at least one picture", hint="name a parameter or an emotion")
    if len(labels) != count:
        raise ValueError(f"{len(labels)} labels for {count} pictures")
    height, width = pictures[0].shape[:2]
    line = max(18, height // 13)  # under each picture, for its label
    if columns is None:
        columns = round((count * (height + line) / width) ** 0.5)
    columns = max(1, min(columns, count))
    cell = width + _GAP, height + line + _GAP
    page = np.full((cell[1] * -(-count // columns) + _GAP, cell[0] * columns + _GAP, 3), _PAPER, np.uint8)
    corners = [(_GAP + k % columns * cell[0], _GAP + k // columns * cell[1]) for k in range(count)]
    for index, (picture, (x, y)) in enumerate(zip(pictures, corners, strict=True)):
        if picture.shape[:2] != (height, width):
            raise ValueError(f"pictures[{index}] is {picture.shape[:2]}, the first is {(height, width)}")
        page[y : y + height, x : x + width] = picture
    sheet = as_image(page)
    for label, (x, y) in zip(labels, corners, strict=True):
        _write_label(sheet, label, (x + width // 2, y + height + line // 2), line * 0.72, width - 6)
    return sheet


def write_png(picture: np.ndarray | Image, path: str | Path) -> None:
    """Write (height, width, 3) uint8 pixels or a Pillow image as PNG, whole or not at all.

    Raises ViewError: the file cannot be written, or Pillow is missing.
    """
    image = as_image(picture) if isinstance(picture, np.ndarray) else picture
    with replacing(Path(path)) as temporary:
        image.save(temporary, format="PNG")


def _write_label(sheet: Image, label: str, middle: tuple[int, int], size: float, room: int) -> None:
    """Write `label` centred at `middle`; smaller, then shortened, where it is wider than `room` pixels."""
    from PIL import ImageDraw, ImageFont  # optional: the extra view

    draw: ImageDraw.ImageDraw = ImageDraw.Draw(sheet)
    label = label.replace("\N{MINUS SIGN}", "-")  # Pillow's own font has no such sign
    while size > _LEAST_TEXT and draw.textlength(label, font=ImageFont.load_default(size)) > room:
        size *= 0.9
    font = ImageFont.load_default(size)
    while len(label) > 2 and draw.textlength(label, font=font) > room:
        label = label[:-3] + ".."
    draw.text(middle, label, fill=_INK, font=font, anchor="mm")
