"""Wavefront OBJ meshes, and folders of them as shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.readers.gltf import read_bytes
from surface.readers.meshdata import MeshData, check_size

Corner = tuple[int, int]
NEUTRAL = ("neutral", "basis", "base", "rest")


def read_obj(path: Path, shapes: Path | None = None) -> MeshData:
    """An OBJ file and its shapes.

    Parameters
    ----------
    path : the neutral face; or a folder with neutral.obj (or basis, base, rest) and one OBJ a shape.
    shapes : folder with one OBJ a shape, named as the shape is; FOLDER/NAME_shapes beside FOLDER/NAME.obj without.

    Raises
    ------
    FitError : a file is missing or damaged, or a shape has other vertices; names file and line.
    """
    if path.is_dir():
        path, shapes = _neutral_in(path), shapes or path
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
        deltas[k] = _moved(file, path, len(vertices)) - vertices
    return parser.mesh(vertices, tuple(f.stem for f in files), deltas)


def _neutral_in(folder: Path) -> Path:
    found = [f for f in sorted(folder.iterdir()) if f.suffix.lower() == ".obj" and f.stem.lower() in NEUTRAL]
    if not found:
        raise FitError(f"{folder}: holds no neutral.obj", hint="name the face at rest neutral.obj")
    return found[0]


def _shape_files(folder: Path, neutral: Path) -> list[Path]:
    if not folder.is_dir():
        raise FitError(f"{folder}: no such folder of shapes", hint="give the folder that holds one .obj a shape")
    files = [f for f in sorted(folder.iterdir()) if f.suffix.lower() == ".obj" and f != neutral]
    if not files:
        raise FitError(f"{folder}: holds no .obj shape", hint="export every shape as an .obj of its own")
    return files


def _moved(file: Path, neutral: Path, count: int) -> Floats:
    """(n, 3) vertices of a shape, which must be as many as the neutral face has."""
    parser = _Parser(file)
    parser.read(only_points=True)
    points = parser.points(parser.vertices, "v")
    if len(points) != count:
        raise FitError(f"{file}: {len(points)} vertices, but {neutral} has {count}",
                       hint="export shapes and neutral face from one mesh, keeping the order of vertices")  # fmt: skip
    return points


class _Parser:
    """One file, line by line."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.vertices: list[tuple[int, bytes]] = []
        self._textures: list[tuple[int, bytes]] = []
        self._faces: list[list[Corner]] = []
        self._piece: list[int] = []
        self._pieces: dict[str, int] = {}
        self._object, self._material = "", ""

    def bad(self, line: int, why: str) -> FitError:
        """The error for a line, counted from 1."""
        return FitError(f"{self.path}, line {line}: {why}", hint="export the file again")

    def read(self, *, only_points: bool = False) -> None:
        """Sort the file's lines."""
        for number, line in enumerate(read_bytes(self.path).replace(b"\\\n", b" ").split(b"\n"), start=1):
            word, _, rest = line.strip().partition(b" ")
            if word == b"v":
                self.vertices.append((number, rest))
            elif only_points:
                continue
            elif word == b"vt":
                self._textures.append((number, rest))
            elif word == b"f":
                self._face(number, rest)
            elif word in (b"o", b"g"):
                self._object = rest.strip().decode("utf-8", "replace")
            elif word == b"usemtl":
                self._material = rest.strip().decode("utf-8", "replace")

    def points(self, lines: list[tuple[int, bytes]], word: str, width: int = 3) -> Floats:
        """(n, width) numbers of the lines; what follows them (weights, colours) is passed over."""
        out = np.zeros((len(lines), width))
        for row, (number, text) in enumerate(lines):
            try:
                out[row] = [float(x) for x in text.split()[:width]]
            except ValueError as e:
                raise self.bad(
                    number, f"{word} needs {width} numbers, not {text[:40].decode('utf-8', 'replace')!r}"
                ) from e
        wrong = np.flatnonzero(~np.isfinite(out).all(axis=1))
        if len(wrong):
            raise self.bad(lines[wrong[0]][0], f"{word} number {wrong[0]} is not a finite number")
        return out

    def _face(self, number: int, text: bytes) -> None:
        corners = [self._corner(number, c) for c in text.split()]
        if len(corners) < 3:
            raise self.bad(number, f"a face needs three corners, not {len(corners)}")
        name = "/".join(x for x in (self._object, self._material) if x)
        piece = self._pieces.setdefault(name, len(self._pieces))
        parts = (
            [corners] if len(corners) <= 4 else [[corners[0], *corners[k : k + 2]] for k in range(1, len(corners) - 1)]
        )
        self._faces += parts
        self._piece += [piece] * len(parts)

    def _corner(self, number: int, text: bytes) -> Corner:
        """Vertex and texture coordinate, counted from 0; -1 for no texture coordinate."""
        words = text.split(b"/")
        try:
            vertex, texture = int(words[0]), int(words[1]) if len(words) > 1 and words[1] else 0
        except ValueError as e:
            raise self.bad(number, f"{text[:20].decode('utf-8', 'replace')!r} is no corner of a face") from e
        v = vertex - 1 if vertex > 0 else len(self.vertices) + vertex
        t = texture - 1 if texture >= 0 else len(self._textures) + texture
        if vertex == 0 or not v >= 0 or not t >= -1:
            raise self.bad(number, f"corner {text.decode('utf-8', 'replace')} points before the first vertex")
        return v, t

    def mesh(self, vertices: Floats, names: tuple[str, ...], deltas: Floats) -> MeshData:
        """What was read, as arrays."""
        filled = np.full((len(self._faces), 4, 2), -1, np.int64)
        for row, corners in enumerate(self._faces):
            filled[row, : len(corners)] = corners
        faces, face_uv = filled[..., 0], filled[..., 1]
        bare = np.any((face_uv < 0) & (faces >= 0), axis=1)
        face_uv[bare] = -1
        return MeshData(
            vertices, faces, self.points(self._textures, "vt", 2), face_uv, names, deltas,
            np.array(self._piece, np.int64), tuple(self._pieces),
        )  # fmt: skip
