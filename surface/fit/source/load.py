"""Read a mesh file of any known format, check it, and transform it into head space."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from surface.base.arrays import Bools
from surface.base.errors import FitError
from surface.fit.source.expressions import with_expressions
from surface.fit.source.frame import find_frame
from surface.fit.source.kinds import piece_kinds, unworn
from surface.fit.source.mesh import FitMesh, check_mesh, renumbered
from surface.fit.source.namenotes import name_notes
from surface.fit.source.names import NameMap, map_names, read_names
from surface.fit.source.shapes import empty_shapes, to_arkit
from surface.readers.gltfmesh import read_gltf
from surface.readers.meshdata import MeshData
from surface.readers.npzmesh import read_npz
from surface.readers.obj import read_obj

SUFFIXES = (".glb", ".gltf", ".vrm", ".obj", ".npz")


@dataclass(frozen=True)
class LoadOptions:
    """How to interpret a mesh file; what is not given is guessed.

    shapes : folder with one OBJ a shape; names : TOML table of shape names.
    unit, up, forward : see :func:`surface.fit.source.frame.find_frame`.
    without : objects or materials to leave out; a part of the name will do.
    """

    shapes: Path | None = None
    names: Path | None = None
    unit: str | None = None
    up: str | None = None
    forward: str | None = None
    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class Loaded:
    """A mesh in head space, which of its shapes make ARKit's, and what was guessed.

    pieces : the file's objects and what kind each is.
    """

    mesh: FitMesh
    named: NameMap
    notes: tuple[str, ...] = ()
    pieces: dict[str, str] = field(default_factory=dict)


def load_mesh(path: str | Path, options: LoadOptions = LoadOptions()) -> Loaded:
    """Read and check a mesh.

    Raises FitError: the file is missing, damaged or too large, has no texture coordinates, holds NaN, or its arrays do
    not fit together; names file and element.
    """
    path = Path(path)
    raw = _read(path, options.shapes)
    mesh = FitMesh(**{f.name: getattr(raw, f.name) for f in fields(FitMesh)})
    mesh = _without(mesh, options.without, str(path))
    kept, notes = unworn(mesh)
    pieces = piece_kinds(mesh, kept)
    mesh, other = with_expressions(mesh if kept.all() else keep_faces(mesh, kept), raw.expressions)
    check_mesh(mesh, str(path))
    own = read_names(options.names) if options.names else None
    named = map_names(mesh.names, own, empty=empty_shapes(mesh), other=other)
    arkit = to_arkit(mesh, named)
    shapes = dict(zip(arkit.names, arkit.deltas, strict=True))
    frame = find_frame(mesh.vertices, shapes, unit=options.unit, up=options.up, forward=options.forward)
    mesh = replace(mesh, vertices=frame.points(mesh.vertices), deltas=frame.points(mesh.deltas))
    return Loaded(mesh, named, (*frame.notes, *notes, *name_notes(mesh.names, named, other)), pieces)


def _read(path: Path, shapes: Path | None) -> MeshData:
    kind = path.suffix.lower()
    if shapes is not None and kind != ".obj" and not path.is_dir():
        raise FitError(f"--shapes {shapes}: belongs to an .obj mesh, {path} has its own shapes", hint="leave it out")
    if kind == ".obj" or path.is_dir():
        return read_obj(path, shapes)
    if kind in (".glb", ".gltf", ".vrm"):
        return read_gltf(path)
    if kind == ".npz":
        return read_npz(path)
    raise FitError(f"{path}: {kind or 'a file without suffix'} is no mesh that can be read",
                   hint=f"export it as {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")  # fmt: skip


def _without(mesh: FitMesh, words: tuple[str, ...], where: str) -> FitMesh:
    """The mesh less the objects whose names hold one of the words."""
    out = np.zeros(len(mesh.pieces), bool)
    for word in words:
        hit = [word.lower() in name.lower() for name in mesh.pieces]
        if not any(hit):
            raise FitError(f"--without {word}: {where} holds {', '.join(mesh.pieces)}", hint="take one of them")
        out |= hit
    return keep_faces(mesh, ~out[mesh.piece]) if len(words) else mesh


def keep_faces(mesh: FitMesh, kept: Bools) -> FitMesh:
    """The mesh with some faces (f,) bool and the vertices they use."""
    used, faces = renumbered(mesh.faces[kept])
    return replace(
        mesh, vertices=mesh.vertices[used], faces=faces, face_uv=mesh.face_uv[kept], deltas=mesh.deltas[:, used],
        piece=mesh.piece[kept] if len(mesh.piece) else mesh.piece,
    )  # fmt: skip
