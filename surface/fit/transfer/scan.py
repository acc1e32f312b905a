"""Read a bare mesh and sample its surface; the mesh may have holes, noise and loose pieces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.base.extras import require
from surface.fit.source.kinds import skin_and_eyes, worn_faces
from surface.fit.source.load import fit_mesh_of, wanted_faces, worn_mesh
from surface.fit.source.mesh import LARGE, SMALL, FitMesh, directed_edges, triangles
from surface.fit.source.textures import Samples as Colours
from surface.fit.transfer.colours import eye_faces, moved, scan_colours
from surface.readers.gltf.mesh import read_gltf
from surface.readers.meshdata import MAX_VERTICES, read_bytes
from surface.readers.npzmesh import read_npz
from surface.readers.obj import read_obj
from surface.readers.ply.mesh import read_ply

OWN = {
    ".glb": read_gltf, ".gltf": read_gltf, ".vrm": read_gltf, ".npz": read_npz, ".obj": read_obj, ".ply": read_ply,
}  # fmt: skip
OTHERS = (".stl", ".off")  # read by trimesh
SAMPLES = 120_000
SAME = 1e-6  # of the mesh's size: vertices nearer than this are one


@dataclass(frozen=True)
class Scan:
    """Triangles of a bare mesh, in any unit and axes.

    vertices : (n, 3). triangles : (t, 3). original : (m,) int64, for each vertex of the file its row in ``vertices``.
    colours : samples of its colours; None where it has none. eye_colours : those of pieces named as eyes, which are not
        among ``colours``.
    notes : messages on what was left out of the file.
    worn : hair, hats and glasses that a head keeps as they are, in the file's coordinates; None without any.
    """

    vertices: Floats
    triangles: Ints
    original: Ints
    colours: Colours | None = None
    eye_colours: Colours | None = None
    notes: tuple[str, ...] = ()
    worn: FitMesh | None = None

    def turned(self, turn: Floats, scale: float, shift: Floats) -> Scan:
        """The scan with every vertex p moved to scale * turn @ p + shift."""
        colours, eyes = (None if c is None else moved(c, turn, scale, shift) for c in (self.colours, self.eye_colours))
        return replace(self, vertices=scale * self.vertices @ turn.T + shift, colours=colours, eye_colours=eyes)

    def kept(self, faces: Bools) -> Scan:
        """The scan with only the triangles that a mask (t,) chooses."""
        return replace(self, triangles=self.triangles[faces])


@dataclass(frozen=True)
class Samples:
    """Points on a scan: ``points (m, 3)``, unit ``normals (m, 3)``, and whether each lies at a border of the scan."""

    points: Floats
    normals: Floats
    border: Bools

    def kept(self, chosen: Bools) -> Samples:
        """The samples that a mask (m,) chooses."""
        return Samples(self.points[chosen], self.normals[chosen], self.border[chosen])


def read_scan(path: str | Path, without: tuple[str, ...] = ()) -> Scan:
    """Read the skin of a mesh; pieces named as clothes, hair, teeth or other parts that are not skin are left out.

    without : further objects or materials to leave out, by any part of their name.

    Raises FitError: the file is missing, damaged or too large, has no triangle, or has numbers that are not finite.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind in OWN:
        raw = OWN[kind](path)
        wanted = wanted_faces(raw, without, str(path))
        still = fit_mesh_of(replace(raw, names=(), deltas=raw.deltas[:0]))
        aside = worn_faces(still) & wanted
        if not (wanted & ~aside).any():
            aside[:] = False
        kept, notes = skin_and_eyes(raw, wanted & ~aside)
        scan = make_scan(raw.vertices, triangles(raw.faces[kept]), str(path))
        worn, damage = worn_mesh(still, aside, str(path))
        eye = eye_faces(raw, kept)
        colours, eyes = scan_colours(raw, kept & ~eye), scan_colours(raw, eye)
        return replace(scan, colours=colours, eye_colours=eyes, notes=(*notes, *damage), worn=worn)
    if kind not in OTHERS:
        raise FitError(f"{path}: {kind or 'a file without suffix'} is no mesh that can be read",
                       hint=f"export it as {', '.join([*OWN, *OTHERS])}")  # fmt: skip
    if without:
        raise FitError(f"--without {without[0]}: {path} has no named objects", hint="leave it out")
    return make_scan(*_by_trimesh(path, kind), str(path))


