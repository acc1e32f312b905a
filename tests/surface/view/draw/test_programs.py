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
        made = materials.programs(ctx, quality, THEMES[theme])
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
