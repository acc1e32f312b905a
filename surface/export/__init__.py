"""Heads for other programs: GLB with morph targets, OBJ with a folder of shapes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from surface.base.errors import ExportError
from surface.head import Head

__all__ = ["SUFFIXES", "export_head"]

SUFFIXES = (".glb", ".obj")


def export_head(head: Head, path: str | Path, pose: Mapping[str, float] | None = None) -> list[Path]:
    """Write a head to a file that other programs open; the suffix says which kind.

    Parameters
    ----------
    path : ``.glb``: all parts, materials and one morph target a shape. ``.obj``: the face at rest with its materials,
        and a folder beside it with one file a shape.
    pose : values by parameter. A .glb stands in this pose when it is opened, its shapes can still be moved; an .obj is
        written in it, without shapes.

    Returns
    -------
    The paths written.

    Raises
    ------
    ExportError : another suffix, a pose that a file of this kind cannot hold, or a place that cannot be written to;
        nothing is left half-written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    try:
        if kind == ".glb":
            from surface.export.glb import write_glb

            return write_glb(head, path, pose or {})
        if kind == ".obj":
            from surface.export.obj import write_obj

            return write_obj(head, path, pose or {})
    except OSError as e:
        raise ExportError(f"{path}: cannot be written ({e})", hint="choose a folder that can be written to") from e
    raise ExportError(f"{path}: is neither .glb nor .obj", hint="for example: omote export head.glb")
