"""Locks of hair over a flat skin: where they lie along their length."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.fit.wardrobe.locks import Locks, grow
from surface.fit.wardrobe.styles import lock_patches


class Plane:
    """A skin in the plane y = 0."""

    def nearest(self, points: Floats, *, ears: bool = False) -> tuple[Floats, Floats]:
        return np.tile([0.0, 1.0, 0.0], (len(points), 1)), points[:, 1]


def heights(settle: float) -> Floats:
    """(steps + 1,) mm above the skin of a lock through hair of 10 mm."""
    paths, _ = grow(
        Plane(), np.zeros((1, 3)), np.array([60.0]), lambda at: np.full(len(at), 10.0),  # type: ignore[arg-type]
        lambda at, normals, share: np.tile([1.0, 0.0, 0.0], (len(at), 1)),
        lift=np.array([1.2]), slack=0.0, settle=settle,
    )  # fmt: skip
    return np.asarray(paths[0, :, 1])


def test_a_tip_settles_by_its_share_and_the_root_not() -> None:
    free, settled = heights(0.0), heights(0.3)
    assert free[-1] == 12.0 and np.isclose(settled[-1], 12.0 * 0.7)
    assert settled[0] == free[0] and (np.diff(settled / free) <= 1e-12).all()


@pytest.mark.parametrize(("count", "degree"), [(3, 2), (4, 3), (5, 3)])
def test_ribbons_are_cubic_along_where_they_have_points_enough(count: int, degree: int) -> None:
    path = np.stack([np.linspace(0.0, 60.0, 9), np.zeros(9), np.zeros(9)], axis=1)[None]
    up = np.tile([0.0, 1.0, 0.0], (1, 9, 1))
    locks = Locks(path, up, np.array([10.0]), np.ones(1), np.ones(1))
    made = lock_patches(locks, count, (3, 5), (2, 3), np.zeros(1))
    assert made.degrees == (2, degree) and made.points.shape == (1, 3, count, 3)
