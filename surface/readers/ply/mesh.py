"""Reader of PLY meshes: faces and strips of triangles, colours of vertices, textures as scanners write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surface.base.arrays import Array, Bools, Floats, Ints
from surface.readers.meshdata import Material, MeshData, check_size, linear
from surface.readers.mtl import picture_beside
from surface.readers.ply.rows import Element, PlyFile

INDICES = ("vertex_indices", "vertex_index")
COLOURS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
PLACES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
TEXTURE = "TextureFile"
MAX_INDEX = 2**31 - 1


def read_ply(path: Path) -> MeshData:
    """Return a PLY file: elements vertex (x, y, z; colours; texture coordinates), face and tristrips.

    Polygons of more than four corners become fans. Colours are taken for sRGB ones.

    Raises FitError: the file is missing, damaged, cut short or too large; names the element.
    """
    file = PlyFile(path)
    vertex = file.elements.get("vertex", Element("vertex", 0))
    points = vertex.columns("x", "y", "z")
    if points is None or not len(points):
        raise file.error("element vertex", "has no x, y and z")
    check_size(str(path), len(points), 0)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise file.error(f"vertex {bad[0]}", "is not a finite number")
    faces, uv, face_uv = _faces(file, vertex)
    material = _material(file)
    return MeshData(
        points, faces, uv, face_uv, (), np.zeros((0, len(points), 3)), np.zeros(len(faces), np.int64),
        (path.stem,), (material,) if material else (), colours=_colours(vertex),
    )  # fmt: skip


def _faces(file: PlyFile, vertex: Element) -> tuple[Ints, Floats, Ints]:
    """Return faces (f, 4), texture coordinates (t, 2) and faces of these (f, 4)."""
    faces, origin, corner = np.zeros((0, 4), np.int64), np.zeros(0, np.int64), np.zeros((0, 4), np.int64)
    element = file.elements.get("face")
    rows = None if element is None else _first(element, INDICES)
    if rows is not None:
        index, starts = _indices(file, "face", rows[0]), rows[1]
        at, origin = _polygons(starts)
        faces = np.where(at >= 0, index[at] if len(index) else -1, -1)
        corner = np.where(at >= 0, at - starts[:-1][origin][:, None], -1)
    strips = file.elements.get("tristrips")
    rows = None if strips is None else _first(strips, INDICES)
    if rows is not None:
        more = _strips(_indices(file, "tristrips", rows[0]), rows[1])
        faces = np.vstack([faces, np.column_stack([more, np.full(len(more), -1)])])
    uv, face_uv = _map_texture(element, vertex, faces, origin, corner)
    return faces, uv, face_uv


def _first(element: Element, names: tuple[str, ...]) -> tuple[Array, Ints] | None:
    return next((element.lists[name] for name in names if name in element.lists), None)


def _indices(file: PlyFile, name: str, flat: Array) -> Ints:
    """Return the whole numbers that may point at vertices; which of them do is checked with the mesh."""
    if len(flat) and not (np.abs(flat.astype(np.float64)) <= MAX_INDEX).all():
        raise file.error(f"element {name}", "points at a vertex that is not there")
    return flat.astype(np.int64)


def _polygons(starts: Ints) -> tuple[Ints, Ints]:
    """Return places (f, 4) of the corners of every polygon in the flat list, -1 after a triangle's, and (f,) which
    polygon each face was cut from: quads stay, larger ones become fans."""
    length = np.diff(starts)
    fans = np.where(length == 4, 1, np.maximum(length - 2, 0))
    origin = np.repeat(np.arange(len(length)), fans)
    step = np.arange(len(origin)) - np.repeat(np.cumsum(fans) - fans, fans)
    first = starts[:-1][origin]
    last = np.where(length[origin] == 4, first + 3, -1)
    return np.column_stack([first, first + step + 1, first + step + 2, last]), origin


def _strips(index: Ints, starts: Ints) -> Ints:
    """Return (t, 3): triangles of strips, whose every second one is oriented the other way; -1 ends a strip."""
    ends = np.zeros(len(index) + 1, bool)
    ends[starts] = True
    ends[1:] |= index < 0
    begin = np.maximum.accumulate(np.where(ends[:-1] | (index < 0), np.arange(len(index)) + (index < 0), 0))
    at = np.arange(max(len(index) - 2, 0))
    whole: Bools = (begin[at] == begin[at + 2]) & (index[at] >= 0)
    at = at[whole]
    odd = (at - begin[at]) % 2
    tri = np.column_stack([index[at], index[at + 1 + odd], index[at + 2 - odd]])
    a, b, c = tri.T
    solid: Ints = tri[(a != b) & (b != c) & (c != a)]
    return solid


def _map_texture(
    element: Element | None, vertex: Element, faces: Ints, origin: Ints, corner: Ints
) -> tuple[Floats, Ints]:  # fmt: skip
    """Return texture coordinates (t, 2) and faces of them: of every corner of a face, or of vertices, or none."""
    none = np.full(faces.shape, -1, np.int64)
    found = next((uv for names in PLACES if (uv := vertex.columns(*names)) is not None), None)
    if found is not None and np.isfinite(found).all():
        return found, faces.copy()
    if element is None or "texcoord" not in element.lists:
        return np.zeros((0, 2)), none
    flat, starts = element.lists["texcoord"]
    uv = flat.astype(np.float64)[: len(flat) // 2 * 2].reshape(-1, 2)
    fits = bool(len(flat) % 2 == 0 and (starts % 2 == 0).all() and np.isfinite(uv).all())
    if fits and len(starts) and len(origin):
        first, count = starts[:-1][origin] // 2, np.diff(starts)[origin] // 2
        whole = (corner.max(axis=1) < count)[:, None]
        none[: len(origin)] = np.where(whole & (corner >= 0), first[:, None] + corner, -1)
    return (uv, none) if fits else (np.zeros((0, 2)), none)


def _colours(vertex: Element) -> Floats | None:
    """Return (n, 3): linear RGB of vertices: whole numbers are shares of their type's largest, others lie from 0 to
    1.
    """
    for names in COLOURS:
        rgb = vertex.columns(*names)
        if rgb is not None:
            kinds = {p.name: p.kind for p in vertex.properties}
            kind = np.dtype(kinds[names[0]])
            full = float(np.iinfo(kind).max) if kind.kind in "iu" else 1.0
            return linear(np.clip(np.nan_to_num(rgb) / full, 0.0, 1.0))
    return None


def _material(file: PlyFile) -> Material | None:
    """Return the texture that a comment names, where it lies beside the file."""
    for line in file.comments:
        word, _, name = line.strip().partition(" ")
        if word == TEXTURE and name:
            data, mime = picture_beside(file.path.parent, name.strip())
            return Material(file.path.stem, texture=data, mime=mime) if data else None
    return None
