"""Draws a face in motion as a film, frame by frame, not in real time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from controller.base.parameters import Floats
from controller.face.still import Still, for_head
from controller.layers.idle.motion import IdleMotion
from surface.head.model.parameters import head_angles
from surface.view.pictures.clip import write_clip
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.framing import framed

FPS = 30.0
"""Default number of frames per second."""


def draw_film(
    still: Still,
    rows: Floats,
    out: Path,
    fps: float = FPS,
    sound: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    lives: Floats | None = None,
) -> int:
    """Draw the head of ``still`` with each row of values, and write the clip, completely or not at all.

    rows : (n, P) float64, one for each frame. out : .mp4, .webp or .gif. sound : sound file for a .mp4.
    progress : called with (done, total). lives : (n, 2) float64, for each frame how far breath lifts the chest, mm, and
    the share by which pupils are wider, see :meth:`surface.head.Head.live`; None: those of the stage's idle motion.

    Returns the number of frames that were written.

    Raises ViewError: see :func:`surface.view.pictures.clip.write_clip`, or OpenGL is missing.
    """
    shown = idle_lives(still, len(rows), fps) if lives is None else lives
    return write_clip(_pictures(still, rows, fps, progress, shown), out, fps=fps, sound=sound)


def idle_lives(still: Still, count: int, fps: float) -> Floats:
    """Return (count, 2) float64: breath, mm, and pupils, a share, of idle motion in each frame, by the settings and the
    seed of the stage.

    They are 0 without a stage, or for one whose liveliness is 0, as in a run.
    """
    stage, lives = still.stage, np.zeros((count, 2))
    if stage is None or stage.settings.liveliness <= 0.0:
        return lives
    motion = IdleMotion(still.parameters, stage.life, stage.settings.seed)
    motion.liveliness = stage.settings.liveliness
    for number in range(count):
        motion.update(number / fps, looking=False)
        lives[number] = motion.beside
    return lives


def _pictures(
    still: Still, rows: Floats, fps: float, progress: Callable[[int, int], None], lives: Floats
) -> Iterator[np.ndarray]:
    head, look = still.load_head(still.chord_mm), still.look
    camera = framed(look.make_camera(), head, worn=look.dressed)
    with Offscreen(
        head, still.size, quality=look.still_quality, theme=look.make_theme(), evaluator=look.evaluator
    ) as screen:
        for number, row in enumerate(rows):
            values = for_head(row, head.parameters, still.parameters)
            head.sway.advance(head_angles(values), number / fps)
            head.live(*lives[number].tolist())
            yield screen.render(values, camera)
            progress(number + 1, len(rows))


def base_of(still: Still, values: Floats, mask: np.ndarray) -> Floats:
    """Return the rows (n, P) of a motion, with the values of ``still`` for the parameters that it does not move.

    values : (n, P) of the motion. mask : (P,) bool, which parameters it moves.
    """
    return np.clip(np.where(mask, values, still.values), still.parameters.low, still.parameters.high)
