"""Adaptive sampling: chooses samples per pixel and resolution of live pictures by how long their frames take."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

#: Samples per pixel of each quality where drawing time does not matter.
SAMPLES = {"full": 4, "fast": 1}
#: A live picture of quality "fast" is drawn at this share of its size where the processor draws it.
SCALE = 0.6
#: If live frames take longer than this to draw, seconds, they fall back to one sample.
BUDGET_S = 0.020
_FRAMES = 15
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")


class AdaptiveSampling:
    """Chooses samples per pixel: all of them for stills, for live pictures as many as the machine can draw in time.

    Drawn in software, where samples cost as much as everything else together, live pictures begin with one
    (their edges are smoothed afterwards); otherwise they begin with all and fall back when frames take too long.

    Parameters
    ----------
    quality : "full" or "fast".
    samples : fixed samples per pixel; None = adaptive.
    software : whether the picture is drawn by the processor.

    Attributes
    ----------
    settings : samples per pixel, and the share of the picture's size to draw at.
    live : whether :meth:`start_live` was called.
    """

    def __init__(self, quality: str, samples: int | None = None, *, software: bool = False) -> None:
        self._adaptive, self._software = samples is None, software
        self._live_scale = SCALE if quality == "fast" else 1.0
        self.settings = SAMPLES[quality] if samples is None else samples, 1.0
        self.live = False
        self._frames, self._seconds = 0, 0.0

    @property
    def simplified(self) -> bool:
        """Whether pictures are live and drawn by the processor, which then draws simpler ones."""
        return self.live and self._adaptive and self._software

    def start_live(self) -> None:
        """Switch to live pictures: from now on drawing time matters."""
        self.live = True
        if self.simplified:
            self.settings = 1, self._live_scale

    def add_frame(self, seconds: float) -> None:
        """Count a live frame's drawing time; falls back to one sample when the mean of the last frames was too slow."""
        if not self._adaptive or self.settings[0] == 1:
            return
        self._frames += 1
        self._seconds += seconds
        if self._frames == _FRAMES:
            if self._seconds > BUDGET_S * _FRAMES:
                self.settings = 1, self.settings[1]
            self._frames, self._seconds = 0, 0.0


def is_software(ctx: moderngl.Context) -> bool:
    """Whether the context draws on the processor."""
    renderer = ctx.info["GL_RENDERER"].lower()
    return any(name in renderer for name in _SOFTWARE)
