"""The mesh in the pose of a shape: straight, but where the jaw is open in part, on the head's arc."""

import numpy as np
import pytest

from surface.fit.measures.mesh_pose import displacement, opening
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Jaw
from surface.head.model.parameters import TONGUE_JAW
from surface.head.posing.rig import jaw_path

JAW = Jaw((0.0, 0.0, 0.0), np.radians(25.0), (0.0, -1.0, 2.0))
POINTS = np.array([[0.0, -30.0, 100.0], [10.0, -20.0, 90.0], [0.0, 60.0, 90.0]])
SOURCES = {"jawOpen": [0], "tongueOut": [1], "mouthClose": [2]}


def turned(amount: float) -> np.ndarray:
    turn, shift = jaw_path(JAW, amount)
    return POINTS @ turn.T + shift - POINTS


def mesh() -> FitMesh:
    still = np.array([1.0, 1.0, 0.0])[:, None]
    tongue, close = np.zeros((3, 3)), np.zeros((3, 3))
    tongue[0, 2], close[1, 1] = 30.0, 5.0
    return FitMesh(
        POINTS, np.array([[0, 1, 2, -1]]), np.zeros((1, 2)), np.zeros((1, 4), int), tuple(SOURCES),
        np.stack([still * turned(1.0), tongue, close]),
    )  # fmt: skip


def test_a_rigid_jaw_that_is_open_in_part_is_on_its_arc_and_not_on_the_chord() -> None:
    part = opening(POINTS, mesh().deltas[0], JAW, 0.33)
    np.testing.assert_allclose(part[:2], turned(0.33)[:2], atol=1e-9)
    assert np.linalg.norm(part[0] - 0.33 * mesh().deltas[0, 0]) > 2.0, "the chord is far beside the arc"
    assert not part[2].any()


@pytest.mark.parametrize("amount", [0.0, 1.0])
def test_both_ends_are_those_of_the_file(amount: float) -> None:
    odd = mesh().deltas[0] + np.array([[3.0, 1.0, -2.0], [0.0, 0.5, 0.0], [0.1, 0.0, 0.0]])
    np.testing.assert_allclose(opening(POINTS, odd, JAW, amount), amount * odd, atol=1e-9)


def test_a_tongue_that_is_put_out_comes_with_the_jaw_it_needs() -> None:
    moved = displacement(mesh(), SOURCES, "tongueOut", JAW)
    np.testing.assert_allclose(moved[1], turned(TONGUE_JAW)[1], atol=1e-9)
    np.testing.assert_allclose(moved[0], turned(TONGUE_JAW)[0] + [0.0, 0.0, 30.0], atol=1e-9)


def test_a_mouth_closes_over_an_open_jaw_and_neutral_moves_nothing() -> None:
    closed = displacement(mesh(), SOURCES, "mouthClose", JAW)
    np.testing.assert_allclose(closed, mesh().deltas[0] + mesh().deltas[2], atol=1e-9)
    assert not displacement(mesh(), SOURCES, "neutral", JAW).any()
    assert not displacement(mesh(), {}, "tongueOut", JAW).any()
