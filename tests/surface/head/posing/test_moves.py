"""surface.head.posing.moves: displacements by groups, against the same sums in numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_head import all_points, part

from surface.head.model.data import Group
from surface.head.model.file import load_data
from surface.head.posing.moves import Moves, gray_order

ROOT = Path(__file__).parents[4]
NAMED = ("mouthPucker", "cheekPuff", "jawOpen")


def test_sparse_is_dense() -> None:
    one = Group("cheekPuff", np.array([3, 7], np.int32), np.array([[1, 2, 3], [4, 5, 6]], np.float32))
    moves = Moves(
        part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6)), one, all_points("other", (9, 9, 9))]), NAMED
    )
    np.testing.assert_array_equal(moves.used, [0, 1])
    points = np.ones((25, 3))
    moves.add(np.array([0.5, 2.0]), points, points)
    want = np.ones((25, 3))
    want[:, 2] += 3.0
    want[[3, 7]] += 2.0 * np.array([[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(points, want, atol=1e-12)
    np.testing.assert_array_equal(moves.at(np.array([7]))[:, 0], [[0, 0, 6], [4, 5, 6]])


def test_displacements_of_many_poses_at_once_are_those_of_each() -> None:
    rng = np.random.default_rng(4)
    groups = [Group(name, rng.permutation(25)[:15], rng.normal(size=(15, 3)).astype(np.float32)) for name in NAMED]
    moves, rest = Moves(part("a", 0, groups=groups), NAMED), rng.normal(size=(25, 3))
    amounts = rng.uniform(-1.0, 1.0, (5, len(moves.used)))
    wanted, single = np.tile(rest, (5, 1, 1)), np.tile(rest, (5, 1, 1))
    for pose, points, values in zip(wanted, single, amounts, strict=True):
        for group, value in zip(groups, values, strict=True):
            pose[group.ids] += value * group.moves.astype(np.float64)
        moves.add(values, points, points)
    np.testing.assert_allclose(moves.add_all(amounts, rest), wanted, atol=1e-12)
    np.testing.assert_allclose(single, wanted, atol=2e-6)  # summed in 32-bit numbers
    assert moves.add_all(amounts[:0], rest).shape == (0, *rest.shape)


def test_a_point_that_is_named_twice_moves_by_both() -> None:
    ids = np.array([24, 1, 3, 1], np.int32)
    moves = Moves(part("a", 0, groups=[Group("cheekPuff", ids, np.arange(12, dtype=np.float32).reshape(4, 3))]), NAMED)
    points = np.zeros((25, 3))
    moves.add(np.array([2.0]), points, points)
    want = np.zeros((25, 3))
    want[[24, 3]], want[1] = [[0, 2, 4], [12, 14, 16]], [24, 28, 32]
    np.testing.assert_array_equal(points, want)
    np.testing.assert_array_equal(moves.at(np.arange(25))[0], want / 2)


def test_a_part_without_groups_stays() -> None:
    moves, points = Moves(part("a", 0), NAMED), np.ones((25, 3))
    moves.add(np.zeros(0), points, points)
    assert (points == 1.0).all() and moves.nbytes == 0


def test_points_that_the_same_groups_move_follow_each_other() -> None:
    """Left and right points in turn, as in a face whose halves alternate, and a group that moves all."""
    left = np.arange(24) % 2 == 0
    order = gray_order(np.stack([left, ~left, np.ones(24, bool)]))
    assert sorted(order) == list(range(24))
    assert np.count_nonzero(np.diff(left[order].astype(int))) == 1


def test_of_the_shipped_head_few_zeros_are_read() -> None:
    """In the file's order nearly every third number that a pose read was the zero of a point between two that moved."""
    data = load_data(ROOT / "configs" / "heads" / "ict")
    face = next(part for part in data.parts if part.name == "face")
    moves = Moves(face, tuple(group.name for group in face.groups))
    needed = sum(12 * len(np.unique(group.ids)) for group in face.groups)
    assert moves.nbytes < 1.3 * needed
