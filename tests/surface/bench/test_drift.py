"""Many updates stay as near to a new evaluation as one."""

from __future__ import annotations

from surface.bench.drift import drift
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
