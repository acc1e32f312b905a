"""Landmarks that are found, written, drawn and read again."""

from pathlib import Path

import made_face
import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions
from surface.fit.transfer import pick_landmarks
from surface.fit.transfer.align import NoFaceFound, Similarity
from surface.fit.transfer.register import Mark, Registered
from surface.fit.transfer.reports.landmarkfile import read_landmarks
from surface.fit.transfer.reports.picture import COLOURS
from surface.fit.transfer.scan import make_scan, read_scan

TURN, SHIFT = Rotation.from_euler("xyz", [80, 10, 20], degrees=True).as_matrix(), np.array([0.5, -1.0, 2.0])


@pytest.fixture(scope="module")
def face():
    return made_face.template()


@pytest.fixture
def scan_file(face, tmp_path) -> Path:
    """The made face in metres, turned."""
    points = 0.001 * face.points @ TURN.T + SHIFT
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in points]
    path = tmp_path / "scan.obj"
    path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in face.triangles]) + "\n")
    return path


@pytest.fixture
def known(face, monkeypatch):
    """The search is tested elsewhere: here it finds what is there; the chin is 5 mm off, as searches may be."""
    heard = []

    def register(template, samples, given, progress):
        marks = {n: Mark(p.copy(), "found", 0.9) for n, p in face.landmarks.items()} | {
            n: Mark(p, "given") for n, p in given.items()
        }
        if "chin" not in given:
            marks["chin"] = Mark(face.landmarks["chin"] + np.array([0, 5.0, 0]), "carried", 0.0)
        heard.append(given)
        return Registered(None, None, marks)

    monkeypatch.setattr(pick_landmarks, "make_template", lambda *_: face)
    monkeypatch.setattr(pick_landmarks.Head, "load", lambda *_: None)
    monkeypatch.setattr(pick_landmarks, "find_face", lambda *_: Similarity(TURN.T, 1000.0, -1000.0 * TURN.T @ SHIFT))
    monkeypatch.setattr(pick_landmarks, "register", register)
    return heard


def in_file(face, name) -> np.ndarray:
    return 0.001 * face.landmarks[name] @ TURN.T + SHIFT


def test_landmarks_are_written_where_they_are_and_read_again(face, scan_file, known, tmp_path):
    out = tmp_path / "marks.toml"
    marks, picture = pick_landmarks.pick_landmarks(scan_file, "ict", out)
    read = read_landmarks(out, read_scan(scan_file))
    assert set(read) == set(marks) == set(face.landmarks)
    for name in set(read) - {"chin"}:
        np.testing.assert_allclose(read[name], in_file(face, name), atol=2e-6)
    text = out.read_text()
    assert "chin = " in text and ", carried" in text and "--landmarks" in text and "--keep" in text
    drawn = np.asarray(Image.open(picture).convert("RGB"))
    for how in ("found", "carried"):
        assert (drawn == COLOURS[how]).all(axis=2).sum() > 30, how


@pytest.mark.slow
def test_a_pixel_of_the_picture_corrects_a_landmark(face, scan_file, known, tmp_path):
    out = tmp_path / "marks.toml"
    pick_landmarks.pick_landmarks(scan_file, "ict", out)
    lines = out.read_text().splitlines()
    view = pick_landmarks.read_landmarks.__globals__["_read_toml"](out)[1]
    column, row, _ = view.pixels(in_file(face, "chin"))
    corrected = [f"chin = {{ pixel = [{column:.0f}, {row:.0f}] }}" if x.startswith("chin") else x for x in lines]
    out.write_text("\n".join(corrected))
    marks, picture = pick_landmarks.pick_landmarks(scan_file, "ict", out, keep=True)
    assert marks["chin"].how == "given" and set(known[-1]) == set(face.landmarks)
    assert np.linalg.norm(marks["chin"].place - in_file(face, "chin")) < 0.001  # 1 mm: a pixel is 0.3
    assert (np.asarray(Image.open(picture).convert("RGB")) == COLOURS["given"]).all(axis=2).sum() > 30


