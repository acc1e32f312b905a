"""Shapes that do something else than their names say."""

import numpy as np
import pytest

from surface.fit.source.mesh import FitMesh
from surface.fit.source.naming.misnamed import closing, correct_shapes, correct_sides

NONE = np.zeros((0, 4), np.int64)


def mesh(**sideways: float) -> FitMesh:
    """Shapes that move five points to the left by so many mm, and down by 2 mm."""
    deltas = np.stack([np.tile([x, -2.0, 0.0], (5, 1)) for x in sideways.values()])
    return FitMesh(np.zeros((5, 3)), NONE, np.zeros((0, 2)), NONE, tuple(sideways), deltas)


@pytest.mark.parametrize(("left", "right"), [("mouthLeft", "mouthRight"), ("jawLeft", "jawRight")])
def test_a_pair_that_goes_astray_is_exchanged(left: str, right: str) -> None:
    given = mesh(**{left: -3.0, "jawOpen": -9.0, right: 3.0})
    made, notes = correct_sides(given)
    assert made.names == (right, "jawOpen", left) and made.deltas is given.deltas
    assert notes == [f"{left} and {right} go to the other side in the file (left is the subject's): exchanged"]


@pytest.mark.parametrize(("left", "right"), [(3.0, -3.0), (-3.0, -3.0), (-0.3, 0.3), (0.0, 0.0), (-3.0, 0.1)])
def test_a_pair_that_goes_right_or_does_not_say_stays(left: float, right: float) -> None:
    made, notes = correct_sides(mesh(mouthLeft=left, mouthRight=right))
    assert made.names == ("mouthLeft", "mouthRight") and notes == []


def test_one_side_alone_stays() -> None:
    assert correct_sides(mesh(mouthLeft=-3.0))[0].names == ("mouthLeft",)


def jaw(opens: float, closes: float) -> FitMesh:
    deltas = np.zeros((3, 5, 3))
    deltas[0, 2, 1], deltas[1, :, 0], deltas[2, 3, 1] = -opens, 1.0, closes
    return FitMesh(np.zeros((5, 3)), NONE, np.zeros((0, 2)), NONE, ("jawOpen", "cheekPuff", "mouthClose"), deltas)


@pytest.mark.parametrize(("opens", "closes", "stays"), [(10.0, 0.8, False), (10.0, 2.6, True), (30.0, 20.0, True)])
def test_a_mouth_close_that_closes_no_open_jaw_is_left_out(opens: float, closes: float, stays: bool) -> None:
    """As in drawn characters whose jaw is made from a vowel, while their mouthClose only presses the lips."""
    given = jaw(opens, closes)
    made, notes = closing(given)
    assert ("mouthClose" in made.names) == stays and len(notes) == (not stays)
    assert correct_shapes(given)[0].names == made.names
    for name in ("jawOpen", "cheekPuff"):
        k, m = given.names.index(name), made.names.index(name)
        np.testing.assert_array_equal(made.deltas[m], given.deltas[k])
    if not stays:
        assert notes == [
            "mouthClose: left out: that of the mesh moves the lips by 0.8 mm, and closes no jaw that opens by 10.0 mm"
        ]


def test_without_a_jaw_there_is_nothing_to_close() -> None:
    given = mesh(mouthClose=0.1)
    assert closing(given) == (given, [])
