"""Pictures of the face, and recordings of what it shows as a table that ``omote play`` plays."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from controller.base.errors import OMOTE_ERRORS
from controller.base.files import replacing
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.takes.livelink import Take
from surface.view.docks import PictureArea
from surface.view.pictures.sheet import write_png

LONGEST_S = 600.0


class Capture:
    """Takes pictures and records, into ``folder``.

    area : of the window, which gives the next picture. newest : the newest parameters (P,). clock : seconds.
    parameters : without them, those of the base vocabulary.
    message : what was written last, or why it was not. last : the last recording as a take, which can be edited.
    """

    def __init__(
        self, area: PictureArea, newest: Callable[[], Floats], folder: Path,
        clock: Callable[[], float] = time.monotonic, parameters: Parameters | None = None,
    ) -> None:  # fmt: skip
        self._area, self._newest, self._folder, self._clock = area, newest, folder, clock
        self._parameters = parameters or PARAMETERS
        self._rows: list[Floats] | None = None
        self._began = 0.0
        self.message = ""
        self.last: Take | None = None

    @property
    def recording(self) -> bool:
        """Whether it records."""
        return self._rows is not None

    @property
    def seconds(self) -> float:
        """How long it has recorded, s."""
        return self._clock() - self._began if self.recording else 0.0

    def take_picture(self) -> None:
        """Write the next picture of the face, without the panel."""
        self._area.wanted = self._write_picture

    def toggle(self) -> None:
        """Begin a recording, or end it and write it."""
        if self._rows is None:
            self._rows, self._began = [], self._clock()
            return
        rows, self._rows = self._rows, None
        if rows:
            self.last = _take_of(self._parameters, np.array(rows))
            path = self._free("recording", ".csv")
            self._write(path, lambda to: _write_table(to, self._parameters.names, np.array(rows)))

    def __call__(self) -> None:
        """Add the present face to the recording; called once a frame. It ends by itself after ten minutes."""
        if self._rows is None:
            return
        self._rows.append(np.append(self.seconds, self._newest()))
        if self.seconds > LONGEST_S:
            self.toggle()

    def _write_picture(self, picture: np.ndarray) -> None:
        self._write(self._free("face", ".png"), lambda to: write_png(picture, to))

    def _write(self, path: Path, write: Callable[[Path], None]) -> None:
        try:
            write(path)
            self.message = f"wrote {path}"
        except OMOTE_ERRORS as error:
            self.message = str(error)

    def _free(self, stem: str, suffix: str) -> Path:
        """The first name with a number that no file has."""
        number = 1
        while (path := self._folder / f"{stem}{number}{suffix}").exists():
            number += 1
        return path


def _take_of(parameters: Parameters, rows: Floats) -> Take:
    values = rows[:, 1:].copy()
    values.flags.writeable = False
    return Take(
        "recording", rows[:, 0] - rows[0, 0], values, np.ones(len(parameters), bool), parameters.low, parameters.high
    )


def _write_table(path: Path, columns: Sequence[str], rows: Floats) -> None:
    names = ",".join(("time", *columns))
    with replacing(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.5f", delimiter=",", header=names, comments="", encoding="utf-8")
