"""What a transfer makes of options, landmarks and sizes, before and after it registers anything."""

import json
from dataclasses import replace

import made_face
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions
from surface.fit.transfer import api
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.reports.landmarkfile import read_landmarks, swapped
from surface.fit.transfer.scan import make_scan

TURN = Rotation.from_euler("x", 90, degrees=True).as_matrix()
SHIFT = np.array([0.5, -1.0, 2.0])


@pytest.fixture(scope="module")
def face():
    return made_face.template()


@pytest.fixture(scope="module")
def scan(face):
    """The face in metres, z up; far beside it something else."""
    points = np.vstack([face.points, face.points + np.array([900.0, 0, 0]), face.points - [0, 0, 500.0]])
    tri = np.vstack([face.triangles + k * len(face.points) for k in range(3)])
    return make_scan(0.001 * points @ TURN + SHIFT, tri, "x.obj")


def picked(face, *names, noise: float = 0.0):
    rng = np.random.default_rng(0)
    chosen = names or tuple(face.landmarks)
    return {n: 0.001 * (face.landmarks[n] + noise * rng.normal(size=3)) @ TURN + SHIFT for n in chosen}


def find(face, scan, marks, **options):
    return api.find_face(scan, face, marks, LoadOptions(**options), "x.obj")


def test_a_face_is_found_by_four_landmarks_and_searched_for_with_fewer(face, scan, monkeypatch) -> None:
    heard = []
    monkeypatch.setattr(api, "align", lambda *given: heard.append(given) or "searched")
    names = list(face.landmarks)
    found = find(face, scan, picked(face, *names[:4]))
    np.testing.assert_allclose(found.turn, TURN, atol=1e-9)
    assert found.scale == pytest.approx(1000) and not heard
    assert find(face, scan, picked(face, *names[:3]), up="z", forward="-y") == "searched"
    template, samples, up, forward, where = heard[0]
    assert template is face and where == "x.obj" and len(samples.points) > 1000
    np.testing.assert_array_equal([up, forward], [[0, 0, 1], [0, -1, 0]])
    find(face, scan, {})
    assert heard[1][2] is None is heard[1][3]


def test_options_that_contradict_each_other_are_named(face, scan) -> None:
    for options, message in (
        ({"up": "w"}, "--up w: is not one of"), ({"forward": "no"}, "--forward no: is not one of"),
        ({"up": "-y", "forward": "y"}, "--up -y --forward y: are one axis"),
        ({"unit": "ell"}, "--unit ell: is not one"),
    ):  # fmt: skip
        with pytest.raises(FitError, match=message) as caught:
            find(face, scan, picked(face), **options)
        assert str(caught.value.hint).startswith("--")
    assert find(face, scan, picked(face), unit="cm", up="y", forward="z").scale == pytest.approx(1000)


def test_landmarks_whose_sides_are_exchanged_or_whose_names_are_wrong_are_refused(face, scan) -> None:
    with pytest.raises(FitError, match=r"x\.obj: left and right") as caught:
        find(face, scan, swapped(picked(face, noise=1.0)))
    assert "subject's left" in str(caught.value.hint)
    marks = picked(face)
    names = list(marks)
    mixed = dict(zip(names, [marks[n] for n in names[5:] + names[:5]], strict=True))
    with pytest.raises(FitError, match="do not lie as those of a face"):
        find(face, scan, mixed)
    assert find(face, scan, picked(face, noise=6.0)).scale == pytest.approx(1000, rel=0.1)  # picked by hand


def test_a_few_landmarks_in_a_plane_are_not_taken_for_exchanged_ones(face, scan) -> None:
    """Exchanged ones fit a face that looks the other way, better by chance where their depths are off."""
    names = ("left_eye_inner", "right_eye_inner", "mouth_left", "mouth_right", "chin")
    marks = {n: 0.001 * (face.landmarks[n] * [1.0, 1.0, -1.0]) @ TURN + SHIFT for n in names}
    off, other = (api._by_landmarks(each, face)[1] for each in (marks, swapped(marks)))
    assert other < 1e-9 < off
    assert find(face, scan, marks).scale == pytest.approx(1000, rel=0.01)


def test_landmarks_are_off_by_the_root_mean_square_in_heights(face) -> None:
    marks = {n: p.copy() for n, p in face.landmarks.items()}
    assert api._by_landmarks(marks, face)[1] < 1e-9
    marks["chin"][0] += 20.0
    found, off = api._by_landmarks(marks, face)
    left = np.array([found.points(marks[n]) - face.landmarks[n] for n in marks])
    assert off == pytest.approx(np.sqrt((left**2).sum(axis=1).mean()) / face.height)


