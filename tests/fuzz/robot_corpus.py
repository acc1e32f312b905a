"""Good files of robots with linkages, of what belongs to them, and of stages with several heads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.joint_limits import joint_limits
from controller.robot.robot import load_robot, robot_parameters
from surface.head import Head
from surface.head.model.joints import Joint, joints_of
from tests.fuzz.kind import FIT_S, Kind
from tests.fuzz.reading import check, reports, run_command

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
EARS = b"""regions = ["ears"]
[profile.ear]
region = "ears"
range = [-1.0, 1.0]
max_speed = 6.0
max_acceleration = 80.0
response_s = 0.02
[parameters.earLeft]
profile = "ear"
rest = 0.25
description = "how far the left ear stands up"
[parameters.earRight]
profile = "ear"
[parameters.tail]
profile = "mouth"
region = "ears"
[alert]
weights = { ear = 0.75, browInnerUp = 0.5 }
[wag]
of = { alert = 0.5 }
"""
LINKED = b"""name = "linked"
vocabularies = ["ears.toml"]
buses = [{ name = "head", kind = "simulated", transport = "memory" }]
[profiles.servo]
bus = "head"
model = "xl330-m288"
map = { at = [-90, 90], deg = [-90, 90] }
limit_deg = [-90, 90]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
[[channels]]
name = "neckLeft"
id = 1
profile = "servo"
[[channels]]
name = "neckRight"
id = 2
profile = "servo"
[[channels]]
name = "eyeUp"
id = 3
profile = "servo"
[[channels]]
name = "eyeSide"
id = 4
profile = "servo"
[[channels]]
name = "lidLeft"
id = 5
profile = "servo"
[[channels]]
name = "ear"
id = 6
profile = "servo"
mix = { earLeft = 40, tail = { at = [0, 0.5, 1], gives = [0, 10, 15] } }
[[channels]]
name = "yaw"
id = 7
profile = "servo"
formula = "40 * headYaw * (1 - 0.5 * jawOpen) if earRight < 0.5 else 0"
[[linkages]]
name = "neck"
kind = "differential"
channels = ["neckLeft", "neckRight"]
inputs.pitch = { headPitch = 40 }
inputs.roll = "30 * headRoll"
plate = [[28, 0, -30], [-28, 0, -30]]
axle = [[28, -70, -12], [-28, -70, -12]]
horn = [[0, 0, -18], [0, 0, -18]]
axis = [[1, 0, 0], [1, 0, 0]]
[[linkages]]
name = "eye"
kind = "gimbal"
channels = ["eyeSide", "eyeUp"]
outer = "pitch"
inputs = { pitch = { leftEyePitch = 30 }, yaw = { leftEyeYaw = 35 } }
[[linkages]]
name = "lid"
kind = "table"
channels = ["lidLeft"]
file = "lid.csv"
inputs = { closed = "eyeBlinkLeft", up = { leftEyePitch = 30 } }
"""
LID = b"up,lidLeft,closed\n" + b"".join(
    b"%d,%.3f,%.2f\n" % (up, 40 * closed + 0.3 * up, closed) for up in (-30, 0, 12, 30) for closed in (0.0, 0.4, 1.0)
)
TABLE = b"# measured by hand\n" + LID
HEADS = b"""name = "duet"
vocabularies = ["ears.toml"]
liveliness = 1.0
turns = "auto"
robots = []
[[heads]]
name = "maple"
person = "maple"
robots = ["linked.toml"]
position_mm = [-300, 0, 0]
yaw_deg = 20
[[heads]]
name = "oak"
person = "oak"
robots = ["eyes-maestro"]
seed = 7
liveliness = 0.4
position_mm = [300, 0, 0]
[[heads.links]]
kind = "line"
port = "simulated"
[groups]
both = ["maple", "oak"]
[[links]]
port = "simulated"
script = "choir"
[[links]]
kind = "websocket"
listen = "127.0.0.1:8765"
"""
HALL = b"""name = "hall"
[[heads]]
name = "maple"
person = "maple"
[zenoh]
role = "conductor"
heads = ["maple"]
listen = ["tls/127.0.0.1:7447"]
connect = ["tcp/127.0.0.1:7448"]
prefix = "omote/hall"
payload = "binary"
lease_ms = 250
delay_ms = 5.5
record = "kept"
[zenoh.tls]
ca = "ca.pem"
certificate = "own.pem"
key = "own.key"
mutual = true
"""


@cache
def _joints() -> list[Joint]:
    """The joints of the shipped head."""
    return joints_of(Head.load(find_config("heads", "ict")).data)


def _pairs() -> bytes:
    """Recorded pairs of two servos: one follows a weight, the other a curve."""
    t = np.arange(60) / 10
    jaw, smile = 0.5 + 0.5 * np.sin(2 * t), 0.5 + 0.5 * np.cos(1.3 * t)
    columns = np.column_stack([t, jaw, smile, 40 * jaw**2 - 5, 20 * smile - 8 * jaw])
    rows = [",".join(f"{cell:.4f}" for cell in row) for row in columns]
    return "\n".join(["time,jawOpen,mouthSmileLeft,servos:yaw,servos:ear", *rows, ""]).encode()


def _fit_pairs(path: Path) -> int:
    """``omote calibrate --pairs``, which writes a robot file beside."""
    return run_command(("calibrate", f"{path.parent}/linked.toml", "--pairs", str(path), "-o", f"{path.parent}/o.toml"))


def _check_beside(name: str) -> Callable[[Path], int]:
    """Read the file by checking another one that names it."""
    return lambda path: check(path.with_name(name))


def _write_service(path: Path) -> int:
    """``omote service`` of a robot or stage."""
    return run_command(("service", str(path), "-o", f"{path.parent}/service"))


def _limit_joints(path: Path) -> None:
    """What ``omote export OUT.urdf --robot`` asks of a robot."""
    robot = load_robot(path, PARAMETERS)
    joint_limits(robot, robot_parameters(robot, path, PARAMETERS), _joints())


def robot_kinds() -> list[Kind]:
    """Robots with linkages and own parameters, tables of linkages and pairs, and stages with several heads."""
    parts = {"ears.toml": EARS, "lid.csv": LID}
    whole = {**parts, "linked.toml": LINKED}
    plain = [(CONFIGS / "robots" / f"{name}.toml").read_bytes() for name in ("head-feetech", "eyes-maestro")]
    wired = b'kind = "feetech"\nport = "/dev/ttyUSB9"\n'
    real = plain[0].replace(b'kind = "simulated"\nsimulates = "feetech"\n', wired)
    pems = dict.fromkeys(("ca.pem", "own.pem", "own.key"), b"-")
    choir = (CONFIGS / "stages" / "choir.toml").read_bytes()
    return [
        Kind("own-parameters", "ears.toml", [EARS]),
        Kind("linked-robot", "linked.toml", [LINKED], beside=parts),
        Kind("own-in-robot", "ears.toml", [EARS], _check_beside("linked.toml"), {"linked.toml": LINKED, "lid.csv": LID},
             ("check", "{folder}/linked.toml")),
        Kind("linkage-table", "lid.csv", [LID, TABLE], _check_beside("linked.toml"),
             {"linked.toml": LINKED, "ears.toml": EARS}, ("check", "{folder}/linked.toml")),
        Kind("pairs", "pairs.csv", [_pairs()], _fit_pairs, whole,
             ("calibrate", "{folder}/linked.toml", "--pairs", "{}", "-o", "{folder}/o.toml"), FIT_S),
        Kind("heads", "stage.toml", [HEADS, choir], beside=whole),
        Kind("zenoh", "stage.toml", [HALL], beside=pems),
        Kind("service", "robot.toml", [real, *plain, HEADS], _write_service, whole, ("service", "{}", "-o", "{out}")),
        Kind("urdf", "linked.toml", [LINKED, *plain], reports(_limit_joints), parts,
             ("export", "{out}.urdf", "--robot", "{}"), FIT_S),
    ]  # fmt: skip
