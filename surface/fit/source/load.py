"""Read a mesh file of any known format, check it, and transform it into head space."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.base.errors import FitError
from surface.fit.source.kinds import piece_kinds, without_clothes, worn_faces
from surface.fit.source.mesh import LARGE, SMALL, FitMesh, bare_where_damaged, check_mesh, renumbered
from surface.fit.source.names import NameMap, map_names, read_names
from surface.fit.source.naming.expressions import with_expressions
from surface.fit.source.naming.namenotes import name_notes
from surface.fit.source.naming.shapes import empty_shapes, share_of
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.conventions import convention_of, is_export
from surface.fit.source.placing.exported import exported_placement
from surface.fit.source.placing.frame import Frame, find_frame
from surface.fit.source.placing.orient import shapes_of_sides
from surface.fit.source.textures import tinted
from surface.head.model.placement import Placement
from surface.readers.gltf.mesh import read_gltf
from surface.readers.meshdata import MeshData
from surface.readers.npzmesh import read_npz
from surface.readers.obj import read_obj

SUFFIXES = (".glb", ".gltf", ".vrm", ".obj", ".npz")
SCANS = (".ply", ".stl", ".off")  # formats of meshes that have no shapes
VOWELS = ("jawOpen", "mouthFunnel", "mouthPucker")  # made of vowels, where the mesh has no such shapes


@dataclass(frozen=True)
class LoadOptions:
    """How to interpret a mesh file; what is not given is guessed.

    shapes : folder with one OBJ a shape; names : TOML table of shape names.
    unit, up, forward : see :func:`surface.fit.source.placing.frame.find_frame`.
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

    placement : from the file's coordinates; marks : landmarks in head space.
    pieces : the file's objects and what kind each is. exported : omote wrote the file, with outlines as they are drawn.
    home : (3,) shift, mm, by which a head that omote exported comes to where it lay; None for other files.
    worn : hair, glasses and the like that a head keeps as they are, in the file's coordinates; None without any.
    """

    mesh: FitMesh
    named: NameMap
    notes: tuple[str, ...] = ()
    placement: Placement = field(default_factory=Placement)
    marks: Landmarks = field(default_factory=Landmarks)
    pieces: dict[str, str] = field(default_factory=dict)
    exported: bool = False
    worn: FitMesh | None = None
    home: Floats | None = None


def load_mesh(path: str | Path, options: LoadOptions = LoadOptions()) -> Loaded:
    """Read and check a mesh.

    Raises FitError: the file is missing, damaged or too large, holds NaN, or its arrays do
    not fit together; names file and element.
    """
    path = Path(path)
    raw = read_mesh(path, options.shapes)
    mesh = fit_mesh_of(raw)
    if options.without:
        mesh = keep_faces(mesh, wanted_faces(mesh, options.without, str(path)))
    aside = worn_faces(mesh)
    kept, notes = without_clothes(mesh, aside)
    worn, damage = worn_mesh(mesh, aside, str(path))
    pieces = piece_kinds(mesh, kept)
    mesh, other = with_expressions(mesh if kept.all() else keep_faces(mesh, kept), raw.expressions)
    mesh = bare_where_damaged(mesh)
    check_mesh(mesh, str(path))
    own = read_names(options.names) if options.names else None
    named = map_names(mesh.names, own, empty=empty_shapes(mesh), other=other, share=partial(share_of, mesh))
    known = None if options.unit or options.up or options.forward else exported_placement(path)
    frame = find_frame(
        mesh.vertices, _shapes(mesh, named), unit=options.unit, up=options.up, forward=options.forward,
        faces=mesh.faces, convention=convention_of(path), known=known,
    )  # fmt: skip
    mesh = replace(mesh, vertices=frame.points(mesh.vertices), deltas=frame.points(mesh.deltas))
    every = (*frame.notes, *notes, *damage, *name_notes(mesh.names, named, other))
    home = None if known is None else known.shift
    return Loaded(mesh, named, every, frame.placement, _turned(frame), pieces, is_export(path), worn, home)


def fit_mesh_of(raw: MeshData) -> FitMesh:
    """The mesh of a file, with colours of its vertices in its materials."""
    return FitMesh(**{f.name: getattr(raw, f.name) for f in fields(FitMesh)} | {"materials": tinted(raw)})


def worn_mesh(mesh: FitMesh, faces: Bools, where: str) -> tuple[FitMesh | None, list[str]]:
    """What is kept as it is of a mesh, faces (f,), without shapes, None where that is nothing; and notes on damaged
    pieces, which are left out."""
    kept, notes = faces.copy(), list[str]()
    for k, name in enumerate(mesh.pieces):
        own = faces & (mesh.piece == k)
        if own.any() and (why := _damage(mesh, own)):
            kept &= ~own
            notes.append(f"{name!r} left out, because {why}")
    if not kept.any():
        return None, notes
    worn = bare_where_damaged(keep_faces(replace(mesh, names=(), deltas=mesh.deltas[:0]), kept))
    check_mesh(worn, f"{where}: hair, glasses and what else is worn")
    return worn, notes


def _damage(mesh: FitMesh, own: Bools) -> str:
    """Why some faces (f,) cannot be drawn; "" where they can."""
    used = mesh.faces[own]
    used = used[used >= 0]
    if used.max(initial=-1) >= len(mesh.vertices) or mesh.face_uv[own].max(initial=-1) >= len(mesh.uv):
        return "a face points at what is not there"
    points = mesh.vertices[used]
    if not (np.abs(points) < LARGE).all():
        return "a vertex is not a finite number of usable size"
    return "" if len(used) and np.ptp(points, axis=0).max() > SMALL else "all its vertices are in one place"


def _shapes(mesh: FitMesh, named: NameMap) -> dict[str, Floats]:
    """The mesh's displacements by ARKit's names, before left and right are known. Moods of the whole face do
    not show a place; vowels that stand in for a shape of the mouth do."""
    sources = {
        n: [(s.index, s.side) for s in every if not s.region or n in VOWELS] for n, every in named.sources.items()
    }  # fmt: skip
    return shapes_of_sides(sources, mesh.deltas)


def _turned(frame: Frame) -> Landmarks:
    """The landmarks of a frame in head space; eyes are in order, since left is known now."""

    def at(point: Floats | None) -> Floats | None:
        return None if point is None else frame.points(point)

    eyes, left = frame.marks.eyes, frame.marks.left
    if eyes is not None:
        centres = frame.points(eyes.centres)
        eyes = Eyes(centres if centres[0, 0] > centres[1, 0] else centres[::-1].copy(), True, eyes.balls, eyes.by)
    return Landmarks(eyes, at(frame.marks.mouth), at(frame.marks.jaw), None if left is None else frame.turn @ left)


def read_mesh(path: Path, shapes: Path | None) -> MeshData:
    """What is in a mesh file of any known format, or in a folder. Raises FitError, as :func:`load_mesh` does."""
    kind = path.suffix.lower()
    if shapes is not None and kind != ".obj" and not path.is_dir():
        raise FitError(f"--shapes {shapes}: belongs to an .obj mesh, {path} has its own shapes", hint="leave it out")
    if kind == ".obj" or path.is_dir():
        return read_obj(path, shapes)
    if kind in (".glb", ".gltf", ".vrm"):
        return read_gltf(path)
    if kind == ".npz":
        return read_npz(path)
    if kind in SCANS:
        raise FitError(f"{path}: a {kind} file has no shapes for expressions",
                       hint="take them from a head that has some: add --expressions-from ict")  # fmt: skip
    kinds = f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
    raise FitError(f"{path}: {kind or 'a file without suffix'} is no mesh that can be read",
                   hint=f"open it in a program such as Blender and export it as {kinds}")  # fmt: skip


def wanted_faces(mesh: FitMesh | MeshData, words: tuple[str, ...], where: str) -> Bools:
    """(f,) which faces belong to no object whose name holds one of the words. Raises FitError: none holds a word."""
    if words and not mesh.pieces:
        message = f"--without {words[0]}: {where} has no named objects or materials"
        raise FitError(message, hint="leave the option out, or name the parts of the mesh before it is exported")
    out = np.zeros(len(mesh.pieces), bool)
    for word in words:
        hit = [word.lower() in name.lower() for name in mesh.pieces]
        if not any(hit):
            raise FitError(f"--without {word}: {where} holds {', '.join(mesh.pieces)}", hint="take one of them")
        out |= hit
    kept: Bools = ~out[mesh.piece] if words else np.ones(len(mesh.faces), bool)
    return kept


def keep_faces(mesh: FitMesh, kept: Bools) -> FitMesh:
    """The mesh with some faces (f,) bool and the vertices they use; what points beyond all of them still does."""
    used, faces = renumbered(mesh.faces[kept])
    used = used[used < len(mesh.vertices)]
    return replace(
        mesh, vertices=mesh.vertices[used], faces=faces, face_uv=mesh.face_uv[kept], deltas=mesh.deltas[:, used],
        piece=mesh.piece[kept] if len(mesh.piece) else mesh.piece,
    )  # fmt: skip