def _by_trimesh(path: Path, kind: str) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and triangles (t, 3) of a file in one of the formats of scanners and CAD programs."""
    require("reading a scan", "trimesh")
    import trimesh  # only for these formats

    data = read_bytes(path)
    log = trimesh.util.log
    was, log.disabled = log.disabled, True  # it prints faults that do not matter here, such as invalid normals
    try:
        mesh = trimesh.load_mesh(BytesIO(data), file_type=kind[1:], process=False)
        return np.array(mesh.vertices, np.float64).reshape(-1, 3), np.array(mesh.faces, np.int64).reshape(-1, 3)
    except Exception as e:
        raise FitError(f"{path}: is damaged or no {kind[1:].upper()} file ({e})", hint="export the scan again") from e
    finally:
        log.disabled = was


def make_scan(vertices: Floats, faces: Ints, where: str) -> Scan:
    """A scan of triangles (t, 3); vertices in one place are merged, triangles without area are left out.

    Raises FitError: see :func:`read_scan`.
    """
    if len(vertices) > MAX_VERTICES:
        raise FitError(f"{where}: {len(vertices)} vertices; {MAX_VERTICES} are the most", hint="decimate it first")
    if not len(faces):
        raise FitError(f"{where}: holds no faces", hint="a cloud of points is not enough: export its triangles")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise FitError(f"{where}: a face points at a vertex that is not there", hint="export the scan again")
    fine: Bools = np.all(np.abs(vertices) < LARGE, axis=1)
    used = np.unique(faces)
    bad = used[~fine[used]]
    if len(bad):
        raise FitError(f"{where}: vertex {bad[0]} is not a finite number of usable size", hint="repair the scan")
    vertices = np.where(fine[:, None], vertices, vertices[used[0]])  # others belong to no face of these
    size = float(np.ptp(vertices[used], axis=0).max())
    if not size > SMALL:
        raise FitError(f"{where}: all vertices are in one place", hint="export the scan again")
    _, first, original = np.unique(np.round(vertices / (SAME * size)), axis=0, return_index=True, return_inverse=True)
    points, faces = vertices[first], original.reshape(-1)[faces]
    whole = np.linalg.norm(_cross(points, faces), axis=1) > (SAME * size) ** 2
    if not whole.any():
        raise FitError(f"{where}: all faces are without area", hint="export the scan again")
    return Scan(points, faces[whole], original.reshape(-1))


def _cross(points: Floats, faces: Ints) -> Floats:
    a, b, c = (points[faces[:, k]] for k in range(3))
    cross: Floats = np.cross(b - a, c - a)
    return cross


def borders_of(scan: Scan) -> tuple[Ints, Ints]:
    """The border of a scan: first and last vertex of every directed edge that only one triangle has."""
    a, b = directed_edges(np.column_stack([scan.triangles, np.full(len(scan.triangles), -1)]))
    n = len(scan.vertices)
    _, index, count = np.unique(np.minimum(a, b) * n + np.maximum(a, b), return_inverse=True, return_counts=True)
    open_ = count[index.reshape(-1)] == 1
    return a[open_], b[open_]


def spread(vertices: Floats, faces: Ints, count: int) -> tuple[Ints, Floats]:
    """Places spread evenly over triangles, the same in every call: triangle (count,), weights of corners (count, 3)."""
    area = np.linalg.norm(_cross(vertices, faces), axis=1)
    total = np.cumsum(area)
    random = np.random.default_rng(0)
    at = (np.arange(count) + random.random(count)) * (total[-1] / count)
    face: Ints = np.minimum(np.searchsorted(total, at), len(area) - 1)
    return face, random.dirichlet(np.ones(3), count)


def sample(scan: Scan, count: int = SAMPLES) -> Samples:
    """Points spread evenly over a scan's surface, with normals interpolated from those of the vertices."""
    face, share = spread(scan.vertices, scan.triangles, count)
    corners = scan.triangles[face]
    points = np.einsum("mk,mkc->mc", share, scan.vertices[corners])
    normals = np.einsum("mk,mkc->mc", share, vertex_normals(scan)[corners])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    area = 0.5 * np.linalg.norm(_cross(scan.vertices, scan.triangles), axis=1).sum()
    near = 1.5 * float(np.sqrt(area / count))
    line = _border_line(scan, near)
    border = cKDTree(line).query(points)[0] < near if len(line) else np.zeros(count, bool)
    return Samples(points, normals, border)


def _border_line(scan: Scan, apart: float) -> Floats:
    """Points (k, 3) along the border of a scan, at distances of at most ``apart``."""
    a, b = (scan.vertices[ids] for ids in borders_of(scan))
    pieces = np.ceil(np.linalg.norm(b - a, axis=1) / apart).astype(np.int64)
    edge = np.repeat(np.arange(len(a)), pieces)
    first = np.cumsum(pieces) - pieces
    share = ((np.arange(len(edge)) - first[edge]) / np.maximum(pieces, 1)[edge])[:, None]
    line: Floats = a[edge] + share * (b - a)[edge]
    return line


def vertex_normals(scan: Scan) -> Floats:
    """(n, 3) unit normals of the vertices, area-weighted means over the triangles around each."""
    cross = _cross(scan.vertices, scan.triangles)
    out = np.zeros_like(scan.vertices)
    for k in range(3):
        np.add.at(out, scan.triangles[:, k], cross)
    unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    return unit
