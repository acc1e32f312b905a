"""One good head comes to the same place however it is brought."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from traps import EYE_X, good_head, on_body, placed, transformed

from surface.fit.source.load import Loaded
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names
from surface.fit.source.placing import place as place_module
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.source.placing.conventions import GLTF, VRM0
from surface.fit.source.placing.frame import EYES_AT, EYES_MM, UNITS, find_frame
from surface.fit.source.placing.orient import SQUARE
from surface.fit.source.placing.place import HeadSize, eye_middle, find_neck, head_size, neck_of, place

HEAD = good_head()
BODY = on_body(HEAD)


@pytest.mark.slow
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("k", range(len(SQUARE)))
def test_any_unit_and_axes_come_to_the_same_place(k, unit):
    file = transformed(HEAD, SQUARE[k], 1.0 / UNITS[unit], (3.0, -1.0, 2.0))
    got = placed(file)
    assert got.placement.unit == unit
    np.testing.assert_allclose(got.mesh.vertices, HEAD.vertices, atol=0.01)
    np.testing.assert_allclose(got.mesh.deltas, HEAD.deltas, atol=0.01)
    assert any("unit taken to be" in note for note in got.notes)
    assert any("turned: up is" in note for note in got.notes) == (not np.array_equal(SQUARE[k], np.eye(3)))


@pytest.mark.parametrize("k", [0, 7, 13, 22])
def test_the_placement_leads_back_to_the_file(k):
    file = transformed(HEAD, SQUARE[k], 0.1, (3.0, -1.0, 2.0))
    got = placed(file)
    np.testing.assert_allclose(got.placement.points(file.vertices), got.mesh.vertices, atol=1e-9)
    np.testing.assert_allclose(got.placement.file_points(got.mesh.vertices), file.vertices, atol=1e-9)
    np.testing.assert_allclose(got.placement.file_moves(got.mesh.deltas), file.deltas, atol=1e-9)


@pytest.mark.parametrize("eyeballs", [True, False])
@pytest.mark.parametrize("unit", ["m", "ft", "dm"])
def test_a_head_on_a_body_comes_to_the_same_place_without_it(unit, eyeballs):
    head = good_head(eyeballs=eyeballs)
    got = placed(transformed(on_body(head), SQUARE[9], 1.0 / UNITS[unit]))
    assert got.placement.unit == unit
    assert got.mesh.vertices[:, 1].min() > -200 and np.abs(got.mesh.vertices[:, 0]).max() < 160
    assert any("a body" in note and "'Boots'" in note and "'Trousers'" in note for note in got.notes)
    wanted = placed(head)
    for name, delta in zip(head.names, got.mesh.deltas, strict=True):  # what moves has not been cut, and stands alike
        moved, before = np.abs(delta).max(axis=1) > 1.0, np.abs(head.deltas[head.names.index(name)]).max(axis=1) > 1.0
        assert moved.sum() == before.sum()
        np.testing.assert_allclose(
            got.mesh.vertices[moved].mean(axis=0), wanted.mesh.vertices[before].mean(axis=0), atol=0.1
        )


def test_eyes_stand_where_the_cameras_expect_them():
    got = placed(transformed(HEAD, SQUARE[5], 0.001, (0, 1.6, 0)))
    np.testing.assert_allclose(got.marks.eyes.centres, EYES_AT + np.outer([EYE_X, -EYE_X], [1, 0, 0]), atol=0.01)


def test_a_head_a_hair_s_breadth_from_its_place_stays_where_it_is():
    """So what omote exports comes back at the same numbers."""
    at_place = placed(HEAD).mesh.vertices
    for off, stays in ((0.03, True), (0.3, False)):
        mesh = replace(HEAD, vertices=at_place + np.array([off, 0.0, 0.0]))
        got = placed(mesh).mesh.vertices
        assert np.array_equal(got, mesh.vertices) == stays
        assert stays or np.abs(got - at_place).max() < 0.05


def test_without_eyeballs_the_lids_tell_nearly_the_same_place():
    got = placed(transformed(good_head(eyeballs=False), SQUARE[5], 0.001, (0, 1.6, 0)))
    skin = HEAD.vertices[: len(got.mesh.vertices)]
    assert np.abs(got.mesh.vertices - skin).max() < 4.0


@pytest.mark.parametrize("angle", [12.0, 35.0, 80.0])
def test_a_scan_that_stands_askew_is_levelled(angle):
    rng = np.random.default_rng(int(angle))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(np.radians(angle)) * cross + (1 - np.cos(np.radians(angle))) * cross @ cross
    got = placed(transformed(HEAD, turn.T, 0.1))
    assert any("levelled" in note for note in got.notes)
    left, right = got.marks.eyes.centres
    assert abs(left[1] - right[1]) < 0.2 and abs(left[2] - right[2]) < 0.2
    crown = got.mesh.vertices[np.argmax(got.mesh.vertices[:, 1])]
    assert np.abs(crown - HEAD.vertices[np.argmax(HEAD.vertices[:, 1])]).max() < 30.0
    assert np.abs(got.mesh.vertices - HEAD.vertices).max() < 0.2 * 335.0


def test_the_format_defines_axes_and_unit():
    got = placed(transformed(HEAD, np.eye(3), 0.001), convention=GLTF)
    assert not any("unit" in note or "turned" in note for note in got.notes)
    backwards = np.diag([-1.0, 1.0, -1.0])
    got = placed(transformed(HEAD, backwards, 0.001), convention=VRM0)
    np.testing.assert_allclose(got.mesh.vertices, HEAD.vertices, atol=0.01)
    assert not any("turned" in note for note in got.notes)


def test_a_format_is_corrected_where_the_anatomy_contradicts_it():
    got = placed(transformed(HEAD, SQUARE[9], 0.1), convention=GLTF)  # a .glb in centimetres, z up
    np.testing.assert_allclose(got.mesh.vertices, HEAD.vertices, atol=0.01)
    assert any("although glTF defines m" in note for note in got.notes)
    assert any("although glTF defines y and z" in note for note in got.notes)


def test_a_scale_of_no_known_unit_is_found_by_the_eyes():
    got = placed(transformed(HEAD, np.eye(3), 1.0 / 1.9))  # 1.9 mm a unit
    assert got.placement.unit == "" and got.marks.eyes.apart == pytest.approx(EYES_MM)
    assert any("no usual unit fits" in note for note in got.notes)


def test_what_is_told_comes_first():
    got = placed(transformed(HEAD, np.eye(3), 0.1), unit="mm", convention=GLTF)
    assert got.placement.scale == 1.0 and any("--unit mm" in note and "mm apart" in note for note in got.notes)
    told = find_frame(HEAD.vertices, dict(zip(HEAD.names, HEAD.deltas, strict=True)), up="z", forward="-y")
    np.testing.assert_allclose(told.turn, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def test_shapes_named_by_the_viewer_are_noticed():
    names = tuple(n.replace("Left", "*").replace("Right", "Left").replace("*", "Right") for n in HEAD.names)
    got = placed(replace(HEAD, names=names))
    np.testing.assert_allclose(got.mesh.vertices, HEAD.vertices, atol=0.01)
    assert any("as the viewer sees them" in note for note in got.notes)


def test_the_neck_stands_below_the_eyes_and_turns_what_is_above_it():
    got = placed(HEAD)
    neck = find_neck(got.mesh, EYES_AT, head_size(got.marks))
    share = neck.share(got.mesh.vertices)
    y = got.mesh.vertices[:, 1]
    assert share[y > -40].min() > 0.99 and share[y < -180].max() < 0.1
    assert neck.pivot[0] == 0.0 and -80 < neck.pivot[1] < -30 and abs(neck.pivot[2]) < 30


@pytest.mark.parametrize(("k", "unit"), [(3, "m"), (18, "ft")])
def test_the_real_head_comes_to_the_same_place(k, unit):
    path = Path(__file__).parents[6] / "shared" / "data" / "ict-facekit" / "ict_neutral_and_expressions.npz"
    if not path.exists():
        pytest.skip("ICT-FaceKit's mesh is beside the repository only where it is built")
    raw = np.load(path)
    names = [str(n).replace("_L", "Left").replace("_R", "Right") for n in raw["names"]]
    chosen = [i for i, n in enumerate(names) if n in ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen", "mouthPucker")]
    faces = raw["faces"].astype(np.int64)
    mesh = FitMesh(raw["neutral"].astype(float), faces, raw["uv"].astype(float), raw["face_uv"].astype(np.int64),
                   tuple(names[i] for i in chosen), raw["deltas"][chosen].astype(float),
                   np.zeros(len(faces), np.int64), ("mesh",))  # fmt: skip
    wanted = placed(mesh).mesh.vertices
    got = placed(transformed(mesh, SQUARE[k], 10.0 / UNITS[unit], (1.0, 2.0, 3.0)))
    assert got.placement.unit == unit
    np.testing.assert_allclose(got.mesh.vertices, wanted, atol=0.02)
    assert np.linalg.norm(wanted - 10 * mesh.vertices, axis=1).max() < 6.0  # it stands nearly where it stood


def marks(apart: float = EYES_MM, mouth_below: float | None = 72.0, *, balls: bool = True) -> Landmarks:
    """Landmarks with eyes so far apart and a mouth so far below them, mm."""
    eyes = Eyes(np.array([[apart / 2, 10.0, 5.0], [-apart / 2, 10.0, 5.0]]), True, balls, "")
    return Landmarks(eyes, None if mouth_below is None else np.array([0.0, 10.0 - mouth_below, 9.0]))


@pytest.mark.parametrize(
    ("given", "size"),
    [
        (Landmarks(), (1.0, 1.0)), (marks(), (1.0, 1.0)), (marks(2 * EYES_MM, 72.0), (2.0, 1.0)),
        (marks(mouth_below=108.0), (1.0, 1.5)), (marks(mouth_below=200.0), (1.0, 2.0)),
        (marks(mouth_below=9.0), (1.0, 0.5)),
        (marks(3 * EYES_MM, None), (3.0, 3.0)), (marks(0.5 * EYES_MM, 300.0), (0.5, 1.0)),
    ],
)  # fmt: skip
def test_a_heads_size_is_that_of_its_face_against_the_shipped_one(given, size):
    found = head_size(given)
    assert (found.across, found.along) == pytest.approx(size)


def test_eyeballs_lie_behind_and_below_the_lids():
    np.testing.assert_allclose(eye_middle(marks().eyes, HeadSize(2.0, 3.0)), [0.0, 10.0, 5.0])
    np.testing.assert_allclose(eye_middle(marks(balls=False).eyes, HeadSize(2.0, 3.0)), [0.0, 0.8, -15.8])


def cloud(points) -> FitMesh:
    points = np.array(points, float)
    none = np.zeros((0, 4), np.int64)
    return FitMesh(points, none, np.zeros((0, 2)), none, (), np.zeros((0, len(points), 3)))


def test_the_neck_of_a_head_without_eyes_is_in_its_lower_quarter():
    neck = neck_of(cloud([[-5.0, -100.0, -20.0], [7.0, 100.0, 60.0]]), Landmarks())
    assert neck.pivot == pytest.approx((0.0, -40.0, 20.0))
    assert (neck.slope, neck.still, neck.whole) == pytest.approx((0.0, -96.0, -60.0))
    with_eyes = cloud([[0.0, 0.0, 0.0]])
    assert neck_of(with_eyes, marks()) == find_neck(with_eyes, EYES_AT, HeadSize())


@pytest.mark.parametrize("along", [1.0, 0.5])
@pytest.mark.parametrize("across", [1.0, 2.0])
def test_the_neck_turns_about_the_middle_of_what_there_is_at_its_height(along, across):
    eyes = np.array([3.0, 20.0, 40.0])
    height = 20.0 - 155.0 * along
    ring = [[3.0, height, 10.0], [40.0, height, -60.0], [-40.0, height, -20.0], [0.0, height, 0.0]]
    beyond = [[0.0, height + 15.1 * along, 300.0], [0.0, height - 15.1 * along, 300.0],
              [70.1 * across + 3.0, height, 300.0], [3.0 - 70.1 * across, height, 300.0]]  # fmt: skip
    neck = find_neck(cloud(ring + beyond), eyes, HeadSize(across, along))
    assert neck.pivot == pytest.approx((3.0, 20.0 - 91.1 * along, -25.0))
    base = 20.0 + 0.35 * 40.0
    assert (neck.slope, neck.still, neck.whole) == pytest.approx((0.35, base - 217.6 * along, base - 143.6 * along))
    near = [[69.9 * across + 3.0, height + 14.9 * along, 30.0], [3.0 - 69.9 * across, height - 14.9 * along, 0.0]]
    assert find_neck(cloud(ring + near), eyes, HeadSize(across, along)).pivot[2] == pytest.approx(-15.0)
    usual = 40.0 - 89.2 * along
    assert find_neck(cloud(ring[:3]), eyes, HeadSize(across, along)).pivot[2] == pytest.approx(usual)  # too few
    for far, limit in ((500.0, 60.0), (-900.0, -60.0)):
        shifted = np.add(ring, [0.0, 0.0, far])
        assert find_neck(cloud(shifted), eyes, HeadSize(across, along)).pivot[2] == pytest.approx(usual + limit * along)


@pytest.mark.parametrize(("off", "shifted"), [(0.04, False), (0.05, False), (0.06, True)])
def test_a_head_0_05_mm_from_its_place_stays(monkeypatch, off, shifted):
    monkeypatch.setattr(place_module, "cut_bust", lambda mesh, at, size: (mesh, (f"cut at {size:.1f}",)))
    mesh = cloud([[1.0, 2.0, 3.0]])
    centres = EYES_AT + np.array([[EYES_MM, off, 0.0], [-EYES_MM, off, 0.0]])
    found = Landmarks(Eyes(centres, True, True, ""), centres.mean(axis=0) - [0.0, 72.0, 0.0], np.array([1.0, 1.0, 1.0]))
    got = place(Loaded(mesh, map_names(()), marks=found, notes=("first",)))
    shift = np.array([0.0, -off, 0.0]) if shifted else np.zeros(3)
    np.testing.assert_allclose(got.mesh.vertices, mesh.vertices + shift)
    np.testing.assert_allclose(got.marks.eyes.centres, centres + shift)
    np.testing.assert_allclose(got.marks.mouth, found.mouth + shift)
    np.testing.assert_allclose(got.marks.jaw, found.jaw + shift)
    np.testing.assert_allclose(got.placement.shift, shift)
    assert got.notes == ("first", "cut at 2.0")  # the greater of both sizes
    bare = Loaded(mesh, map_names(()))
    assert place(bare) is bare
