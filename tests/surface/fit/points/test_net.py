"""Placement of control points."""

import numpy as np

from surface.fit.points.net import coarse_places, level_caps, net_at, wanted_places
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
