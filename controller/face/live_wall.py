"""Draws all heads of a stage into one picture, in the context of a window."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from controller.base.mailboxes import Mailbox
from controller.base.parameters import Floats, Parameters
from controller.face.wall import LoadedHead, grid
from surface.head import Crowd
from surface.head.model.parameters import head_angles
from surface.view.draw.placing import Box, Placing
from surface.view.draw.renderer import Renderer
from surface.view.live import LiveDrawing
from surface.view.scene.camera import Camera

if TYPE_CHECKING:
    import moderngl


FRAME_S = 0.05
"""Time after which a frame draws no further head: the window, which draws them, also has to see clicks and keys."""


class LiveWall:
    """The heads of a stage, each in a tile of one picture.

    A renderer takes some tenths of a second to make, so one is made in each frame: heads appear one after the other,
    and the window goes on. Where all heads take longer than ``FRAME_S`` to draw, they take turns.

    loaded : from :func:`controller.face.wall.load_heads`. mailboxes : of all heads, in the order of the stage.
    quality : "full" or "fast".
    """

    def __init__(
        self, loaded: Sequence[LoadedHead], parameters: Parameters, mailboxes: Sequence[Mailbox], quality: str
    ) -> None:
        self._waiting, self._groups = list(loaded), list[_Group]()
        self._turns: list[tuple[_Group, int]] = []  # a head and its number in the stage, the next to be drawn first
        self._mailboxes, self._quality = mailboxes, quality
        self._rows = np.zeros((len(mailboxes), len(parameters) + 1))  # with a 0 for parameters that omote does not know
        self._size = 0, 0
        self._picture: moderngl.Framebuffer | None = None
        self._placing: Placing | None = None

    def boxes(self, size: tuple[float, float]) -> list[tuple[float, float, float, float]]:
        """Left, top, width, height of each head's tile in a picture of a size, in its unit, from its top left."""
        columns, rows = grid(len(self._mailboxes), (int(size[0]), int(size[1])))
        width, height = max(1.0, size[0] // columns), max(1.0, size[1] // rows)
        left, top = (size[0] - columns * width) // 2, (size[1] - rows * height) // 2
        return [
            (left + i % columns * width, top + i // columns * height, width, height)
            for i in range(len(self._mailboxes))
        ]

    def draw(self, ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Framebuffer:
        """The next picture of all heads, of ``size``, pixels."""
        if self._waiting:
            self._add_group(_Group(ctx, self._waiting.pop(0), self._quality))
        if self._picture is None or size != self._size:
            self._make_picture(ctx, size)
        assert self._picture is not None and self._placing is not None
        for mailbox, row in zip(self._mailboxes, self._rows, strict=True):
            mailbox.read(row[:-1])
        lives = np.array([mailbox.life for mailbox in self._mailboxes])
        boxes = [_from_below(box, size) for box in self.boxes(size)]
        for group in self._groups:
            group.posed = False
        ends_s = time.perf_counter() + FRAME_S
        for drawn, (group, place) in enumerate(self._turns, start=1):
            group.draw(self._rows, lives, place, boxes[place][2:])
            self._placing.copy(self._picture, group.drawing.target.picture, boxes[place])
            if time.perf_counter() >= ends_s:
                self._turns = self._turns[drawn:] + self._turns[:drawn]
                break
        return self._picture

    def _add_group(self, group: _Group) -> None:
        self._groups.append(group)
        self._turns = [(group, place) for place in group.places] + self._turns

    def _make_picture(self, ctx: moderngl.Context, size: tuple[int, int]) -> None:
        self._release_picture()
        self._size = size
        self._picture = ctx.framebuffer([ctx.texture(size, 4)])
        self._picture.clear()
        self._placing = self._placing or Placing(ctx)

    def _release_picture(self) -> None:
        if self._picture is not None:
            self._picture.color_attachments[0].release()
            self._picture.release()
            self._picture = None

    def release(self) -> None:
        """Release the graphics memory."""
        self._release_picture()
        for group in self._groups:
            group.drawing.release()
        if self._placing is not None:
            self._placing.release()
        self._groups, self._turns, self._placing = [], [], None


class _Group:
    """Heads that look alike: one that is posed by its renderer, or several that are posed in one batch.

    places : their numbers in the stage. drawing : draws one of them at a time. posed : whether a batch is posed as it
    shall be drawn in this frame.
    """

    def __init__(self, ctx: moderngl.Context, loaded: LoadedHead, quality: str) -> None:
        face, alone = loaded.stage.settings.face, len(loaded.places) == 1
        self.places, self._head, self._loaded = loaded.places, loaded.head, loaded
        self._crowd = None if alone else Crowd(loaded.head, len(loaded.places))
        evaluator = face.evaluator if alone else "cpu"
        renderer = Renderer(ctx, loaded.head, quality=quality, theme=face.make_theme(), evaluator=evaluator)
        self.drawing = LiveDrawing(renderer, posed_elsewhere=not alone)
        self.posed = False
        self._tile, self._camera = (0, 0), Camera.front()

    def draw(self, rows: Floats, lives: Floats, place: int, tile: tuple[int, int]) -> None:
        """Draw head ``place`` of the stage in the pose of its row of ``rows (n, P + 1)``, with its breath and pupils in
        ``lives (n, 2)``, as large as a tile, pixels.

        Heads that are posed in one batch are so once for all, until ``posed`` is set to False.
        """
        if tile != self._tile:
            self._tile, self._camera = tile, self._loaded.camera(tile)
        self.drawing.size = tile
        if self._crowd is None:
            values = rows[place, self._loaded.order]
            self._head.sway.advance(head_angles(values), time.monotonic())
            self._head.live(*lives[place].tolist())
            self.drawing.draw(values, self._camera)
            return
        if not self.posed:
            self.posed = True
            self._crowd.pose(rows[self.places][:, self._loaded.order], lives[self.places])
        self._crowd.show(self.places.index(place))
        self.drawing.draw_present(self._camera)


def _from_below(box: tuple[float, float, float, float], size: tuple[int, int]) -> Box:
    """A box as OpenGL counts it, from the lower left corner."""
    left, top, width, height = (int(number) for number in box)
    return left, size[1] - top - height, width, height
