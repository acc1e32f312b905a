"""Slopes of the mesh in (u, v)."""

import numpy as np
from slit_sheet import SIZE_MM, N, slit_sheet

from surface.fit.islands import find_islands
from surface.fit.slopes import face_slopes, join_slopes

MESH = slit_sheet()
ISLAND = find_islands(MESH)[0]


def test_slopes_of_a_linear_function_are_exact():
    s = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    f = MESH.uv @ [3.0, -2.0] + 1.0
    np.testing.assert_allclose(s.mix_u @ f, 3.0 * s.span[:, 0], rtol=1e-6)
    np.testing.assert_allclose(s.mix_v @ f, -2.0 * s.span[:, 1], rtol=1e-6)
    np.testing.assert_allclose(s.span, 1.0 / N, rtol=1e-6)


def test_slopes_of_the_sheet_are_its_derivatives():
    s = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    want = SIZE_MM * -0.6 * np.sin(3 * (s.uv[:, 0] - 0.5)) * np.cos(3 * (s.uv[:, 1] - 0.5)) / N
    np.testing.assert_allclose(s.mix_u @ MESH.vertices[:, 2], want, atol=0.02)


def test_joined_slopes_stand_one_after_the_other():
    one = face_slopes(ISLAND, len(MESH.vertices), np.ones(len(ISLAND.uv)))
    two = join_slopes([one, one])
    assert two.mix_u.shape == (2 * one.mix_u.shape[0], one.mix_u.shape[1])
    np.testing.assert_array_equal(two.uv[len(one.uv) :], one.uv)
