"""One or more good files of every kind that omote reads, and what reads them."""

from __future__ import annotations

import base64
import io
import json
import math
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.net.neutral import Neutral, Ranges, load_state, save_state
from controller.takes.mcap_files import write_mcap
from controller.takes.recording import recorded
from drivers.core.pcapng import file_head, packet
from drivers.core.trafficlog import read_log
from surface.fit.identities import read_modes
from surface.fit.source.load import Loaded, LoadOptions, load_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import read_names
from surface.head import Head, save_data
from surface.head.model.data import Contact, HeadData, Rule
from surface.head.model.file import load_data
from surface.head.model.identity import Identity, fingerprint, save_identities
from surface.head.model.look import Worn
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.model.wardrobe import read_garment, with_garments
from surface.head.posing.baked import write_decimated, write_shade
from surface.readers.common import NamedSurface
from surface.readers.plain import write_surfaces
from tests.fuzz import scans
from tests.fuzz.outcome import PROCESSOR_S
from tests.fuzz.reading import check, reports, run_command
from tests.surface.meshfiles import GlbBuilder, glb, write_obj
from tests.surface.readers.test_gismo import geometry, hierarchy, tensor
from tests.surface.readers.test_tsm import Writer, cells
from tests.surface.small_head import all_points, sheet, small_head

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
ROBOTS = ("head-text", "eyes-maestro", "head-arduino", "head-dynamixel1", "head-feetech", "head-ssc32")
CALIBRATED = "head24.mine.calibration.toml"
EXPRESSIONS = b"""[grin]
kind = "gesture"
aliases = ["wide_smile", "beam"]
source = "AU 6+12"
onset_s = 0.45
offset_s = 0.6
blink = "blend"
gaze = "keep"
weights = { mouthSmile = 0.85, cheekSquint = 0.75, jawOpen = 0.06 }
[sulk]
kind = "user"
weights = { browDown = 0.5, mouthFrownLeft = 0.3 }
[mixed]
kind = "user"
onset_s = 0.2
of = { grin = 0.4, sulk = 0.6 }
"""
CALIBRATION = b"""format = 1
name = "mine"
robot = "head24"
[channels.jaw]
min_deg = -8.5
neutral_deg = 0.0
max_deg = 24.25
[channels.neckYaw]
min_deg = -40
neutral_deg = 1.5
max_deg = 41
"""
FAULTS = b"""name = "bad minute"
loop_s = 60
timeline = ["0.5 fault mute:7 late:3:45ms", "4 clear mute", "5 place 3 1500"]
"""
STUDY = b"""name = "smiles"
stage = "demo"
repeats = 4
order = "shuffled"
before_s = 5.0
[conditions.smile]
steps = ["0 EXPR smile", "0.5 GAZE 10 0"]
length_s = 3.0
[conditions.tour]
script = "tour"
length_s = 27.0
"""
RANGES = b"[ranges]\njawOpen = [0.1, 0.6]\nmouthSmile = [0.0, 0.8]\nheadYaw = [-0.5, 0.4]\n"
TRAFFIC = b"""# omote traffic = 1
# family = dynamixel
# baud = 1000000
# servos = 1:xl330-m288
0.000000 > ff ff fd 00 01 03 00 01 19 4e
0.000512 < ff ff fd 00 01 07 00 55 00 b0 04 34 b2 d4
"""
WIDE_STAGE = b"""name = "wide"
head = "ict"
robots = ["head24", "eyes-maestro"]
liveliness = 0.5
show = "tour"
[face]
size = [640, 480]
fps = 30
quality = "full"
theme = "mask"
background = ["#102030", "#405060"]
[[links]]
kind = "line"
port = "simulated"
checksum = "latched"
script = "tour"
[[links]]
kind = "line"
port = "/dev/ttyUSB9"
baud = 1000000
"""


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name : of the kind. file : path in a folder under which it is read.
    seeds : good files. read : reads one and returns omote's exit code. beside : files that belong to it.
    words : of the command that reads it, ``{}`` its path; ``omote check`` without.
    most_s : processor time of that command; more where it goes on to fit.
    """

    name: str
    file: str
    seeds: list[bytes]
    read: Callable[[Path], int] = check
    beside: dict[str, bytes] = field(default_factory=dict)
    words: tuple[str, ...] = ()
    most_s: float = PROCESSOR_S

    def lay_out(self, folder: Path) -> Path:
        """Write what belongs to it into a folder; returns the path where it is read itself."""
        path = folder / self.file
        path.parent.mkdir(parents=True, exist_ok=True)
        for name, data in self.beside.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
        return path

    def command(self, path: Path) -> int:
        """Run the command that reads it."""
        if not self.words:
            return check(path)
        with tempfile.TemporaryDirectory(prefix="fuzz-") as out:
            given = {"{}": str(path), "{folder}": str(path.parent), "{out}": f"{out}/head"}
            words = self.words
            for name, text in given.items():
                words = tuple(word.replace(name, text) for word in words)
            return run_command(words)


FIT = ("fit", "{}", "-o", "{out}")
SCAN = (*FIT, "--expressions-from", "ict", "--up", "y", "--forward", "z")  # known axes: the search is short
FIT_S = 60.0
"""Processor time of a command that goes on to fit what a damaged file still holds; reading it has the usual limit."""


def kinds() -> list[Kind]:
    """Every kind; what needs a package that is not installed is left out."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as folder:
        return [
            *_configs(),
            *_garments(),
            *_takes(Path(folder)),
            *_surfaces(Path(folder)),
            *_meshes(Path(folder)),
            *_scans(Path(folder)),
            *_groups(Path(folder)),
            *_heads(Path(folder)),
        ]


