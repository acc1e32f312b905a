"""Placement of control points."""

import itertools

import numpy as np
import pytest

from surface.fit.points.net import Net, coarse_places, keys, level_caps, net_at, wanted_places
from surface.fit.source.chart import Cut

GRID = np.stack(np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41)), axis=-1).reshape(-1, 2)


def test_a_coarse_net_covers_every_sample():
    net = net_at(coarse_places(GRID, 0.2), 0.2, [], GRID)
    covered = [
        ((net.knots_u[:, 0] <= u) & (u < net.knots_u[:, 4]) & (net.knots_v[:, 0] <= v) & (v < net.knots_v[:, 4])).any()
        for u, v in GRID
    ]
    assert all(covered)


def test_points_inside_a_slit_are_cut_at_it_and_others_are_not():
    cut = Cut(0.5, 0.2, 0.8)
    places = np.array([[2, 2, 10, 10], [2, 2, 0, 10], [2, 2, 10, 16]])
    net = net_at(places, 0.2, [cut], GRID)
    assert len(net) == 4
    rows = [k for k in range(4) if tuple(net.place[k]) == (2, 2, 10, 10)]
    above, below = sorted(rows, key=lambda k: -net.knots_v[k].mean())
    assert net.knots_v[above].min() == 0.5 and net.knots_v[below].max() == 0.5
    straddling = [k for k in range(4) if tuple(net.place[k]) == (2, 2, 0, 10)]
    assert net.knots_v[straddling[0]].min() < 0.5 < net.knots_v[straddling[0]].max()


def test_points_without_samples_are_left_out():
    assert len(net_at(np.array([[0, 0, 40, 40]]), 0.2, [], GRID)) == 0


def test_new_points_stand_around_what_is_off():
    net = net_at(coarse_places(GRID, 0.2), 0.2, [], GRID)
    error = np.where(np.linalg.norm(GRID - [0.31, 0.72], axis=1) < 0.03, 5.0, 0.0)
    caps = np.full((len(GRID), 2), 4)
    places = wanted_places(net, GRID, caps, error, 0.2)
    assert (places[:, :2] == 1).all()
    centre = places[:, 2:] * 0.1
    assert np.abs(centre - [0.31, 0.72]).max() < 0.2


def test_no_net_is_finer_than_the_samples():
    caps = level_caps(np.array([[0.1, 0.025], [1.0, 1e-6]]), 0.2, 6)
    np.testing.assert_array_equal(caps, [[1, 3], [0, 6]])
    net = net_at(coarse_places(GRID, 0.2), 0.2, [], GRID)
    assert len(wanted_places(net, GRID, np.zeros((len(GRID), 2), int), np.full(len(GRID), 9.0), 0.2)) == 0


def test_a_sample_asks_for_the_first_level_that_lacks_one_of_its_four_points():
    net = net_at(coarse_places(GRID, 0.2), 0.2, [], GRID)
    at, caps = np.array([[0.33, 0.72]]), np.array([[3, 1]])
    for level, i in (((1, 1), 3), ((2, 1), 6), ((3, 1), 13)):
        places = wanted_places(net, at, caps, np.array([2.0]), 0.2)
        around = np.array([[*level, i + di, 7 + dj] for di in (0, 1) for dj in (0, 1)])
        assert sorted(places.tolist()) == around.tolist()
        net = net.joined(net_at(places[:3], 0.2, [], GRID))
        assert wanted_places(net, at, caps, np.array([2.0]), 0.2)[:, :2].tolist() == [list(level)] * 4
        net = net.joined(net_at(places[3:], 0.2, [], GRID))
    assert not len(wanted_places(net, at, caps, np.array([2.0]), 0.2))


@pytest.mark.parametrize("coarse", [0.25, 0.3])
def test_a_coarse_net_holds_every_point_whose_support_meets_the_samples_and_hardly_more(coarse: float) -> None:
    uv = np.array([[0.5, -1.25], [1.25, -0.75], [0.9, -1.0]])
    places = coarse_places(uv, coarse)
    assert not places[:, :2].any() and len(np.unique(places, axis=0)) == len(places)
    wanted = []
    for k, (low, high) in enumerate(((0.5, 1.25), (-1.25, -0.75))):
        middle = np.arange(-40, 41)
        meets = middle[((middle - 2) * coarse <= high + 1e-12) & ((middle + 2) * coarse >= low - 1e-12)]
        found = np.unique(places[:, 2 + k])
        assert np.isin(meets, found).all() and np.ptp(found) <= np.ptp(meets) + 2
        wanted.append(len(found))
    assert len(places) == wanted[0] * wanted[1]