def test_in_the_heads_frame_only_what_is_near_a_head_is_kept(face, scan) -> None:
    found = find(face, scan, picked(face))
    kept = api.in_frame(scan, face, found)
    assert len(kept.triangles) == len(face.triangles)
    at = kept.vertices[kept.triangles].reshape(-1, 3)
    np.testing.assert_allclose(
        [at.min(axis=0), at.max(axis=0)], [face.points.min(axis=0), face.points.max(axis=0)], atol=1e-6
    )
    h = face.height
    ends = np.array(
        [[0, 100 + 0.3 * h, 50], [0, 100 + 0.45 * h, 50], [0, -100 - 0.3 * h, 50], [0, -100 - 0.45 * h, 50]]
    )
    small = np.repeat(ends, 3, axis=0) + np.tile([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], (4, 1))
    ids = np.arange(12).reshape(4, 3)
    bits = make_scan(small, ids, "x")
    still = Similarity(np.eye(3), 1.0, np.zeros(3))
    middles = bits.vertices[api.in_frame(bits, face, still).triangles].mean(axis=1)[:, 1]
    assert len(middles) == 2 and np.abs(middles).max() < 100 + 0.35 * h


@pytest.mark.parametrize(
    ("scale", "unit", "factor", "words"),
    [
        (1000.0, None, 1.0, "unit taken to be m: 1.00 times"), (1.0, None, 1.0, "unit taken to be mm"),
        (800.0, None, 1.25, "unit taken to be m: 1.25 times"), (1000 / 1.4, None, 1.4, "1.40 times"),
        (1000 / 0.75, None, 0.75, "0.75 times"), (1000 / 1.5, None, 1.0, "unit unknown"),
        (0.2, None, 1.0, "unit unknown"), (1000 / 0.65, None, 1.0, "unit unknown"),
        (8.0, "cm", 1.25, None), (8.0, "m", 125.0, None),
    ],
)  # fmt: skip
def test_the_true_size_is_that_of_a_unit_that_people_have(scale, unit, factor, words) -> None:
    found = Similarity(np.eye(3), scale, np.zeros(3), 0.0421)
    made, notes = api._true_size(found, unit, {})
    assert made == pytest.approx(factor)
    assert notes[0] == "face found by its form, score 0.042; turned by 0 degrees"
    assert len(notes) == 1 if words is None else words in notes[1]


@pytest.mark.parametrize("degrees", [0, 37, 120, 180])
def test_notes_say_how_the_face_was_found_and_by_how_much_it_was_turned(degrees) -> None:
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])).as_matrix()
    marks = dict.fromkeys("abcd", np.zeros(3))
    notes = api._true_size(Similarity(turn, 1.0, np.zeros(3), 0.1), "mm", marks)[1]
    assert notes == [f"face found by 4 landmarks; turned by {degrees} degrees"]
    del marks["a"]
    assert "by its form" in api._true_size(Similarity(turn, 1.0, np.zeros(3), 0.1), "mm", marks)[1][0]


def test_nothing_is_read_where_nothing_can_be_written(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(Exception, match="file"):
        api.transfer_head("nowhere.obj", "nowhere", tmp_path / "file" / "head", name="x")
    assert replace(LoadOptions(), unit="m").unit == "m"


DOZEN = (
    "nose_tip", "chin", "left_eye_inner", "left_eye_outer", "right_eye_inner", "right_eye_outer", "mouth_left",
    "mouth_right", "upper_lip", "lower_lip", "left_eye_upper", "right_eye_upper",
)  # fmt: skip


def a_dozen(face, kind: str) -> str:
    """Landmarks picked by hand, a millimetre off, as a file of some kind."""
    marks = {n: p.tolist() for n, p in picked(face, *DOZEN, noise=1.0).items()}
    if kind == ".json":
        return json.dumps({"landmarks": marks})
    if kind == ".pp":
        points = (f'<point x="{x}" y="{y}" z="{z}" name="{n}" active="1"/>' for n, (x, y, z) in marks.items())
        return f"<!DOCTYPE PickedPoints><PickedPoints>{''.join(points)}</PickedPoints>"
    return "\n".join(f"{n} = {p}" for n, p in marks.items())


@pytest.mark.parametrize("kind", [".toml", ".json", ".pp"])
def test_a_dozen_landmarks_by_hand_place_a_scan_without_a_search(face, scan, tmp_path, monkeypatch, kind) -> None:
    monkeypatch.setattr(api, "align", None)
    path = tmp_path / f"marks{kind}"
    path.write_text(a_dozen(face, kind))
    marks = read_landmarks(path, scan)
    assert len(marks) == 12
    found = find(face, scan, marks)
    off = np.degrees(np.arccos(np.clip((np.trace(found.turn @ TURN.T) - 1) / 2, -1, 1)))
    assert off < 2 and found.scale == pytest.approx(1000, rel=0.03)
    nose = found.points(0.001 * face.landmarks["nose_tip"] @ TURN + SHIFT)
    assert np.linalg.norm(nose - face.landmarks["nose_tip"]) < 2.0
