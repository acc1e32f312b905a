"""surface.fit.points.nurbsnet: uniform nets are exact for cubics and grow until they are good enough."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

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
