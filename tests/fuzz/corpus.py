"""One or more good files of every kind that omote reads, and what reads them."""

from __future__ import annotations

import json
import struct
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.cli.app import main, report_error
from controller.layers.commands import CommandState
from controller.takes.recording import recorded
from surface.base.errors import SurfaceError
from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import FitMesh
from surface.head import Head, save_data
from surface.head.model.data import Contact, Rule
from surface.head.model.identity import Identity, fingerprint, save_identities
from surface.head.posing.baked import write_decimated, write_shade
from surface.readers.common import NamedSurface
from surface.readers.plain import write_surfaces
from tests.surface.meshfiles import glb, write_obj
from tests.surface.readers.test_gismo import geometry, hierarchy, tensor
from tests.surface.readers.test_tsm import Writer, cells
from tests.surface.small_head import all_points, sheet, small_head

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name : of the kind. file : path in a folder under which it is read.
    seeds : good files. read : reads one and returns omote's exit code. beside : files that belong to it.
    """

    name: str
    file: str
    seeds: list[bytes]
    read: Callable[[Path], int]
    beside: dict[str, bytes] = field(default_factory=dict)


def check(path: Path) -> int:
    """``omote check`` of a file; of its folder where it belongs to a head."""
    sys.argv = ["omote", "check", str(path.parent if path.parent.name == "head" else path)]
    try:
        main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def mesh(path: Path) -> int:
    """What ``omote fit`` reads before it fits."""
    try:
        load_mesh(path)
    except SurfaceError as error:
        report_error(error)
        return 1
    return 0


def kinds() -> list[Kind]:
    """Every kind; what needs a package that is not installed is left out."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as folder:
        return [
            *_configs(),
            *_takes(Path(folder)),
            *_surfaces(Path(folder)),
            *_meshes(Path(folder)),
            *_heads(Path(folder)),
        ]


def _configs() -> list[Kind]:
    named = {
        "stage": ["stages/demo.toml", "stages/everything.toml", "stages/play.toml"],
        "robot": ["robots/head24.toml", "robots/head-text.toml", "robots/eyes-maestro.toml"],
        "script": ["scripts/everything.toml"],
        **{
            name: [f"vocabularies/{name}.toml"]
            for name in ("arkit", "expressions", "facs", "affect", "visemes", "layers")
        },
        "life": ["life/natural.toml"],
    }
    return [
        Kind(name, f"{name}.toml", [(CONFIGS / f).read_bytes() for f in files], check) for name, files in named.items()
    ]


def wav(samples: np.ndarray, rate: int = 16000) -> bytes:
    """A sound of signed 16 bit mono PCM."""
    data = samples.astype("<i2").tobytes()
    layout = struct.pack("<IHHIIHH", 16, 1, 1, rate, 2 * rate, 2, 16)
    return (
        b"RIFF"
        + struct.pack("<I", 36 + len(data))
        + b"WAVEfmt "
        + layout
        + b"data"
        + struct.pack("<I", len(data))
        + data
    )


def _takes(folder: Path) -> list[Kind]:
    names = list(PARAMETERS.names)
    header = (
        "Timecode,BlendShapeCount," + ",".join(n[0].upper() + n[1:] for n in names[:52]) + ",HeadYaw,HeadPitch,HeadRoll"
    )
    rows = [f"00:00:{k // 60:02}:{k % 60:02}.000,61," + ",".join(["0.25"] * 55) for k in range(90)]
    cues = [{"start": 0.0, "end": 0.3, "value": "A"}, {"start": 0.3, "end": 0.9, "value": "D"}]
    return [
        Kind("csv", "take.csv", ["\n".join([header, *rows]).encode()], check),
        Kind("tsv", "speech.tsv", [b"0.00\tX\n0.10\tD\n0.40\tB\n0.90\tX\n", b"0.0\taa\n0.5\tPP\n1.0\tsil\n"], check),
        Kind(
            "rhubarb", "speech.json", [json.dumps({"metadata": {"duration": 0.9}, "mouthCues": cues}).encode()], check
        ),
        Kind("wav", "voice.wav", [wav(8000 * np.sin(np.arange(8000) / 9.0))], check),
        Kind("recording", "run.rec", [_recording(folder / "run.rec")], check),
        Kind("group", "group.json", [_group()], check),
    ]


