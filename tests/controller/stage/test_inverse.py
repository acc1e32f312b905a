"""Dragged points back to parameters, and to control points where no parameter fits."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.anchors import SkinSamples, head_order, sample_skin, skin_points
from controller.stage.inverse import GroupMoves, PointSolver, SculptSolver, load_group, save_group
from surface.head import Group, Head


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(find_config("heads", "ict"))


@pytest.fixture(scope="module")
def dragger(head: Head) -> PointSolver:
    return solver(head, skin_points(head, "face", 80, 3))


def solver(head: Head, uv: np.ndarray) -> PointSolver:
    return PointSolver(sample_skin(head, "face", uv), head_order(head.parameters, P), P)


def missing(dragger: PointSolver, wanted: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(m,) mm between wanted places and where the face brings the points."""
    return np.linalg.norm(wanted - dragger.skin.rest - dragger.skin.displacement(values[dragger.moved]), axis=1)


def places(head: Head, dragger: PointSolver, **values: float) -> np.ndarray:
    """Where the head really brings the points."""
    part = head.part("face")
    head.pose(head.values(values))
    found = part.surface.basis_matrix(dragger.skin.uv) @ part.control_points
    head.pose(np.zeros(len(head.parameters)))
    return np.asarray(found)


@pytest.mark.parametrize(
    "values",
    [
        {"jawOpen": 0.7},
        {"mouthSmileLeft": 0.6, "browInnerUp": 0.5},
        {"eyeBlinkLeft": 0.8, "mouthPucker": 0.7},
        {"jawOpen": 0.4, "mouthSmileLeft": 0.5, "mouthSmileRight": 0.5, "browDownLeft": 0.6},
    ],
)
def test_a_face_is_found_again_from_some_points_of_it(
    head: Head, dragger: PointSolver, values: dict[str, float]
) -> None:
    wanted = places(head, dragger, **values)
    found = dragger.solve(wanted)
    for name, value in values.items():
        assert found[P.index(name)] == pytest.approx(value, abs=0.1), name
    others = [i for i, name in enumerate(P.names) if name not in values]
    assert np.abs(found[others]).max() < 0.15
    assert np.abs(found[others] > 0.05).sum() <= 3
    assert missing(dragger, wanted, found).mean() < 0.3


def test_one_dragged_corner_of_the_mouth_is_a_few_parameters(head: Head) -> None:
    corner = head.part("face").mesh
    nearest = np.linalg.norm(corner.vertices - [28.6, -34.0, 102.0], axis=1).argmin()
    one = solver(head, np.asarray(corner.uv[[nearest]], dtype=float))
    wanted = one.skin.rest + np.array([[3.0, 5.0, -4.0]])
    found = one.solve(wanted)
    assert 1 <= np.count_nonzero(found > 0.01) <= 6
    assert missing(one, wanted, found) < 0.5


def one_shape(*quarters: float, **more: float) -> PointSolver:
    """A point whose only shape moves it upwards by so many mm on each quarter of its way."""
    moves = np.zeros((1, 3, 1, 4))
    moves[0, 1, 0] = quarters
    skin = SkinSamples("face", np.zeros((1, 2)), np.zeros((1, 3)), moves, np.zeros(1))
    return PointSolver(skin, np.array([P.index("cheekPuff")]), P, **more)


def test_a_little_less_is_found_than_wanted_for_the_sake_of_small_values() -> None:
    found = one_shape(2.5, 2.5, 2.5, 2.5).solve(np.array([[0.0, 5.0, 0.0]]))
    assert found[P.index("cheekPuff")] == pytest.approx((10 * 5 - 0.02) / (10**2 + 1e-3), rel=1e-9)
    found = one_shape(2.5, 2.5, 2.5, 2.5, sparsity=4.0).solve(np.array([[0.0, 5.0, 0.0]]))
    assert found[P.index("cheekPuff")] == pytest.approx((10 * 5 - 4.0) / (10**2 + 1e-3), rel=1e-9)
    assert np.count_nonzero(found) == 1


@pytest.mark.parametrize(
    ("height", "value"), [(1.0, 0.25), (2.0, 0.375), (3.0, 0.5), (6.0, 0.75), (10.0, 1.0), (99.0, 1.0)]
)
def test_a_shape_that_is_not_straight_is_followed_along_its_way(height: float, value: float) -> None:
    found = one_shape(1.0, 2.0, 3.0, 4.0).solve(np.array([[0.0, height, 0.0]]))
    assert found[P.index("cheekPuff")] == pytest.approx(value, abs=0.02)