def _configs() -> list[Kind]:
    named = {
        "stage": ["stages/demo.toml", "stages/everything.toml", "stages/play.toml", "stages/serial.toml"],
        "robot": ["robots/head24.toml", *(f"robots/{name}.toml" for name in ROBOTS)],
        "script": ["scripts/everything.toml", "scripts/tour.toml"],
        **{name: [f"vocabularies/{name}.toml"] for name in ("arkit", "facs", "affect", "visemes", "vrm", "layers")},
        "life": ["life/natural.toml"],
        "person": ["persons/maple.toml", "persons/oak.toml"],
        "controls": ["controls/keyboard.toml", "controls/gamepad.toml", "controls/midi.toml"],
    }
    found = [Kind(name, f"{name}.toml", [(CONFIGS / f).read_bytes() for f in files]) for name, files in named.items()]
    return [
        *found, Kind("stage-wide", "stage.toml", [WIDE_STAGE]), Kind("expressions", "own.toml", [EXPRESSIONS]),
        Kind("calibration", CALIBRATED, [CALIBRATION]), Kind("faults", "faults.toml", [FAULTS]),
        Kind("traffic", "bus.log", [TRAFFIC]), Kind("pcapng", "bus.pcapng", [_pcapng()]),
        Kind("study", "study.toml", [STUDY]), Kind("ranges", "ranges.toml", [RANGES]),
    ]  # fmt: skip


def _pcapng() -> bytes:
    """The same traffic in the form of network analysers."""
    record = read_log(TRAFFIC.decode())
    return file_head(record.wire) + b"".join(packet(piece, 1_700_000_000 * 10**9) for piece in record.pieces)


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


@cache
def _shipped_head() -> HeadData:
    return load_data(CONFIGS / "heads" / "ict")


def _wear(path: Path) -> None:
    """Put a garment on the shipped head."""
    with_garments(_shipped_head(), (read_garment(Worn(path, (0.1, 0.1, 0.1))),), str(path))


def _garments() -> list[Kind]:
    seed = (CONFIGS / "wardrobe" / "hair-crop.npz").read_bytes()
    words = ("render", "--person", "{folder}/person.toml", "--size", "64x64", "-o", "{out}.png")
    person = b'name = "worn"\n[hair]\nstyle = "hair.npz"\ncolour = "#222222"\n'
    return [Kind("garment", "hair.npz", [seed], reports(_wear), {"person.toml": person}, words, FIT_S)]


def _takes(folder: Path) -> list[Kind]:
    names = list(PARAMETERS.names)
    header = (
        "Timecode,BlendShapeCount," + ",".join(n[0].upper() + n[1:] for n in names[:52]) + ",HeadYaw,HeadPitch,HeadRoll"
    )
    rows = [f"00:00:{k // 60:02}:{k % 60:02}.000,61," + ",".join(["0.25"] * 55) for k in range(20)]
    cues = [{"start": 0.0, "end": 0.3, "value": "A"}, {"start": 0.3, "end": 0.9, "value": "D"}]
    return [
        Kind("csv", "take.csv", ["\n".join([header, *rows]).encode()]),
        Kind("tsv", "speech.tsv", [b"0.00\tX\n0.10\tD\n0.40\tB\n0.90\tX\n", b"0.0\taa\n0.5\tPP\n1.0\tsil\n"]),
        Kind("rhubarb", "speech.json", [json.dumps({"metadata": {"duration": 0.9}, "mouthCues": cues}).encode()]),
        Kind("wav", "voice.wav", [wav(8000 * np.sin(np.arange(3000) / 9.0))]),
        *_alignments(),
        *_recorded_by_others(folder / "take.mcap"),
        Kind("recording", "run.rec", [_recording(folder / "run.rec")]),
        Kind("group", "group.json", [_group()]),
        Kind("link", "phone.json", [_learned(folder / "phone.json")], reports(_read_learned)),  # a link reads it
    ]


def _recorded_by_others(path: Path) -> list[Kind]:
    """A take in MCAP, where its package is installed."""
    if find_spec("mcap") is None:
        return []
    values = np.linspace(0.0, 0.5, 20)[:, None] * np.ones(len(PARAMETERS))
    write_mcap(path, np.arange(20) / 30.0, values, np.ones(len(PARAMETERS), bool), PARAMETERS)
    return [Kind("mcap", "take.mcap", [path.read_bytes()])]


