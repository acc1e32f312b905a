"""surface.view.draw.fences"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ball_head import BallHead

from surface.view import Offscreen
from surface.view.draw.fences import FrameFence
from surface.view.pictures.offscreen import open_context


class RecordingQuery:
    """In place of OpenGL's query: no real one says when it was asked for its result."""

    def __init__(self, number: int, events: list[str]) -> None:
        self.number, self.events = number, events

    def __enter__(self) -> None:
        self.events.append(f"mark {self.number}")

    def __exit__(self, *error: Any) -> None:
        pass

    @property
    def samples(self) -> int:
        self.events.append(f"wait {self.number}")
        return 0


def test_each_frame_waits_for_the_one_before_after_it_has_marked_its_own_end() -> None:
    events: list[str] = []
    numbers = iter((0, 1))
    nothing = SimpleNamespace(clear=lambda: None)
    ctx: Any = SimpleNamespace(
        framebuffer=lambda buffers: nothing,
        renderbuffer=lambda size, components: None,
        query=lambda samples: RecordingQuery(next(numbers), events),
    )
    fence = FrameFence(ctx)
    for _ in range(3):
        fence.end_frame()
    assert events == ["mark 0", "mark 1", "wait 0", "mark 0", "wait 1"]


def test_it_waits_with_real_queries(gl: None) -> None:
    ctx = open_context()
    fence = FrameFence(ctx)
    for _ in range(5):
        fence.end_frame()
    assert ctx.error == "GL_NO_ERROR"
    fence.release()
    ctx.release()


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_a_picture_drawn_with_fences_is_the_picture(gl: None, frames: int) -> None:
    """As on a graphics processor, in software: what is read after any number of frames is the last of them."""
    with Offscreen(BallHead(), (60, 50)) as still, Offscreen(BallHead(), (60, 50)) as live:
        live._fence = FrameFence(live.ctx)
        for k in range(frames):
            live.draw(np.full(len(live.head.parameters), 0.1 * k))
        wanted = still.render(np.full(len(live.head.parameters), 0.1 * (frames - 1)))
        assert np.abs(live.read().astype(int) - wanted).mean() < 1.0
