"""surface.export.urdf: an independent reader of URDF moves the links as omote moves the head."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.export.urdf import write_urdf
from surface.head import Head
from surface.head.model.joints import JointLimit, joints_of
from surface.head.model.parameters import EYE_RAD, HEAD_RAD

yourdfpy = pytest.importorskip("yourdfpy", reason="pip install yourdfpy")

ROOT = Path(__file__).resolve().parents[3]
AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
PARTS = {"eye_left": "leftEyePitch", "eye_right": "rightEyePitch", "teeth_upper": "headRoll"}


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(ROOT / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def written(head: Head, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    limits = {"headYaw": JointLimit(-0.5, 0.25, 1.5)}
    return write_urdf(head, tmp_path_factory.mktemp("urdf") / "head.urdf", {}, limits)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the reader's own dependencies
def test_links_stand_where_the_parts_of_the_head_do(head: Head, written: list[Path]) -> None:
    robot = yourdfpy.URDF.load(str(written[0]), load_meshes=True)
    assert robot.validate()
    pose = {"headYaw": 0.4, "headPitch": -0.6, "headRoll": 0.5, "leftEyeYaw": 0.7, "leftEyePitch": 0.3,
            "rightEyeYaw": -0.4, "rightEyePitch": -0.8}  # fmt: skip
    full = dict(zip(("headYaw", "headPitch", "headRoll"), HEAD_RAD, strict=True))
    full |= {f"{side}{angle}": rad for side in ("leftEye", "rightEye")
             for angle, rad in zip(("Yaw", "Pitch"), EYE_RAD, strict=True)}  # fmt: skip
    robot.update_cfg({name: value * full[name] for name, value in pose.items()})
    head.pose(head.values(pose))
    places = {part.name: part.vertices.astype(float) @ AXES.T * 1e-3 for part in head.parts}
    head.pose(head.values({}))
    meshes = {path.stem: path for path in written[1:]}
    for part, link in PARTS.items():
        mesh = yourdfpy.urdf.trimesh.load(meshes[f"{link}-{part}"])
        moved = mesh.vertices @ robot.get_transform(link)[:3, :3].T + robot.get_transform(link)[:3, 3]
        wanted = places[part]
        low, high = wanted.min(axis=0), wanted.max(axis=0)
        np.testing.assert_allclose([moved.min(axis=0), moved.max(axis=0)], [low, high], atol=3e-4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_limits_are_those_that_were_given_and_every_triangle_belongs_to_one_link(
    head: Head, written: list[Path]
) -> None:
    robot = yourdfpy.URDF.load(str(written[0]), load_meshes=True)
    yaw, jaw = robot.joint_map["headYaw"], robot.joint_map["jawOpen"]
    assert (yaw.limit.lower, yaw.limit.upper, yaw.limit.velocity) == (-0.5, 0.25, 1.5)
    assert jaw.limit.upper == pytest.approx(head.data.jaw.angle_rad, abs=1e-6) and jaw.limit.lower == 0.0
    assert [joint.name for joint in joints_of(head.data)] == [joint.name for joint in robot.robot.joints]
    count = sum(len(yourdfpy.urdf.trimesh.load(path).faces) for path in written[1:])
    head.pose(head.values({}))
    assert count > 0.99 * sum(len(part.triangles) for part in head.parts)
    assert {path.stem.partition("-")[0] for path in written[1:]} >= {"jawOpen", "headRoll", "base_link", "leftEyePitch"}
    robot.update_cfg({"jawOpen": jaw.limit.upper})
    chin = yourdfpy.urdf.trimesh.load(next(path for path in written if path.stem == "jawOpen-teeth_lower"))
    down = robot.get_transform("jawOpen")
    moved = chin.vertices @ down[:3, :3].T + down[:3, 3]
    robot.update_cfg({"jawOpen": 0.0})
    rest = chin.vertices + robot.get_transform("jawOpen")[:3, 3]
    assert (moved - rest)[:, 2].mean() < -0.01  # m: it opens downwards
