"""The shipped head's own form, changed by a known map and moved, gets its expressions again.

The map is the oracle: where it puts a place of the shipped head, the new head must have it.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions
from surface.fit.transfer.api import transfer_head
from surface.fit.transfer.template import make_template
from surface.head import Head

ICT = Path(__file__).parents[4] / "configs" / "heads" / "ict"
TURN = Rotation.from_euler("xyz", [85, 4, 17], degrees=True).as_matrix()  # about z up
METRES = 0.001
SHIFT = np.array([0.4, -0.2, 1.6])
SKIN = (0.5, 0.36, 0.3)  # sRGB


def other_face(p: np.ndarray) -> np.ndarray:
    """The known map: a wider, shorter face with a longer chin, a larger nose and eyes set lower."""
    out = p * [1.05, 0.97, 1.0]
    out[:, 1] -= 5.0 * np.exp(-((p[:, 0] / 30) ** 2) - ((p[:, 1] + 75) / 25) ** 2)
    out[:, 2] += 4.0 * np.exp(-((p[:, 0] / 14) ** 2) - ((p[:, 1] - 5) / 18) ** 2)
    out[:, 1] -= 3.0 * np.exp(-(((np.abs(p[:, 0]) - 32) / 22) ** 2) - ((p[:, 1] - 36) / 18) ** 2)
    return out


@pytest.fixture(scope="module")
def shipped() -> Head:
    return Head.load(ICT)


@pytest.fixture(scope="module")
def scan_file(shipped, tmp_path_factory) -> Path:
    template = make_template(shipped, "ict")
    points = METRES * other_face(template.points) @ TURN.T + SHIFT
    path = tmp_path_factory.mktemp("scan") / "scan.obj"
    colour = " ".join(map(str, SKIN))
    lines = [f"v {x:.6f} {y:.6f} {z:.6f} {colour}" for x, y, z in points]
    path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in template.triangles]) + "\n")
    return path


@pytest.fixture(scope="module")
def made(scan_file):
    out = scan_file.parent / "head"
    heard: list[float] = []
    folder = scan_file.parent / "report"
    with pytest.MonkeyPatch.context() as patch:
        for name, count in (("FEATURES", 300), ("FACE", 150), ("REST", 110)):  # the map is smooth: it needs no more
            patch.setattr(f"surface.fit.transfer.register.{name}", count)
        report = transfer_head(
            scan_file, ICT, out, name="other", options=LoadOptions(up="z"), report_dir=folder,
            progress=lambda _, done: heard.append(done),
        )  # fmt: skip
    return Head.load(out), report, heard


def corresponding(shipped: Head, head: Head, pose: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Places of both faces in a pose, those of the shipped head's vertices at the front; they have the same (u, v),
    which does not hold for the vertices, because a head is tessellated in its own form."""
    out = []
    mesh = shipped.part("face").mesh
    front = mesh.uv
    rest = shipped.part("face").surface.evaluate(front)
    chosen = (rest[:, 2] > 60) & (rest[:, 1] > -80) & (rest[:, 1] < 80)
    for h in (shipped, head):
        h.pose(h.values(pose))
        face = h.part("face")
        weights = face.surface.basis_matrix(front, side=mesh.side)
        out.append((weights @ face.control_points)[chosen])
        h.pose(h.values({}))
    return out[0], out[1]


def gaps(head: Head, contact: str, pose: dict[str, float]) -> np.ndarray:
    """Height of each column's open gap between lips or lids in a pose, mm."""
    own = next(c for c in head.data.contacts if c.name == contact)
    head.pose(head.values(pose))
    points = head.part(own.part).control_points
    at = head.part(own.part).surface.with_points(points).evaluate(own.places[:, :, :10].reshape(-1, 2))
    head.pose(head.values({}))
    upper, lower = at.reshape(2, -1, 10, 3)
    return upper[..., 1].min(axis=1) - lower[..., 1].max(axis=1)


