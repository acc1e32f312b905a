"""Reader of Wavefront OBJ meshes, and of folders of them as shapes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.readers.meshdata import MeshData, check_size, linear, read_bytes
from surface.readers.mtl import read_mtl

Corner = tuple[int, int]
Lines = list[tuple[int, bytes]]
MAX_INDEX = 2**31 - 1
NEUTRAL = ("neutral", "basis", "base", "rest")


def read_obj(path: Path, shapes: Path | None = None) -> MeshData:
    """Return an OBJ file and its shapes.

    path : the neutral face; or a folder with neutral.obj (or basis, base, rest) and one OBJ a shape.
    shapes : folder with one OBJ a shape, named as the shape is; if None, FOLDER/NAME_shapes beside FOLDER/NAME.obj.

    Raises FitError: a file is missing or damaged, or a shape has other vertices; names file and line.
    """
    if path.is_dir():
        neutral = [f for f in _obj_files(path) if f.stem.lower() in NEUTRAL]
        if not neutral:
            raise FitError(f"{path}: holds no neutral.obj", hint="name the face at rest neutral.obj")
        path, shapes = neutral[0], shapes or path
    beside = path.with_name(f"{path.stem}_shapes")
    folder = shapes or (beside if beside.is_dir() else None)
    files = [] if folder is None else _shape_files(folder, path)
    parser = _Parser(path)
    parser.read()
    vertices = parser.points(parser.vertices, "v")
    if not len(vertices):
        raise FitError(f"{path}: holds no vertex: no line begins with v", hint="export the mesh as .obj with UVs")
    check_size(str(path), len(vertices), len(files))
    deltas = np.zeros((len(files), len(vertices), 3))
    for k, file in enumerate(files):
        shape = _Parser(file)
        shape.read(only_points=True)
        points = shape.points(shape.vertices, "v")
        if len(points) != len(vertices):
            why = f"{len(points)} vertices, but {path} has {len(vertices)}"
            hint = "export shapes and neutral face from one mesh, keeping the order of vertices"
            raise FitError(f"{file}: {why}", hint=hint)
        deltas[k] = points - vertices
    return replace(parser.mesh(vertices, tuple(f.stem for f in files), deltas), colours=parser.colours())


def _obj_files(folder: Path) -> list[Path]:
    return [f for f in sorted(folder.iterdir()) if f.suffix.lower() == ".obj"]


def _shape_files(folder: Path, neutral: Path) -> list[Path]:
    if not folder.is_dir():
        raise FitError(f"{folder}: no such folder of shapes", hint="give the folder that holds one .obj a shape")
    files = [f for f in _obj_files(folder) if f != neutral]
    if not files:
        raise FitError(f"{folder}: holds no .obj shape", hint="export every shape as a separate .obj")
    return files


class _Parser:
    """Parser of one file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.vertices: Lines = []
        self._textures: Lines = []
        self._faces: list[list[Corner]] = []
        self._piece: list[int] = []
        self._pieces: dict[str, int] = {}
        self._material: dict[str, str] = {}  # of each piece
        self._library = ""

    def _error(self, line: int, why: str) -> FitError:
        """Return the error for a line, counted from 1."""
        return FitError(f"{self.path}, line {line}: {why}", hint="export the file again")

    def read(self, *, only_points: bool = False) -> None:
        """Sort the file's lines by their keywords."""
        group = material = ""
        for number, line in enumerate(read_bytes(self.path).replace(b"\\\n", b" ").split(b"\n"), start=1):
            word, _, rest = line.strip().partition(b" ")
            if word == b"v":
                self.vertices.append((number, rest))
            elif only_points:
                continue
            elif word == b"vt":
                self._textures.append((number, rest))
            elif word == b"f":
                piece = "/".join(x for x in (group, material) if x)
                self._material[piece] = material
                self._face(number, rest, piece)
            elif word in (b"o", b"g"):
                group = rest.strip().decode("utf-8", "replace")
            elif word == b"mtllib":
                self._library = rest.strip().decode("utf-8", "replace")
            elif word == b"usemtl":
                material = rest.strip().decode("utf-8", "replace")

    def points(self, lines: Lines, word: str, width: int = 3) -> Floats:
        """Return (n, width): numbers of the lines; further numbers of a line (weights, colours) are ignored."""
        out = np.zeros((len(lines), width))
        for row, (number, text) in enumerate(lines):
            try:
                out[row] = [float(x) for x in text.split()[:width]]
            except ValueError as e:
                shown = text[:40].decode("utf-8", "replace")
                raise self._error(number, f"{word} needs {width} numbers, not {shown!r}") from e
        wrong = np.flatnonzero(~np.isfinite(out).all(axis=1))
        if len(wrong):
            raise self._error(lines[wrong[0]][0], f"{word} number {wrong[0]} is not a finite number")
        return out

    def colours(self) -> Floats | None:
        """Return (n, 3): linear RGB of vertices, where every one has three numbers from 0 to 1 behind its place, as
        ZBrush and MeshLab write them (sRGB); None elsewhere."""
        rows = [text.split() for _, text in self.vertices]
        if not rows or any(len(row) not in (6, 7) for row in rows):
            return None
        try:
            srgb = np.array([row[3:6] for row in rows], float)
        except ValueError:
            return None
        known = bool(np.isfinite(srgb).all()) and float(srgb.min()) >= 0.0 and float(srgb.max()) <= 1.0
        return linear(srgb) if known else None

    def _face(self, number: int, text: bytes, piece: str) -> None:
        """Add a face; more than four corners become a fan of triangles."""
        corners = [self._corner(number, c) for c in text.split()]
        if len(corners) < 3:
            raise self._error(number, f"a face needs three corners, not {len(corners)}")
        parts = [corners]
        if len(corners) > 4:
            parts = [[corners[0], *corners[k : k + 2]] for k in range(1, len(corners) - 1)]
        self._faces += parts
        self._piece += [self._pieces.setdefault(piece, len(self._pieces))] * len(parts)

    def _corner(self, number: int, text: bytes) -> Corner:
        """Return the vertex and texture coordinate, counted from 0; -1 for no texture coordinate."""
        words = text.split(b"/")
        try:
            vertex, texture = int(words[0]), int(words[1]) if len(words) > 1 and words[1] else 0
        except ValueError as e:
            raise self._error(number, f"{text[:20].decode('utf-8', 'replace')!r} is no corner of a face") from e
        v = vertex - 1 if vertex > 0 else len(self.vertices) + vertex
        t = texture - 1 if texture >= 0 else len(self._textures) + texture
        if max(v, t) > MAX_INDEX:
            raise self._error(number, f"corner {text[:40].decode('utf-8', 'replace')} points beyond the last vertex")
        if vertex == 0 or v < 0 or (texture != 0 and t < 0):
            raise self._error(number, f"corner {text.decode('utf-8', 'replace')} points before the first vertex")
        return v, t

    def mesh(self, vertices: Floats, names: tuple[str, ...], deltas: Floats) -> MeshData:
        """Return the parsed faces and texture coordinates with these vertices and shapes."""
        filled = np.full((len(self._faces), 4, 2), -1, np.int64)
        for row, corners in enumerate(self._faces):
            filled[row, : len(corners)] = corners
        faces, face_uv = filled[..., 0], filled[..., 1]
        face_uv[np.any((face_uv < 0) & (faces >= 0), axis=1)] = -1
        uv, piece = self.points(self._textures, "vt", 2), np.array(self._piece, np.int64)
        known = read_mtl(self.path.parent, self._library) if self._library else {}
        materials = tuple(known.get(self._material[p]) for p in self._pieces) if known else ()
        return MeshData(vertices, faces, uv, face_uv, names, deltas, piece, tuple(self._pieces), materials)
