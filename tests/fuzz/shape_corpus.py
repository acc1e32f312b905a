"""Good files of surfaces, meshes, scans and groups of control points."""

from __future__ import annotations

import base64
import io
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from surface.fit.identities import read_modes
from surface.fit.source.load import Loaded, LoadOptions, load_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import read_names
from surface.readers.common import NamedSurface
from surface.readers.plain import write_surfaces
from tests.fuzz import scans
from tests.fuzz.kind import FIT, FIT_S, Kind
from tests.fuzz.reading import reports
from tests.surface.meshfiles import GlbBuilder, glb, meshopt_compressed, write_obj
from tests.surface.readers.test_gismo import geometry, hierarchy, tensor
from tests.surface.readers.test_tsm import Writer, cells
from tests.surface.small_head import sheet

SCAN = (*FIT, "--expressions-from", "ict", "--up", "y", "--forward", "z")  # known axes: the search is short


def shape_kinds(folder: Path) -> list[Kind]:
    """Every kind of surface, mesh, scan and file of groups; `folder` takes what is written on the way."""
    return [*_surfaces(folder), *_meshes(folder), *_scans(folder), *_groups(folder)]


def _surfaces(folder: Path) -> list[Kind]:
    write_surfaces(folder / "plain.json", [NamedSurface("sheet", sheet(0.0))])
    rng = np.random.default_rng(1)
    xml = [
        geometry("TensorBSpline2", tensor(), rng.normal(size=(36, 3))).encode(),
        geometry("THBSpline2", hierarchy("THBSpline", [(1, 0, 0, 4, 4)]), rng.normal(size=(48, 3))).encode(),
    ]
    kinds = [
        Kind("surface", "surface.json", [(folder / "plain.json").read_bytes()]),
        Kind("gismo", "surface.xml", xml),
        Kind("tsm", "surface.tsm", [Writer(cells([0, 1, 2, 3], [0, 1, 2])).text().encode()]),
    ]
    return [*kinds, *_rhino(folder / "ball.3dm")]


def _rhino(path: Path) -> list[Kind]:
    """A ball, a box, a cylinder and a trimmed disc; nothing without rhino3dm."""
    try:
        import rhino3dm as rhino
    except ImportError:
        return []
    middle = rhino.Point3d(0, 0, 0)
    circle = rhino.Circle(middle, 2.0)
    box = rhino.BoundingBox(middle, rhino.Point3d(1, 2, 3))
    shapes = [
        rhino.Sphere(middle, 5.0).ToBrep(),
        rhino.Brep.CreateFromBoundingBox(box),
        rhino.Extrusion.CreateCylinderExtrusion(rhino.Cylinder(circle, 4.0), True, True),
        rhino.Brep.CreateTrimmedPlane(rhino.Plane(middle, rhino.Vector3d(0, 0, 1)), circle.ToNurbsCurve()),
    ]
    seeds = []
    for shape in shapes:
        file = rhino.File3dm()
        file.Objects.Add(shape)
        file.Write(str(path), 7)
        seeds.append(path.read_bytes())
    return [Kind("3dm", "surface.3dm", seeds)]


def _grid() -> FitMesh:
    """A sheet of quads with one shape."""
    side = 5
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    corner = np.arange(side * side).reshape(side, side)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    points = np.column_stack([160 * u - 80, 200 * v - 100, 40 * np.sin(3 * u)])
    moves = np.column_stack([0 * u, -10 * v, 0 * u])[None]
    return FitMesh(points, faces, np.column_stack([u, v]), faces.copy(), ["jawOpen"], moves)


