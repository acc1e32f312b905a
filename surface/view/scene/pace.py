"""How many samples per pixel a live picture can afford."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

#: Samples per pixel of each quality where nothing is in a hurry.
SAMPLES = {"full": 4, "fast": 1}
#: A live picture of quality "fast" is drawn at this share of its size where the processor draws it.
SCALE = 0.6
#: A live frame may take this long to draw before its samples are given up, seconds.
BUDGET_S = 0.020
_FRAMES = 15
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")


class Pace:
    """Chooses samples per pixel: all of them for stills, for live pictures what the machine keeps up with.

    Drawing in software, where samples cost as much as everything else together, live pictures begin with one
    (their edges are smoothed afterwards); elsewhere they begin with all and fall back when frames take too long.

    Parameters
    ----------
    quality : "full" or "fast".
    wanted : samples per pixel asked for; None = choose.
    software : whether the picture is drawn by the processor.
    """

    def __init__(self, quality: str, wanted: int | None = None, *, software: bool = False) -> None:
        self._free = wanted is None
        self._software = software
        self._quality = quality
        self.samples, self.scale = SAMPLES[quality] if wanted is None else wanted, 1.0
        self.live = False
        self._frames, self._seconds = 0, 0.0

    @property
    def wanted(self) -> tuple[int, float]:
        """Samples per pixel, and the share of the picture's size to draw at."""
        return self.samples, self.scale

    @property
    def hurried(self) -> bool:
        """Whether pictures move and the processor draws them."""
        return self.live and self._free and self._software

    def begin_live(self) -> None:
        """From now on frames are in a hurry."""
        if not self.live and self._free and self._software:
            self.samples, self.scale = 1, SCALE if self._quality == "fast" else 1.0
        self.live = True

    def note(self, seconds: float) -> None:
        """A live frame took this long to draw; falls back to one sample when many in a row were too slow."""
        if not self._free or self.samples == 1:
            return
        self._frames += 1
        self._seconds += seconds
        if self._frames == _FRAMES:
            if self._seconds > BUDGET_S * _FRAMES:
                self.samples = 1
            self._frames, self._seconds = 0, 0.0


def is_software(ctx: moderngl.Context) -> bool:
    """Whether the context draws on the processor."""
    renderer = ctx.info["GL_RENDERER"].lower()
    return any(name in renderer for name in _SOFTWARE)
