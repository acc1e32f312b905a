"""A face found by its form alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from slit_sheet import slit_sheet
from traps import joined, on_body, placed, transformed

from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing import match
from surface.fit.source.placing.match import FaceMatch, match_face
from surface.fit.source.placing.orient import SQUARE
from surface.fit.source.placing.symmetry import Mirror, find_mirrors
from surface.head import Head

EYES = np.array([[31.8, 36.1, 84.2], [-31.8, 36.1, 84.2]])


@pytest.fixture(scope="module")
def bare() -> FitMesh:
    """The shipped head's skin as a scan would have it: no shapes, no eyeballs, one object."""
    head = Head.load(Path(__file__).parents[5] / "configs" / "heads" / "ict")
    parts = []
    for name in ("face", "back"):
        part = head.part(name)
        faces = np.column_stack([part.triangles, np.full(len(part.triangles), -1)]).astype(np.int64)
        n = len(part.vertices)
        parts.append(FitMesh(part.vertices.astype(float), faces, np.zeros((n, 2)), faces.copy(), (),
                             np.zeros((0, n, 3)), np.zeros(len(faces), np.int64), ("Scan",)))  # fmt: skip
    return joined(*parts)


def askew(degrees: float, axis: tuple[float, float, float]) -> np.ndarray:
    a = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.mark.slow
@pytest.mark.parametrize(("turn", "scale"), [
    (SQUARE[18], 1 / 304.8), (askew(140, (-2, 1, 1)), 0.37),
])  # fmt: skip
def test_a_scan_comes_to_its_place(bare, turn, scale):
    mesh = transformed(bare, turn, scale, (1.0, 2.0, 3.0))
    face = match_face(mesh.vertices, mesh.faces)
    assert face is not None and face.scale == pytest.approx(scale, rel=0.05)
    np.testing.assert_allclose((face.at(EYES) - [1, 2, 3]) / scale @ turn.T, EYES, atol=4.0)
    got = placed(mesh)
    assert any("by its form" in note for note in got.notes)
    assert np.abs(got.mesh.vertices - bare.vertices).max() < 15.0  # of 340 mm: pitch and size are known that well


@pytest.mark.slow
def test_a_face_is_found_on_a_body_without_shapes(bare):
    mesh = transformed(on_body(bare), SQUARE[4], 0.01)
    got = placed(mesh)
    assert any("a body" in note for note in got.notes) and got.placement.unit == "dm"
    assert got.mesh.vertices[:, 1].min() > -215 and abs(got.mesh.vertices[:, 1].max() - 145) < 12


@pytest.mark.slow
def test_a_mask_without_the_back_of_the_head_is_found(bare):
    front = bare.vertices[bare.faces[:, 0], 2] > 35.0
    mask = replace(bare, faces=bare.faces[front], face_uv=bare.face_uv[front], piece=bare.piece[front])
    used = np.unique(mask.faces[mask.faces >= 0])
    at = np.full(len(bare.vertices), -1)
    at[used] = np.arange(len(used))
    faces = np.where(mask.faces >= 0, at[mask.faces], -1)
    face = match_face(bare.vertices[used] @ SQUARE[6], faces)
    assert face is not None
    np.testing.assert_allclose(face.at(EYES) @ SQUARE[6].T, EYES, atol=4.0)


@pytest.mark.slow
def test_what_is_no_face_is_not_taken_for_one():
    sheet = slit_sheet()
    assert match_face(sheet.vertices, sheet.faces) is None
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 33), np.linspace(-1.5, 1.5, 21))
    ball = np.column_stack(
        [(np.cos(v) * np.cos(u)).ravel(), (1.3 * np.sin(v)).ravel(), (np.cos(v) * np.sin(u)).ravel()]
    )
    at = np.arange(33 * 21).reshape(21, 33)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    assert match_face(100 * ball, faces) is None
    assert match_face(np.zeros((4, 3)), np.zeros((1, 4), np.int64)) is None


