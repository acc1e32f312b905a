"""Draws the face of a run frame by frame, from the newest parameters in a mailbox, and records pictures and statistics.

It never waits for links or servos.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controller.base.clock import Clock, Samples
from controller.base.errors import ControllerError
from controller.base.mailboxes import REST, Life, Mailbox
from controller.base.parameters import Floats, Parameters
from controller.stage.stage import FaceSettings

if TYPE_CHECKING:
    from surface.head import Head  # imported lazily, so that the control process (body) starts first
    from surface.view.pictures.offscreen import AdaptiveOffscreen, Offscreen  # imported lazily for the same reason
    from surface.view.scene.choice import QualityChoice  # imported lazily for the same reason

Image = NDArray[np.uint8]

_SHEET_PICTURES = 12
_SHEET_COLUMNS = 4


def head_indices(parameters: Parameters, wanted: Sequence[str]) -> NDArray[np.intp]:
    """Return the (h,) index of each of a head's parameters in the full vector (p,) with one more element at its end.

    The extra element is 0; unknown names have its index.
    """
    indices = {name: i for i, name in enumerate(parameters.names)}
    return np.array([indices.get(name, len(indices)) for name in wanted], dtype=np.intp)


class HeadValues:
    """Selects a head's parameters from the full vector in a mailbox; names that omote does not know stay 0.

    full : (p,) float64, the full vector of the last call. values : (h,) float64, those of the head.
    stamp_ns : arrival of the newest command in them (monotonic clock). replaced : called with the full vector, which it
    may modify, for instance by the face that the servos show; None: it is used unchanged.
    """

    def __init__(self, mailbox: Mailbox, parameters: Parameters, wanted: Sequence[str]) -> None:
        self._mailbox, self._parameters = mailbox, parameters
        self._padded = np.zeros(len(parameters.names) + 1)
        self.full = self._padded[:-1]
        self.stamp_ns = 0
        self.replaced: Callable[[Floats], None] | None = None
        self.follow(wanted)

    def follow(self, wanted: Sequence[str]) -> None:
        """Select the parameters of another head; ``wanted`` : their names."""
        self._indices, self.values = head_indices(self._parameters, wanted), np.zeros(len(wanted))

    @property
    def life(self) -> Life:
        """Breath and pupils that belong to the values of the last call."""
        return self._mailbox.life

    def listen(self, mailbox: Mailbox) -> None:
        """Read another mailbox of the same parameters."""
        self._mailbox = mailbox

    def __call__(self) -> Floats:
        """Return the newest values in the head's order, (h,) float64, always in the same array."""
        _, self.stamp_ns = self._mailbox.read(self.full)
        if self.replaced is not None:
            self.replaced(self.full)
        return np.take(self._padded, self._indices, out=self.values)


