"""Flat holes are opened; what is far away stays."""

import numpy as np
from slit_sheet import slit_sheet

from surface.fit.source.islands import Island, boundary_loops, find_islands
from surface.fit.source.relax import OPEN, open_flat_holes


def flat_island() -> Island:
    island = find_islands(slit_sheet())[0]
    x = island.uv[:, 1] - 0.52
    return Island(island.vertex, np.column_stack([island.uv[:, 0], 0.52 + 0.3 * x + 0.7 * x * np.abs(x)]), island.faces)


def test_the_hole_gets_higher_and_its_sides_stay_straight():
    before, after = flat_island(), open_flat_holes(flat_island())
    loop = boundary_loops(before)[1]
    height, opened = np.ptp(before.uv[loop][:, 1]), np.ptp(after.uv[loop][:, 1])
    assert opened > 1.5 * height
    rows = after.uv[loop][before.uv[loop][:, 1] > 0.52][:, 1]
    assert np.ptp(rows) < 1e-12


def test_no_face_is_turned_over():
    island = open_flat_holes(flat_island())
    a, b, c, d = (island.uv[island.faces[:, k]] for k in range(4))

    def cross(p, q):
        return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]

    assert cross(c - a, d - b).min() > 0


def test_a_chart_without_flat_holes_is_left_alone():
    island = find_islands(slit_sheet())[0]
    tall = Island(island.vertex, island.uv * [1.0, 1.0 / OPEN * 4], island.faces)
    np.testing.assert_array_equal(open_flat_holes(tall).uv, tall.uv)