def _meshes(folder: Path) -> list[Kind]:
    grid = _grid()
    write_obj(folder / "mesh.obj", grid, folder / "shapes")
    np.savez(
        folder / "mesh.npz", neutral=grid.vertices, faces=grid.faces, uv=grid.uv, face_uv=grid.face_uv,
        names=np.array(grid.names), deltas=grid.deltas,
    )  # fmt: skip
    small = glb(replace(grid))
    glbs = [small.bytes(), glb(grid, sparse=True).bytes(), meshopt_compressed(small).bytes()]
    whole, shape = (folder / "mesh.obj").read_bytes(), (folder / "shapes" / "jawOpen.obj").read_bytes()
    read = reports(load_mesh)
    return [
        Kind("obj", "mesh.obj", [whole], read, words=FIT, most_s=FIT_S),
        Kind("glb", "mesh.glb", glbs, read, words=FIT, most_s=FIT_S),
        Kind("gltf", "mesh.gltf", [_gltf(small), _gltf(glb(grid, sparse=True))], read, words=FIT, most_s=FIT_S),
        Kind("npz", "mesh.npz", [(folder / "mesh.npz").read_bytes()], read, words=FIT, most_s=FIT_S),
        Kind("shape", "shapes/jawOpen.obj", [shape], reports(_with_shapes), {"mesh.obj": whole},
             ("fit", "{folder}/../mesh.obj", "--shapes", "{folder}", "-o", "{out}"), FIT_S),
        Kind("names", "names.toml", [b'[names]\nmouthWide = "jawOpen"\n"Head.Smile_L" = "mouthSmileLeft"\n'],
             reports(read_names), {"mesh.glb": small.bytes()},
             ("fit", "{folder}/mesh.glb", "--names", "{}", "-o", "{out}"), FIT_S),
        Kind("modes", "modes.npz", [_modes(grid)],  # no command comes so far with a mesh without a recipe
             reports(lambda path: read_modes(path, grid, path.with_name("mesh.npz"))),
             {"mesh.npz": (folder / "mesh.npz").read_bytes()}),
    ]  # fmt: skip


def _scans(folder: Path) -> list[Kind]:
    """Bare meshes, and landmarks on one."""
    grid = _grid()
    given = {"ply": scans.plys(grid.vertices, grid.faces), "stl": scans.stls(grid.vertices, grid.faces),
             "off": [scans.off(grid.vertices, grid.faces)]}  # fmt: skip
    kinds = [
        Kind(name, f"scan.{name}", seeds, reports(scans.read_scan), words=SCAN, most_s=FIT_S)
        for name, seeds in given.items()
    ]
    (folder / "scan.ply").write_bytes(given["ply"][0])
    scan = scans.read_scan(folder / "scan.ply")
    command = ("fit", "{folder}/scan.ply", *SCAN[2:], "--landmarks", "{}")
    for file, seeds in scans.landmark_files().items():
        name = "landmarks" + Path(file).suffix.replace(".toml", "")
        read = reports(partial(scans.read_marks, scan))
        kinds.append(Kind(name, file, seeds, read, {"scan.ply": given["ply"][0]}, command, FIT_S))
    return kinds


def _groups(folder: Path) -> list[Kind]:
    """Groups of a surface's control points, made by hand and by dragging."""
    surface = sheet(-20.0)
    write_surfaces(folder / "groups.json", [NamedSurface("sheet", surface)])
    beside = {"sheet.json": (folder / "groups.json").read_bytes()}
    axes = ("--unit", "mm", "--up", "y", "--forward", "z")
    words = ("fit", "{folder}/sheet.json", "-o", "{out}", *axes, "--groups", "{}")
    read = reports(partial(scans.read_groups, surface))
    return [
        Kind("groups", "groups.toml", [scans.GROUPS], read, beside, words, FIT_S),
        Kind("groups.json", "dragged.json", [json.dumps(scans.DRAGGED).encode()], read, beside, words, FIT_S),
    ]


def _with_shapes(path: Path) -> Loaded:
    return load_mesh(path.parents[1] / "mesh.obj", LoadOptions(shapes=path.parent))


def _gltf(builder: GlbBuilder) -> bytes:
    """A mesh as JSON alone, its buffer in a data URI."""
    builder.bytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(builder.data).decode()
    return json.dumps(builder.document | {"buffers": [{"byteLength": len(builder.data), "uri": uri}]}).encode()


def _modes(mesh: FitMesh) -> bytes:
    """Two ways in which a mesh may vary; its own vertices besides, as in a mesh's file."""
    out = io.BytesIO()
    np.savez(out, deltas=np.stack([mesh.vertices, -mesh.vertices]), neutral=mesh.vertices)
    return out.getvalue()