class Recorder:
    """Keeps a limited number of small pictures of a run, for a clip and a contact sheet.

    clip_hz : pictures per second in the clip. height : approximate height of the kept pictures (pixels).
    most : number of pictures kept; a longer run keeps only every second one, then every fourth, and so on.
    whole : whether to keep whole pictures instead of their central squares.
    """

    def __init__(self, *, clip_hz: float = 12.5, height: int = 360, most: int = 400, whole: bool = False) -> None:
        self.clip_hz, self.height, self._most, self._whole = clip_hz, height, most, whole
        self.frames: list[Image] = []
        self.times_s: list[float] = []
        self._next_s = 0.0

    def wants(self, time_s: float) -> bool:
        """Whether a picture is due."""
        return time_s >= self._next_s

    def keep(self, picture: Image, time_s: float) -> None:
        """Keep a picture (h, w, 3) uint8, reduced in size, or its central square."""
        height, width = picture.shape[:2] if self._whole else [min(picture.shape[:2])] * 2
        top, left = (picture.shape[0] - height) // 2, (picture.shape[1] - width) // 2
        step = max(1, picture.shape[0] // self.height)
        m, n = height // step, width // step
        kept, total = picture[top : top + m * step, left : left + n * step], np.zeros((m, n, 3), np.uint16)
        for row, column in np.ndindex(step, step):
            total += kept[row::step, column::step]
        self.frames.append((total // step**2).astype(np.uint8))
        self.times_s.append(time_s)
        if len(self.frames) > self._most:
            self.frames, self.times_s, self.clip_hz = self.frames[::2], self.times_s[::2], self.clip_hz / 2
        self._next_s = (int(time_s * self.clip_hz) + 1) / self.clip_hz

    def write(self, folder: Path) -> list[str]:
        """Write ``sheet.png`` and ``face.webp`` into ``folder`` and return their paths; none without pictures.

        Raises ControllerError: the folder cannot be made. ViewError: a picture cannot be written.
        """
        from surface.view.pictures.clip import write_clip  # imported lazily: few runs write pictures
        from surface.view.pictures.sheet import compose, write_png  # imported lazily: few runs write pictures

        if not self.frames:
            return []
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            hint = "choose another folder for the pictures"
            raise ControllerError(f"{folder}: cannot be made: {error.strerror}", hint=hint) from error
        chosen = np.unique(np.linspace(0, len(self.frames) - 1, _SHEET_PICTURES).round().astype(int))
        labels = [f"{self.times_s[i]:.1f} s" for i in chosen]
        sheet, clip = folder / "sheet.png", folder / "face.webp"
        write_png(compose([self.frames[i] for i in chosen], labels, columns=_SHEET_COLUMNS), sheet)
        write_clip(self.frames, clip, fps=self.clip_hz)
        return [str(sheet), str(clip)]


class FrameLog:
    """Statistics of frames.

    frames : number of frames. moved : number of frames whose values differ from those of the frame before.
    frame_ms : time of each frame. command_to_picture_ms : time from the arrival of a command to the end of the first
    frame that shows it.
    """

    def __init__(self) -> None:
        self.frames = self.moved = 0
        self.frame_ms, self.command_to_picture_ms = Samples(), Samples()
        self._stamp_ns = 0
        self._previous: Floats | None = None
        self._first_ns = self._last_ns = 0
        self._start_to_first_s = 0.0

    def add(self, values: Floats, began_ns: int, ended_ns: int, stamp_ns: int = 0) -> None:
        """Add a frame of ``values`` : (h,), drawn between two monotonic times (ns).

        stamp_ns : arrival of the newest command that the frame shows; 0 for none.
        """
        if stamp_ns > self._stamp_ns:
            self._stamp_ns = stamp_ns
            self.command_to_picture_ms.add((ended_ns - stamp_ns) / 1e6)
        if self._previous is None:
            self._first_ns = began_ns
            self._start_to_first_s = process_age_s()
        else:
            self.moved += bool((self._previous != values).any())
        self._previous = values.copy()
        self._last_ns = ended_ns
        self.frames += 1
        self.frame_ms.add((ended_ns - began_ns) / 1e6)

    def report(self, settings: FaceSettings, renderer: str) -> dict[str, object]:
        """Return the statistics for a report."""
        seconds = (self._last_ns - self._first_ns) / 1e9
        return {
            "frames": self.frames,
            "seconds": seconds,
            "frames_per_second": self.frames / seconds if seconds else 0.0,
            "frames_with_motion": self.moved,
            "frame_ms": self.frame_ms.summary(),
            "command_to_picture_ms": self.command_to_picture_ms.summary(),
            "start_to_first_frame_s": self._start_to_first_s,
            "size": list(settings.size),
            "quality": settings.quality,
            "renderer": renderer,
        }


def process_age_s() -> float:
    """Return the seconds since the operating system started this process; 0 if that is not known."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        uptime = float(Path("/proc/uptime").read_text().split()[0])
        return uptime - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


class HeadlessFace:
    """Draws frame after frame without a display (headless).

    values : returns the head's newest values, (h,) float64. recorder : keeps pictures; None: none is read back.

    Raises ViewError: OpenGL is missing.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: Callable[[], Floats],
        recorder: Recorder | None = None,
    ) -> None:
        from surface.head.model.parameters import head_angles  # imported lazily, so that the body starts first
        from surface.view.scene.framing import framed

        self._angles = head_angles
        self._screen = _open_screen(head, settings)
        self._head, self._settings = head, settings
        self._camera = framed(settings.make_camera(), head, worn=settings.dressed)
        self._values, self._recorder = values, recorder
        self._log = FrameLog()
        self._screen.go_live()
        self._screen.draw(np.zeros(len(head.parameters)), self._camera)  # loads code before the first frame is timed

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Draw while ``keep_going()`` returns True, at most ``fps`` times a second."""
        started = time.monotonic_ns()
        for now in Clock(self._settings.fps, prompt=True).run(keep_going):
            values, time_s = self._values(), (now - started) / 1e9
            self._head.sway.advance(self._angles(values), time_s)
            self._head.live(*getattr(self._values, "life", REST))
            self._screen.draw(values, self._camera)
            if self._recorder is not None and self._recorder.wants(time_s):
                self._recorder.keep(self._screen.read(), time_s)
            self._log.add(values, now, time.monotonic_ns(), getattr(self._values, "stamp_ns", 0))

    def close(self) -> None:
        """Free the graphics memory."""
        self._screen.close()

    def report(self) -> dict[str, object]:
        """Return the statistics of the frames; see :meth:`FrameLog.report`."""
        evaluator = self._screen.renderer.evaluator
        return {
            **self._log.report(self._settings, self._screen.ctx.info["GL_RENDERER"]),
            "evaluator": evaluator.name,
            "evaluator_chosen": evaluator.reason,
            **qualities(getattr(self._screen, "choice", None)),
        }


def _open_screen(head: Head, settings: FaceSettings) -> Offscreen | AdaptiveOffscreen:
    """Return what draws the picture in the quality of the settings."""
    from surface.view.pictures.offscreen import AdaptiveOffscreen, Offscreen  # imported lazily: the body starts first

    theme = settings.make_theme()
    if settings.quality == "auto":
        return AdaptiveOffscreen(head, settings.size, rate_hz=settings.fps, theme=theme, evaluator=settings.evaluator)
    return Offscreen(head, settings.size, quality=settings.quality, theme=theme, evaluator=settings.evaluator)


def qualities(choice: QualityChoice | None) -> dict[str, object]:
    """Return how long each quality was used and how often it changed, for a report; empty for a fixed quality."""
    return {} if choice is None else {"quality_seconds": dict(choice.seconds), "quality_switches": choice.switches}
