"""The face at its own clock: the newest parameters to the head, the head to a picture.

It reads parameters from a mailbox and never waits for links or servos.
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
from controller.base.mailboxes import Mailbox
from controller.base.parameters import Floats, Parameters
from controller.stage.stage import FaceSettings

if TYPE_CHECKING:
    from surface.head import Head  # start-up: the body gets its orders first
    from surface.view.pictures.offscreen import Offscreen  # start-up: the body gets its orders first

Image = NDArray[np.uint8]


class HeadValues:
    """Picks a head's parameters out of the full vector.

    Parameters
    ----------
    mailbox : where the full vector (p,) is published.
    parameters : names of the full vector.
    wanted : names the head understands; names omote does not know stay 0.

    Attributes
    ----------
    full : (p,) float64, the full vector of the last call.
    values : (h,) float64, the head's share of it.
    """

    def __init__(self, mailbox: Mailbox, parameters: Parameters, wanted: Sequence[str]) -> None:
        place = {name: i for i, name in enumerate(parameters.names)}
        self._mailbox = mailbox
        self.full = np.zeros(len(parameters.names))
        self._from = np.array([place[name] for name in wanted if name in place], dtype=np.intp)
        self._to = np.array([i for i, name in enumerate(wanted) if name in place], dtype=np.intp)
        self.values = np.zeros(len(wanted))
        self.stamp_ns = 0

    def __call__(self) -> Floats:
        """The newest values in the head's order, (h,) float64; the same array each time."""
        _, self.stamp_ns = self._mailbox.read(self.full)
        self.values[self._to] = self.full[self._from]
        return self.values


class Recorder:
    """Keeps a few small pictures of a run: frames for a clip, moments for a contact sheet.

    Parameters
    ----------
    clip_hz : pictures per second in the clip.
    height : height of the kept pictures (pixels).
    most : pictures kept. A longer run keeps every second one, then every fourth, and so on: all of it, in no more
        memory.
    """

    def __init__(self, *, clip_hz: float = 12.5, height: int = 360, most: int = 400) -> None:
        self.clip_hz = clip_hz
        self._most = most
        self.height = height
        self.frames: list[Image] = []
        self.times_s: list[float] = []
        self._next_s = 0.0

    def wants(self, time_s: float) -> bool:
        """Whether a picture is due."""
        return time_s >= self._next_s

    def keep(self, picture: Image, time_s: float) -> None:
        """Keep the middle square of one picture (h, w, 3) uint8, made smaller."""
        step = max(1, picture.shape[0] // self.height)
        self.frames.append(_shrink(_middle_square(picture), step))
        self.times_s.append(time_s)
        if len(self.frames) > self._most:
            self.frames, self.times_s, self.clip_hz = self.frames[::2], self.times_s[::2], self.clip_hz / 2
        self._next_s = (int(time_s * self.clip_hz) + 1) / self.clip_hz


def _middle_square(picture: Image) -> Image:
    h, w = picture.shape[:2]
    side = min(h, w)
    top, left = (h - side) // 2, (w - side) // 2
    return picture[top : top + side, left : left + side]


def _shrink(picture: Image, step: int) -> Image:
    """Mean of ``step`` x ``step`` pixels."""
    h, w = picture.shape[0] // step * step, picture.shape[1] // step * step
    total = np.zeros((h // step, w // step, 3), dtype=np.uint16)
    for row in range(step):
        for column in range(step):
            total += picture[row:h:step, column:w:step]
    return (total // (step * step)).astype(np.uint8)


class FrameLog:
    """Counts frames, and what they cost.

    Attributes
    ----------
    frames : frames drawn.
    moved : frames whose values differed from the frame before.
    frame_ms : time each frame took (ms).
    """

    def __init__(self) -> None:
        self.frames = 0
        self.moved = 0
        self.frame_ms = Samples()
        self._previous: Floats | None = None
        self._first_ns = self._last_ns = 0
        self._start_to_first_s = 0.0

    def add(self, values: Floats, began_ns: int, ended_ns: int) -> None:
        """Note one frame of ``values`` : (h,), drawn between two monotonic times (ns)."""
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
        """Frames, frames per second, milliseconds a frame, and how many frames differed from the one before."""
        seconds = (self._last_ns - self._first_ns) / 1e9
        return {
            "frames": self.frames,
            "seconds": seconds,
            "frames_per_second": self.frames / seconds if seconds else 0.0,
            "frames_with_motion": self.moved,
            "frame_ms": self.frame_ms.summary(),
            "start_to_first_frame_s": self._start_to_first_s,
            "size": list(settings.size),
            "quality": settings.quality,
            "renderer": renderer,
        }


def process_age_s() -> float:
    """Seconds since the operating system started this process; 0 where it does not tell."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        uptime = float(Path("/proc/uptime").read_text().split()[0])
        return uptime - int(fields[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


class HeadlessFace:
    """Draws frame after frame without a display.

    Parameters
    ----------
    head : the head to draw.
    settings : size, rate and quality.
    values : gives the head's newest values, (h,) float64.
    recorder : takes pictures along the way; None reads none back.

    Raises
    ------
    ViewError
        when there is no OpenGL.
    """

    def __init__(
        self,
        head: Head,
        settings: FaceSettings,
        values: Callable[[], Floats],
        recorder: Recorder | None = None,
    ) -> None:
        from surface.view.pictures.offscreen import Offscreen  # start-up: the body gets its orders first

        self._screen: Offscreen = Offscreen(
            head, settings.size, quality=settings.quality, theme=settings.make_theme(), evaluator=settings.evaluator
        )
        self._camera = settings.make_camera()
        self._values = values
        self._recorder = recorder
        self._settings = settings
        self._log = FrameLog()
        self._screen.go_live()
        self._screen.draw(np.zeros(len(head.parameters)), self._camera)  # what loads at the first frame loads now

    def run(self, keep_going: Callable[[], bool]) -> None:
        """Draw until ``keep_going()`` is false, at most ``fps`` times a second."""
        started = time.monotonic_ns()
        for now in Clock(self._settings.fps, prompt=True).run(keep_going):
            values = self._values()
            self._draw(values, (now - started) / 1e9)
            self._log.add(values, now, time.monotonic_ns())

    def _draw(self, values: Floats, time_s: float) -> None:
        self._screen.draw(values, self._camera)
        if self._recorder is not None and self._recorder.wants(time_s):
            self._recorder.keep(self._screen.read(), time_s)

    def close(self) -> None:
        """Give the graphics memory back."""
        self._screen.close()

    def report(self) -> dict[str, object]:
        """What was drawn; see :meth:`FrameLog.report`."""
        evaluator = self._screen.renderer.evaluator
        return {
            **self._log.report(self._settings, self._screen.ctx.info["GL_RENDERER"]),
            "evaluator": evaluator.name,
            "evaluator_chosen": evaluator.reason,
        }
