"""surface.head.model.data: how much of the head's rotation points follow."""

import numpy as np
import pytest

from surface.head import Neck


def test_the_neck_bends_between_chin_and_shoulders():
    chin, nape, chest = [0, -80, 95.0], [0, -50, -75.0], [0, -190.0, 30]
    share = Neck((0.0, -55.0, 0.0)).share(np.array([chin, nape, chest]))
    assert share[0] == 1 and share[1] > 0.95 and share[2] == 0


def test_the_share_rises_smoothly_along_the_slope():
    neck = Neck((0.0, 0.0, 0.0), slope=0.5, still=-100.0, whole=-60.0)
    y = np.array([-101.0, -100.0, -90.0, -80.0, -70.0, -60.0, -59.0])
    share = neck.share(np.column_stack([np.full(7, 33.0), y - 10.0, np.full(7, 20.0)]))
    np.testing.assert_allclose(share, [0.0, 0.0, 5 / 32, 0.5, 27 / 32, 1.0, 1.0])
    assert neck.share(np.array([[0.0, -80.0, 0.0]]))[0] == pytest.approx(0.5)
