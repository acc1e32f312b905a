"""Sparse displacements give what dense ones do, and a rig works anew only what a pose changes."""

import numpy as np
from small_head import all_points, part, small_head

from surface.head.model.data import Group
from surface.head.model.parameters import NAMES, read_pose
from surface.head.posing.moves import Moves
from surface.head.posing.rig import SkinRig

NAMED = ("mouthPucker", "cheekPuff", "jawOpen")


def test_sparse_is_dense():
    one = Group("cheekPuff", np.array([3, 7], np.int32), np.array([[1, 2, 3], [4, 5, 6]], np.float32))
    moves = Moves(
        part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6)), one, all_points("other", (9, 9, 9))]), NAMED
    )
    np.testing.assert_array_equal(moves.used, [0, 1])
    points = np.ones((25, 3))
    moves.add(np.array([0.5, 2.0]), points)
    want = np.ones((25, 3))
    want[:, 2] += 3.0
    want[[3, 7]] += 2.0 * np.array([[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(points, want, atol=1e-12)
    np.testing.assert_array_equal(moves.at(np.array([7]))[:, 0], [[0, 0, 6], [4, 5, 6]])


def test_runs_of_points_are_cut_at_wide_gaps_only():
    ids = np.array([24, 1, 3, 1], np.int32)
    moves = Moves(part("a", 0, groups=[Group("cheekPuff", ids, np.arange(12, dtype=np.float32).reshape(4, 3))]), NAMED)
    points = np.zeros((25, 3))
    moves.add(np.array([2.0]), points)
    want = np.zeros((25, 3))
    want[[24, 3]], want[1] = [[0, 2, 4], [12, 14, 16]], [24, 28, 32]
    np.testing.assert_array_equal(points, want)
    np.testing.assert_array_equal(moves.at(np.arange(25))[0], want / 2)


def test_a_rig_rests_while_nothing_changes_and_wakes_when_it_is_told_to():
    rig = SkinRig(part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6))]), small_head())

    def pose(**given: float):
        return read_pose(np.array([given.get(n, 0.0) for n in NAMES]))

    rig.apply(pose(mouthPucker=0.5))
    version, points = rig.version, rig.points.copy()
    rig.apply(pose(mouthPucker=0.5, browInnerUp=1.0))  # none of this part's business
    assert rig.version == version
    rig.rest[0] += 1.0
    rig.invalidate()
    np.testing.assert_allclose(rig.apply(pose(mouthPucker=0.5))[0] - points[0], 1.0)
    assert rig.version == version + 1
