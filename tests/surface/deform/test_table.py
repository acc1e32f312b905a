"""One table, any number of states."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
import shapes

from surface.deform.table import arrays_of, stencil_table
from surface.spline.controlpoints import ControlPoints


def plain() -> ControlPoints:
    """Hills as a plain table of control points."""
    hills = shapes.hills(10)
    return ControlPoints.from_padded(hills.points, hills.weights, *hills.padded, *hills.degrees)


def test_moves_change_the_state_and_nothing_of_the_table() -> None:
    surface = plain()
    table = stencil_table(surface, shapes.hills(10).tessellate(chord_error=0.5))
    before = {name: array.copy() for name, array in vars(table.lists).items() if isinstance(array, np.ndarray)}
    before |= {name: getattr(table, name).copy() for name in ("origin", "below", "bend")}
    one, two = table.new_state(surface.points), table.new_state(surface.points)
    rng = np.random.default_rng(4)
    for state in (one, two):
        table.update(state)
    for _ in range(40):
        ids, rows = rng.choice(surface.n, 4, replace=False), rng.normal(size=(4, 3))
        table.update(one, (ids, rows, True))
    now = arrays_of(table, one)
    assert all(np.array_equal(now[name], array) for name, array in before.items())
    assert not np.array_equal(one.vertices, two.vertices)
    table.update(two, (np.arange(surface.n), one.points, False))
    assert np.allclose(one.vertices, two.vertices, rtol=0, atol=1e-4)
    with pytest.raises(FrozenInstanceError):
        table.below = table.bend  # type: ignore[misc]


def test_a_refused_change_leaves_the_state() -> None:
    surface = plain()
    table = stencil_table(surface, shapes.hills(10).tessellate(chord_error=0.5))
    state = table.new_state(surface.points)
    table.update(state)
    before = state.vertices.copy()
    for ids, rows, message in (([100], [[0.0, 0, 0]], r"ids\[0\]: 100"), ([3], [[0.0, np.inf, 0]], r"xyz\[0\]")):
        with pytest.raises(ValueError, match=message):
            table.update(state, (np.array(ids), np.array(rows), False))
    assert np.array_equal(state.points, surface.points)
    assert np.array_equal(state.vertices, before)
