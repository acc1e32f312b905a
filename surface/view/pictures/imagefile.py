"""Image files written whole or not at all: to a temporary file first, then moved to their name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surface.base import writing
from surface.base.errors import ViewError
from surface.base.extras import importing

if TYPE_CHECKING:
    from PIL.Image import Image


def as_image(pixels: np.ndarray) -> Image:
    """Pillow image of (height, width, 3) uint8 pixels. Raises MissingPackage: Pillow is not installed."""
    with importing("an image file", "PIL"):
        from PIL import Image as pillow  # optional: the extra view
    return pillow.fromarray(np.ascontiguousarray(pixels))


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path to write to; moved to `path` on success, removed on failure; see
    :func:`surface.base.writing.replacing`.

    Raises ViewError: the folder is missing or cannot be written.
    """
    if not path.parent.is_dir():
        raise ViewError(f"cannot write {path}: there is no folder {path.parent}", hint=f"mkdir -p {path.parent}")
    try:
        with writing.replacing(path) as temporary:
            yield temporary
    except OSError as error:
        hint = "check the free space and the folder's rights, or choose another folder with -o"
        raise ViewError(f"cannot write {path}: {error.strerror or error}", hint=hint) from error
