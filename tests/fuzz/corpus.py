"""One or more good files of every kind that omote reads, and what reads them."""

from __future__ import annotations

import tempfile
from pathlib import Path

from drivers.core.pcapng import file_head, packet
from drivers.core.trafficlog import read_log
from tests.fuzz.head_corpus import head_kinds
from tests.fuzz.kind import Kind
from tests.fuzz.robot_corpus import robot_kinds
from tests.fuzz.shape_corpus import shape_kinds
from tests.fuzz.take_corpus import take_kinds

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


def kinds() -> list[Kind]:
    """Every kind; what needs a package that is not installed is left out."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as folder:
        return [
            *_configs(),
            *robot_kinds(),
            *take_kinds(Path(folder)),
            *shape_kinds(Path(folder)),
            *head_kinds(Path(folder)),
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
