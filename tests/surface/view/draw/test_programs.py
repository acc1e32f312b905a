"""surface.view.draw.programs"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.base.errors import ViewError
from surface.view.draw import materials
from surface.view.draw.programs import assemble, build, set_uniforms, source
from surface.view.pictures.offscreen import open_context
from surface.view.scene.theme import THEMES


def test_text_begins_with_the_version_then_the_defines() -> None:
    text = assemble(("light.glsl", "skin.glsl"), {"LID_POINTS": 7})
    assert text.startswith("#version 140\n#define LID_POINTS 7\n")
    assert text.index("key_direction") < text.index("WIDE")


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("quality", ["full", "fast"])
def test_every_program_compiles(gl: None, quality: str, theme: str) -> None:
    ctx = open_context()
    try:
        made = materials.programs(ctx, quality, THEMES[theme], fine=materials.FINE, worn=materials.WORN)
        assert {material.program for material in materials.MATERIALS.values()} <= set(made)
    finally:
        ctx.release()


def test_a_refused_shader_names_its_files(gl: None, monkeypatch: pytest.MonkeyPatch) -> None:
    ctx = open_context()
    monkeypatch.setattr("surface.view.draw.programs.source", lambda name: "nonsense")
    try:
        with pytest.raises(ViewError, match=r"hair\.vert / flat\.frag"):
            build(ctx, ("hair.vert",), ("flat.frag",))
    finally:
        ctx.release()


def test_matrices_arrive_as_written_and_unknown_names_pass(gl: None) -> None:
    ctx = open_context()
    try:
        program = build(ctx, ("light.glsl", "hair.vert"), ("flat.frag",))
        matrix = np.arange(16.0).reshape(4, 4)
        set_uniforms(program, {"view_projection": matrix, "no_such_uniform": 1.0, "albedo": (1, 2, 3)})
        held = np.frombuffer(program["view_projection"].read(), np.float32).reshape(4, 4)
        assert pytest.approx(matrix) == held.T
        assert program["albedo"].value == (1, 2, 3)
    finally:
        ctx.release()


def test_shaders_stay_within_glsl_140(root: Path) -> None:
    files = sorted((root / "surface" / "view" / "draw" / "shaders").iterdir())
    assert len(files) > 15
    for file in files:
        assert "layout(" not in source(file.name)
        assert "#version" not in source(file.name)


def test_uniforms_of_every_kind(gl: None) -> None:
    ctx = open_context()
    try:
        program = ctx.program(
            vertex_shader="#version 140\nin vec3 at; uniform mat3 turn; uniform vec3 lids[2]; uniform float amount;"
            "uniform int unit; uniform vec3 colour; out vec3 sum;"
            "void main() { sum = turn * at + lids[1] * amount + colour * float(unit); gl_Position = vec4(0.0); }",
            varyings=["sum"],
        )
        ctx.clear_errors()
        turn, lids = np.arange(9.0).reshape(3, 3), np.array([[9.0, 9, 9], [1, 2, 4]])
        set_uniforms(program, {"turn": turn, "lids": lids, "amount": 0.5, "unit": 2, "colour": (10.0, 20.0, 40.0)})
        out = ctx.buffer(reserve=12)
        ctx.framebuffer([ctx.renderbuffer((1, 1), 4)]).use()
        array = ctx.vertex_array(program, [(ctx.buffer(np.float32([1, 10, 100]).tobytes()), "3f", "at")])
        array.transform(out, vertices=1)
        got = np.frombuffer(out.read(), np.float32)
        assert got == pytest.approx(turn @ [1, 10, 100] + 0.5 * lids[1] + 2 * np.array([10, 20, 40]))
    finally:
        ctx.release()


def test_a_program_without_fragments_fills_a_buffer(gl: None) -> None:
    ctx = open_context()
    try:
        made = build(
            ctx,
            ("sum.glsl", "rotate.glsl", "turn.glsl", "place.vert"),
            (),
            outputs=("out_position", "out_normal"),
            defines={"WIDTH": 64},
        )
        assert {"first", "count", "share"} <= set(made)
    finally:
        ctx.release()


def test_defines_come_before_every_file() -> None:
    text = assemble(("flat.frag",), {"INSIDE": "0.25", "B": 2})
    assert text == "#version 140\n#define INSIDE 0.25\n#define B 2\n" + source("flat.frag")
