"""The rigid motion of points."""

import numpy as np
import pytest

from surface.fit.points.rigidfit import rigid_fit
from surface.head.model.parameters import rotation

POINTS = np.random.default_rng(2).normal(size=(40, 3)) * 20 + [0, -40, 80]


def test_rigid_fit_recovers_a_motion():
    turn, shift = rotation(0.2, -0.3, 0.1), np.array([1.0, -2.0, 3.0])
    got_turn, got_shift = rigid_fit(POINTS, POINTS @ turn.T + shift)
    np.testing.assert_allclose(got_turn, turn, atol=1e-12)
    np.testing.assert_allclose(got_shift, shift, atol=1e-10)


def test_a_mirrored_cloud_is_turned_and_not_mirrored():
    turn, _ = rigid_fit(POINTS, POINTS * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
