"""Draws a face in motion, or the faces of a stage, as a film: frame by frame, not in real time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from controller.base.parameters import Flags, Floats
from controller.body.offline import play_offline
from controller.face.face import Image
from controller.face.still import Still, for_head
from controller.face.wall import Wall
from controller.stage.stage import Stage, heads_of
from surface.head.model.parameters import head_angles
from surface.view.pictures.clip import write_clip
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.framing import framed

FPS = 30.0
"""Default number of frames per second."""


def film_rows(
    still: Still, path: Path, motion: Floats, mask: Flags, lives: Floats | None, fps: float
) -> tuple[Floats, Floats]:
    """Return what the heads of ``still`` show at each of n frames: values (n, h, P), and lives (n, h, 2), breath and
    pupils, see :meth:`surface.head.Head.live`.

    A take or show is played on the heads of a stage with idle motion, or on several heads, as in a run. Otherwise the
    film shows the motion itself, with neither breath nor pupils unless they are recorded.

    path : the take, show or recording. motion : (n, P) its values. mask : (P,) bool, which parameters it moves.
    lives : (n, 2) those of a recording; None for others.

    Raises what :func:`controller.body.offline.play_offline` raises.
    """
    stage = _played_stage(still, recorded=lives is not None)
    alone = base_of(still, motion, mask)
    if stage is None:
        return alone[:, None], (np.zeros((len(alone), 2)) if lives is None else lives)[:, None]
    set_by_hand = still.values != still.parameters.rest
    held = [set_by_hand & ~mask] + [set_by_hand] * (len(heads_of(stage)) - 1)
    rows, beside = play_offline(stage, path, len(motion), fps, still.values, held)
    if lives is not None:
        rows[:, 0], beside[:, 0] = alone, lives  # layers, and so what is held, do not change a recording
    return rows, beside


def _played_stage(still: Still, *, recorded: bool) -> Stage | None:
    """Return the stage on which a film is played as in a run: one of several heads, or with idle motion, which a
    recording contains already. None: the film shows the motion itself."""
    if still.wall is not None or still.stage is None:
        return still.wall
    stage = heads_of(still.stage)[0]  # of several heads, if the options name a head, the film shows one
    return stage if stage.settings.liveliness > 0.0 and not recorded else None


def draw_film(
    still: Still,
    rows: Floats,
    lives: Floats,
    out: Path,
    fps: float = FPS,
    sound: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Draw the heads of ``still`` with each row of values, and write the clip, completely or not at all.

    rows, lives : (n, h, P), (n, h, 2) float64, for each frame and head; see :func:`film_rows`.
    out : .mp4, .webp or .gif. sound : sound file for a .mp4. progress : called with (done, total).

    Returns the number of frames that were written.

    Raises ViewError: see :func:`surface.view.pictures.clip.write_clip`, or OpenGL is missing.
    """
    draw = _head_pictures if still.wall is None else _wall_pictures
    pictures = _counted(draw(still, rows, lives, fps), len(rows), progress)
    return write_clip(pictures, out, fps=fps, sound=sound, count=len(rows))


def _counted(pictures: Iterator[Image], total: int, progress: Callable[[int, int], None]) -> Iterator[Image]:
    for done, picture in enumerate(pictures, start=1):
        yield picture
        progress(done, total)


def _head_pictures(still: Still, rows: Floats, lives: Floats, fps: float) -> Iterator[Image]:
    """Yield the pictures (h, w, 3) uint8 of one head."""
    head, look = still.load_head(still.chord_mm), still.look
    camera = framed(look.make_camera(), head, worn=look.dressed)
    with Offscreen(
        head, still.size, quality=look.still_quality, theme=look.make_theme(), evaluator=look.evaluator
    ) as screen:
        for number, ((row,), (life,)) in enumerate(zip(rows, lives, strict=True)):
            values = for_head(row, head.parameters, still.parameters)
            head.sway.advance(head_angles(values), number / fps)
            head.live(*life.tolist())
            yield screen.render(values, camera)


def _wall_pictures(still: Still, rows: Floats, lives: Floats, fps: float) -> Iterator[Image]:
    """Yield the pictures (h, w, 3) uint8 of all heads of a stage, side by side."""
    assert still.wall is not None
    with Wall(still.wall, still.parameters, still.size) as wall:
        for number, (row, life) in enumerate(zip(rows, lives, strict=True)):
            yield filled(wall.join(wall.pictures(row, life, number / fps)), still.size)


def filled(picture: Image, size: tuple[int, int]) -> Image:
    """Return a picture (h, w, 3) uint8 of at least a width and height, where its last column and row are repeated."""
    missing = [(0, max(0, wanted - there)) for wanted, there in zip(size[::-1], picture.shape, strict=False)]
    return np.pad(picture, [*missing, (0, 0)], mode="edge")


def base_of(still: Still, values: Floats, mask: Flags) -> Floats:
    """Return the rows (n, P) of a motion, with the values of ``still`` for the parameters that it does not move.

    values : (n, P) of the motion. mask : (P,) bool, which parameters it moves.
    """
    return np.clip(np.where(mask, values, still.values), still.parameters.low, still.parameters.high)
