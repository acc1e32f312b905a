"""surface.fit.points.nurbsnet: uniform nets are exact for cubics and grow until they are good enough."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.points import nurbsnet
from surface.fit.points.nurbsnet import STEP, STEPS, uniform_nets
from surface.fit.source.chart import TILE, Chart, make_chart
from surface.fit.source.islands import find_islands


@pytest.fixture(scope="module")
def chart() -> Chart:
    mesh = slit_sheet()
    return make_chart(mesh, find_islands(mesh), normalise=False)


def cubic(uv: np.ndarray) -> np.ndarray:
    u, v = uv.T
    return np.column_stack([20 * u, 10 * v**2, 5 * u**3 - 8 * u * v])


def test_a_cubic_needs_the_smallest_net(chart):
    nets = uniform_nets(chart, cubic(chart.uv), 120, 0.01)
    assert nets[-1].rms < 0.01 and nets[-1].points < 100
    assert all(n.rms > 0.01 for n in nets[:-1])


def test_the_smallest_net_that_is_good_enough_is_found_to_a_tenth(chart):
    u, v = chart.uv.T
    targets = np.column_stack([u, v, np.sin(25 * u) * np.sin(25 * v)])
    nets = uniform_nets(chart, targets, 60, 0.05)
    sizes, errors = [n.points for n in nets], [n.rms for n in nets]
    assert sizes == sorted(sizes) and errors[-1] <= 0.05 < errors[-2]
    assert sizes[-1] < 1.35 * sizes[-2]
    (largest,) = uniform_nets(chart, targets, 60, 0.0)
    assert largest.points == pytest.approx(60 * STEP ** STEPS[1], rel=0.25)


def test_nets_are_split_at_slits(chart):
    (cut,) = chart.cuts
    across = (chart.uv[:, 0] - 0.5 * (cut.start + cut.end)) / (0.5 * (cut.end - cut.start))
    hump = 9.0 * np.clip(1.0 - across**2, 0.0, 1.0) ** 2  # fades where the slit ends
    targets = np.column_stack([*chart.uv.T, np.where(chart.uv[:, 1] > cut.v, 0.0, hump)])
    whole = Chart(chart.uv, chart.mix, chart.weight, chart.spacing, chart.folded, [], [])
    with_slit, without = (uniform_nets(c, targets, 60, 0.0)[0].rms for c in (chart, whole))
    assert with_slit < 0.9 * without


def test_only_the_first_tile_counts_and_folds_are_not_measured(chart):
    targets = cubic(chart.uv)
    beside = chart.uv + np.array([TILE, 0.0])
    rows = {k: np.concatenate([getattr(chart, k)] * 2) for k in ("weight", "spacing", "folded")}
    two = Chart(np.vstack([chart.uv, beside]), chart.mix, **rows, loops=[], loop_vertices=[])
    whole = Chart(chart.uv, chart.mix, **{k: getattr(chart, k) for k in rows}, loops=[], loop_vertices=[])
    (alone,), (first,) = (
        uniform_nets(whole, targets, 12, 0.0),
        uniform_nets(two, np.vstack([targets, targets * 9]), 12, 0.0),
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


def task(uv: np.ndarray, weight: np.ndarray, targets: np.ndarray) -> nurbsnet._Task:
    return nurbsnet._Task(uv, weight, np.ones(len(uv), bool), targets, [])


def solved(uv: np.ndarray, spans: int, weight: np.ndarray, targets: np.ndarray) -> np.ndarray:
    rows, split = nurbsnet._rows(uv, spans, [])
    used = np.flatnonzero(rows.getnnz(axis=0))
    return nurbsnet._solve(rows, used, split, task(uv, weight, targets))


@pytest.mark.parametrize("spans", [1, 4, 9])
def test_rows_are_the_cubic_b_splines_of_even_knots(spans):
    """They add up to 1, are exact for a plane through the points' own places, and know no other points."""
    rng = np.random.default_rng(spans)
    uv = np.vstack([rng.random((200, 2)) * [3.0, 0.5] + [-1.0, 7.0], [[-1.0, 7.0], [2.0, 7.5]]])
    rows, split = nurbsnet._rows(uv, spans, [])
    assert rows.shape == (202, 2 * (spans + 3) ** 2) and not split.any()
    rows = rows[:, : len(split)]
    places = np.stack(np.meshgrid(np.arange(-1, spans + 2), np.arange(-1, spans + 2), indexing="ij"), axis=-1)
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(rows @ places.reshape(-1, 2), (uv - [-1.0, 7.0]) / [3.0, 0.5] * spans, atol=1e-7)
    assert rows.toarray().min() >= 0.0 and np.diff(rows.indptr).max() == 16


def test_samples_in_one_line_have_rows_too():
    rows, _ = nurbsnet._rows(np.column_stack([np.linspace(0, 1, 20), np.full(20, 0.3)]), 4, [])
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, atol=1e-12)


def test_samples_count_by_their_weight():
    once = np.random.default_rng(6).random((900, 2))
    uv, weight = np.vstack([once, once]), np.repeat([3.0, 1.0], 900)
    found = solved(uv, 6, weight, np.repeat([0.0, 8.0], 900)[:, None])
    np.testing.assert_allclose(found, 2.0, atol=0.02)


def test_what_no_sample_holds_lies_in_the_middle_of_its_neighbours():
    """A gap in the samples of a plane, six spans wide: the net goes on as a plane there, within a fiftieth."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40)))
    uv, gap = np.column_stack([u, v]), np.hypot(u - 0.5, v - 0.5) < 0.3
    targets = np.column_stack([10 * u, 10 * v, 3 * u - 2 * v])
    found = solved(uv, 12, np.where(gap, 0.0, 1.0), np.where(gap[:, None], 50.0, targets))
    np.testing.assert_allclose(found, targets, atol=0.2)


def test_a_net_has_four_spans_at_least():
    uv = np.random.default_rng(0).random((300, 2))
    assert nurbsnet._spans_for(task(uv, np.ones(300), uv), 10.0, 3.2) == 4
