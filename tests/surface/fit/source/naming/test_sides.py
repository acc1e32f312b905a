"""Shapes that go to the other side than their names say."""

import numpy as np
import pytest

from surface.fit.source.mesh import FitMesh
from surface.fit.source.naming.sides import right_sides

NONE = np.zeros((0, 4), np.int64)


def mesh(**sideways: float) -> FitMesh:
    """Shapes that move five points to the left by so many mm, and down by 2 mm."""
    deltas = np.stack([np.tile([x, -2.0, 0.0], (5, 1)) for x in sideways.values()])
    return FitMesh(np.zeros((5, 3)), NONE, np.zeros((0, 2)), NONE, tuple(sideways), deltas)


@pytest.mark.parametrize(("left", "right"), [("mouthLeft", "mouthRight"), ("jawLeft", "jawRight")])
def test_a_pair_that_goes_astray_is_exchanged(left: str, right: str) -> None:
    given = mesh(**{left: -3.0, "jawOpen": -9.0, right: 3.0})
    made, notes = right_sides(given)
    assert made.names == (right, "jawOpen", left) and made.deltas is given.deltas
    assert notes == [f"{left} and {right} go to the other side in the file (left is the subject's): exchanged"]


@pytest.mark.parametrize(("left", "right"), [(3.0, -3.0), (-3.0, -3.0), (-0.3, 0.3), (0.0, 0.0), (-3.0, 0.1)])
def test_a_pair_that_goes_right_or_does_not_say_stays(left: float, right: float) -> None:
    made, notes = right_sides(mesh(mouthLeft=left, mouthRight=right))
    assert made.names == ("mouthLeft", "mouthRight") and notes == []


def test_one_side_alone_stays() -> None:
    assert right_sides(mesh(mouthLeft=-3.0))[0].names == ("mouthLeft",)
