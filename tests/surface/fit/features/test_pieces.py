"""Brows and lashes stand on the skin and follow it."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.features.pieces import ROOT_MM, Skin, brow_strip, fit_strip, lash_strip
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands


@pytest.fixture(scope="module")
def skin() -> Skin:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    return Skin(fit_chart(mesh, chart, FitRequest(250, coarse=0.2)))


def ends(strip, v: float) -> np.ndarray:
    s = np.linspace(0.02, 0.98, 9)
    at = strip.surface.basis_matrix(np.column_stack([s, np.full(9, v)]))
    return np.stack([at @ strip.points, *(at @ (strip.points + m) for m in strip.moves)])


def test_a_strip_passes_through_its_samples():
    s, t = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 3), indexing="ij")
    rows = np.stack([s, t, 0.2 * s**2], axis=-1)[None]
    strip = fit_strip(rows, 8, 3, [])
    at = strip.surface.basis_matrix(np.column_stack([s.ravel(), t.ravel()]))
    np.testing.assert_allclose(at @ strip.points, rows.reshape(-1, 3), atol=1e-9)


def test_lashes_are_rooted_in_the_lid_in_every_shape(skin):
    s = np.linspace(0.35, 0.65, 20)
    root = np.column_stack([s, np.full(20, 0.45)])
    strip = lash_strip(skin, root, np.array([0.0, 0.0, 20.0]), np.full(20, 8.0), upper=True, hairs=12)
    want = skin.at(np.column_stack([0.35 + 0.3 * np.linspace(0.02, 0.98, 9), np.full(9, 0.45)]))
    assert np.linalg.norm(ends(strip, 0.0) - want, axis=2).max() < ROOT_MM + 0.45
    length = np.linalg.norm(ends(strip, 1.0) - ends(strip, 0.0), axis=2)
    assert length.min() > 6.5 and length.max() < 9.0


def brow_uv() -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0.55, 0.8, 20), np.linspace(0.78, 0.82, 5), indexing="ij")
    return np.stack([u, v], axis=-1)


def test_brows_lie_just_above_the_skin(skin):
    strip = brow_strip(skin, brow_uv(), hairs=12)
    uv = np.column_stack([0.55 + 0.25 * np.linspace(0.02, 0.98, 9), np.full(9, 0.8)])
    above = ((ends(strip, 0.5) - skin.at(uv)) * skin.normals(uv)).sum(axis=2)
    assert above.min() > 0.3 and above.max() < 1.2


def test_combs_are_closed_lines_inside_the_strip(skin):
    (loop,) = brow_strip(skin, brow_uv(), hairs=12).loops
    assert loop.min() >= 0 and loop.max() <= 1 and len(loop) > 40