def _learned(path: Path) -> bytes:
    """What a link learned of a person."""
    neutral, ranges = Neutral(PARAMETERS), Ranges(PARAMETERS)
    neutral.values[3], neutral.known, ranges.top[5] = 0.2, True, 0.7
    save_state(path, PARAMETERS, neutral, ranges)
    return path.read_bytes()


def _read_learned(path: Path) -> None:
    load_state(path, PARAMETERS, Neutral(PARAMETERS), Ranges(PARAMETERS))


def _results() -> list[dict[str, object]]:
    """Results of MediaPipe's face landmarker: landmarks, and blend shapes as its task for browsers nests them."""
    ring = [{"x": 0.5 + 0.2 * math.cos(k), "y": 0.5 + 0.2 * math.sin(k), "z": 0.01 * (k % 7)} for k in range(478)]
    shapes = [{"categories": [{"categoryName": "jawOpen", "score": 0.4}]}]
    return [{"faceLandmarks": [ring]}, {"faceBlendshapes": shapes, "faceLandmarks": [ring[:468]]}]


RESULTS = _results()


def _alignments() -> list[Kind]:
    """Takes that share their suffixes with others, and alignments of speech."""
    tier = b'"IntervalTier"\n"phones"\n0\n1\n2\n0\n0.4\n"AA1"\n0.4\n1\n"sp"\n'
    grid = b'File type = "ooTextFile"\nObject class = "TextGrid"\n\n0\n1\n<exists>\n1\n' + tier
    fragment = {"begin": "0.0", "end": "1.0", "id": "f1", "language": "eng", "lines": ["Mama"], "children": []}
    shapes = {"FrameIndex": 0, "BlendShapes": [[0.25] * 55] * 3}
    visemes = [{"audio_offset": 500000 * k, "viseme_id": k} for k in range(6)]
    openface = b"frame, timestamp, confidence, success, pose_Rx, pose_Ry, pose_Rz, AU01_r, AU28_c\n"
    openface += b"".join(b"%d, 0.%d, 0.9, 1, 0.1, 0, 0, 2.5, 1\n" % (k, k) for k in range(1, 9))
    pyfeat = b"input,frame,FaceScore,AU01,AU12,approx_time\n"
    pyfeat += b"".join(b"a.mp4,%d,0.9,0.1,0.5,00:0%d\n" % (k * 30, k) for k in range(5))
    return [
        Kind("openface", "of.csv", [openface]), Kind("pyfeat", "feat.csv", [pyfeat]),
        Kind("plain", "plain.csv", [b"time,jawOpen,headYaw_deg\n0,0.1,5\n0.1,0.5,-5\n", b"t;JawOpen\n0;0,5\n1;1\n"]),
        Kind("textgrid", "a.TextGrid", [grid, grid.decode().encode("utf-16")]),
        Kind("aeneas", "aeneas.json", [json.dumps({"fragments": [fragment]}).encode()]),
        Kind("azure-visemes", "visemes.json", [json.dumps(visemes).encode()]),
        Kind("azure-shapes", "shapes.json", [json.dumps(shapes).encode()]),
        Kind("mediapipe", "face.json", [json.dumps(RESULTS * 2).encode()]),
    ]  # fmt: skip


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
    whole, shape = (folder / "mesh.obj").read_bytes(), (folder / "shapes" / "jawOpen.obj").read_bytes()
    read = reports(load_mesh)
    return [
        Kind("obj", "mesh.obj", [whole], read, words=FIT, most_s=FIT_S),
        Kind("glb", "mesh.glb", [small.bytes(), glb(grid, sparse=True).bytes()], read, words=FIT, most_s=FIT_S),
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


def _save_head(folder: Path) -> None:
    """A small head with everything that a folder can hold."""
    u, v = np.meshgrid(np.linspace(0.3, 0.7, 5), np.linspace(0.05, 0.4, 6), indexing="ij")
    places = np.stack([np.stack([u, 0.5 + v], axis=-1), np.stack([u, 0.5 - v], axis=-1)])
    rule = Rule("frown", ({"mouthPucker": 0.5, "jawOpen": 0.5},), 2.0)
    data = small_head(contacts=[Contact("lips", "a", ("b",), -1, 60.0, 0.5, places)], rules=[rule])
    parts = [replace(p, mesh=pack(tessellate(p, make_surface(p), data.seams), p.budget)) for p in data.parts]
    save_data(folder, replace(data, parts=parts))
    head = Head.load(folder)
    wide = Identity("wide", {"a": all_points("wide", (1, 0, 0))}, {}, np.zeros((2, 3)), np.zeros(3), fingerprint(data))
    save_identities(folder, [wide])
    write_shade(folder, {part.name: np.full(len(part.vertices), 0.5) for part in head.parts}, head.parts)
    write_decimated(folder, head.parts, {f"{part.name}/full": part.triangles for part in head.parts})


def _heads(folder: Path) -> list[Kind]:
    _save_head(folder / "head")
    files = {path.name: path.read_bytes() for path in sorted((folder / "head").iterdir())}
    return [
        Kind(name, f"head/{name}", [data], beside={f"head/{n}": d for n, d in files.items() if n != name})
        for name, data in files.items()
    ]
