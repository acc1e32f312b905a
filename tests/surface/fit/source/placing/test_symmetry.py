"""Planes in which points mirror themselves."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.fit.source.placing import symmetry as module
from surface.fit.source.placing.symmetry import find_mirrors

RNG = np.random.default_rng(0)


def lopsided(count: int = 900) -> np.ndarray:
    """A body that mirrors itself in x = 0 and in no other plane."""
    p = RNG.uniform(-1, 1, (count, 3)) * [40, 60, 50]
    p[:, 2] += 0.01 * p[:, 1] ** 2 + 0.4 * np.abs(p[:, 0])
    p[:, 1] += 12.0 * np.sin(p[:, 2] / 20)
    return np.vstack([p, p * [-1, 1, 1]])


@pytest.mark.parametrize("seed", [0, 2])
def test_the_plane_of_a_body_is_found_in_any_place_turn_and_size(seed: int) -> None:
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    scale, shift = 10.0 ** (seed - 1), np.array([7.0, -900.0, 30.0])
    points = scale * lopsided() @ turn.T + shift
    best = find_mirrors(points)[0]
    assert abs(best.normal @ turn[:, 0]) > 0.9999
    assert abs((best.centre - shift) @ turn[:, 0]) < 0.01 * scale * 40
    assert best.error < 1e-6 and np.linalg.norm(best.normal) == pytest.approx(1.0)


def test_what_is_not_mirrored_like_hair_does_not_move_the_plane() -> None:
    hair = RNG.uniform([20, 40, -50], [60, 80, 50], (200, 3))
    best = find_mirrors(np.vstack([lopsided(), hair])[RNG.permutation(2000)])[0]
    assert abs(best.normal[0]) > 0.999 and abs(best.centre[0]) < 1.5


def test_a_box_has_three_planes_and_they_differ() -> None:
    eighth = RNG.uniform(0, 1, (250, 3)) * [30, 50, 90]
    signs = np.stack(np.meshgrid([1, -1], [1, -1], [1, -1]), axis=-1).reshape(-1, 3)
    found = find_mirrors((eighth[:, None] * signs).reshape(-1, 3))
    normals = np.abs([m.normal for m in found])
    assert len(found) == 3
    np.testing.assert_allclose(normals[normals.argmax(axis=1).argsort()], np.eye(3), atol=0.02)
    assert [m.error for m in found] == sorted(m.error for m in found)
    assert len(find_mirrors((eighth[:, None] * signs).reshape(-1, 3), most=2)) == 2


def test_a_plane_that_is_much_worse_than_the_best_is_none() -> None:
    found = find_mirrors(lopsided())
    assert (
        len(found) == 1
        or found[1].error < max(module.RIVAL_FACTOR * found[0].error, found[0].error + module.RIVAL_EXCESS) <= 0.1
    )


def test_mirrored_points_are_as_far_on_the_other_side() -> None:
    normal, centre, points = np.array([0.6, 0.0, 0.8]), np.array([1.0, 2, 3]), RNG.normal(size=(20, 3))
    image = module._mirrored(points, normal, centre)
    np.testing.assert_allclose((image - centre) @ normal, -(points - centre) @ normal)
    np.testing.assert_allclose(np.cross(image - points, normal), 0.0, atol=1e-12)
    np.testing.assert_allclose(module._mirrored(image, normal, centre), points)


def test_starts_are_spread_over_half_a_sphere() -> None:
    found = module._spread(24)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    cosine = np.abs(found @ found.T) - 2 * np.eye(24)
    assert (found[:, 2] > 0).all() and np.degrees(np.arccos(cosine.max())) > 15
    asked = RNG.normal(size=(500, 3))
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.abs(asked @ found.T).max(axis=1).min())) < 26
