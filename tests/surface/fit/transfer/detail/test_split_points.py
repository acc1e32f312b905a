"""Control points of half the spans make the same surface and the same expressions as those they replace."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from small_head import JAW, part

from surface.fit.transfer.detail.split_points import halved, how_many, split_points
from surface.head import Group, PartData
from surface.head.model.meshes import make_surface
from surface.head.posing.rig import jaw_path

UV = np.random.default_rng(1).uniform(0, 1, (300, 2))
CHOSEN = np.array([6, 7, 12, 0, 17])


def moving_part() -> PartData:
    """With groups, shares of the jaw that differ from point to point, and weights."""
    rng = np.random.default_rng(0)
    groups = [
        Group(name, np.arange(0, 25, step, dtype=np.int32), rng.normal(size=(len(range(0, 25, step)), 3)).astype("f4"))
        for name, step in (("mouthPucker", 2), ("jawOpen", 1))
    ]
    made = part("a", -40.0, groups=groups, jaw=rng.uniform(0, 1, 25))
    return replace(made, weights=rng.uniform(0.5, 2.0, 25))


def of_group(data: PartData, name: str) -> np.ndarray:
    field = np.zeros((len(data.points), 3))
    own = next(g for g in data.groups if g.name == name)
    field[own.ids] = own.moves
    return make_surface(data).basis_matrix(UV) @ field


def opened(data: PartData) -> np.ndarray:
    turn, shift = jaw_path(JAW, 1.0)
    swung = data.jaw[:, None] * (data.points @ turn.T + shift - data.points)
    return make_surface(data).basis_matrix(UV) @ swung + of_group(data, "jawOpen")


@pytest.mark.parametrize("knots", [(0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 0.0, 0.0, 0.0, 1.0), (1.3, 1.3, 2.0, 3.0, 3.5)])
def test_a_blending_function_is_the_sum_of_finer_ones(knots) -> None:
    x = np.linspace(knots[0] + 1e-6, knots[-1] - 1e-6, 101)

    def blend(k):
        return np.nan_to_num(BSpline.basis_element(np.array(k), extrapolate=False)(x))

    finer = halved(knots)
    np.testing.assert_allclose(sum(share * blend(k) for k, share in finer.items()), blend(knots), atol=1e-12)
    widest = np.diff(knots).max()
    assert all(np.diff(k).max() <= 0.5 * widest + 1e-12 for k in finer)


def test_a_split_part_has_the_same_form_and_the_same_expressions() -> None:
    before = moving_part()
    after = split_points(before, CHOSEN, JAW)
    assert len(after.points) > 40
    np.testing.assert_allclose(make_surface(after).evaluate(UV), make_surface(before).evaluate(UV), atol=1e-9)
    np.testing.assert_allclose(of_group(after, "mouthPucker"), of_group(before, "mouthPucker"), atol=2e-4)
    np.testing.assert_allclose(opened(after), opened(before), atol=2e-4)


def test_points_on_lids_stay_as_they_are() -> None:
    lids = np.zeros(25)
    lids[[7, 8]] = 1.0
    before = replace(moving_part(), lids=lids)
    after = split_points(before, CHOSEN, JAW)
    held = np.flatnonzero(after.lids)
    np.testing.assert_array_equal(after.points[held], before.points[[7, 8]])
    np.testing.assert_array_equal(after.lids[held], [1.0, 1.0])
    np.testing.assert_allclose(make_surface(after).evaluate(UV), make_surface(before).evaluate(UV), atol=1e-9)


@pytest.mark.parametrize("room", [0, 20, 45, 1000])
def test_as_many_are_split_as_there_is_room_for(room: int) -> None:
    before = moving_part()
    count = how_many(before, CHOSEN, room)

    def added(k: int) -> int:
        return len(split_points(before, CHOSEN[:k], JAW).points) - 25

    assert added(count) <= room or count == 0
    assert count == len(CHOSEN) or added(count + 1) > room