def _recording(path: Path) -> bytes:
    out = PARAMETERS.neutral()
    with recorded(CommandState(PARAMETERS), path) as recorder:
        for k in range(1, 30):
            recorder.set_parameters([3], [0.02 * k], k * 10_000_000)
            recorder.expression("smile", 0.5, None, k * 10_000_000)
            recorder.tick(k * 10_000_000, 0.01, out)
    return path.read_bytes()


def _group() -> bytes:
    table = {"format": 1, "name": "dimple", "part": "face", "ids": [5, 9], "moves_mm": [[0, 0, 1.5], [0.2, 0, 1]]}
    return json.dumps(table).encode()


def _surfaces(folder: Path) -> list[Kind]:
    write_surfaces(folder / "plain.json", [NamedSurface("sheet", sheet(0.0))])
    rng = np.random.default_rng(1)
    xml = [
        geometry("TensorBSpline2", tensor(), rng.normal(size=(36, 3))).encode(),
        geometry("THBSpline2", hierarchy("THBSpline", [(1, 0, 0, 4, 4)]), rng.normal(size=(48, 3))).encode(),
    ]
    kinds = [
        Kind("surface", "surface.json", [(folder / "plain.json").read_bytes()], check),
        Kind("gismo", "surface.xml", xml, check),
        Kind("tsm", "surface.tsm", [Writer(cells([0, 1, 2, 3], [0, 1, 2])).text().encode()], check),
    ]
    try:
        import rhino3dm
    except ImportError:
        return kinds
    file = rhino3dm.File3dm()
    file.Objects.AddSphere(rhino3dm.Sphere(rhino3dm.Point3d(0, 0, 0), 5.0))
    file.Write(str(folder / "ball.3dm"), 7)
    return [*kinds, Kind("3dm", "surface.3dm", [(folder / "ball.3dm").read_bytes()], check)]


def _grid() -> FitMesh:
    """A sheet of quads with one shape."""
    side = 9
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    corner = np.arange(side * side).reshape(side, side)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    points = np.column_stack([160 * u - 80, 200 * v - 100, 40 * np.sin(3 * u)])
    moves = np.column_stack([0 * u, -10 * v, 0 * u])[None]
    return FitMesh(points, faces, np.column_stack([u, v]), faces.copy(), ["jawOpen"], moves)


def _meshes(folder: Path) -> list[Kind]:
    grid = _grid()
    write_obj(folder / "mesh.obj", grid)
    np.savez(
        folder / "mesh.npz", neutral=grid.vertices, faces=grid.faces, uv=grid.uv, face_uv=grid.face_uv,
        names=np.array(grid.names), deltas=grid.deltas,
    )  # fmt: skip
    small = glb(replace(grid))
    return [
        Kind("obj", "mesh.obj", [(folder / "mesh.obj").read_bytes()], mesh),
        Kind("glb", "mesh.glb", [small.bytes(), glb(grid, sparse=True).bytes()], mesh),
        Kind("npz", "mesh.npz", [(folder / "mesh.npz").read_bytes()], mesh),
    ]


def _save_head(folder: Path) -> None:
    """A small head with everything that a folder can hold."""
    u, v = np.meshgrid(np.linspace(0.3, 0.7, 5), np.linspace(0.05, 0.4, 6), indexing="ij")
    places = np.stack([np.stack([u, 0.5 + v], axis=-1), np.stack([u, 0.5 - v], axis=-1)])
    rule = Rule("frown", ({"mouthPucker": 0.5, "jawOpen": 0.5},), 2.0)
    data = small_head(contacts=[Contact("lips", "a", ("b",), -1, 60.0, 0.5, places)], rules=[rule])
    save_data(folder, data)
    head = Head.load(folder)
    wide = Identity("wide", {"a": all_points("wide", (1, 0, 0))}, {}, np.zeros((2, 3)), np.zeros(3), fingerprint(data))
    save_identities(folder, [wide])
    write_shade(folder, {part.name: np.full(len(part.vertices), 0.5) for part in head.parts}, head.parts)
    write_decimated(folder, head.parts, {f"{part.name}/full": part.triangles for part in head.parts})


def _heads(folder: Path) -> list[Kind]:
    _save_head(folder / "head")
    files = {path.name: path.read_bytes() for path in sorted((folder / "head").iterdir())}
    return [
        Kind(name, f"head/{name}", [data], check, {n: d for n, d in files.items() if n != name})
        for name, data in files.items()
    ]
