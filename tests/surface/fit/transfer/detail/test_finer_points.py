"""Skin gets more control points where its own are too far apart for the form of a scan, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from small_head import JAW, part

from surface.fit.transfer.detail import finer_points as module
from surface.fit.transfer.detail.finer_mesh import FineMesh
from surface.fit.transfer.detail.finer_points import centres, fit_points, gains
from surface.head.model.meshes import make_surface

U, V = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(0, 1, 41)], indexing="ij"))
PART = part("a", 0.0)
REST = make_surface(PART).evaluate(np.column_stack([U, V]))
MESH = FineMesh(np.column_stack([U, V]), None, np.zeros((0, 3), int), REST)
ALL = np.ones(len(U))


@pytest.fixture(autouse=True)
def _many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GROWTH", 6.0)


def bump(height: float) -> np.ndarray:
    """Skin with a bump of 6 mm radius near a corner of 40 mm of it."""
    at = REST.copy()
    at[:, 2] += height * np.exp(-((REST[:, 0] - 30.0) ** 2 + (REST[:, 1] - 10.0) ** 2) / 18.0)
    return at


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).sum(axis=1).mean()))


def test_points_are_added_where_a_form_is_too_fine_for_the_net(monkeypatch) -> None:
    at = bump(4.0)
    fitted = fit_points(PART, MESH, at, ALL, JAW, ALL)
    assert 25 < len(fitted.part.points) <= 6 * 25
    middles = centres(fitted.surface)
    near = np.linalg.norm(middles - [0.75, 0.75], axis=1) < 0.3
    assert near.sum() > 1.5 * (np.linalg.norm(middles - [0.25, 0.25], axis=1) < 0.3).sum()
    np.testing.assert_allclose(make_surface(fitted.part).evaluate(MESH.uv), REST, atol=1e-9)
    monkeypatch.setattr(module, "GROWTH", 1.0)
    assert rms(fitted.at, at) < 0.4 * rms(fit_points(PART, MESH, at, ALL, JAW, ALL).at, at)


def test_no_more_points_are_added_than_the_limit_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GROWTH", 2.0)
    assert 25 < len(fit_points(PART, MESH, bump(4.0), ALL, JAW, ALL).part.points) <= 2 * 25


def test_a_form_that_the_net_can_follow_adds_none() -> None:
    at = REST * [1.1, 0.9, 1.0] + [0.0, 2.0, 5.0]
    fitted = fit_points(PART, MESH, at, ALL, JAW, ALL)
    assert len(fitted.part.points) == 25
    np.testing.assert_allclose(fitted.at, at, atol=0.05)


def test_what_does_not_count_adds_none() -> None:
    assert len(fit_points(PART, MESH, bump(4.0), 0.0 * ALL, JAW, ALL).part.points) == 25


def test_points_on_lids_are_not_split_nor_those_that_are_close_already() -> None:
    on_lids = replace(PART, lids=np.ones(25))
    assert len(fit_points(on_lids, MESH, bump(4.0), ALL, JAW, ALL).part.points) == 25
    small = FineMesh(MESH.uv, None, MESH.triangles, 0.2 * REST)
    tiny = replace(PART, points=0.2 * PART.points)
    assert len(fit_points(tiny, small, 0.2 * bump(20.0), ALL, JAW, ALL).part.points) == 25


def test_noise_leaves_no_lumps() -> None:
    noise = np.random.default_rng(2).normal(scale=0.3, size=REST.shape) * [0, 0, 1.0]
    fitted = fit_points(PART, MESH, REST + noise, ALL, JAW, ALL)
    assert rms(fitted.at, REST) < 0.1


def test_points_are_not_split_where_that_lowers_the_error_little(monkeypatch) -> None:
    at = bump(4.0)
    freely = fit_points(PART, MESH, at, ALL, JAW, ALL)
    heard = []

    def recorded(*args):
        heard.append(gains(*args))
        return heard[-1]

    monkeypatch.setattr(module, "gains", recorded)
    monkeypatch.setattr(module, "LEAST_GAIN_MM", 0.3)
    fitted = fit_points(PART, MESH, at, ALL, JAW, ALL)
    assert heard[0].min() < 0.3 < heard[0].max()
    assert 25 < len(fitted.part.points) < len(freely.part.points)
    np.testing.assert_allclose(make_surface(fitted.part).evaluate(MESH.uv), REST, atol=1e-9)
    monkeypatch.setattr(module, "LEAST_GAIN_MM", 100.0)
    assert len(fit_points(PART, MESH, at, ALL, JAW, ALL).part.points) == 25


def test_gains_are_what_the_error_around_each_point_sinks_by() -> None:
    shares = csr_matrix(np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]]))
    np.testing.assert_allclose(gains(shares, np.array([4.0, 4.0, 0.0]), np.array([1.0, 1.0, 0.0])),
                               [1.0, np.sqrt(4.0 / 3) - np.sqrt(1.0 / 3)])  # fmt: skip


def test_places_of_more_weight_are_met_more_closely(monkeypatch) -> None:
    monkeypatch.setattr(module, "ROUNDS", 0)
    at = bump(4.0)
    even, more = (fit_points(PART, MESH, at, ALL, JAW, w) for w in (ALL, np.where(np.isclose(U, 0.75), 50.0, 1.0)))
    line = np.isclose(U, 0.75)
    assert rms(more.at[line], at[line]) < 0.9 * rms(even.at[line], at[line])
    assert rms(more.at, at) > rms(even.at, at)


def test_errors_of_places_of_more_weight_count_more_for_where_points_are_split() -> None:
    slight = bump(0.8)
    assert len(fit_points(PART, MESH, slight, ALL, JAW, ALL).part.points) == 25
    assert len(fit_points(PART, MESH, slight, ALL, JAW, 100.0 * ALL).part.points) > 25