def aligned(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Points turned and shifted nearest to others: the new head has its own place, but the scan's true size."""
    turn, _ = Rotation.align_vectors(others - others.mean(axis=0), points - points.mean(axis=0))
    return turn.apply(points - points.mean(axis=0)) + others.mean(axis=0)


@pytest.mark.slow
def test_the_face_has_the_form_of_the_scan(shipped, made):
    head, report, heard = made
    before, after = corresponding(shipped, head, {})
    wanted = other_face(before)
    assert np.sqrt(((after - before) ** 2).sum(axis=1).mean()) > 2.0  # the map is no trifle
    off = np.linalg.norm(aligned(after, wanted) - wanted, axis=1)
    assert np.sqrt((off**2).mean()) < 1.3  # along the skin, too
    assert report.fit.parts[0].neutral.rms < 0.3 and report.fit.parts[0].samples > 10_000
    assert heard == sorted(heard) and heard[0] > 0 and heard[-1] <= 1


@pytest.mark.slow
def test_eyes_sit_in_their_sockets(shipped, made):
    head, _, _ = made
    before, after = corresponding(shipped, head, {})
    wanted = other_face(before)
    turn, _ = Rotation.align_vectors(wanted - wanted.mean(axis=0), after - after.mean(axis=0))
    eyes = turn.apply(head.data.eyes - after.mean(axis=0)) + wanted.mean(axis=0)
    assert np.linalg.norm(eyes - other_face(shipped.data.eyes), axis=1).max() < 1.5
    assert head.data.eye_radius == pytest.approx(shipped.data.eye_radius, rel=0.08)


@pytest.mark.slow
def test_every_expression_is_there_and_moves_as_on_the_shipped_head(shipped, made):
    head, report, _ = made
    assert set(report.fit.parameters) == set(shipped.groups) and not report.fit.missing
    for name, most in (("jawOpen", 0.15), ("mouthSmileLeft", 0.2), ("browInnerUp", 0.15), ("cheekPuff", 0.2)):
        rest, moved = corresponding(shipped, head, {}), corresponding(shipped, head, {name: 1.0})
        theirs, ours = moved[0] - rest[0], moved[1] - rest[1]
        assert np.sqrt(((ours - theirs) ** 2).sum() / (theirs**2).sum()) < most, name


@pytest.mark.slow
def test_lips_seal_and_lids_close(made):
    head, _, _ = made
    assert gaps(head, "lips", {}).max() < 0.5
    assert gaps(head, "lips", {"jawOpen": 0.7}).max() > 8
    for side, shape in (("left_lids", "eyeBlinkLeft"), ("right_lids", "eyeBlinkRight")):
        assert gaps(head, side, {}).max() > 5
        assert gaps(head, side, {shape: 1.0}).max() < 0.5


@pytest.mark.slow
def test_the_report_tells_where_landmarks_are_what_was_open_and_what_is_shut(shipped, made, scan_file):
    _, report, _ = made
    own = make_template(shipped, "ict").landmarks
    for mark in report.landmarks:
        place = METRES * other_face(own[mark.name][None])[0] @ TURN.T + SHIFT
        off = np.linalg.norm(mark.place - place) / METRES
        assert off < (8.0 if mark.how == "carried" else 4.0), mark
        assert mark.off_mm < 8.0 and (mark.sure > 0.5) == (mark.how == "found"), mark
    assert {m.name for m in report.landmarks} == set(own) and report.matched > 0.8 and report.registration.rms < 1.0
    assert {"eyeBlinkLeft", "eyeBlinkRight"} >= {n for n, (low, high) in report.reseated.items() if high > 1.4}
    assert len(report.reseated) < 40  # most shapes stay as the map makes them
    assert set(report.openings) == {"mouth", "left eye", "right eye"}
    assert len(report.gaps) == 4 and all(gap.mm <= gap.most_mm for gap in report.gaps)
    table = json.loads((scan_file.parent / "report" / "report.json").read_text())
    assert table["scan_to_head_mm"]["face"]["rms"] == pytest.approx(report.fit.parts[0].neutral.rms)
    text = (scan_file.parent / "report" / "report.md").read_text()
    assert all(f"| {name} |" in text for name in own) and "eyeBlinkLeft 1: closed" in text
    for name in ("landmarks.png", "error.png"):
        assert (scan_file.parent / "report" / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_skin_has_the_scans_colour(made):
    head, report, _ = made
    linear = ((np.array(SKIN) + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1
    albedo = head.part("face").attributes["albedo"]
    np.testing.assert_allclose(np.median(albedo, axis=0), linear, atol=0.01)
    assert any("colours taken from the scan" in note for note in report.fit.notes)


@pytest.mark.slow
def test_unit_and_turn_are_said(made):
    _, report, _ = made
    notes = " ".join(report.fit.notes)
    assert "unit taken to be m" in notes and "by its form" in notes


def landmark_table(shipped: Head, turn: np.ndarray = TURN, mirror: bool = False) -> str:
    lines = []
    for name, place in make_template(shipped, "ict").landmarks.items():
        x, y, z = METRES * other_face(place[None])[0] @ turn.T + SHIFT
        if mirror:
            name = name.replace("left", "*").replace("right", "left").replace("*", "right")
        lines.append(f"{name} = [{x}, {y}, {z}]")
    return "\n".join(lines)


@pytest.mark.slow
def test_landmarks_with_left_and_right_exchanged_are_refused(shipped, scan_file, tmp_path):
    (tmp_path / "marks.toml").write_text(landmark_table(shipped, mirror=True))
    with pytest.raises(FitError, match="left and right"):
        transfer_head(scan_file, ICT, tmp_path / "head", name="x", landmarks=tmp_path / "marks.toml")
    assert not (tmp_path / "head").exists()


@pytest.mark.slow
def test_wrong_options_and_meshes_without_a_face_are_refused(tmp_path):
    grid = [[x, y, 0.02 * np.sin(x + 2 * y)] for x in range(12) for y in range(12)]
    lines = [f"v {x} {y} {z}" for x, y, z in grid]
    lines += [f"f {12 * i + j + 1} {12 * i + j + 13} {12 * i + j + 14}" for i in range(11) for j in range(11)]
    (tmp_path / "sheet.obj").write_text("\n".join(lines))
    for options, message in (
        (LoadOptions(unit="ell"), "--unit ell"), (LoadOptions(up="w"), "--up w"),
        (LoadOptions(up="y", forward="-y"), "one axis"), (LoadOptions(up="y", forward="z"), "no face was found"),
    ):  # fmt: skip
        with pytest.raises(FitError, match=message):
            transfer_head(tmp_path / "sheet.obj", ICT, tmp_path / "head", name="x", options=options)
    assert not (tmp_path / "head").exists()
