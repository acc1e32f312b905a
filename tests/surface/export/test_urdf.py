"""surface.export.urdf: an independent reader of URDF moves the links as omote moves the head."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from surface.export.urdf import write_urdf
from surface.head import Head
from surface.head.model.joints import JointLimit, joints_of
from surface.head.model.parameters import EYE_RAD, HEAD_RAD

trimesh = pytest.importorskip("trimesh", reason="pip install trimesh")

try:
    import yourdfpy
except ImportError:
    yourdfpy = None
reader = pytest.mark.skipif(yourdfpy is None, reason="pip install yourdfpy")
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


@reader
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
    for part, link in PARTS.items():
        pieces = [path for path in written[1:] if path.stem.startswith(f"{link}-{part}")]  # of an eye its iris too
        vertices = np.concatenate([yourdfpy.urdf.trimesh.load(path).vertices for path in pieces])
        moved = vertices @ robot.get_transform(link)[:3, :3].T + robot.get_transform(link)[:3, 3]
        wanted = places[part]
        low, high = wanted.min(axis=0), wanted.max(axis=0)
        np.testing.assert_allclose([moved.min(axis=0), moved.max(axis=0)], [low, high], atol=3e-4)


@reader
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


@pytest.mark.slow
def test_every_mesh_is_there_and_of_a_colour_that_is_defined(written: list[Path]) -> None:
    robot = ET.parse(written[0]).getroot()
    colours = {each.get("name"): each.find("color") for each in robot.findall("material")}
    visuals = robot.findall("link/visual")
    files = {written[0].parent / str(mesh.get("filename")) for mesh in robot.iter("mesh")}
    assert files == set(written[1:]) and len(visuals) == len(files)
    assert {visual.find("material").get("name") for visual in visuals} == set(colours)  # type: ignore[union-attr]
    rgba = {name: [float(c) for c in str(colour.get("rgba")).split()] for name, colour in colours.items()
            if name is not None and colour is not None}  # fmt: skip
    pupil, iris, white = (sum(rgba[f"eye_left_{ring}"][:3]) for ring in ("pupil", "iris", "sclera"))
    assert pupil < 0.5 * iris and iris < 0.8 * white


@pytest.mark.slow
def test_an_eye_looks_along_its_iris(head: Head, written: list[Path]) -> None:
    for side, link in (("left", "leftEyePitch"), ("right", "rightEyePitch")):
        white, iris, pupil = (trimesh.load(written[1].parent / f"{link}-eye_{side}{ring}.stl")
                              for ring in ("", "_iris", "_pupil"))  # fmt: skip
        radius = np.linalg.norm(white.vertices, axis=1).max()
        for ring, most in ((iris, 0.49), (pupil, 0.19)):
            assert (ring.vertices[:, 0] > 0.8 * radius).all()  # in front
            middle = ring.triangles.mean(axis=1)
            assert np.hypot(middle[:, 1], middle[:, 2]).max() < most * 1.05 * radius
            np.testing.assert_allclose(ring.bounds[:, 1:].mean(axis=0), 0.0, atol=0.05 * radius)


@pytest.mark.slow
def test_strips_of_hair_have_a_front_on_both_sides_of_the_face(written: list[Path]) -> None:
    """A viewer that draws only the fronts of triangles shows both brows, and all lashes."""
    for name in ("headRoll-brows", "headRoll-lashes"):
        mesh = trimesh.load(written[1].parent / f"{name}.stl")
        for side in (mesh.triangles_center[:, 1] > 0.0, mesh.triangles_center[:, 1] < 0.0):
            forward = (mesh.face_normals[side, 0] > 0.0).mean()
            assert 0.45 < forward < 0.55


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_a_link_stays_a_link(head: Head, tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    real = tmp_path / "kept" / "robot.urdf"
    (tmp_path / "head.urdf").symlink_to(real)
    write_urdf(head, tmp_path / "head.urdf", {})
    assert (tmp_path / "head.urdf").is_symlink() and ET.parse(real).getroot().tag == "robot"
