"""Exporters of heads to other programs: GLB with morph targets, OBJ with a folder of shapes.

In: a head and a pose, exporters from other packages. Out: files. Imports base and head.

Every module of this folder that defines ``EXPORTER``, an :class:`surface.export.exporter.Exporter`, is used.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from surface.base.errors import ExportError
from surface.export.animation import Animation
from surface.export.exporter import API, Exporter, Write
from surface.export.frames import FRAMES
from surface.head import Head

__all__ = ["API", "SUFFIXES", "Animation", "Exporter", "export_head", "exporters"]

SUFFIXES: tuple[str, ...]  # of the exporters of this folder


def __getattr__(name: str) -> Any:
    if name == "SUFFIXES":
        return tuple(suffix for one in exporters() for suffix in one.suffixes)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def exporters(extra: Iterable[Exporter] = ()) -> tuple[Exporter, ...]:
    """Return the exporters of this folder, by module, and ``extra`` ones after them.

    Raises ExportError: an exporter was made for another omote, or two want the same suffix.
    """
    found = (*_shipped()[0], *extra)
    owner: dict[str, Exporter] = {}
    for one in found:
        if one.api != API:
            why = f"was made for exporters of version {one.api}, this omote has {API}"
            raise ExportError(f"exporter {one.kind!r}: {why}", hint="update omote")
        for suffix in one.suffixes:
            if owner.setdefault(suffix, one) is not one:
                why = f"{suffix} is written by {owner[suffix].kind!r} already"
                raise ExportError(f"exporter {one.kind!r}: {why}", hint="remove the package that brings one of them")
    return found


@cache
def _shipped() -> tuple[tuple[Exporter, ...], tuple[str, ...]]:
    """Return exporters of this folder, and what is missing for those that cannot be imported."""
    found, missing = [], []
    for module in pkgutil.iter_modules(__path__):
        try:
            exporter = getattr(import_module(f"{__name__}.{module.name}"), "EXPORTER", None)
        except ImportError as error:
            missing.append(f"{module.name} needs {error.name or error}")
            continue
        if isinstance(exporter, Exporter):
            found.append(exporter)
    return tuple(found), tuple(missing)


def export_head(
    head: Head, path: str | Path, pose: Mapping[str, float] | None = None, extra: Iterable[Exporter] = (),
    frame: str = "head", animation: Animation | None = None, web: bool = False,
) -> list[Path]:  # fmt: skip
    """Write a head to a file for other programs; the suffix chooses the exporter (see :func:`exporters`).

    pose : values by parameter. A .glb opens in this pose and keeps its shapes; an .obj is written in it, without
        shapes.
    extra : exporters from other packages.
    frame : "head" for head space (mm or m, y up, z forward), "file" for axes, origin and unit of the file that the head
        was fitted to.
    animation : motion that the file shall hold; its shapes move over time, and its head turns.
    web : a small file for pages of browsers: fewer triangles, quantized, with joints for head and eyes.

    Returns the paths written.

    Raises ExportError: another suffix or frame, a frame of a file that nothing is known of, a pose or an animation that
    a file of this kind cannot hold, or a place that cannot be written to; nothing is left half-written.
    """
    path, known = Path(path), exporters(extra)
    if frame not in FRAMES:
        raise ExportError(f"frame {frame!r}: is neither {' nor '.join(FRAMES)}", hint="leave it out for head space")
    for one in known:
        if path.suffix.lower() in one.suffixes:
            try:
                return _writer(one, frame, animation, web)(head, path, pose or {})
            except OSError as e:
                there = path.parent.is_dir()
                hint = "choose a folder that can be written to" if there else f"mkdir -p {path.parent}"
                raise ExportError(f"{path}: cannot be written ({e.strerror or e})", hint=hint) from e
    *most, last = (suffix for one in known for suffix in one.suffixes)
    why = "".join(f"; {note}" for note in _shipped()[1])
    raise ExportError(
        f"{path}: is neither {', '.join(most)} nor {last}{why}", hint="for example: omote export head.glb"
    )


def _writer(exporter: Exporter, frame: str, animation: Animation | None, web: bool) -> Write:
    """Return what writes in a frame, an animation, or for the web."""
    if web:
        if exporter.write_web is None or frame != "head" or animation is not None:
            raise ExportError(
                f"{exporter.kind!r}: --web writes a .glb in head space without animation",
                hint="for example: omote export head.glb --web",
            )
        return exporter.write_web
    if animation is not None:
        if exporter.animate is None or frame != "head":
            why = f"{exporter.kind!r} holds no animation" if exporter.animate is None else "--frame file: no animation"
            raise ExportError(why, hint="export a .glb, in head space")
        animate, shown = exporter.animate, animation
        return lambda head, path, pose: animate(head, shown, path, pose)
    if frame == "head":
        return exporter.write
    if exporter.write_in_file is None:
        why = f"{exporter.kind!r} writes {', '.join(exporter.suffixes)} in head space only"
        raise ExportError(why, hint="leave out --frame, or write a .glb or an .obj")
    return exporter.write_in_file