def test_knots_are_even_at_the_spacing_of_their_level() -> None:
    net = net_at(np.array([[1, 3, 5, -6]]), 0.4, [], np.array([[1.0, -0.3]]))
    np.testing.assert_allclose(net.knots_u, [[0.6, 0.8, 1.0, 1.2, 1.4]])
    np.testing.assert_allclose(net.knots_v, [[-0.4, -0.35, -0.3, -0.25, -0.2]])
    np.testing.assert_allclose(net.centres, [[1.0, -0.3]])
    knots_u, knots_v = np.array([[0.0, 0, 1, 5, 9], [0, 1, 2, 3, 4]]), np.array([[2.0, 2, 2, 5, 7]] * 2)
    uneven = Net(np.zeros((2, 4), np.int64), knots_u, knots_v)
    np.testing.assert_allclose(uneven.centres, [[2.0, 3.0], [2.0, 3.0]])


def test_only_what_a_slit_cuts_all_along_becomes_two() -> None:
    """A point at level 2 of a net of 0.5: its support reaches from 0.25 to 0.75 along both directions."""
    place, uv = np.array([[2, 2, 4, 4]]), np.random.default_rng(1).random((400, 2))
    knots = np.array([0.25, 0.375, 0.5, 0.625, 0.75])
    for cut, count in (
        (Cut(0.5, 0.25, 0.75), 2),  # exactly as long as the support
        (Cut(0.5, 0.25 + 1e-6, 0.75), 1),
        (Cut(0.5, 0.25, 0.75 - 1e-6), 1),
        (Cut(0.25, 0.0, 1.0), 1),  # at its lower end
        (Cut(0.75, 0.0, 1.0), 1),
        (Cut(0.45, 0.0, 1.0), 2),
    ):
        net = net_at(place, 0.5, [cut], uv)
        assert len(net) == count, cut
        assert (net.place == place).all()
        if count == 2:
            np.testing.assert_allclose(net.knots_u, [knots] * 2)
            np.testing.assert_allclose(net.knots_v, [np.maximum(knots, cut.v), np.minimum(knots, cut.v)])
    both = net_at(place, 0.5, [Cut(0.5, 0.0, 1.0), Cut(0.6, 0.0, 1.0)], uv)
    assert sorted(both.knots_v[:, [0, 4]].tolist()) == [[0.25, 0.5], [0.5, 0.6], [0.6, 0.75]]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_support_must_hold_a_sample_a_twentieth_within_it(axis: int) -> None:
    for where, held in ((0.019, False), (0.021, True), (0.2, True), (0.379, True), (0.381, False), (0.5, False)):
        sample = np.array([[0.3, 0.3]])
        sample[0, axis] = 0.1 + where  # the support reaches from 0.1 to 0.5
        others = np.array([[-3.0, -3.0], [9.0, 0.3], [0.3, 9.0]])
        for uv in (sample, np.vstack([others, sample]), np.vstack([sample, others])):
            assert len(net_at(np.array([[0, 0, 3, 3]]), 0.1, [], uv)) == held, where


def test_places_are_wanted_by_the_squares_of_the_errors_around_them() -> None:
    """Two samples apart, and one between four points, nearest to the last of them."""
    net = net_at(coarse_places(GRID, 0.2), 0.2, [], GRID)
    uv = np.array([[0.31, 0.53], [0.305, 0.525], [0.305, 0.525], [0.305, 0.525], [0.79, 0.19]])
    caps = np.full((5, 2), 3)
    places = wanted_places(net, uv, caps, np.array([1.0, 1.5, 1.5, 1.5, 4.0]), 0.2)
    # the sample with an error of 1 asks for nothing; 3 times 1.5 squared is 6.75, 4 squared 16
    assert places[:4].tolist()[0] == [1, 1, 8, 2] and sorted(places[:4, 2].tolist())[0] in (3, 7)
    want: dict[tuple[int, int], float] = {}
    for (u, v), error in zip(uv, (0.0, 1.5, 1.5, 1.5, 4.0), strict=True):
        for i, j in itertools.product((int(u / 0.1), int(u / 0.1) + 1), (int(v / 0.1), int(v / 0.1) + 1)):
            if error:
                share = (1 - abs(u / 0.1 - i)) * (1 - abs(v / 0.1 - j))
                want[i, j] = want.get((i, j), 0.0) + share * error**2
    assert {tuple(place) for place in places[:, 2:].tolist()} == set(want)
    amounts = [want[tuple(place)] for place in places[:, 2:].tolist()]
    assert amounts == sorted(amounts, reverse=True)


def test_each_place_has_a_number_of_its_own() -> None:
    ends = (-(1 << 22), -1, 0, 1, (1 << 22) - 1)
    places = np.array(list(itertools.product((0, 1, 15), (0, 1, 15), ends, ends)))
    assert len(np.unique(keys(places))) == len(places)