def test_values_stay_in_range_for_places_out_of_reach(dragger: PointSolver) -> None:
    rng = np.random.default_rng(1)
    for scale in (5.0, 500.0):
        found = dragger.solve(dragger.skin.rest + rng.normal(0, scale, dragger.skin.rest.shape))
        assert np.all(found >= P.low) and np.all(found <= P.high)
    assert np.abs(dragger.solve(dragger.skin.rest)).max() < 1e-3


def test_bad_places_are_refused(dragger: PointSolver) -> None:
    with pytest.raises(ValueError, match="places must be"):
        dragger.solve(np.full(dragger.skin.rest.shape, np.nan))
    with pytest.raises(ValueError, match="places must be"):
        dragger.solve(np.zeros((2, 3)))


def test_control_points_bring_points_exactly_where_they_are_wanted(head: Head) -> None:
    uv = skin_points(head, "face", 5, 8)
    wanted = np.random.default_rng(2).normal(0, 3, (5, 3))
    shape = SculptSolver(head).solve(uv, wanted, least_mm=0.0)
    surface = head.part("face").surface
    moved = np.zeros_like(surface.points)
    moved[shape.ids] = shape.moves
    assert surface.basis_matrix(uv) @ moved == pytest.approx(wanted, abs=1e-9)


def test_more_fairness_spreads_a_pull_wider(head: Head) -> None:
    uv = skin_points(head, "face", 1, 8)
    few, many = (
        len(SculptSolver(head, fairness=f).solve(uv, [[0.0, 0.0, 5.0]], least_mm=0.3).ids) for f in (0.1, 50.0)
    )
    assert few < many


def test_a_pull_at_one_lip_leaves_the_other(head: Head) -> None:
    mesh = head.part("face").mesh
    lower = np.linalg.norm(mesh.vertices - [0.0, -43.0, 114.0], axis=1).argmin()
    upper = np.linalg.norm(mesh.vertices - [0.0, -28.0, 118.0], axis=1).argmin()
    uv = np.asarray(mesh.uv[[lower, upper]], dtype=float)
    shape = SculptSolver(head).solve(uv[:1], [[0.0, -5.0, 0.0]])
    surface = head.part("face").surface
    moved = np.zeros_like(surface.points)
    moved[shape.ids] = shape.moves
    assert np.linalg.norm(surface.basis_matrix(uv)[1] @ moved) < 0.5


def test_impossible_pulls_are_refused(head: Head) -> None:
    reshaper, uv = SculptSolver(head), skin_points(head, "face", 1, 8)
    with pytest.raises(ValueError, match="too close"):
        reshaper.solve(np.repeat(uv, 2, axis=0), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        reshaper.solve(uv, [[np.nan, 0.0, 0.0]])
    with pytest.raises(ValueError, match="no surface"):
        reshaper.solve([[9.0, 9.0]], [[0.0, 0.0, 1.0]])


def test_a_kept_group_is_what_a_head_moves(head: Head, tmp_path: Path) -> None:
    uv = skin_points(head, "face", 3, 8)
    shape = SculptSolver(head).solve(uv, np.eye(3) * 4.0)
    save_group(tmp_path / "bump.json", "bump", shape)
    name, kept = load_group(tmp_path / "bump.json", head.data)
    assert (name, kept.part) == ("bump", "face")
    assert kept.moves == pytest.approx(shape.moves, abs=1e-5)
    # in the place of a parameter the head has, it moves the picture
    parts = [
        replace(p, groups=[*(g for g in p.groups if g.name != "cheekPuff"),
                           Group("cheekPuff", kept.ids, kept.moves.astype(np.float32))]) if p.name == "face" else p
        for p in head.data.parts
    ]  # fmt: skip
    other = Head(replace(head.data, parts=parts))
    other.pose(other.values({"cheekPuff": 1.0}))
    moved = other.part("face").surface.basis_matrix(uv) @ other.part("face").control_points
    rest = head.part("face").surface.evaluate(uv)
    assert moved - rest == pytest.approx(np.eye(3) * 4.0, abs=0.3)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("format", 9),
        ("format", None),
        ("part", "hat"),
        ("ids", [99999]),
        ("ids", "x"),
        ("moves_mm", [[1, 2]]),
        ("moves_mm", [["a"] * 3]),
    ],
)
def test_a_damaged_group_file_names_its_key(head: Head, tmp_path: Path, key: str, value: object) -> None:
    table = {"format": 1, "name": "n", "part": "face", "ids": [1], "moves_mm": [[0.0, 0.0, 1.0]]}
    path = tmp_path / "g.json"
    path.write_text(json.dumps(table | {key: value}))
    with pytest.raises(ConfigError, match=key):
        load_group(path, head.data)
    path.write_text("{")
    with pytest.raises(ConfigError, match="not valid JSON"):
        load_group(path, head.data)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(GroupMoves).anything = 1
