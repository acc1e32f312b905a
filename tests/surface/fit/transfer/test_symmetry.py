"""Scans that are the same on both sides: their plane, and a registration that is the same on both sides, too."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.fit.transfer.align import Similarity
from surface.fit.transfer.register import Mark, Registered
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.symmetry import FLIP, MirroredWarp, levelled, mirror_plane, symmetrised
from surface.fit.transfer.template import Template
from surface.fit.transfer.warp import Warp

RNG = np.random.default_rng(3)
TURN = Rotation.from_euler("yz", [4.0, -3.0], degrees=True).as_matrix()
SHIFT = np.array([2.5, 0.0, 0.0])


def egg(count: int, *, dent: float = 0.0) -> Samples:
    """Samples of a bulging face that mirrors itself in x = 0, but for a dent of so many mm in its left cheek."""
    x, y = RNG.uniform(-60, 60, count), RNG.uniform(-80, 80, count)
    points = np.column_stack([x, y, _height(x, y, dent)])
    step = 1e-3
    rise = [_height(x + a, y + b, dent) - _height(x - a, y - b, dent) for a, b in ((step, 0), (0, step))]
    normals = np.column_stack([-rise[0], -rise[1], np.full(count, 2 * step)])
    return Samples(points, normals / np.linalg.norm(normals, axis=1)[:, None], np.zeros(count, bool))


def _height(x: np.ndarray, y: np.ndarray, dent: float) -> np.ndarray:
    nose = 25.0 * np.exp(-((x / 10) ** 2) - ((y / 20) ** 2))
    brows = 6.0 * np.exp(-(((np.abs(x) - 30) / 12) ** 2) - (((y - 35) / 8) ** 2))
    return 90.0 - 0.012 * x**2 - 0.004 * y**2 + nose + brows - dent * np.exp(-(((x - 35) ** 2 + (y + 20) ** 2) / 300))


@pytest.fixture
def template() -> Template:
    own = egg(900)
    marks = {"nose_bridge": np.array([0.0, 35.0, 90.0]), "chin": np.array([0.0, -75.0, 70.0])}
    tri = np.zeros((0, 3), np.int64)
    return Template(own.points, own.normals, tri, np.ones(900, bool), np.full(900, -1), marks, np.zeros((2, 3)), 12.0)


def turned(samples: Samples) -> Samples:
    return replace(samples, points=samples.points @ TURN.T + SHIFT, normals=samples.normals @ TURN.T)


def test_the_plane_of_a_turned_face_is_found_and_becomes_the_heads(template: Template) -> None:
    plane = mirror_plane(template, turned(egg(40_000)))
    assert plane is not None
    np.testing.assert_allclose(plane.normal, TURN[:, 0], atol=2e-3)
    assert (SHIFT - plane.centre) @ plane.normal == pytest.approx(0.0, abs=0.1)
    level = levelled(Similarity(TURN, 1.0, SHIFT), plane)
    np.testing.assert_allclose(level.turn @ level.turn.T, np.eye(3), atol=1e-9)
    rest = egg(500).points
    both = [level.points(rows) for rows in (rest, FLIP * rest)]
    np.testing.assert_allclose(both[0], FLIP * both[1], atol=0.15)
    assert np.linalg.norm(level.points(rest) - (rest @ TURN.T + SHIFT), axis=1).max() < 12.0  # no more than it was off


def test_a_face_with_a_dent_in_one_cheek_has_no_plane(template: Template) -> None:
    assert mirror_plane(template, egg(40_000, dent=6.0)) is None


def test_a_scan_without_a_face_has_no_plane(template: Template) -> None:
    far = egg(2000)
    assert mirror_plane(template, replace(far, points=far.points + 1000.0)) is None


@pytest.fixture
def warp() -> Warp:
    points = RNG.uniform(-50, 50, (40, 3))
    return Warp(points, points + RNG.normal(0.0, 2.0, (40, 3)), np.ones(40), 10.0)


def test_a_mirrored_map_is_the_mean_of_both_sides(warp: Warp) -> None:
    both, at = MirroredWarp(warp), RNG.uniform(-50, 50, (30, 3))
    np.testing.assert_allclose(both(FLIP * at), FLIP * both(at), atol=1e-9)
    np.testing.assert_allclose(both(at), 0.5 * (warp(at) + FLIP * warp(FLIP * at)), atol=1e-12)
    middle = at * [0.0, 1.0, 1.0]
    np.testing.assert_allclose(both(middle)[:, 1:], warp(middle)[:, 1:], atol=1e-9)
    normals = RNG.normal(size=(30, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    placed, out = both.turned(at, normals)
    np.testing.assert_allclose(placed, both(at), atol=1e-9)
    there, back = both.turned(FLIP * at, FLIP * normals)
    np.testing.assert_allclose((FLIP * there, FLIP * back), (placed, out), atol=1e-9)


def test_landmarks_of_both_sides_become_alike_unless_given(warp: Warp) -> None:
    marks = {
        "left_eye_upper": Mark(np.array([30.0, 40.0, 80.0]), "found", 0.9),
        "right_eye_upper": Mark(np.array([-32.0, 42.0, 81.0]), "found", 0.8),
        "mouth_left": Mark(np.array([20.0, -40.0, 85.0]), "given"),
        "mouth_right": Mark(np.array([-24.0, -44.0, 85.0]), "found", 0.5),
        "nose_tip": Mark(np.array([1.0, 0.0, 110.0]), "found", 1.0),
    }
    made = symmetrised(Registered(warp, warp, marks)).marks
    np.testing.assert_allclose(made["left_eye_upper"].place, [31.0, 41.0, 80.5])
    np.testing.assert_allclose(made["right_eye_upper"].place, [-31.0, 41.0, 80.5])
    np.testing.assert_allclose(made["nose_tip"].place, [0.0, 0.0, 110.0])
    assert made["mouth_left"] is marks["mouth_left"] and made["mouth_right"] is marks["mouth_right"]