def test_nothing_is_overwritten_unasked_and_files_are_toml(scan_file, known, tmp_path):
    out = tmp_path / "marks.toml"
    out.write_text("chin = 3\n")
    with pytest.raises(FitError, match="is there already") as caught:
        pick_landmarks.pick_landmarks(scan_file, "ict", out)
    assert "--keep" in caught.value.hint and out.read_text() == "chin = 3\n"
    with pytest.raises(FitError, match="as TOML"):
        pick_landmarks.pick_landmarks(scan_file, "ict", tmp_path / "marks.txt")
    with pytest.raises(FitError, match="cannot be written"):
        pick_landmarks.pick_landmarks(scan_file, "ict", tmp_path / "nowhere" / "marks.toml")
    assert not list(tmp_path.glob(".marks*"))


def test_a_sheet_that_lies_flat_is_refused():
    flat = make_scan(np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1]]), np.array([[0, 1, 2]]), "flat.obj")
    with pytest.raises(FitError, match=r"flat\.obj: lies flat") as caught:
        pick_landmarks.as_it_stands(flat, LoadOptions(), "flat.obj")
    assert "--up" in caught.value.hint
    pick_landmarks.as_it_stands(flat, LoadOptions(up="z", forward="y"), "flat.obj")


def test_a_scan_shows_nothing_beside_it(face):
    scan = make_scan(face.points, face.triangles, "x")
    view = pick_landmarks.view_of(Similarity(np.eye(3), 1.0, np.zeros(3)), np.array(list(face.landmarks.values())))
    inside = face.points[(np.abs(face.points[:, :2]) < 40).all(axis=1)][::40]
    for point in np.vstack([inside, face.points[face.triangles[500]].mean(axis=0)]):
        np.testing.assert_allclose(view.place(scan, *view.pixels(point)[:2]), point, atol=1e-6)
    assert view.place(scan, -500.0, 10.0) is None


@pytest.mark.parametrize("body", [False, True])
def test_where_no_face_is_found_a_picture_shows_the_mesh_and_its_pixels_are_landmarks(
    face, scan_file, known, tmp_path, monkeypatch, body
):
    def none(*_):
        raise NoFaceFound("scan.obj: no face was found in it")

    monkeypatch.setattr(pick_landmarks, "find_face", none)
    if body:  # the lowest third of a body of 1.7 m, far below the face
        with scan_file.open("a") as f:
            below = np.array([[0, -1600.0, 0], [90, -1600, 0], [0, -1500, 60]]) @ (0.001 * TURN.T) + SHIFT
            f.write("".join(f"v {x} {y} {z}\n" for x, y, z in below) + "f -1 -2 -3\n")
    out = tmp_path / "marks.toml"
    up, forward = ("xyz"[k] if s > 0 else "-" + "xyz"[k] for k, s in (_axis(TURN[:, 1]), _axis(TURN[:, 2])))
    options = LoadOptions(up=up, forward=forward)
    with pytest.raises(NoFaceFound, match="by hand") as caught:
        pick_landmarks.pick_landmarks(scan_file, "ict", out, options=options)
    assert "--keep" in caught.value.hint and str(out.with_suffix(".png")) in caught.value.hint
    text = out.read_text()
    assert text.count("# ") >= len(pick_landmarks.BY_HAND) and "# mouth_left = { pixel = [0, 0] }" in text
    view = pick_landmarks.read_landmarks.__globals__["_read_toml"](out)[1]
    places = view.pixels(np.array([in_file(face, n) for n in pick_landmarks.BY_HAND]))
    assert ((places[:, :2] > 0) & (places[:, :2] < [810, 900])).all()
    assert np.ptp(places[:, 1]) > 100  # the face is large enough to be clicked on
    for name, (column, row, _) in zip(pick_landmarks.BY_HAND, places, strict=True):
        line = f"{name} = {{ pixel = [{column:.0f}, {row:.0f}] }}"
        text = text.replace(f"# {name} = {{ pixel = [0, 0] }}", line)
    out.write_text(text)
    read = read_landmarks(out, read_scan(scan_file))
    assert max(np.linalg.norm(read[n] - in_file(face, n)) for n in pick_landmarks.BY_HAND) < 0.004


def _axis(way: np.ndarray) -> tuple[int, float]:
    k = int(np.abs(way).argmax())
    return k, float(way[k])