def test_the_mirror_plane_of_a_face_is_found_in_any_direction(bare):
    points = bare.vertices[::9] @ askew(75, (1, 1, 0.4))
    best = find_mirrors(points)[0]
    assert abs(best.normal @ ([1, 0, 0] @ askew(75, (1, 1, 0.4)))) > 0.9995
    assert abs(best.centre @ best.normal) < 1.0 and best.error < 0.05


DOME = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9), indexing="ij"), axis=-1).reshape(-1, 2)
ROWS = np.arange(81).reshape(9, 9)
QUADS = np.stack([ROWS[:-1, :-1], ROWS[1:, :-1], ROWS[1:, 1:], ROWS[:-1, 1:]], axis=-1).reshape(-1, 4)


def test_a_sheet_is_flat_and_a_closed_mesh_is_not():
    flat = np.column_stack([DOME, 0 * DOME[:, 0]])
    assert match._flatness(7 * flat, QUADS) == pytest.approx(1.0)
    both = np.vstack([QUADS, QUADS[:, ::-1]])
    assert match._flatness(flat, both) == pytest.approx(0.0, abs=1e-12)
    roof = np.column_stack([DOME, -np.abs(DOME[:, 0])])  # two slopes of 45 degrees
    assert match._flatness(roof, QUADS) == pytest.approx(np.sqrt(0.5))
    assert match._flatness(0 * flat, QUADS) == 0.0


def test_samples_lie_on_the_mesh_half_by_area_and_half_by_faces():
    fine = np.vstack([0.1 * DOME, 0.1 * DOME + [3.0, 0.0]])[: 81 + 81]
    points = np.column_stack([fine, 0 * fine[:, 0]])
    points[81:] = [3.0, 0, 0] + 10 * (points[81:] - [3.0, 0, 0])  # as many faces, a hundred times the area
    faces = np.vstack([QUADS, QUADS + 81])
    at, out = match._sampled(points, faces)
    np.testing.assert_allclose(out, np.tile([0, 0, 1.0], (len(at), 1)), atol=1e-12)
    small = np.abs(at[:, 0]) <= 0.1 + 1e-12
    assert small.mean() == pytest.approx(0.5 * (0.5 + 1 / 101), abs=0.02)
    assert np.array_equal(at, match._sampled(points, faces)[0])  # the same every time
    own = (at[small] + 0.1) / 0.2
    assert own[:, :2].min() >= 0 and own[:, :2].max() <= 1 and np.abs(own[:, :2].mean(axis=0) - 0.5).max() < 0.02
    counts = np.histogram2d(*own[:, :2].T, bins=4, range=[[0, 1], [0, 1]])[0]
    assert counts.min() > 0.75 * counts.mean()


def test_noses_are_places_that_stand_out_of_the_profile():
    y = np.linspace(0.0, 60.0, 6001)
    depth = 10.0 + 8.0 * np.exp(-(((y - 30) / 2) ** 2)) + 3.0 * np.exp(-(((y - 45) / 2) ** 2))
    local = np.column_stack([0 * y, y, depth])
    aside = local + np.array([5.0, 0, 40.0])  # beside the profile
    found = match._noses(np.vstack([local, aside]), 60.0)
    (first, deep), (second, _), *rest = found
    assert first == pytest.approx(30, abs=0.6) and deep == pytest.approx(18, abs=0.1)
    assert second == pytest.approx(45, abs=0.6) and len(found) <= match.NOSES
    assert len(rest) <= 4
    shifted = match._noses(local + np.array([0, 500.0, 7.0]), 60.0)
    np.testing.assert_allclose(shifted[0], [first + 500, deep + 7], atol=1e-6)
    assert match._noses(local[:20], 60.0) == [] and match._noses(aside, 60.0) == []


