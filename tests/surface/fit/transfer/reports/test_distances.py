"""surface.fit.transfer.reports.distances: points near a ball, whose distances are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from surface.fit.transfer.reports.distances import CLOSE_MM, COUNT, distances_from, sample_head
from surface.fit.transfer.scan import Samples

RADIUS = 50.0


def ball(name: str, material: str, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    return SimpleNamespace(name=name, material=material, vertices=(mesh.vertices + centre).astype(np.float32),
                           triangles=mesh.faces.astype(np.int32))  # fmt: skip


@pytest.fixture(scope="module")
def samples() -> Samples:
    parts = [ball("face", "skin"), ball("teeth", "teeth", (0.0, 0.0, 500.0)), ball("eye", "eye", (200.0, 0.0, 0.0))]
    head: Any = SimpleNamespace(name="balls", parts=parts)
    return sample_head(head)


def test_skin_and_eyeballs_are_sampled_alike_and_nothing_else(samples: Samples) -> None:
    assert len(samples.points) == COUNT
    near = np.linalg.norm(samples.points, axis=1) < RADIUS + 1.0
    eye = np.linalg.norm(samples.points - [200.0, 0.0, 0.0], axis=1) < RADIUS + 1.0
    assert (near | eye).all() and near.mean() == pytest.approx(0.5, abs=0.01)


def test_close_points_have_their_distance_along_the_normal_and_far_ones_from_the_sample(samples: Samples) -> None:
    rng = np.random.default_rng(3)
    ways = rng.normal(size=(400, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    for height in (-1.5, -0.2, 0.0, 0.3, 1.7, 5.0, 40.0):
        found = distances_from(samples, (RADIUS + height) * ways)
        chord = 0.05  # of the ball's triangles
        if abs(height) > CLOSE_MM:
            np.testing.assert_array_equal(found.mm, found.to_sample)
            assert found.mm.min() > abs(height) - chord and found.mm.max() < abs(height) + 0.4
        else:
            np.testing.assert_allclose(found.mm, abs(height), atol=chord + 0.01)
            assert (found.mm <= found.to_sample + 1e-9).all()
        at = samples.points[found.nearest]
        np.testing.assert_allclose(np.linalg.norm(at - (RADIUS + height) * ways, axis=1), found.to_sample)


def test_the_nearest_sample_is_the_nearest_of_all(samples: Samples) -> None:
    points = np.random.default_rng(4).uniform(-80, 280, (20, 3))
    found = distances_from(samples, points)
    for point, mm, number in zip(points, found.to_sample, found.nearest, strict=True):
        far = np.linalg.norm(samples.points - point, axis=1)
        assert far.min() == pytest.approx(mm) and far.argmin() == number


def test_a_point_two_millimetres_off_counts_from_its_sample() -> None:
    one = Samples(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.zeros(1, bool))
    points = np.array([[1.2, 0.0, 1.5], [1.6, 0.0, 1.2], [3.0, 0.0, -4.0]])
    found = distances_from(one, points)
    assert found.to_sample.tolist() == pytest.approx([np.hypot(1.2, 1.5), 2.0, 5.0])
    assert found.mm.tolist() == pytest.approx([1.5, 2.0, 5.0]) and CLOSE_MM == 2.0
