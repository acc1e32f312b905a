"""surface.export.urdf: an independent reader of URDF moves the links as omote moves the head."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from surface.export import urdf
from surface.export.shapes import ExportPart
from surface.export.urdf import write_urdf
from surface.head import Head
from surface.head.model.joints import Joint, JointLimit, joints_of
from surface.head.model.parameters import EYE_RAD, HEAD_RAD
from surface.head.posing.rig import jaw_path

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


def piece(material: str, vertices: np.ndarray, triangles: list[list[int]], **other: object) -> ExportPart:
    rows = np.asarray(vertices, np.float32)
    own = {"pivot": np.zeros(3), "colours": None, **other}
    return ExportPart("own", material, rows, rows, rows[:, :2], np.array(triangles, np.int32), **own)  # type: ignore[arg-type]


def test_a_binary_stl_has_a_header_of_80_bytes_and_50_for_each_triangle() -> None:
    corners = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 3, 0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]], np.float32)
    data = urdf._stl(corners)
    assert len(data) == 80 + 4 + 2 * 50 and data[80:84] == b"\x02\0\0\0" and data[:15] == b"written by omot"
    for k, normal in enumerate(([0.0, 0, 1], [-1.0, 0, 0])):
        row = np.frombuffer(data[84 + 50 * k : 84 + 50 * k + 48], "<f4").reshape(4, 3)
        np.testing.assert_allclose(row[0], normal)
        np.testing.assert_array_equal(row[1:], corners[k])


def test_triangles_of_an_eye_are_parted_by_how_far_they_are_from_its_axis() -> None:
    pivot, radius = np.array([30.0, 40.0, 50.0]), 12.0
    angles = np.array([0.05, 0.15, 0.2, 0.45, 0.55, 1.4, 1.7])
    middles = pivot + radius * np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])
    part = piece("eye", np.repeat(middles, 3, axis=0), np.arange(21).reshape(7, 3).tolist(), pivot=pivot)
    distance = urdf._off_axis(part, part.triangles)
    np.testing.assert_allclose(distance, [*np.sin(angles[:6]), 2.0], atol=1e-5)
    found = {each.name: len(each.triangles) for each in urdf._split_by_colour("link", part, part.triangles)}
    assert found == {"own_pupil": 2, "own_iris": 2, "own": 3}
    front = urdf._split_by_colour("link", part, part.triangles[:1])
    assert [(each.name, each.material, each.file) for each in front] == [
        ("own_pupil", "own_pupil", "link-own_pupil.stl")
    ]


@pytest.mark.parametrize(("material", "sides"), [("brow", 2), ("lash", 2), ("hair", 2), ("skin", 1), ("teeth", 1)])
def test_strips_are_written_with_both_their_sides(material: str, sides: int) -> None:
    part = piece(material, np.eye(3), [[0, 1, 2]])
    (only,) = urdf._split_by_colour("link", part, part.triangles)
    corners = only.corners()
    assert len(corners) == sides
    np.testing.assert_array_equal(corners[0], np.eye(3))
    np.testing.assert_array_equal(corners[-1], np.eye(3)[:: -1 if sides == 2 else 1])


def test_the_whole_jaw_turns_about_its_axis_and_glides(head: Head) -> None:
    jaw = head.data.jaw
    points = np.array([[1.0, 2.0, 90.0], list(jaw.centre), [5.0, -60.0, 40.0]], np.float32)
    turn, shift = jaw_path(jaw, 1.0)
    np.testing.assert_allclose(urdf._jaw_swing(head, points), points @ turn.T + shift - points, atol=1e-4)


def test_skin_belongs_to_what_moves_it_most(head: Head) -> None:
    neck = head.data.neck
    rest = np.array([[0.0, -30.0, 100.0], [0.0, -30.0, 100.0], [0.0, -400.0, 0.0]], np.float32)
    assert neck.share(rest.astype(float)).tolist() == [1.0, 1.0, 0.0]
    swing = urdf._jaw_swing(head, rest)
    skin = SimpleNamespace(follows="skin")
    opened = (rest + swing * np.array([[0.51], [0.49], [1.0]])).astype(np.float32)
    assert urdf._carriers(head, skin, rest, opened).tolist() == [2, 1, 0]  # type: ignore[arg-type]
    for follows, link in (("jaw", 2), ("skull", 1), ("left_eye", 3), ("right_eye", 4)):
        own = SimpleNamespace(follows=follows)
        assert urdf._carriers(head, own, rest, opened).tolist() == [link] * 3  # type: ignore[arg-type]


def test_a_document_names_colours_links_and_joints_in_metres() -> None:
    limit = JointLimit(-0.5, 0.25, 1.5)
    joints = [Joint("headYaw", "base_link", np.array([10.0, 20.0, 30.0]), limit),
              Joint("headPitch", "headYaw", np.array([10.0, 50.0, 30.0]), limit)]  # fmt: skip
    part = piece("skin", np.eye(3), [[0, 1, 2]])
    own = urdf.Piece("headYaw", "own", part, part.triangles, "skin", np.array([0.0, 0.25, 1.0]))
    robot = ET.fromstring(urdf._document("me", joints, [own], "me_meshes"))
    assert robot.get("name") == "me"
    colour = robot.find("material/color")
    assert colour is not None and colour.get("rgba") == f"0.0000 {0.25 ** (1 / 2.2):.4f} 1.0000 1"
    assert [link.get("name") for link in robot.findall("link")] == ["base_link", "headYaw", "headPitch"]
    assert [mesh.get("filename") for mesh in robot.iter("mesh")] == ["me_meshes/headYaw-own.stl"]
    origins = [str(each.get("xyz")) for each in robot.findall("joint/origin")]
    assert origins == ["0.030000 0.010000 0.020000", "0.000000 0.000000 0.030000"]  # forward, left, up
    first = robot.find("joint/limit")
    assert first is not None and first.attrib == {
        "lower": "-0.500000", "upper": "0.250000", "velocity": "1.5000", "effort": "1",
    }  # fmt: skip
