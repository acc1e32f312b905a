"""Frames as one image that Pillow takes frame by frame: of a clip, only one is kept."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from PIL.Image import Image

from surface.base.errors import ViewError


class Reel(Image):
    """An image of several frames, as Pillow's own of animated files: ``seek`` shows the next one.

    Pillow keeps every image of a list that it is given to append, which is some megabytes for each frame of a film.

    frames : (height, width, 3) uint8 each, all of one size; taken one by one. count : how many there are, 1 or more.

    Raises ViewError: there are fewer frames.
    """

    def __init__(self, frames: Iterable[np.ndarray], count: int) -> None:
        super().__init__()
        self._frames, self._at, self.n_frames = iter(frames), 0, count
        first = self._next()
        self.__setstate__([{}, "RGB", first.shape[1::-1], None, first.tobytes()])  # what pickled images are made from

    def seek(self, frame: int) -> None:
        """Show a frame: the one that is shown or the next one, the first where Pillow goes back when it is done.

        Raises EOFError: there is no such frame, as Pillow expects. ViewError: there are fewer frames than was said.
        """
        if frame >= self.n_frames:
            raise EOFError(f"there are {self.n_frames} frames")
        while self._at < frame:
            self._at += 1
            self.frombytes(self._next().tobytes())

    def tell(self) -> int:
        """Number of the frame that is shown."""
        return self._at

    def _next(self) -> np.ndarray:
        found = next(self._frames, None)
        if found is None:
            raise ViewError(f"the clip ends after {self._at} frames of {self.n_frames}", hint="record it again")
        return np.ascontiguousarray(found)
