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


def drawn(ctx: moderngl.Context, buffers: PartBuffers, *which: int) -> int:
    """Triangles that a draw call sends."""
    ctx.framebuffer([ctx.renderbuffer((8, 8), 4)]).use()
    query = ctx.query(primitives=True)
    with query:
        buffers.draw(*which)
    return int(query.primitives)


def test_all_triangles_are_drawn_or_those_asked_for(ctx: moderngl.Context) -> None:
    buffers = buffers_of(ctx, eye("left_eye"))
    count = len(buffers.triangles)
    assert drawn(ctx, buffers) == count
    assert drawn(ctx, buffers, 0, 5) == 5
    assert drawn(ctx, buffers, count - 7, 7) == 7
    assert drawn(ctx, buffers, 3, 0) == 0
    buffers.release()


def test_static_data_is_read_as_its_type_says(ctx: moderngl.Context) -> None:
    part = eye("left_eye")
    program = ctx.program(
        vertex_shader="#version 140\nin vec3 position; in vec3 normal; in vec2 small; in float plain; out vec4 sum;"
        "void main() { sum = vec4(small, plain, position.x + normal.y); gl_Position = vec4(0.0); }",
        varyings=["sum"],
    )
    ctx.clear_errors()
    packed = np.zeros((len(part.vertices), 2), np.uint8)
    packed[:, 0], packed[:, 1] = 255, 51
    static = {"small": packed, "plain": np.arange(len(packed), dtype=np.float32)[:, None], "unused": packed}
    buffers = PartBuffers(ctx, part, program, static)
    out = ctx.buffer(reserve=16 * 3 * len(part.triangles))
    ctx.framebuffer([ctx.renderbuffer((1, 1), 4)]).use()  # without one, transform feedback does nothing
    buffers._array.transform(out, moderngl.POINTS)
    got = np.frombuffer(out.read(), np.float32).reshape(-1, 4)
    ids = part.triangles.ravel()
    assert got[:, :2] == pytest.approx(np.tile([1.0, 0.2], (len(ids), 1)))
    assert (got[:, 2] == ids).all()
    assert got[:, 3] == pytest.approx(part.vertices[ids, 0] + part.normals[ids, 1], abs=1e-4)
    buffers.release()


def test_buffers_that_a_shader_fills_hold_positions_and_normals_together(ctx: moderngl.Context) -> None:
    part = eye("left_eye")
    program = build(ctx, ("light.glsl", "hair.vert"), ("flat.frag",))
    buffers = PartBuffers(ctx, part, program, {}, on_gpu=True)
    assert buffers.feedback.size == 24 * len(part.vertices)
    assert buffers.upload() == 0 and buffers.upload([(0, 5)]) == 0
    assert buffers.outline() is None
    buffers.release()


def test_the_outline_is_what_is_drawn(ctx: moderngl.Context) -> None:
    part = eye("left_eye")
    buffers = buffers_of(ctx, part)
    part.changed = [(2, 5)]
    assert buffers.upload() == 3
    outline = buffers.outline()
    assert outline is not None and outline[0] is part.vertices and outline[1] is part.triangles
    buffers.release()


@pytest.mark.parametrize(("share", "whole"), [(0.5, False), (0.51, True)])
def test_more_than_half_is_sent_as_a_whole(ctx: moderngl.Context, share: float, whole: bool) -> None:
    part = eye("left_eye")
    part.vertices, part.normals = part.vertices[:600].copy(), part.normals[:600].copy()
    part.triangles = np.array([[0, 1, 2]])
    buffers = buffers_of(ctx, part)
    part.vertices += 1
    stop = int(share * 600)
    assert buffers.upload([(0, stop)]) == stop
    assert (held(buffers)[0][stop:] == part.vertices[stop:]).all() == whole
    buffers.release()
