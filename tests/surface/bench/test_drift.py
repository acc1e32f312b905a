"""Many updates stay as near to a new evaluation as one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from surface.bench.drift import _jitter_knots, _max_errors, drift
from tests.surface import shapes


def test_many_updates_of_every_kind_stay_within_a_millionth_of_the_size() -> None:
    surface = shapes.hills()
    found = drift(surface, surface.tessellate(chord_error=1.0), 200_000)
    assert (found.moves, found.groups, found.weights, found.knots) == (195_900, 3_900, 100, 100)
    assert 0 < found.error <= 1e-6
    assert found.normal_error < 2e-6


def test_a_closed_surface_moves_at_both_ends() -> None:
    ring = shapes.torus()
    found = drift(ring, ring.tessellate(chord_error=0.5), 3_000, seed=2)
    assert found.moves + found.groups + found.weights + found.knots == 3_000
    assert 0 < found.error <= 1e-6


def test_a_reversed_mesh_is_compared_with_reversed_normals() -> None:
    surface = shapes.hills(8)
    found = drift(surface, surface.tessellate(chord_error=5.0, flip=True), 3)
    assert (found.moves, found.groups, found.weights, found.knots) == (1, 0, 1, 1)
    assert found.normal_error < 2e-6 and found.error < 1e-6


def test_updates_are_counted_and_reported_in_rounds_of_two_thousand() -> None:
    surface, said = shapes.hills(8), list[str]()
    mesh = surface.tessellate(chord_error=5.0)
    found = drift(surface, mesh, 4_100, report=said.append)
    assert said == ["0 updates", "2000 updates", "4000 updates"]
    # a fiftieth of each round, less one, are groups: 39, 39 and 1; two of each round change weights and knots
    assert (found.moves, found.groups, found.weights, found.knots) == (4_100 - 79 - 6, 79, 3, 3)
    assert drift(surface, mesh, 40, seed=1) == drift(surface, mesh, 40, seed=1) != drift(surface, mesh, 40, seed=2)


def test_errors_are_parts_of_the_size_and_lengths_of_differences() -> None:
    surface = shapes.hills(8)
    deformation = surface.deformation(surface.tessellate(chord_error=5.0))
    assert max(_max_errors(deformation, 100.0)) < 1e-6
    vertices, normals = deformation.vertices.copy(), deformation.normals.copy()
    vertices[3] += [3.0, 0.0, 4.0]
    normals[5] += [0.0, 0.6, 0.8]
    off = SimpleNamespace(mesh=deformation.mesh, surface=surface, vertices=vertices, normals=normals)
    assert _max_errors(off, 100.0) == (pytest.approx(0.05, rel=1e-4), pytest.approx(1.0, rel=1e-4))


def test_knots_are_moved_by_a_tenth_within_their_ends() -> None:
    rng, knots = np.random.default_rng(3), np.array([2.0, 2.0, 3.0, 4.0, 5.0, 5.0])
    for _ in range(50):
        found = _jitter_knots(knots, rng)
        assert found[[0, 1, 4, 5]].tolist() == [2, 2, 5, 5] and (np.diff(found) >= 0).all()
        low, high = 0.9 * knots[2:4] + 0.2, 0.9 * knots[2:4] + 0.5
        assert (found[2:4] >= low).all() and (found[2:4] <= high).all() and (found[2:4] != knots[2:4]).any()