def test_starts_have_the_nose_on_the_profile_and_the_plane_of_the_template_in_the_mirrors():
    y = np.linspace(0.0, 60.0, 3001)
    profile = np.column_stack([0 * y, y, 5.0 * np.exp(-(((y - 20) / 2) ** 2))])
    wide = profile + np.random.default_rng(0).normal(size=(3001, 1)) * [1.0, 0, 0]
    turn = SQUARE[13]
    mirror = Mirror(turn[0], np.array([3.0, 4.0, 5.0]), 0.0)
    starts = match._starts(wide @ turn + mirror.centre, mirror)
    ways = {tuple(np.round(s.turn, 6).ravel()) for s in starts}
    assert len(ways) == 2 * match.ANGLES
    for s in starts:
        assert np.linalg.det(s.turn) == pytest.approx(1) and abs(s.turn[0] @ turn[0]) == pytest.approx(1)
        assert (s.at(match.NOSE) - mirror.centre) @ turn[0] == pytest.approx(0, abs=1e-9)
    upright = [s for s in starts if np.allclose(s.turn, turn)]
    assert len(upright) % len(match.FACE_FRACTIONS) == 0
    at = {round(float((s.at(match.NOSE) - mirror.centre) @ turn[1])) for s in upright}
    assert 20 in at or 21 in at
    scales = sorted({round(s.scale * match.TEMPLATE_HEIGHT / 60.0, 6) for s in upright}, reverse=True)
    assert scales == sorted(match.FACE_FRACTIONS, reverse=True)


@pytest.mark.parametrize("angle", [0.0, 12.0, -25.0])
def test_pairs_turn_a_template_about_its_left_scale_it_and_shift_it_in_its_plane(angle):
    rng = np.random.default_rng(1)
    template = rng.normal(size=(60, 3)) * [30, 50, 20]
    template = np.vstack([template, template * [-1, 1, 1]])
    base = SQUARE[5]
    pitch = askew(angle, (1, 0, 0)).T
    shift = np.array([0.0, 7.0, -3.0]) @ base
    target = 1.1 * template @ (pitch @ base) + shift
    weight = np.full((1, 120), 1 / 120)
    turn, scale, moved = match._moved(template, target[None], weight, base[None], np.array([1.0]))
    np.testing.assert_allclose(turn[0], pitch @ base, atol=1e-9)
    assert scale[0] == pytest.approx(1.1)
    np.testing.assert_allclose(FaceMatch(turn[0], scale[0], moved[0], 0.0).at(template), target, atol=1e-9)
    for start, wanted in ((0.5, 0.5 * 1.18), (3.0, 3.0 * 0.85)):  # no step changes the size by much
        assert match._moved(template, target[None], weight, base[None], np.array([start]))[1][0] == pytest.approx(
            wanted
        )
    weight[0, :60] = 0.0
    target[:60] += 99.0
    half = match._moved(template, target[None], weight / weight.sum(), base[None], np.array([1.0]))
    assert half[1][0] == pytest.approx(1.1)


def test_an_error_is_the_distance_in_the_templates_size_and_the_turn_of_its_normals():
    points = np.column_stack([5 * DOME, 0 * DOME[:, 0]])
    up = np.tile([0, 0, 1.0], (81, 1))
    cloud = match._Cloud(points, up)

    def error(normals, height=0.0, scale=1.0):
        start = FaceMatch(np.eye(3), scale, np.array([0, 0, height]), np.inf)
        (found,) = cloud.fits(points / scale, normals, [start], 0)
        return found.error

    assert error(up) == pytest.approx(0.0, abs=1e-9) and error(up, 3.0) == pytest.approx(3.0)
    assert error(up, 3.0, 2.0) == pytest.approx(1.5) and error(up, 900.0) == match.MAX_DISTANCE
    assert error(-up) == pytest.approx(10.0) and error(np.tile([0, 0.8, 0.6], (81, 1))) == pytest.approx(4.0)
    starts = [FaceMatch(np.eye(3), 1.0, np.array([0, 0, z]), np.inf) for z in (4.0, 1.0, 2.0)]
    assert [round(m.error, 6) for m in cloud.fits(points, up, starts, 0)] == [1.0, 2.0, 4.0]
    (better,) = cloud.fits(points, up, starts[:1], 3)
    assert better.error < 0.2
