"""Shader programs: GLSL 140 text from the shaders folder, put together and compiled."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError

if TYPE_CHECKING:
    import moderngl

VERSION = "#version 140\n"


@cache
def source(name: str) -> str:
    """Text of one packaged shader file."""
    return resources.files("surface.view.draw").joinpath("shaders", name).read_text(encoding="utf-8")


def assemble(names: tuple[str, ...], defines: Mapping[str, int | str]) -> str:
    """One shader's text: version line, defines, then the named files in order."""
    lines = [f"#define {key} {value}\n" for key, value in defines.items()]
    return VERSION + "".join(lines) + "\n".join(source(name) for name in names)


def build(
    ctx: moderngl.Context,
    vertex: tuple[str, ...],
    fragment: tuple[str, ...],
    *,
    outputs: tuple[str, ...] = (),
    defines: Mapping[str, int | str] | None = None,
) -> moderngl.Program:
    """Compile and link the named files.

    Parameters
    ----------
    vertex, fragment : shader files, in order; no fragment files for a program that only fills a buffer.
    outputs : what such a program writes, one after the other.
    defines : macros set before the files.

    Raises
    ------
    ViewError : when the driver refuses the shader; the message carries the driver's words.
    """
    import moderngl  # optional

    texts: dict[str, Any] = {"vertex_shader": assemble(vertex, defines or {})}
    if fragment:
        texts["fragment_shader"] = assemble(fragment, defines or {})
    if outputs:
        texts["varyings"] = outputs
    try:
        program = ctx.program(**texts)
    except moderngl.Error as error:
        raise ViewError(
            f"the graphics driver refused the shader {'+'.join(vertex)} / {'+'.join(fragment)}: {error}",
            hint="update the graphics driver, or set LIBGL_ALWAYS_SOFTWARE=1 to draw in software",
        ) from error
    # moderngl asks every program for things that OpenGL 3.1 does not have; the complaint is not ours.
    ctx.clear_errors()
    return program


def put(program: moderngl.Program, values: Mapping[str, Any]) -> None:
    """Set uniforms; names that the compiler removed are passed over.

    Numbers go in as they are; arrays as float32 in column-major order, so matrices are given as they are
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
            uniform.write(_bytes(np.asarray(value, np.float32)))


@lru_cache(maxsize=256)
def _packed(numbers: tuple[float, ...]) -> bytes:
    """Uniform bytes of a vector; the same few come in every frame."""
    return np.array(numbers, np.float32).tobytes()


def _bytes(array: np.ndarray) -> bytes:
    """Uniform bytes: square matrices transposed to column-major, everything else as it lies."""
    square = array.ndim == 2 and array.shape[0] == array.shape[1]
    return (array.T if square else array).tobytes()
