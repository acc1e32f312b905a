"""surface.view.bounds"""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.bounds import box_corners


def test_box_corners() -> None:
    corners = box_corners(np.array([[1.0, 2.0, 3.0], [0.0, 5.0, -1.0]]))
    assert len(np.unique(corners, axis=0)) == 8
    assert corners.min(axis=0) == pytest.approx([0, 2, -1])
    assert corners.max(axis=0) == pytest.approx([1, 5, 3])
