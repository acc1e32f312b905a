"""Points of surfaces find their (u, v): folds, seams, many narrow spans."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from surface import DCPSurface
from surface.readers import inversion
from surface.readers.inversion import invert, search_between
from tests.surface import shapes


def cylinder() -> DCPSurface:
    """Radius 2, height 3, clamped at its seam at u = 0 and 4."""
    angle = np.arange(9) * np.pi / 4
    far = np.where(np.arange(9) % 2, 2 * 2**0.5, 2.0)
    ring = np.stack([far * np.cos(angle), far * np.sin(angle)], axis=1)
    net = np.stack([np.column_stack([ring, np.full(9, z)]) for z in (0.0, 3.0)], axis=1)
    weights = np.repeat(np.where(np.arange(9) % 2, 0.5**0.5, 1.0)[:, None], 2, axis=1)
    return DCPSurface.from_nurbs(2, 1, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 1, 1], net, weights)


def test_points_of_a_sheet_find_their_parameters() -> None:
    surface = shapes.hills(12)
    uv = np.random.default_rng(1).uniform(0, 1, (300, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_points_near_a_seam_are_found_on_both_sides_of_it() -> None:
    surface = cylinder()
    u = np.concatenate([np.linspace(1e-3, 0.2, 60), np.linspace(3.8, 3.999, 60)])
    uv = np.stack([u, np.linspace(0.1, 0.9, 120)], axis=1)
    found, distance = invert(surface, surface.evaluate(uv))
    assert np.abs(found - uv).max() < 1e-9
    assert distance.max() < 1e-9


def test_points_between_many_narrow_knot_spans_are_found() -> None:
    """A row of ripples, each within a span that even samples would miss."""
    rng, count = np.random.default_rng(5), 120
    net = np.stack(np.meshgrid(np.arange(float(count)), np.arange(4.0), indexing="ij"), axis=-1)
    heights = rng.normal(scale=2.0, size=(count, 4, 1))
    ends = np.cumsum(rng.uniform(0.01, 3.0, count - 2))
    knots = np.concatenate([[0.0, 0.0, 0.0], ends, [ends[-1]] * 2]) / ends[-1]
    surface = DCPSurface.from_nurbs(
        2, 3, knots, [0, 0, 0, 0, 1, 1, 1, 1], np.concatenate([net, heights], 2), np.ones((count, 4))
    )
    uv = rng.uniform(0.001, 0.999, (400, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert distance.max() < 1e-8
    assert np.abs(surface.evaluate(found) - surface.evaluate(uv)).max() < 1e-8


def test_of_two_folds_that_touch_the_nearest_sample_does_not_decide() -> None:
    """A strip bent back on itself, 0.01 apart: samples of the wrong fold lie nearer to half of the points."""
    x = np.concatenate([np.linspace(0, 4, 9), np.linspace(4, 0, 9)])
    z = np.concatenate([np.zeros(9), np.full(9, 0.01)])
    net = np.stack([np.column_stack([x, np.full(18, y), z]) for y in (0.0, 1.0)], axis=1)
    knots = np.concatenate([[0.0], np.arange(18.0), [17.0]]) / 17.0
    surface = DCPSurface.from_nurbs(1, 1, knots, [0, 0, 1, 1], net, np.ones((18, 2)))
    uv = np.random.default_rng(6).uniform(0.01, 0.99, (300, 2))
    found, distance = invert(surface, surface.evaluate(uv))
    assert distance.max() < 1e-9
    assert np.abs(found - uv).max() < 1e-6


@pytest.mark.parametrize("constant", ["u", "v"])
def test_points_about_a_pole_are_found(constant: str) -> None:
    """A cone: at its tip one derivative is zero."""
    angle, height = np.linspace(0.0, 1.5, 5), np.linspace(0.0, 1.0, 4)
    net = np.stack([np.outer(np.cos(angle), height), np.outer(np.sin(angle), height), np.tile(height, (5, 1))], axis=-1)
    net = net if constant == "u" else net.swapaxes(0, 1)
    degrees = (2, 1) if constant == "u" else (1, 2)
    count = net.shape[:2]
    knots = [np.concatenate([np.zeros(p + 1), np.arange(1.0, n - p), np.full(p + 1, n - p)])
             for p, n in zip(degrees, count, strict=True)]  # fmt: skip
    surface = DCPSurface.from_nurbs(*degrees, *knots, net, np.ones(count))
    along = np.column_stack([np.linspace(0.0, knots[0][-1], 30), np.linspace(0.0, 1e-3, 30)])
    uv = along if constant == "u" else along[:, ::-1] * [1.0, knots[1][-1] / knots[0][-1]]
    points = np.vstack([surface.evaluate(uv), [[0.0, 0.0, 0.0]]])
    found, distance = invert(surface, points)
    assert distance.max() < 1e-9
    assert np.abs(surface.evaluate(found) - points).max() < 1e-9


def sloped(su: tuple[float, ...], sv: tuple[float, ...], shrink: float = 1.0) -> SimpleNamespace:
    """The plane u su + v sv over 0..1, whose derivatives it gives as ``shrink`` times what they are."""
    axes = np.array([su, sv], float)

    def derivatives(uv: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return uv @ axes, *(np.tile(shrink * axis, (len(uv), 1)) for axis in axes)

    return SimpleNamespace(rect=(0.0, 1.0, 0.0, 1.0), evaluate=lambda uv: uv @ axes, derivatives=derivatives)


def test_a_step_solves_the_least_squares_of_both_directions_or_takes_half_of_each_where_they_are_one() -> None:
    points, uv = np.array([[0.7, 0.9, 0.3], [0.1, 0.4, 2.0]]), np.array([[0.5, 0.2], [0.0, 1.0]])
    for su, sv in (((2.0, 0.5, 0.0), (0.3, 1.0, 1.0)), ((1.0, 0.0, 0.0), (0.0, 0.0, 4.0))):
        axes = np.array([su, sv])
        wanted = np.linalg.lstsq(axes.T, (points - uv @ axes).T, rcond=None)[0].T
        np.testing.assert_allclose(inversion._step(sloped(su, sv), points, uv), wanted)  # type: ignore[arg-type]
    pole = inversion._step(sloped((0, 0, 0), (0, 2.0, 0)), points, uv)  # type: ignore[arg-type]
    np.testing.assert_allclose(pole, [[0.0, (0.45 - 0.2) / 2], [0.0, (0.2 - 1.0) / 2]])
    pole = inversion._step(sloped((0, 2.0, 0), (0, 0, 0)), points, uv)  # type: ignore[arg-type]
    np.testing.assert_allclose(pole, [[(0.45 - 0.5) / 2, 0.0], [0.1, 0.0]])
    both = inversion._step(sloped((0, 2.0, 0), (0, 4.0, 0)), points, uv)  # type: ignore[arg-type]
    off = points[:, 1] - uv @ [2.0, 4.0]
    np.testing.assert_allclose(both, np.column_stack([off / 4, off / 8]))


@pytest.mark.parametrize("shrink", [1.0, 0.1, 0.01])
def test_steps_that_are_too_long_are_shortened_and_grow_again(shrink: float) -> None:
    surface, points = sloped((2.0, 0.0, 0.0), (0.0, 1.0, 0.0), shrink), np.array([[0.9, 0.7, 0.0], [1.0, 0.2, 0.3]])
    uv, distance = inversion._gauss_newton(surface, points, np.full((2, 2), 0.4))  # type: ignore[arg-type]
    np.testing.assert_allclose(uv, points[:, :2] / [2.0, 1.0], atol=1e-8)
    np.testing.assert_allclose(distance, [0.0, 0.3], atol=1e-7)


def test_a_search_ends_at_the_rectangles_border() -> None:
    surface, points = sloped((2.0, 0.0, 0.0), (0.0, 1.0, 0.0)), np.array([[9.0, 0.5, 0.0], [0.5, -3.0, 0.0]])
    uv, distance = inversion._gauss_newton(surface, points, np.full((2, 2), 0.4))  # type: ignore[arg-type]
    np.testing.assert_allclose(uv, [[1.0, 0.5], [0.25, 0.0]])
    np.testing.assert_allclose(distance, [7.0, 3.0])


def test_searches_begin_evenly_and_at_three_places_in_each_span() -> None:
    knots = np.array([[0.0, 0.0, 0.0, 3.0], [0.0, 0.0, 3.0, 4.0], [0.0, 3.0, 4.0, 9.0]])
    even = np.linspace(0.0, 4.0, 48)
    spans = [0.5, 1.5, 2.5, 3 + 1 / 6, 3.5, 3 + 5 / 6]
    np.testing.assert_allclose(inversion._stations(knots, 0.0, 4.0), np.unique(np.concatenate([even, spans])))
    many = inversion._stations(np.linspace(0.0, 1.0, 201)[None], 0.0, 1.0)
    assert 360 <= len(many) <= 360 + 48 and np.diff(many).max() < 1 / 150  # of 600, spread over all
    few = inversion._stations(np.linspace(0.0, 1.0, 121)[None], 0.0, 1.0)
    assert len(few) == 360 + 48  # just as many as are allowed


def test_quarters_are_of_the_rectangle_and_none_is_empty() -> None:
    grid = np.array([[0.1, 0.9], [0.5, 0.5], [0.6, 0.4], [0.7, 0.8], [0.51, 0.5]])
    quarters = inversion._quarters(SimpleNamespace(rect=(0.0, 1.0, 0.0, 1.0)), grid)  # type: ignore[arg-type]
    assert [q.tolist() for q in quarters] == [[1], [2, 4], [0], [3]]
    assert [q.tolist() for q in inversion._quarters(SimpleNamespace(rect=(0.0, 4.0, 0.0, 1.2)), grid)] == [  # type: ignore[arg-type]
        [1, 2, 4], [0, 3]
    ]  # fmt: skip


def test_the_nearest_sample_is_that_of_all_distances(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inversion, "BATCH_DISTANCES", 100)
    rng = np.random.default_rng(3)
    samples, points = rng.normal(size=(30, 3)) + 50.0, rng.normal(size=(17, 3)) + 50.0
    wanted = np.linalg.norm(points[:, None] - samples, axis=2).argmin(axis=1)
    np.testing.assert_array_equal(inversion._nearest(samples, points), wanted)
    monkeypatch.setattr(inversion, "BATCH_DISTANCES", 1)  # one at a time at least
    np.testing.assert_array_equal(inversion._nearest(samples, points), wanted)
    assert len(inversion._nearest(samples, points[:0])) == 0


def test_a_point_that_ended_on_another_fold_is_found_between_its_neighbours() -> None:
    surface = shapes.hills(12)
    uv = np.column_stack([np.linspace(0.2, 0.6, 9), np.linspace(0.3, 0.4, 9)])
    points = surface.evaluate(uv)
    found, distance = uv.copy(), np.zeros(9)
    for k in (0, 4, 8):  # the first and the last have one neighbour
        found[k], distance[k] = [0.9, 0.95], np.nan if k == 4 else 50.0
    search_between(surface, points, found, distance, 1e-6)
    assert np.abs(found - uv).max() < 1e-9 and distance.max() < 1e-9
    kept, off = uv + 0.01, np.full(9, 1e-7)
    search_between(surface, points, kept, off, 1e-6)  # near enough
    assert np.array_equal(kept, uv + 0.01) and (off == 1e-7).all()
    away = points + np.array([0.0, 0.0, 1.0])
    found, distance = uv.copy(), np.full(9, 1e-3)
    search_between(surface, away, found, distance, 1e-6)  # nothing nearer
    assert np.array_equal(found, uv) and (distance == 1e-3).all()
