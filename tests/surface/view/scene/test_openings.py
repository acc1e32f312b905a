"""surface.view.scene.openings"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ball_head import EYES, BallHead, BallPart, grid, rotation, skin, values

from surface.head import Head
from surface.view.scene.openings import (
    LID_POINTS,
    Openings,
    aperture,
    boundary_loops,
    fit_sphere,
    leading_edge,
    nearest_loop,
    vector_area,
)


@pytest.fixture
def head() -> BallHead:
    return BallHead()


def part(head: BallHead, name: str) -> BallPart:
    return next(p for p in head.parts if p.name == name)


@pytest.mark.parametrize("name", EYES)
def test_an_eyes_rotation_is_read_back(head: BallHead, name: str) -> None:
    openings = Openings(head.parts)
    head.pose(values(leftEyeYaw=0.6, rightEyeYaw=-0.4, headYaw=0.5))
    own = 0.6 if name == "left_eye" else -0.4
    wanted = rotation(np.radians(60 * 0.5)) @ rotation(np.radians(35 * own))
    assert openings.eye(part(head, name))["eye_rotation"] == pytest.approx(wanted, abs=1e-5)


def test_eye_local_given_by_the_head_is_used(head: BallHead) -> None:
    eye = part(head, "left_eye")
    local = np.roll((eye.rest - EYES["left_eye"]) / 13.0, 1, axis=1).astype(np.float32)
    eye.attributes["eye_local"] = local
    assert Openings(head.parts).local(eye) == pytest.approx(local)


def test_lids_follow_a_blink(head: BallHead) -> None:
    openings = Openings(head.parts)
    rest = openings.eye(part(head, "left_eye"))
    assert rest["lids"] == 1.0
    assert np.mean(rest["lid_upper"][:, 1]) > np.mean(rest["lid_lower"][:, 1]) + 5
    head.pose(values(eyeBlinkLeft=1.0))
    shut = openings.eye(part(head, "left_eye"))
    assert np.mean(shut["lid_upper"][:, 1]) < np.mean(rest["lid_upper"][:, 1]) - 5


def test_the_mouth_opens_monotonously(head: BallHead) -> None:
    openings = Openings(head.parts)
    areas = []
    for amount in (0.0, 0.3, 0.7, 1.0):
        head.pose(values(jawOpen=amount))
        openings.refresh()
        mouth = openings.mouth()
        areas.append(np.linalg.norm(mouth["opening_area"]))
        assert abs(mouth["opening_centre"][0]) < 3
    assert (np.diff(areas) > 50).all()


def test_heads_without_holes_or_skin_still_work(head: BallHead) -> None:
    closed = skin()
    eye = part(head, "left_eye")
    for parts in ([eye], [eye, part(head, "teeth")]):
        openings = Openings(parts)
        assert openings.eye(eye)["lids"] == 0.0
        assert all(np.shape(openings.eye(eye)[name]) == (LID_POINTS, 3) for name in ("lid_upper", "lid_lower"))
        assert np.linalg.norm(openings.mouth()["opening_area"]) > 0
    assert np.linalg.norm(Openings([closed]).mouth()["opening_area"]) > 0


def test_fit_sphere_is_exact_on_a_cap() -> None:
    random = np.random.default_rng(1)
    unit = random.standard_normal((60, 3)) * [1, 1, 0.2] + [0, 0, 1]
    points = 12.0 * unit / np.linalg.norm(unit, axis=1, keepdims=True) + [30.9, 36.1, 79.9]
    centre, radius = fit_sphere(points)
    assert centre == pytest.approx([30.9, 36.1, 79.9])
    assert radius == pytest.approx(12.0)


@pytest.fixture(scope="module")
def shipped(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


def posed(head: Head, **given: float) -> Head:
    head.pose(head.values(given))
    return head


def test_the_shipped_heads_lids_are_found_and_close(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    for part in (p for p in shipped.parts if p.material == "eye"):
        posed(shipped)
        opened = openings.eye(part)
        assert opened["lids"] == 1.0
        posed(shipped, eyeBlinkLeft=1.0, eyeBlinkRight=1.0)
        shut = openings.eye(part)
        heights = [np.max(lids["lid_upper"][:, 1] - lids["lid_lower"][:, 1]) for lids in (opened, shut)]
        assert heights[0] > 7.0
        assert heights[1] < 0.35 * heights[0]


def test_the_shipped_heads_mouth_lets_in_more_light_when_open(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    areas = []
    for amount in (0.0, 0.25, 0.5, 1.0):
        posed(shipped, jawOpen=amount)
        openings.refresh()
        areas.append(np.linalg.norm(openings.mouth()["opening_area"]))
    assert (np.diff(areas) > 60).all()


def test_the_shipped_heads_eyes_turn_by_their_parameters(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    for part in (p for p in shipped.parts if p.material == "eye"):
        posed(shipped, leftEyeYaw=0.5, rightEyeYaw=0.5)
        assert openings.eye(part)["eye_rotation"] == pytest.approx(rotation(np.radians(17.5)), abs=1e-3)


def sheet_with_hole() -> tuple[np.ndarray, np.ndarray]:
    uv, triangles = grid(11, 11)
    middle = uv[triangles].mean(axis=1)
    hole = (np.abs(middle - 0.5) < 0.2).all(axis=1)
    return np.column_stack([uv * 100, np.zeros(len(uv))]), triangles[~hole]


def test_a_sheet_with_a_hole_has_two_loops() -> None:
    points, triangles = sheet_with_hole()
    loops = sorted(boundary_loops(triangles), key=len)
    assert [len(loop) for loop in loops] == [16, 40]
    inner = points[loops[0], :2]
    assert np.allclose(np.abs(inner - 50).max(axis=1), 20)
    assert np.allclose(np.linalg.norm(np.diff(inner, axis=0), axis=1), 10)


def test_a_closed_surface_has_none() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    assert boundary_loops(tetrahedron) == []
    assert boundary_loops(np.zeros((0, 3), int)) == []


def test_aperture_tells_upper_from_lower_edge() -> None:
    points, triangles = sheet_with_hole()
    hole = aperture(min(boundary_loops(triangles), key=len), points)
    upper, lower = points[hole.upper], points[hole.lower]
    assert len(upper) == len(lower) == LID_POINTS
    assert upper[:, 1].mean() > 55 > 45 > lower[:, 1].mean()
    assert (np.diff(upper[:, 0]) >= 0).all()
    assert upper[0, 0] == pytest.approx(30)
    assert upper[-1, 0] == pytest.approx(70)


def test_nearest_loop_finds_each_eye_and_respects_its_reach() -> None:
    part = skin()
    loops = boundary_loops(part.triangles)
    found = [nearest_loop(loops, part.rest, centre, 30.0) for centre in EYES.values()]
    assert [np.sign(part.rest[loop, 0].mean()) for loop in found if loop is not None] == [1.0, -1.0]
    assert nearest_loop(loops, part.rest, np.array([0.0, 0.0, 400.0]), 30.0) is None
    assert nearest_loop([], part.rest, np.zeros(3), 30.0) is None


def test_vector_area_of_a_circle() -> None:
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    ring = np.column_stack([3 * np.cos(angle) + 100, 3 * np.sin(angle) - 20, np.full(720, 50.0)])
    assert vector_area(ring) == pytest.approx([0, 0, np.pi * 9], rel=1e-4, abs=1e-9)


def test_leading_edge_is_what_reaches_furthest_over_the_eyeball() -> None:
    x = np.linspace(-10, 10, LID_POINTS)
    rows = {"edge": (5.0, 12.0), "margin": (4.0, 13.5), "lid": (8.0, 13.0), "lower": (-5.0, 12.0)}
    vertices = np.concatenate([np.column_stack([x, np.full_like(x, y), np.full_like(x, z)]) for y, z in rows.values()])
    ids = dict(zip(rows, np.arange(4 * LID_POINTS).reshape(4, -1), strict=True))
    centre = np.zeros(3)
    assert (leading_edge(ids["edge"], ids["lower"], vertices, centre, 1.0) == ids["margin"]).all()
    assert (leading_edge(ids["lower"], ids["edge"], vertices, centre, -1.0) == ids["lower"]).all()


def test_loops_of_fewer_than_six_edges_are_no_openings() -> None:
    for corners, found in ((5, []), (6, [6, 6])):
        inner, outer = np.arange(corners), np.arange(corners) + corners
        following = np.roll(inner, -1), np.roll(outer, -1)
        band = [np.column_stack([inner, outer, following[1]]), np.column_stack([inner, following[1], following[0]])]
        assert [len(loop) for loop in boundary_loops(np.concatenate(band))] == found


def test_lids_are_spaced_evenly_from_corner_to_corner() -> None:
    x = np.array([0.0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9.5, 10])
    upper, lower = np.column_stack([x, 0.1 + 0 * x]), np.column_stack([x[1:-1], -0.1 + 0 * x[1:-1]])[::-1]
    vertices = np.column_stack([np.concatenate([upper, lower]), np.zeros(22)])
    found = aperture(np.roll(np.arange(22), 7), vertices)
    assert found.loop.tolist() == list(range(22))
    assert found.upper[0] == found.lower[0] == 0 and found.upper[-1] == found.lower[-1] == 11
    # ten places 10 / 9 apart, each the first vertex at or after it
    assert vertices[found.upper, 0].tolist() == [0, 2, 3, 4, 5, 6, 7, 8, 9, 10]
    assert (vertices[found.lower[1:-1], 1] < 0).all() and (np.diff(vertices[found.lower, 0]) > 0).all()


def test_loops_are_taken_up_to_their_reach() -> None:
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    loop = np.arange(4)
    assert nearest_loop([loop], vertices, np.array([1.0, 1.0, 5.0]), 5.0) is loop
    assert nearest_loop([loop], vertices, np.array([1.0, 1.0, 5.0]), 4.9) is None


def test_the_mouths_opening_is_where_its_lips_are(head: BallHead) -> None:
    openings = Openings(head.parts)
    face = part(head, "face")
    head.pose(values(jawOpen=1.0))
    openings.refresh()
    mouth = openings.mouth()
    lips = openings._lips
    assert lips is not None
    ring = face.vertices[lips.loop].astype(float)
    area = vector_area(ring)
    outward = np.array(mouth["opening_area"]) / np.linalg.norm(mouth["opening_area"])
    assert outward[2] > 0.8 and abs(outward @ area) == pytest.approx(np.linalg.norm(area), rel=1e-5)
    assert mouth["opening_centre"] == pytest.approx(ring.mean(axis=0) + 14.0 * outward, abs=1e-3)
    corner = ring[np.argmax(ring[:, 0])] - ring[np.argmin(ring[:, 0])]
    assert mouth["opening_side"] == pytest.approx(0.38 * corner, abs=1e-3)
    shut = 0.9 * np.linalg.norm(vector_area(face.rest[lips.loop].astype(float)))
    assert np.linalg.norm(mouth["opening_area"]) == pytest.approx(np.linalg.norm(area) - shut, rel=1e-4)
    head.pose(values())
    openings.refresh()
    assert np.linalg.norm(openings.mouth()["opening_area"]) == pytest.approx(max(shut / 9, 20.0), rel=1e-4)


def test_lips_that_pass_each_other_at_rest_do_not_turn_the_opening_round(head: BallHead) -> None:
    face = part(head, "face")
    lips = Openings(head.parts)._lips
    assert lips is not None
    open_lips = face.vertices.copy()
    middle = face.vertices[lips.loop, 1].mean()
    face.vertices[lips.loop, 1] = 2 * middle - face.vertices[lips.loop, 1]
    openings = Openings(head.parts)
    face.vertices[:] = open_lips
    openings.refresh()
    assert openings.mouth()["opening_area"][2] > 0.9 * np.linalg.norm(openings.mouth()["opening_area"])


def test_lids_and_lips_are_those_of_the_face_not_of_the_largest_skin(head: BallHead) -> None:
    back = skin()
    back.name = "back"
    back.vertices = np.concatenate([back.vertices, np.tile(back.vertices[:1], (10_000, 1))]) - [0.0, 0.0, 200.0]
    openings = Openings([back, *head.parts])
    assert openings.eye(part(head, "left_eye"))["lids"] == 1.0 and openings._lips is not None
    assert set(openings.read_vertices()) >= {"face", *EYES}


def test_without_contacts_lids_are_where_the_eyes_are_whatever_the_skin_is_called(head: BallHead) -> None:
    """Heads of surface files have no contacts, and their face may be in several parts."""
    face = part(head, "face")
    face.name = "brow band"
    lower = skin()
    lower.name, lower.vertices = "face", lower.vertices - [0.0, 0.0, 200.0]
    openings = Openings([lower, *head.parts])
    assert openings.eye(part(head, "left_eye"))["lids"] == 1.0
    assert set(openings.read_vertices()) >= {"brow band", *EYES}


def test_without_lips_a_mouth_is_open_a_little() -> None:
    assert Openings([]).mouth() == {
        "opening_centre": (0.0, -35.0, 110.0), "opening_area": (0.0, 0.0, 250.0), "opening_side": (18.0, 0.0, 0.0),
    }  # fmt: skip


def test_an_eyes_own_directions_are_unit_vectors_from_its_centre(head: BallHead) -> None:
    eye = part(head, "right_eye")
    local = Openings(head.parts).local(eye)
    assert local == pytest.approx((eye.rest - EYES["right_eye"]) / 13.0, abs=1e-4)
    assert local.dtype == np.float32


def test_all_vertices_that_are_read_are_named(head: BallHead) -> None:
    asked: dict[str, set[int]] = {}

    def read(part: BallPart, ids: np.ndarray) -> np.ndarray:
        asked.setdefault(part.name, set()).update(np.asarray(ids).tolist())
        return part.vertices[ids]

    openings = Openings(head.parts, read)
    openings.refresh()
    for name in EYES:
        openings.eye(part(head, name))
    named = {name: set(ids.tolist()) for name, ids in openings.read_vertices().items()}
    assert all(ids <= named[name] for name, ids in asked.items())
    assert set(named) == {"face", *EYES} and all(len(named[name]) == 48 for name in EYES)


@pytest.mark.parametrize("size", [0.1, 1e-9])
def test_lips_pressed_together_still_let_in_a_little_light(head: BallHead, size: float) -> None:
    shrink = [1.0]
    openings = Openings(head.parts, lambda part, ids: part.vertices[ids] * np.float32(shrink[0]))
    shrink[0] = size
    openings.refresh()
    mouth = openings.mouth()
    assert all(np.isfinite(value).all() for value in mouth.values())
    if size > 0.01:
        assert np.linalg.norm(mouth["opening_area"]) == pytest.approx(20.0, rel=1e-4)


def test_lips_tint_the_skin_beside_them(head: BallHead) -> None:
    assert Openings(head.parts).lip_tint is None
    face = part(head, "face")
    share = np.linspace(0.0, 1.0, len(face.vertices), dtype=np.float32)[:, None]
    skin, red = np.float32([0.6, 0.4, 0.3]), np.float32([0.45, 0.1, 0.15])
    face.attributes = {"lips": share, "albedo": skin + share * (red - skin)}
    assert Openings(head.parts).lip_tint == pytest.approx(tuple(red / skin), rel=0.15)
    face.attributes = {"lips": np.zeros_like(share), "albedo": face.attributes["albedo"]}
    assert Openings(head.parts).lip_tint is None
