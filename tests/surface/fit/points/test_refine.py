"""Fitting a chart: accuracy grows with points, and a slit lets its lips part."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import ROW, N, slit_sheet

from surface.dcp import DCPSurface
from surface.fit.points import refine
from surface.fit.points.dense import dense_errors
from surface.fit.points.net import coarse_places, net_at
from surface.fit.points.refine import FitRequest, Fitted, Hold, fit_chart
from surface.fit.points.solve import basis, fairness
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh


@pytest.fixture(scope="module")
def fitted() -> tuple:
    mesh = slit_sheet()
    chart = make_chart(mesh, find_islands(mesh), normalise=False)
    return mesh, chart, fit_chart(mesh, chart, FitRequest(500, coarse=0.2, neutral_mm=0.05, shape_mm=0.05))


def rms(e: np.ndarray) -> float:
    return float(np.sqrt((e**2).mean()))


def test_neutral_and_shapes_are_met(fitted):
    _, _, fit = fitted
    assert len(fit.net) <= 500
    assert rms(fit.error) < 0.15
    assert max(rms(e) for e in fit.shape_error) < 0.4


def test_more_points_fit_better(fitted):
    mesh, chart, fine = fitted
    coarse = fit_chart(mesh, chart, FitRequest(90, coarse=0.2, neutral_mm=0.05, shape_mm=0.05))
    assert len(coarse.net) < len(fine.net)
    assert rms(coarse.shape_error[0]) > 1.5 * rms(fine.shape_error[0])


def test_the_lower_lip_opens_and_the_upper_one_stays(fitted):
    _, _, fit = fitted
    lips = np.array([[0.5, (ROW + 1) / N], [0.5, ROW / N]])
    moved = basis(fit.net, lips) @ fit.moves[0]
    assert abs(moved[0, 1]) < 0.5
    assert moved[1, 1] < -13


def test_errors_are_those_of_the_surface(fitted):
    mesh, chart, fit = fitted
    error = np.linalg.norm(basis(fit.net, chart.uv) @ fit.points - chart.mix @ mesh.vertices, axis=1)
    np.testing.assert_allclose(error, fit.error, atol=1e-9)


def test_fairness_vanishes_for_a_point_cloud_in_one_place(fitted):
    _, _, fit = fitted
    assert np.abs(fairness(fit.net) @ np.ones(len(fit.net))).max() < 1e-9


def test_progress_never_falls(fitted):
    mesh, chart, _ = fitted
    heard: list[float] = []
    result = fit_chart(mesh, chart, FitRequest(120, coarse=0.25), heard.append)
    assert isinstance(result, Fitted)
    assert heard == sorted(heard) and heard[-1] <= 1.0


def test_the_rms_of_a_fit_leaves_folds_out(fitted):
    mesh, chart, fit = fitted
    error = np.random.default_rng(0).uniform(0, 3, len(fit.error))
    folded = np.arange(len(error)) % 3 == 0
    kept = error[~folded]
    other = replace(fit, error=error)
    bare = replace(chart, between=None)
    assert refine._rms(mesh, replace(bare, folded=folded), other) == pytest.approx(np.sqrt((kept**2).mean()))
    assert refine._rms(mesh, replace(bare, folded=folded | True), other) == 0.0
    dense = dense_errors(mesh, chart, fit.net, fit.points, fit.moves[:0]).neutral
    both = np.concatenate([kept, dense])
    assert refine._rms(mesh, replace(chart, folded=folded), other) == pytest.approx(np.sqrt((both**2).mean()))
    between = replace(chart.between, folded=np.ones_like(chart.between.folded))
    own = replace(chart, folded=folded, between=between)
    assert refine._rms(mesh, own, other) == pytest.approx(np.sqrt((kept**2).mean()))


def rough_sheet() -> FitMesh:
    """A coarse mesh, 7 by 7 vertices, whose heights say nothing of each other."""
    x, y = np.meshgrid(np.linspace(-50.0, 50.0, 7), np.linspace(-50.0, 50.0, 7))
    rough = np.random.default_rng(4).uniform(-8.0, 8.0, x.size)
    at = np.column_stack([x.ravel(), y.ravel(), rough])
    rows = np.arange(49).reshape(7, 7)
    faces = np.stack([rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]], axis=-1).reshape(-1, 4)
    return FitMesh(at, faces, at[:, :2] / 100.0 + 0.5, faces.copy(), (), np.zeros((0, 49, 3)))


def test_a_dense_fit_follows_a_coarse_mesh_between_its_samples_and_is_measured_at_these():
    mesh = rough_sheet()
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    request = FitRequest(300, coarse=0.1, finest=0.3, neutral_mm=0.2, astray_mm=20.0)
    for folded in (False, True):  # folded places are held only loosely: they are no samples
        own = replace(chart, between=replace(chart.between, folded=np.full_like(chart.between.folded, folded)))
        fits = [fit_chart(mesh, own, replace(request, dense=dense)) for dense in (False, True)]
        plain, dense = (rms(dense_errors(mesh, chart, f.net, f.points, f.moves).neutral) for f in fits)
        assert dense < (0.6 if not folded else 1.01) * plain and dense > (0.99 * plain if folded else 0.0)
        assert all(f.error.shape == (len(chart.uv),) for f in fits)


def test_a_net_of_more_points_than_samples_is_mended_between_them():
    """Coarse samples are met by any number of points; what stands between them must not."""
    mesh = rough_sheet()
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    request = FitRequest(300, coarse=0.1, finest=0.3, neutral_mm=0.2, astray_mm=2.5)
    first = refine._refined(
        mesh, chart, net_at(coarse_places(chart.uv, 0.1), 0.1, chart.cuts, chart.uv), request, Hold(), lambda done: None
    )
    fit = fit_chart(mesh, chart, request)
    spikes, left = (dense_errors(mesh, chart, f.net, f.points, f.moves).most for f in (first, fit))
    assert len(first.net) > len(chart.uv) and rms(first.error) < 0.2 and spikes > 4.0
    assert left < 0.7 * spikes


def test_what_a_sample_needs_is_its_worst_error_in_what_is_good_enough(fitted):
    _, chart, fit = fitted
    rng = np.random.default_rng(1)
    neutral, shapes = rng.uniform(0, 1, len(fit.error)), rng.uniform(0, 1, fit.shape_error.shape)
    weight = rng.uniform(0.1, 3, len(neutral))
    request = FitRequest(100, neutral_mm=0.2, shape_mm=0.5)
    own = replace(chart, weight=weight)
    found = refine.need(own, replace(fit, error=neutral, shape_error=shapes), request)
    for k in range(0, len(found), 37):
        assert found[k] == pytest.approx(min(weight[k], 1.0) * max(neutral[k] / 0.2, max(s[k] for s in shapes) / 0.5))
    still = refine.need(own, replace(fit, error=neutral, shape_error=shapes[:0]), request)
    np.testing.assert_allclose(still, np.minimum(weight, 1.0) * neutral / 0.2)


def test_points_are_held_where_they_reach_a_stray_place(fitted):
    _, _, fit = fitted
    uv = np.array([[0.3, 0.7], [0.8, 0.1]])
    reached = (np.abs(basis(fit.net, uv).toarray()) > 0).any(axis=0)
    found = Hold(uv, 30.0).fair(fit.net, 0.5)
    np.testing.assert_array_equal(found, np.where(reached, 15.0, 0.5))
    assert 0 < reached.sum() < len(fit.net)
    np.testing.assert_array_equal(Hold().fair(fit.net, 0.5), 0.5)


def test_places_become_samples_of_full_weight(fitted):
    _, chart, _ = fitted
    places = chart.between.take(np.arange(len(chart.between.uv)) < 9)
    more = refine._with_samples(chart, places)
    n = len(chart.uv)
    np.testing.assert_array_equal(more.uv[n:], places.uv)
    np.testing.assert_array_equal(more.weight[n:], 1.0)
    assert not more.folded[n:].any() and abs(more.mix[n:] - places.mix).max() == 0
    np.testing.assert_array_equal(more.uv[:n], chart.uv)


def test_strays_are_places_too_far_off_and_those_beside_such_samples(fitted):
    mesh, chart, fit = fitted
    none = replace(fit, error=0 * fit.error, shape_error=0 * fit.shape_error)
    dense = dense_errors(mesh, chart, fit.net, fit.points, fit.moves)
    most = np.maximum(dense.neutral, dense.worst)
    limit = float(np.quantile(most, 0.9))
    np.testing.assert_array_equal(refine._strays(mesh, chart, none, limit), most > limit)
    for sample in (40, 300):
        for key, rows in (("error", none.error.copy()), ("shape_error", none.shape_error.copy())):
            rows[..., sample] = 99.0
            found = refine._strays(mesh, chart, replace(none, **{key: rows}), 50.0)
            shared = (chart.between.mix[:, chart.mix[[sample]].indices].toarray() > 0).any(axis=1)
            np.testing.assert_array_equal(found, shared)
    rows = none.error.copy()
    rows[40] = 99.0
    folded = np.arange(len(rows)) == 40
    assert not refine._strays(mesh, replace(chart, folded=folded), replace(none, error=rows), 50.0).any()
    samples = max(fit.error[~chart.folded].max(), fit.shape_error[:, ~chart.folded].max())
    assert refine._most(mesh, chart, fit) == max(dense.most, samples) > dense.most
    assert refine._most(mesh, replace(chart, folded=np.ones_like(chart.folded)), fit) == dense.most


def test_a_net_grows_by_a_share_where_it_is_needed_most(fitted):
    _, chart, fit = fitted
    coarse = fit.net.take(np.arange(len(fit.net)) < 200)
    needed = np.where(np.linalg.norm(chart.uv - [0.25, 0.75], axis=1) < 0.1, 9.0, 0.0)
    request = FitRequest(900, coarse=0.2, growth=1.25)
    grown, any_new = refine._grow(coarse, chart, needed, request, 500)
    assert any_new and 200 < len(grown) <= 250
    fresh = np.arange(200, len(grown))
    middle = np.column_stack([grown.knots_u[fresh].mean(axis=1), grown.knots_v[fresh].mean(axis=1)])
    assert np.linalg.norm(middle - [0.25, 0.75], axis=1).max() < 0.4
    assert len(refine._grow(coarse, chart, needed, request, 7)[0]) <= 207
    same, more = refine._grow(fit.net, chart, 0 * needed, request, 500)
    assert not more and len(same) == len(fit.net)


def test_control_points_have_the_errors_that_were_measured(fitted):
    mesh, chart, fit = fitted
    again = refine._on(mesh, chart, replace(fit, error=0 * fit.error, shape_error=0 * fit.shape_error))
    np.testing.assert_allclose(again.error, fit.error, atol=1e-9)
    np.testing.assert_allclose(again.shape_error, fit.shape_error, atol=1e-9)
    np.testing.assert_array_equal(again.moves, fit.moves)


def dome() -> FitMesh:
    """A cap of a ball of 80 mm from above, whose 15 by 15 vertices stand irregularly, cut into triangles at random."""
    rng = np.random.default_rng(7)
    s = np.linspace(-50.0, 50.0, 15)
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    free = (np.abs(x) < 49) & (np.abs(y) < 49)
    x, y = (a + free * rng.uniform(-2.0, 2.0, a.size) for a in (x, y))
    at = np.column_stack([x, y, np.sqrt(80.0**2 - x**2 - y**2)])
    rows = np.arange(225).reshape(15, 15)
    a, b, c, d = (g.ravel() for g in (rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]))
    other, none = rng.random(len(a)) < 0.5, np.full(len(a), -1)
    one = np.where(other[:, None], np.column_stack([a, b, d]), np.column_stack([a, b, c]))
    two = np.where(other[:, None], np.column_stack([b, c, d]), np.column_stack([a, c, d]))
    faces = np.column_stack([np.vstack([one, two]), np.concatenate([none, none])])
    return FitMesh(at, faces, at[:, :2] / 100.0 + 0.5, faces.copy(), (), np.zeros((0, 225, 3)))


DOME = FitRequest(900, coarse=0.04, finest=0.3, neutral_mm=0.25, bend=0.12)


def tilts(mesh: FitMesh, fit: Fitted) -> np.ndarray:
    """Angles (degrees) between normals of a fit and of the ball."""
    surface = DCPSurface(fit.points, np.ones(len(fit.net)), fit.net.knots_u, fit.net.knots_v)
    at, su, sv = surface.derivatives(np.random.default_rng(1).uniform(0.15, 0.85, (800, 2)))
    normal = np.cross(su, sv)
    along = (normal * at).sum(axis=1) / (np.linalg.norm(normal, axis=1) * np.linalg.norm(at, axis=1))
    return np.degrees(np.arccos(np.clip(along, -1.0, 1.0)))


def test_a_calm_fit_has_the_normals_of_the_smooth_surface_that_the_mesh_stands_for():
    mesh = dome()
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    plain, calm = (fit_chart(mesh, chart, replace(DOME, calm_mm=mm)) for mm in (0.0, 0.25))
    assert rms(tilts(mesh, calm)) < 0.7 * rms(tilts(mesh, plain))
    assert (refine.bounded_errors(chart, calm) <= 0.25 * np.array(refine.BOUNDS)).all()
    np.testing.assert_array_equal(calm.net.place, plain.net.place)


def test_a_fit_is_calm_only_as_far_as_its_bounds_allow():
    """Of a fit that is at its bounds already, or beyond them, nothing gets worse."""
    mesh = dome()
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    plain = fit_chart(mesh, chart, DOME)
    before = refine.bounded_errors(chart, plain)
    for bound in (2.0, 1.02, 0.5):
        most = np.maximum(bound * before[0] * np.array(refine.BOUNDS), before)
        calm = fit_chart(mesh, chart, replace(DOME, calm_mm=bound * before[0]))
        assert (refine.bounded_errors(chart, calm) <= most).all()
        assert (np.abs(calm.points - plain.points).max() > 0.01) == (bound == 2.0)


def test_errors_that_have_bounds_are_those_outside_folds(fitted):
    _, chart, fit = fitted
    own = replace(chart, folded=np.arange(len(fit.error)) % 3 == 0)
    error, shapes = fit.error[~own.folded], fit.shape_error[:, ~own.folded]
    found = refine.bounded_errors(own, fit)
    wanted = [rms(error), np.percentile(error, 99), np.mean([rms(s) for s in shapes])]
    np.testing.assert_allclose(found, wanted)
    still = replace(fit, shape_error=fit.shape_error[:0])
    assert refine.bounded_errors(own, still)[2] == 0.0
    assert not refine.bounded_errors(replace(own, folded=own.folded | True), fit).any()


def test_where_a_calm_surface_would_leave_the_mesh_it_follows_that_as_before():
    """A peak of 3 mm on one vertex: calm everywhere the fit cuts it off, so the faces there are followed."""
    mesh = dome()
    mesh.vertices[112, 2] += 3.0
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    plain = fit_chart(mesh, chart, DOME)
    calm = refine.Calm(mesh, chart, plain.net, np.full(len(plain.net), DOME.fair), DOME.bend)
    room = float(refine.need(chart, plain, DOME).max()) + 0.01  # at first nothing is strict
    everywhere, within = (refine._calmed_within(r, calm, plain, DOME) for r in (1e9, room))
    cut, kept = (refine.need(chart, f, DOME) for f in (everywhere, within))
    assert cut.max() > 1.5 * room and kept.max() < 1.1 * room
    far = (np.abs(chart.uv - 0.5).max(axis=1) < 0.35) & (np.linalg.norm(chart.uv - chart.uv[112], axis=1) > 0.25)
    assert far.sum() > 50
    np.testing.assert_allclose(within.error[far], everywhere.error[far], atol=0.05)


def test_a_calm_surface_stays_nearer_to_the_mesh_where_that_is_more_important():
    """As on lids, through which an eyeball would come otherwise."""
    mesh = dome()
    chart = make_chart(mesh, find_islands(mesh), downweight_slivers=True)
    plain, half = fit_chart(mesh, chart, DOME), chart.uv[:, 0] < 0.5
    important = replace(chart, importance=np.where(half, 3.0, 1.0))
    room = 0.6 * float(refine.need(chart, plain, DOME).max())
    fair = np.full(len(plain.net), DOME.fair)
    alike, nearer = (
        refine._calmed_within(room, refine.Calm(mesh, c, plain.net, fair, DOME.bend), plain, DOME)
        for c in (chart, important)
    )
    inside = np.abs(chart.uv - 0.5).max(axis=1) < 0.4
    assert rms(nearer.error[half & inside]) < 0.9 * rms(alike.error[half & inside])
