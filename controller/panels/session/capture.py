"""Pictures and clips of the face, and recordings of what it shows as a table that ``omote play`` plays."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from controller.base.errors import OMOTE_ERRORS
from controller.base.files import replacing
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.face.face import Recorder
from controller.panels.session.jobs import Jobs
from controller.panels.session.problems import Problems
from controller.takes.livelink import Take
from surface.view.docks import PictureArea
from surface.view.pictures.clip import write_clip
from surface.view.pictures.sheet import write_png

MAX_S = 600.0
_CLIP_HEIGHT = 480


class Capture:
    """Takes pictures and records, into ``folder``.

    area : of the window, which gives the next picture. newest : the newest parameters (P,). clock : seconds.
    parameters : default: those of the base vocabulary.
    jobs : writes clips beside the picture.
    message : what was written last, or why it was not. last : the last recording as a take, which can be edited.
    """

    def __init__(
        self, area: PictureArea, newest: Callable[[], Floats], folder: Path,
        clock: Callable[[], float] = time.monotonic, parameters: Parameters | None = None, jobs: Jobs | None = None,
    ) -> None:  # fmt: skip
        self._jobs, self._clip_began = jobs or Jobs(Problems()), 0.0
        self._clip: Recorder | None = None
        self._area, self._newest, self._folder, self._clock = area, newest, folder, clock
        self._parameters = parameters or PARAMETERS
        self._rows: list[Floats] | None = None
        self._began = 0.0
        self._promised: set[Path] = set()  # names of clips that are being written
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

    @property
    def filming(self) -> bool:
        """Whether it takes a clip."""
        return self._clip is not None

    def toggle_clip(self) -> None:
        """Begin a clip of the face, or end it and write it; a longer one has fewer pictures a second."""
        if self._clip is None:
            self._clip, self._clip_began = Recorder(height=_CLIP_HEIGHT, whole=True), self._clock()
            return
        clip, self._clip = self._clip, None
        if len(clip.frames) < 2:
            self.message = "a clip needs two pictures at least"
            return
        path = self._free("clip", ".webp")
        self._promised.add(path)
        self.message = f"writing {path}"
        self._jobs.start(f"writing {path.name}", lambda _: self._write_clip(clip, path),
                         lambda count: self._report_written(path, f", {count} pictures"))  # fmt: skip

    def _write_clip(self, clip: Recorder, path: Path) -> int:
        """Write a clip, in another thread; returns how many pictures it has."""
        rate_hz = (len(clip.frames) - 1) / (clip.times_s[-1] - clip.times_s[0])
        try:
            return write_clip(clip.frames, path, fps=rate_hz)
        except OMOTE_ERRORS as error:
            self.message = str(error)
            raise

    def _report_written(self, path: Path, more: str = "") -> None:
        self.message = f"wrote {path}{more}"

    def _film(self) -> None:
        """Take the next picture for the clip where one is due, and nobody else wants it."""
        clip, at_s = self._clip, self._clock() - self._clip_began
        if clip is not None and clip.wants(at_s) and self._area.wanted is None:
            self._area.wanted = lambda picture: self._add_to_clip(clip, picture, at_s)

    def _add_to_clip(self, clip: Recorder, picture: np.ndarray, at_s: float) -> None:
        """Add a picture to a clip; one of another size ends it, as where the window was resized."""
        if clip is not self._clip:
            return
        clip.keep(picture, at_s)
        if clip.frames[-1].shape != clip.frames[0].shape:
            del clip.frames[-1], clip.times_s[-1]
            self.toggle_clip()

    def toggle(self) -> None:
        """Begin a recording, or end it and write it."""
        if self._rows is None:
            self._rows, self._began = [], self._clock()
            return
        rows, self._rows = self._rows, None
        if rows:
            self.last = _make_take(self._parameters, np.array(rows))
            path = self._free("recording", ".csv")
            self._write(path, lambda to: _write_table(to, self._parameters.names, np.array(rows)))

    def __call__(self) -> None:
        """Add the present face to the recording; called once per frame. It ends automatically after ten minutes."""
        self._film()
        if self._rows is None:
            return
        self._rows.append(np.append(self.seconds, self._newest()))
        if self.seconds > MAX_S:
            self.toggle()

    def _write_picture(self, picture: np.ndarray) -> None:
        self._write(self._free("face", ".png"), lambda to: write_png(picture, to))

    def _write(self, path: Path, write: Callable[[Path], None]) -> None:
        try:
            write(path)
            self._report_written(path)
        except OMOTE_ERRORS as error:
            self.message = str(error)

    def _free(self, stem: str, suffix: str) -> Path:
        """Return the first name with a number that no file has."""
        number = 1
        while (path := self._folder / f"{stem}{number}{suffix}").exists() or path in self._promised:
            number += 1
        return path


def _make_take(parameters: Parameters, rows: Floats) -> Take:
    values = rows[:, 1:].copy()
    values.flags.writeable = False
    return Take(
        "recording", rows[:, 0] - rows[0, 0], values, np.ones(len(parameters), bool), parameters.low, parameters.high
    )


def _write_table(path: Path, columns: Sequence[str], rows: Floats) -> None:
    names = ",".join(("time", *columns))
    with replacing(path) as temporary:
        np.savetxt(temporary, rows, fmt="%.5f", delimiter=",", header=names, comments="", encoding="utf-8")
