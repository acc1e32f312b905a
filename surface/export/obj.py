"""Exports heads as Wavefront OBJ with materials, in millimetres.

A folder beside it gets one OBJ for each shape, another the pictures of its materials.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats32
from surface.base.files import open_file
from surface.base.writing import replacing
from surface.export.exporter import Exporter
from surface.export.frames import in_file, placement_of
from surface.export.mtl import ObjMaterials
from surface.export.shapes import ExportPart, export_parts, is_posed
from surface.export.worn import accessory_parts
from surface.head import Head

_OWN = ", written by omote;"
"""What the first line of every file says behind the name of the head."""
_TITLE_BYTES = 1000


def write_obj(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """See :func:`surface.export.export_head`."""
    title = f"# {head.name}{_OWN} millimetres, y up, z forward"
    return _write_parts(_parts(head, pose), path, title)


def write_obj_in_file(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """Do the same as :func:`write_obj`, but in the axes, origin and unit of the file that the head was fitted to."""
    placement = placement_of(head)
    title = f"# {head.name}{_OWN} in the frame of its source, {json.dumps({'placement': placement.table()})}"
    parts = _parts(head, pose)
    return _write_parts(in_file(parts, placement), path, title)


def _parts(head: Head, pose: Mapping[str, float]) -> list[ExportPart]:
    """Return the parts of a head in a pose and, behind them, its accessories."""
    return export_parts(head, pose, shapes=not is_posed(head, pose)) + accessory_parts(head, pose)


def _write_parts(parts: list[ExportPart], path: Path, title: str) -> list[Path]:
    """Write the OBJ with its materials and its folders of shapes and pictures; nothing is replaced before all of it is
    complete.

    Returns the paths.
    """
    looks = ObjMaterials(parts)
    pictures = path.with_name(f"{path.stem}_textures")
    shapes = dict.fromkeys(name for part in parts for name in part.displacements)
    vertices, normals = (np.concatenate([getattr(p, key) for p in parts]) for key in ("vertices", "normals"))
    textures = [f"vt {u:.6f} {v:.6f}" for part in parts for u, v in part.uv.tolist()]
    faces, rows = _faces(parts, looks.names), _rows("v", vertices)
    folder = path.with_name(f"{path.stem}_shapes")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as temporary:
        made = [Path(temporary) / target.name for target in (path, path.with_suffix(".mtl"))]
        points = [*rows, *textures, *_rows("vn", normals)]
        _write(made[0], [title, f"mtllib {path.stem}.mtl", *points, *faces])
        _write(made[1], looks.lines(pictures.name))
        if shapes:
            made.append(Path(temporary) / folder.name)
            made[2].mkdir()
        for name in shapes:
            moves = np.concatenate([p.displacements.get(name, np.zeros_like(p.vertices)) for p in parts])
            _write(made[2] / f"{name}.obj", [title, *_moved_rows(rows, vertices, moves), *textures, *faces])
        if shapes:
            folder.mkdir(exist_ok=True)
        if looks.pictures:
            pictures.mkdir(exist_ok=True)
        for name, picture in looks.pictures.items():
            with replacing(pictures / name) as beside:
                beside.write_bytes(picture)
        for new in made[:2]:  # everything is complete: replace the old
            with replacing(path.parent / new.name) as beside:
                shutil.copyfile(new, beside)
        if shapes:
            _replace_shapes(made[2], folder)
    made_folders = [at for at, there in ((folder, shapes), (pictures, looks.pictures)) if there]
    return [path, path.with_suffix(".mtl"), *made_folders]


def _replace_shapes(new: Path, folder: Path) -> None:
    """Move new shapes into their folder, and remove older ones that omote wrote there; other files in it stay."""
    for old in folder.glob("*.obj"):
        if _is_own(old):
            old.unlink()
    for shape in new.iterdir():
        shape.replace(folder / shape.name)


def _is_own(path: Path) -> bool:
    """Whether omote wrote a file, by its first line."""
    try:
        with open_file(path) as file:
            return _OWN.encode() in file.readline(_TITLE_BYTES)
    except OSError:
        return False


EXPORTER = Exporter(
    api=1,
    kind="obj",
    title="the face at rest with its materials and textures, and a folder beside it with one file for each shape",
    suffixes=(".obj",),
    write=write_obj,
    write_in_file=write_obj_in_file,
)


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rows(word: str, rows: Floats32) -> list[str]:
    return [f"{word} {x:.5f} {y:.5f} {z:.5f}" for x, y, z in rows.tolist()]


def _moved_rows(rows: list[str], vertices: Floats32, moves: Floats32) -> list[str]:
    """Return the rows of vertices (n, 3) after moves (n, 3); ``rows`` are theirs before, and most do not move."""
    out, moved = rows.copy(), np.flatnonzero(moves.any(axis=1))
    for k, row in zip(moved.tolist(), _rows("v", vertices[moved] + moves[moved]), strict=True):
        out[k] = row
    return out


def _faces(parts: list[ExportPart], looks: list[str]) -> list[str]:
    out, start = [], 1
    for part, look in zip(parts, looks, strict=True):
        out += [f"o {part.name}", f"usemtl {look}"]
        out += ["f " + " ".join(f"{i}/{i}/{i}" for i in corner) for corner in (part.triangles + start).tolist()]
        start += len(part.vertices)
    return out
