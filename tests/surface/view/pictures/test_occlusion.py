"""surface.view.pictures.occlusion"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ball_head import BallHead, BallPart, ball, grid, values
from cards import card
from small_head import small_head

from surface.head import Head, save_data
from surface.head.model.accessories import write_accessories
from surface.head.model.data import Neck
from surface.head.posing.dressing import WornMesh
from surface.view.pictures.occlusion import (
    bake,
    bake_head,
    fit_sky,
    orthographic,
    shade_head,
    smoothed,
    sphere_directions,
    thinness,
    visibility,
)


def plate(name: str, y: float, half: float, material: str = "skin") -> BallPart:
    uv, triangles = grid(15, 15)
    points = np.column_stack([(uv[:, 0] - 0.5) * 2 * half, np.full(len(uv), y), (0.5 - uv[:, 1]) * 2 * half])
    return BallPart(name, material, triangles, points, np.tile([0.0, 1.0, 0.0], (len(points), 1)))


def test_a_ball_alone_sees_the_whole_sky(gl: None) -> None:
    points, normals, triangles = ball(50.0, 41, 61)
    share = bake([BallPart("ball", "skin", triangles, points, normals)], directions=24, resolution=320)["ball"][:, :1]
    assert share.shape == (len(points), 1)
    assert share.min() > 0.97


def test_under_a_lid_it_is_dark(gl: None) -> None:
    share = bake([plate("floor", 0.0, 100.0), plate("lid", 8.0, 100.0)], directions=60, resolution=320)
    middle = share["floor"][:, 0].reshape(15, 15)[5:10, 5:10]
    assert middle.max() < 0.05
    assert share["lid"][:, 0].min() > 0.95


@pytest.mark.slow
def test_a_disc_above_hides_its_form_factor(gl: None) -> None:
    radius, height = 40.0, 30.0
    points, _, triangles = ball(np.array([radius, 0.01, radius]), 41, 61)
    disc = BallPart(
        "disc", "skin", triangles, points + np.array([0.0, height, 0.0]), np.tile([0.0, 1.0, 0.0], (len(points), 1))
    )
    share = bake([plate("floor", 0.0, 100.0), disc], directions=300, resolution=192)["floor"][:, 0]
    wanted = 1.0 - radius**2 / (radius**2 + height**2)
    assert share.reshape(15, 15)[7, 7] == pytest.approx(wanted, abs=0.03)


def test_the_mouths_inside_is_shaded_by_itself_alone(gl: None) -> None:
    share = bake(
        [plate("teeth", 0.0, 20.0, "teeth"), plate("skin", 8.0, 100.0), plate("mouth", -5.0, 9.0, "mouth")],
        directions=24,
        resolution=256,
    )
    assert share["teeth"][:, 0].min() > 0.95
    assert (share["mouth"] == [1, 1, 0, 0, 0]).all()


def test_gaps_between_teeth_are_dark_though_they_are_narrow(gl: None) -> None:
    narrow = [plate("floor", 0.0, 20.0, "teeth"), plate("lid", 0.9, 20.0, "teeth")]
    share = bake(narrow, directions=24, resolution=320)["floor"][:, 0].reshape(15, 15)
    assert share[5:10, 5:10].max() < 0.05


def test_neighbours_are_calmed_and_lone_vertices_left() -> None:
    uv, triangles = grid(15, 15)
    slope = np.column_stack([uv[:, 0], np.ones(len(uv))])
    noisy = slope + np.random.default_rng(1).normal(0.0, 0.1, slope.shape)
    lone = np.vstack([noisy, [[7.0, 7.0]]]).astype(np.float32)
    result = smoothed(lone, triangles)
    inner = np.abs(uv - 0.5).max(axis=1) < 0.35
    assert np.abs(result[:-1] - slope)[inner].std() < 0.5 * np.abs(noisy - slope)[inner].std()
    np.testing.assert_allclose(smoothed(slope, triangles)[inner], slope[inner], atol=1e-6)
    assert (result[-1] == 7.0).all()


@pytest.mark.slow
def test_what_opens_does_not_stay_black(gl: None) -> None:
    head = BallHead()
    opened = bake_head(head, values(jawOpen=1.0), directions=12, resolution=96)
    rest = bake(head.parts, directions=12, resolution=96)
    assert all((opened[p.name] >= smoothed(rest[p.name][:, :1], p.triangles) - 1e-6).all() for p in head.parts)
    assert (head.parts[0].vertices == BallHead().parts[0].vertices).all()


def test_directions_are_even() -> None:
    directions = sphere_directions(200)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(200))
    assert np.abs(directions.mean(axis=0)).max() < 0.01
    assert np.cov(directions.T) == pytest.approx(np.eye(3) / 3, abs=0.01)


def test_orthographic_depth_grows_away_from_the_viewer() -> None:
    points = np.random.default_rng(2).uniform(-50, 90, (200, 3))
    direction = np.array([0.6, 0.0, 0.8])
    box, matrix, span = orthographic(points, direction)
    assert box.min() > 0
    assert box.max() < 1
    assert np.diff(box[np.argsort(points @ direction), 2]).max() <= 1e-12
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    assert (clip[:, :3] + 1) / 2 == pytest.approx(box)
    assert np.ptp(box[:, 2]) * span == pytest.approx(np.ptp(points @ direction))


def test_lit_blends_over_neighbours() -> None:
    picture = np.zeros((8, 8), np.float32)
    picture[:, 4:] = 1.0
    box = np.array([[0.5, 0.5, 0.5], [0.9, 0.5, 0.5], [0.1, 0.5, 0.5], [0.1, 0.5, 0.01]])
    assert visibility(box, picture, 0.02) == pytest.approx([0.5, 1.0, 0.0, 1.0])


def test_a_sky_on_one_side_is_found() -> None:
    directions = sphere_directions(400)
    one = np.column_stack([np.ones(400), directions])
    seen = (directions[:, 0] > 0).astype(float)
    normal = (one[:, :, None] * one[:, None, :]).sum(axis=0)[None]
    sky = fit_sky(normal, (seen[:, None] * one).sum(axis=0)[None])[0]
    towards = sky[0] + directions @ sky[1:]
    assert towards[directions[:, 0] > 0.7].min() > 0.75
    assert towards[directions[:, 0] < -0.7].max() < 0.25
    assert sky[2:] == pytest.approx(0.0, abs=0.05)


def test_a_thin_plate_is_thin_and_a_ball_is_not() -> None:
    head = BallHead()
    ball = head.parts[1]  # an eyeball, 26 mm through
    assert thinness(ball).max() == 0.0
    ball.vertices[:] = _flattened(ball.rest)
    assert thinness(ball).max() > 0.6


def _flattened(points: np.ndarray) -> np.ndarray:
    """Pressed to a tenth in z about their middle."""
    middle = points.mean(axis=0)
    return middle + (points - middle) * [1.0, 1.0, 0.1]


@pytest.mark.slow
def test_skin_gets_its_sky_and_its_thinness(gl: None) -> None:
    head = BallHead()
    baked = bake_head(head, values(jawOpen=1.0), directions=24, resolution=96)
    face = baked["face/visible"]
    assert face.shape == (len(head.parts[0].vertices), 4)
    assert (face.min() >= 0.0, face.max() <= 1.0) == (True, True)
    assert baked["face/thin"].shape == (len(face), 1)
    assert "teeth/visible" not in baked


@pytest.mark.parametrize(("apart", "thin"), [(1.1, 0.9), (5.5, 0.5), (10.9, 0.1 / 11), (11.1, 0.0), (30.0, 0.0)])
def test_thinness_falls_from_touching_to_eleven_millimetres(apart: float, thin: float) -> None:
    front, back = plate("a", apart, 40.0), plate("b", 0.0, 40.0)
    both = BallPart(
        "both",
        "skin",
        np.concatenate([front.triangles, back.triangles + len(front.rest)]),
        np.concatenate([front.rest, back.rest]),
        np.concatenate([front.normals, -back.normals]),
    )
    assert thinness(both) == pytest.approx(np.full((len(both.rest), 1), thin), abs=1e-4)
    both.normals[:] = -both.normals  # a gap, not a plate
    assert (thinness(both) == 0.0).all()


def test_neighbours_share_half_of_their_mean_in_each_pass() -> None:
    triangles, values = np.array([[0, 1, 2]]), np.array([[0.0], [1.0], [5.0], [9.0]])
    assert smoothed(values, triangles, 1)[:, 0] == pytest.approx([1.5, 1.75, 2.75, 9.0])
    assert smoothed(values, triangles)[:, 0] == pytest.approx([1.875, 1.9375, 2.1875, 9.0])


def test_a_sky_that_is_all_open_is_one_in_every_direction() -> None:
    one = np.column_stack([np.ones(300), sphere_directions(300)])
    normal = (one[:, :, None] * one[:, None, :]).sum(axis=0)[None]
    sky = fit_sky(normal, one.sum(axis=0)[None])[0]
    assert sky == pytest.approx([1 / 1.02, 0, 0, 0], abs=1e-3)
    assert fit_sky(normal, 100 * one.sum(axis=0)[None])[0, 0] == 2.0
    assert fit_sky(0 * normal, 0 * one.sum(axis=0)[None])[0].tolist() == [0, 0, 0, 0]


def test_an_orthographic_view_fills_its_cube_with_a_margin() -> None:
    points = np.random.default_rng(3).normal(size=(50, 3)) * [10, 30, 20]
    for direction in np.vstack([sphere_directions(7), [[0, 1, 0], [1, 0, 0]]]):
        box, matrix, span = orthographic(points, direction)
        assert box.min(axis=0) == pytest.approx(0.02 / 1.04) and box.max(axis=0) == pytest.approx(1.02 / 1.04)
        clip = np.column_stack([points, np.ones(50)]) @ matrix.T
        assert clip[:, :3] == pytest.approx(2 * box - 1) and (clip[:, 3] == 1).all()
        assert span == pytest.approx(1.04 * np.ptp(points @ direction))
        assert np.argmax(box[:, 2]) == np.argmin(points @ direction)


def test_parts_of_no_group_stay_open_and_skin_gets_three_arrays(gl: None) -> None:
    share = bake([plate("brow", 0.0, 9.0, "brow"), plate("lid", 8.0, 90.0)], directions=8, resolution=32)
    assert share["brow"].dtype == np.float32 and (share["brow"] == [1, 1, 0, 0, 0]).all()
    made = bake_head(BallHead(), values(), directions=8, resolution=32)
    assert set(made) == {"face", "face/visible", "face/thin", "left_eye", "right_eye", "teeth", "mouth"}
    assert made["face/visible"].shape[1] == 4 and made["face/thin"].shape[1] == 1
    assert made["face/visible"].min() >= 0.0 and made["face/visible"].max() <= 1.0


@pytest.mark.parametrize("count", [96, 300])
def test_no_two_directions_are_near_each_other(count: int) -> None:
    directions = sphere_directions(count)
    between = np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1)))[~np.eye(count, dtype=bool)]
    assert between.min() > 0.75 * np.degrees(np.sqrt(4 * np.pi / count))
    turn = np.diff(np.unwrap(np.arctan2(directions[:, 2], directions[:, 0])))
    assert np.degrees(turn) % 360 == pytest.approx(360 - 137.50776405)  # the golden angle
    assert directions[0, 1] == pytest.approx(1 - 1 / count) and directions[-1, 1] == pytest.approx(1 / count - 1)


def test_visibility_ends_at_the_pictures_rim() -> None:
    picture = np.full((4, 4), 0.5, np.float32)
    picture[3, :], picture[:, 0] = 0.9, 0.1
    low = [[0.0, 0.5, 0.4], [0.9, 0.5, 0.4], [0.25, 0.5, 0.4]]
    box = np.array([*low, [1.0, 1.0, 0.8], [0.5, 0.75, 0.7], [0.5, 0.5, 0.5]])
    assert visibility(box, picture, 0.0) == pytest.approx([0.0, 1.0, 0.5, 1.0, 0.5, 1.0])


def test_a_head_is_baked_with_its_mouth_half_open_and_its_eyes_nearly_shut(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    given: list[np.ndarray] = []
    old = tmp_path / "old"
    old.write_text("of another head")
    patches = {
        "load_data": lambda folder: small_head(), "shade_path": lambda folder: old,
        "bake_head": lambda head, pose: given.append(pose), "write_shade": lambda folder, baked, parts: old,
    }  # fmt: skip
    for name, instead in patches.items():
        monkeypatch.setattr(f"surface.view.pictures.occlusion.{name}", instead)
    assert shade_head(tmp_path) == old and not old.exists()
    wanted = Head(small_head()).values({"jawOpen": 0.45, "eyeBlinkLeft": 0.8, "eyeBlinkRight": 0.8})
    assert len(given) == 1 and (given[0] == wanted).all()


def test_pictures_are_96_of_512_pixels_where_nothing_else_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple[object, ...]] = []
    ended: list[int] = []
    context = SimpleNamespace(release=lambda: ended.append(1))
    monkeypatch.setattr("surface.view.pictures.occlusion.open_context", lambda: context)
    monkeypatch.setattr(
        "surface.view.pictures.occlusion._bake", lambda ctx, members, *how: given.append((len(members), *how)) or {}
    )
    bake(BallHead().parts)
    assert given == [(3, 96, 512, 1.2, ()), (1, 96, 512, 0.35, ())] and ended == [1]


@pytest.mark.parametrize(("kind", "alpha", "least", "most"), [
    ("hat", "OPAQUE", 0.2, 0.35), ("hair", "MASK", 0.2, 0.35), ("hat", "BLEND", 0.95, 1.0),
    ("glasses", "OPAQUE", 0.95, 1.0),
])  # fmt: skip
def test_hair_and_hats_shade_what_lies_below_them(gl: None, kind: str, alpha: str, least: float, most: float) -> None:
    lying = card(kind=kind, alpha=alpha, texture=b"")
    over = replace(lying, vertices=np.float32([[-100, 8, 100], [100, 8, 100], [100, 8, -100], [-100, 8, -100]]))
    head = SimpleNamespace(
        parts=[plate("floor", 0.0, 100.0)], parameters=(), pose=lambda _: None,
        accessories=(WornMesh(over, Neck((0.0, 0.0, 0.0))),),
    )  # fmt: skip
    share = bake_head(head, np.zeros(0), directions=60, resolution=320)["floor"]  # type: ignore[arg-type]
    middle = share[:, 0].reshape(15, 15)[5:10, 5:10]
    assert least < middle.min() and middle.max() < most + 0.01


def test_hair_far_from_a_head_does_not_shade_it(gl: None) -> None:
    points, normals, triangles = ball(80.0, 41, 61)
    parts = [BallPart("ball", "skin", triangles, points, normals)]
    far = card((-3.0, -3.0), (3.0, 3.0), z=-2500.0, kind="hair", texture=b"")
    bare, worn = (bake(parts, directions=24, resolution=320, worn=each)["ball"] for each in ((), (far,)))
    assert bare[:, 0].min() > 0.95 and np.abs(worn[:, 0] - bare[:, 0]).max() < 0.01


def test_what_lies_before_a_view_makes_it_deeper_and_no_wider() -> None:
    points, direction = np.random.default_rng(3).normal(0.0, 50.0, (40, 3)), np.array([0.0, 0.0, 1.0])
    box, _, span = orthographic(points, direction)
    deeper, matrix, long = orthographic(points, direction, np.array([[900.0, 900.0, 700.0], [0.0, 0.0, -700.0]]))
    np.testing.assert_allclose(deeper[:, :2], box[:, :2])
    assert span + 300.0 < long < 1.04 * (700.0 - points[:, 2].min()) + 1e-6
    nearest = matrix @ [0.0, 0.0, 700.0, 1.0]
    assert -1.0 < nearest[2] < -0.9 and deeper[:, 2].min() > 0.5


def test_the_accessories_beside_a_head_shade_it(gl: None, tmp_path: Path) -> None:
    save_data(tmp_path, small_head())
    bare = np.load(shade_head(tmp_path))["a"].astype(float)
    write_accessories(tmp_path, [card((-60.0, -60.0), (60.0, 60.0), z=40.0)])
    assert np.load(shade_head(tmp_path))["a"].astype(float).mean() < 0.75 * bare.mean()
