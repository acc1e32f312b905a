"""Shader programs: GLSL 140 text from the shaders folder, assembled and compiled, and their uniforms."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError

if TYPE_CHECKING:
    import moderngl


@cache
def source(name: str) -> str:
    """Text of one packaged shader file."""
    return resources.files("surface.view.draw").joinpath("shaders", name).read_text(encoding="utf-8")


def assemble(names: tuple[str, ...], defines: Mapping[str, int | str]) -> str:
    """One shader's text: version line, defines, then the named files in order."""
    lines = [f"#define {key} {value}\n" for key, value in defines.items()]
    return "#version 140\n" + "".join(lines) + "\n".join(source(name) for name in names)


def build(
    ctx: moderngl.Context,
    vertex: tuple[str, ...],
    fragment: tuple[str, ...],
    *,
    outputs: tuple[str, ...] = (),
    defines: Mapping[str, int | str] | None = None,
) -> moderngl.Program:
    """Compile and link the named files.

    vertex, fragment : shader files, in order; no fragment files for a program that only fills a buffer.
    outputs : what such a program writes, one after the other.
    defines : macros set before the files.

    Raises ViewError: when the driver refuses the shader; the message contains the driver's.
    """
    import moderngl  # optional

    shaders = {"vertex_shader": vertex, "fragment_shader": fragment}
    texts: dict[str, Any] = {kind: assemble(names, defines or {}) for kind, names in shaders.items() if names}
    if outputs:
        texts["varyings"] = outputs
    try:
        program = ctx.program(**texts)
    except moderngl.Error as error:
        raise ViewError(
            f"the graphics driver refused the shader {'+'.join(vertex)} / {'+'.join(fragment)}: {error}",
            hint="update the graphics driver, or set LIBGL_ALWAYS_SOFTWARE=1 to draw in software",
        ) from error
    ctx.clear_errors()  # moderngl queries every program for features that OpenGL 3.1 does not have
    return program


def set_uniforms(program: moderngl.Program, values: Mapping[str, Any]) -> None:
    """Set uniforms; names that the compiler removed are ignored.

    Numbers are set as they are; arrays as float32 in column-major order, so matrices are given as they are
    written on paper (row, column).
    """
    for name, value in values.items():
        uniform: Any = program.get(name, None)
        if uniform is None:
            continue
        if isinstance(value, int | float):
            uniform.value = value
        elif isinstance(value, tuple):
            uniform.write(_packed(value))
        else:
            array = np.asarray(value, np.float32)
            square = array.ndim == 2 and array.shape[0] == array.shape[1]
            uniform.write((array.T if square else array).tobytes())


@lru_cache(maxsize=256)
def _packed(numbers: tuple[float, ...]) -> bytes:
    """Uniform bytes of a vector; the same few are set in every frame."""
    return np.array(numbers, np.float32).tobytes()
