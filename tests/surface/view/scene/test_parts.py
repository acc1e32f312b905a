"""surface.view.scene.parts"""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from ball_head import BallPart, eye

from surface.view.draw.programs import build
from surface.view.pictures.offscreen import open_context
from surface.view.scene.parts import PartBuffers


@pytest.fixture
def ctx(gl: None) -> Iterator[moderngl.Context]:
    made = open_context()
    yield made
    made.release()


def buffers_of(ctx: moderngl.Context, part: BallPart) -> PartBuffers:
    return PartBuffers(ctx, part, build(ctx, ("light.glsl", "hair.vert"), ("flat.frag",)), {})


def held(buffers: PartBuffers) -> tuple[np.ndarray, np.ndarray]:
    assert buffers._dynamic is not None
    position, normal = buffers._dynamic.positions.read(), buffers._dynamic.normals.read()
    return np.frombuffer(position, np.float32).reshape(-1, 3), np.frombuffer(normal, np.float32).reshape(-1, 3)


@pytest.mark.parametrize("ranges", [[(3, 9), (40, 41)], [(0, 700)], []])
def test_exactly_what_changed_is_sent(ctx: moderngl.Context, ranges: list[tuple[int, int]]) -> None:
    part = eye("left_eye")
    buffers = buffers_of(ctx, part)
    before = part.vertices.copy()
    part.vertices += 5
    part.normals[:] = -part.normals
    assert buffers.upload(ranges) == sum(stop - start for start, stop in ranges)
    touched = np.zeros(len(before), bool)
    for start, stop in ranges:
        touched[start:stop] = True
    if touched.sum() > len(before) / 2:
        touched[:] = True
    wanted = np.where(touched[:, None], part.vertices, before)
    assert (held(buffers)[0] == wanted).all()
    assert (held(buffers)[1][touched] == part.normals[touched]).all()
    buffers.release()


def test_arrays_that_are_not_contiguous_are_sent_rightly(ctx: moderngl.Context) -> None:
    part = eye("left_eye")
    part.vertices = np.asfortranarray(part.vertices)
    buffers = buffers_of(ctx, part)
    assert (held(buffers)[0] == part.vertices).all()
    buffers.release()
