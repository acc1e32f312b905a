"""Write a head as Wavefront OBJ with its materials, and one OBJ a shape in a folder beside it; millimetres."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surface.export.exporter import Exporter
from surface.export.glb import materials
from surface.export.shapes import Piece, pieces_of
from surface.head import Head


def write_obj(head: Head, path: Path, pose: Mapping[str, float]) -> list[Path]:
    """See :func:`surface.export.export_head`."""
    pieces = pieces_of(head, pose, shapes=not pose)
    shapes = list(dict.fromkeys(n for p in pieces for n in p.moves))
    faces, textures = _faces(pieces), _textures(pieces)
    head_line = [f"# {head.name}, written by omote; millimetres, y up, z forward", f"mtllib {path.stem}.mtl"]
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as made:
        folder = Path(made)
        rest = np.concatenate([p.vertices for p in pieces])
        normals = np.concatenate([p.normals for p in pieces])
        _write(folder / path.name, [*head_line, *_points("v", rest), *textures, *_points("vn", normals), *faces])
        _write(folder / f"{path.stem}.mtl", _materials(pieces))
        for name in shapes:
            moved = rest + np.concatenate([p.moves.get(name, np.zeros_like(p.vertices)) for p in pieces])
            _write(folder / "shapes" / f"{name}.obj", [*head_line[:1], *_points("v", moved), *textures, *faces])
        return _put_in_place(folder, path, bool(shapes))


EXPORTER = Exporter(
    kind="obj",
    suffixes=(".obj",),
    help="the face at rest with its materials, and a folder beside it with one file a shape",
    write=write_obj,
)


def _write(path: Path, lines: list[str]) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _put_in_place(folder: Path, path: Path, shapes: bool) -> list[Path]:
    """Replace the old files by the new ones, which are complete."""
    out = [path, path.with_suffix(".mtl")]
    for target in out:
        (folder / target.name).replace(target)
    if shapes:
        target = path.with_name(f"{path.stem}_shapes")
        if target.exists():
            shutil.rmtree(target)
        (folder / "shapes").replace(target)
        out.append(target)
    return out


def _points(word: str, rows: NDArray[np.float32]) -> list[str]:
    return [f"{word} {x:.5f} {y:.5f} {z:.5f}" for x, y, z in rows.tolist()]


def _textures(pieces: list[Piece]) -> list[str]:
    return [f"vt {u:.6f} {v:.6f}" for p in pieces for u, v in p.uv.tolist()]


def _faces(pieces: list[Piece]) -> list[str]:
    out, start = [], 1
    for piece in pieces:
        out += [f"o {piece.name}", f"usemtl {piece.material}"]
        out += ["f " + " ".join(f"{i}/{i}/{i}" for i in corner) for corner in (piece.triangles + start).tolist()]
        start += len(piece.vertices)
    return out


def _materials(pieces: list[Piece]) -> list[str]:
    out = []
    for name in dict.fromkeys(p.material for p in pieces):
        table = materials().get(name, materials()["skin"])
        colour = " ".join(f"{c ** (1 / 2.2):.4f}" for c in table["colour"])
        out += [f"newmtl {name}", f"Kd {colour}", f"Ns {1000 * (1 - table['roughness']) ** 2:.1f}", "illum 2", ""]
    return out
