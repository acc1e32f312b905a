"""surface.fit.points.nurbsnet: uniform nets are exact for cubics and grow until they are good enough."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.points import nurbsnet
from surface.fit.points.nurbsnet import MULTIPLES, uniform_nets
from surface.fit.source.chart import TILE, Chart, make_chart
from surface.fit.source.islands import find_islands


@pytest.fixture(scope="module")
def chart() -> Chart:
    mesh = slit_sheet()
    return make_chart(mesh, find_islands(mesh), normalise=False)


def cubic(uv: np.ndarray) -> np.ndarray:
    u, v = uv.T
    return np.column_stack([20 * u, 10 * v**2, 5 * u**3 - 8 * u * v])


def test_the_first_net_has_about_as_many_points_and_is_exact_for_a_cubic(chart):
    (net,) = uniform_nets(chart, cubic(chart.uv), 120, 0.01)
    assert 90 < net.points < 150 and net.rms < 0.01


def test_nets_grow_until_one_is_good_enough(chart):
    u, v = chart.uv.T
    targets = np.column_stack([u, v, np.sin(25 * u) * np.sin(25 * v)])
    every = uniform_nets(chart, targets, 60, 0.0)
    assert len(every) == len(MULTIPLES)
    sizes, errors = [n.points for n in every], [n.rms for n in every]
    np.testing.assert_allclose(sizes, 60 * np.array(MULTIPLES), rtol=0.25)
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.2 * errors[0]
    enough = uniform_nets(chart, targets, 60, errors[2])
    assert enough == every[:3]


def test_only_the_first_tile_counts_and_folds_are_not_measured(chart):
    targets = cubic(chart.uv)
    beside = chart.uv + np.array([TILE, 0.0])
    rows = {k: np.concatenate([getattr(chart, k)] * 2) for k in ("weight", "spacing", "folded")}
    two = Chart(np.vstack([chart.uv, beside]), chart.mix, **rows, loops=[], loop_vertices=[])
    (alone,), (first,) = (
        uniform_nets(chart, targets, 120, 1.0),
        uniform_nets(two, np.vstack([targets, targets * 9]), 120, 1.0),
    )
    assert alone == first
    chart.folded[:5] = True
    try:
        targets[:5] += 50.0
        rough = uniform_nets(chart, targets, 120, 1e9)[0].rms
        chart.folded[:5] = False
        assert rough < 0.9 * uniform_nets(chart, targets, 120, 1e9)[0].rms
    finally:
        chart.folded[:5] = False


@pytest.mark.parametrize("spans", [1, 4, 9])
def test_rows_are_the_cubic_b_splines_of_even_knots(spans):
    """They add up to 1, are exact for a plane through the points' own places, and know no other points."""
    rng = np.random.default_rng(spans)
    uv = np.vstack([rng.random((200, 2)) * [3.0, 0.5] + [-1.0, 7.0], [[-1.0, 7.0], [2.0, 7.5]]])
    rows = nurbsnet._rows(uv, spans)
    assert rows.shape == (202, (spans + 3) ** 2)
    places = np.stack(np.meshgrid(np.arange(-1, spans + 2), np.arange(-1, spans + 2), indexing="ij"), axis=-1)
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(rows @ places.reshape(-1, 2), (uv - [-1.0, 7.0]) / [3.0, 0.5] * spans, atol=1e-7)
    assert rows.toarray().min() >= 0.0 and np.diff(rows.indptr).max() == 16


def test_samples_in_one_line_have_rows_too():
    rows = nurbsnet._rows(np.column_stack([np.linspace(0, 1, 20), np.full(20, 0.3)]), 4)
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, atol=1e-12)


def test_samples_count_by_their_weight():
    once = np.random.default_rng(6).random((900, 2))
    uv, weight = np.vstack([once, once]), np.repeat([3.0, 1.0], 900)
    rows = nurbsnet._rows(uv, 6)
    used = np.flatnonzero(rows.getnnz(axis=0))
    found = nurbsnet._solve(rows, used, weight, np.repeat([0.0, 8.0], 900)[:, None])
    np.testing.assert_allclose(found, 2.0, atol=0.02)


def test_what_no_sample_holds_lies_in_the_middle_of_its_neighbours():
    """A gap in the samples of a plane, six spans wide: the net goes on as a plane there, within a fiftieth."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40)))
    uv, gap = np.column_stack([u, v]), np.hypot(u - 0.5, v - 0.5) < 0.3
    targets = np.column_stack([10 * u, 10 * v, 3 * u - 2 * v])
    rows = nurbsnet._rows(uv, 12)
    used = np.flatnonzero(rows.getnnz(axis=0))
    found = nurbsnet._solve(rows, used, np.where(gap, 0.0, 1.0), np.where(gap[:, None], 50.0, targets))
    np.testing.assert_allclose(found, targets, atol=0.2)


def test_a_net_has_four_spans_at_least():
    uv = np.random.default_rng(0).random((300, 2))
    assert nurbsnet._spans_for(uv, 10.0, 3.2) == 4
