"""How displacements are turned and stretched by a map, and parts and heads that are carried over."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_head import all_points, part, small_head

from surface.fit.transfer.warp_head import _with_points, stretches, with_contacts_solved

TURN = Rotation.from_euler("xyz", [20, -30, 40], degrees=True).as_matrix()


class Linear:
    """A map whose derivatives are the same everywhere."""

    def __init__(self, linear: np.ndarray) -> None:
        self.linear, self.heard = linear, []

    def jacobians(self, points, reach):
        self.heard.append(reach)
        return np.tile(self.linear, (len(points), 1, 1))


@pytest.mark.parametrize(
    ("sizes", "kept"),
    [((1.0, 1.0, 1.0), (1.0, 1.0, 1.0)), ((1.3, 1.0, 0.7), (1.3, 1.0, 0.7)), ((3.0, 1.5, 0.2), (1.6, 1.5, 0.6))],
)
def test_displacements_turn_with_the_map_and_stretch_within_bounds(sizes, kept) -> None:
    axes = Rotation.from_euler("z", 25, degrees=True).as_matrix()
    linear = TURN @ axes @ np.diag(sizes) @ axes.T
    found = stretches(Linear(linear), np.zeros((4, 3)))
    np.testing.assert_allclose(found, np.tile(TURN @ axes @ np.diag(kept) @ axes.T, (4, 1, 1)), atol=1e-12)


def test_a_fold_of_the_map_mirrors_no_displacement() -> None:
    warp = Linear(np.diag([1.0, 1.0, -0.1]))
    (found,) = stretches(warp, np.zeros((1, 3)))
    assert np.linalg.det(found) > 0 and np.linalg.svd(found)[1].min() >= 0.6 - 1e-12
    np.testing.assert_allclose(found @ [1, 0, 0], [1, 0, 0], atol=1e-12)
    assert warp.heard[0] > 1.0  # over more than single faces


def test_a_part_gets_other_points_and_turned_displacements() -> None:
    old = part("a", 0.0, groups=[all_points("jawOpen", (1.0, 2.0, 3.0)), all_points("mouthPucker", (0.00001, 0, 0))])
    linear = np.stack([TURN * (1 + 0.01 * k) for k in range(25)])
    new = _with_points(old, old.points + 5.0, linear)
    np.testing.assert_array_equal(new.points, old.points + 5.0)
    wanted = np.array([1, 2, 3.0]) @ TURN.T * (1 + 0.01 * np.arange(25))[:, None]
    np.testing.assert_allclose(new.groups[0].moves, wanted, atol=6e-5)
    assert [g.name for g in new.groups] == ["jawOpen", "mouthPucker"] and new.groups[0].moves.dtype == np.float32
    assert not new.groups[1].moves.any()  # a hundredth of a micrometre is nothing


def test_a_head_whose_contacts_touch_nothing_is_settled_as_it_is() -> None:
    head = small_head()
    for before, after in zip(head.parts, with_contacts_solved(head).parts, strict=True):
        np.testing.assert_allclose(after.points, before.points, atol=1e-9)
