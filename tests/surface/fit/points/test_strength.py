"""Shapes made stronger before a fit: by a factor, and by pulls on places of the face."""

from dataclasses import replace

import numpy as np
from slit_sheet import slit_sheet

from surface.fit.points.strength import Pull, Smoothing, Strength, strengthen
from surface.fit.source.mesh import FitMesh

FROWN = Strength("browDown", pulls=(Pull((13.0, 59.0), (11.0, 9.0), (-2.8, -1.8, 0.6)),))


def cloud(points: np.ndarray, names: tuple[str, ...], at: float = 0.0) -> FitMesh:
    """Points without faces, every shape of which moves each by ``at`` in x, y and z."""
    none = np.zeros((0, 4), np.int64)
    return FitMesh(points, none, np.zeros((0, 2)), none, names, np.full((len(names), len(points), 3), at))


def test_strengthening_touches_the_named_shapes_only():
    mesh = strengthen(slit_sheet(), [Strength("jaw", 1.5)])
    np.testing.assert_allclose(mesh.deltas[0], 1.5 * slit_sheet().deltas[0])
    np.testing.assert_array_equal(mesh.deltas[1], slit_sheet().deltas[1])


def test_a_shape_is_first_scaled_and_then_pulled_and_what_stands_twice_counts_twice():
    twice = [Strength("browDown", 2.0, FROWN.pulls), Strength("browDown", 3.0)]
    moved = strengthen(cloud(np.array([[13.0, 59.0, 105.0]]), ("browDown_L",), at=0.5), twice).deltas[0, 0]
    np.testing.assert_allclose(moved, 3 * (2 * 0.5 + np.array([-2.8, -1.8, 0.6])))


def test_the_heads_of_the_brows_are_drawn_in_on_their_own_side():
    points = np.array([[13.0, 59.0, 105.0], [-13.0, 59.0, 105.0], [50.0, 59.0, 95.0]])
    left, right = strengthen(cloud(points, ("browDown_L", "browDown_R")), [FROWN]).deltas
    np.testing.assert_allclose(left[0], [-2.8, -1.8, 0.6])
    np.testing.assert_allclose(right[1], [2.8, -1.8, 0.6])
    assert np.abs(left[1:]).max() < 0.02


def test_a_shape_without_a_side_is_pulled_on_both_and_alike():
    points = np.array([[13.0, 59.0, 105.0], [-13.0, 59.0, 105.0], [0.0, 59.0, 105.0]])
    moved = strengthen(cloud(points, ("browDown",)), [FROWN]).deltas[0]
    np.testing.assert_allclose(moved[0], moved[1] * [-1.0, 1.0, 1.0])
    np.testing.assert_allclose(moved[0], [-2.8, -1.8, 0.6], atol=0.02)
    assert moved[2, 0] == 0.0 and moved[2, 1] < -0.4


def test_a_pull_fades_with_the_distance_and_towards_the_sides_of_the_head() -> None:
    near = np.exp(-0.5)
    places = {  # by place: share of the whole move
        (13.0, 59.0, 105.0): 1.0, (24.0, 59.0, 105.0): near, (13.0, 68.0, 105.0): near, (13.0, 50.0, 90.0): near,
        (13.0, 59.0, 75.0): 0.5, (13.0, 59.0, 67.5): 0.15625, (13.0, 59.0, 60.0): 0.0,
        (3.5, 59.0, 105.0): 0.5 * np.exp(-0.5 * (9.5 / 11) ** 2), (-6.0, 59.0, 105.0): 0.0,
    }  # fmt: skip
    points = np.array(list(places))
    for side, shape in ((-1.0, 0), (1.0, 1)):
        mesh = cloud(points * [side, 1.0, 1.0], ("browDownRight", "browDownLeft", "browUp"), at=0.25)
        before = mesh.deltas.copy()
        after = strengthen(mesh, [FROWN]).deltas
        wanted = np.array(list(places.values()))[:, None] * [-2.8 * side, -1.8, 0.6]
        np.testing.assert_allclose(after[shape] - before[shape], wanted, atol=1e-9)
        np.testing.assert_array_equal(after[2], before[2])
        np.testing.assert_array_equal(mesh.deltas, before)


def test_a_recipes_table_becomes_a_strength():
    table = {"shape": "browDown", "pulls": [{"centre": (13.0, 59.0), "reach": (11.0, 9.0), "move": (-2.8, -1.8, 0.6)}]}
    assert Strength.of(table) == FROWN
    assert Strength.of({"shape": "jaw", "scale": 1.5}) == Strength("jaw", 1.5)


def _sheet(lumps: float) -> FitMesh:
    """The front of a face as a flat grid of 2 mm, which rises by y / 10 mm, with lumps of so many mm, 4 mm long."""
    y, x = np.mgrid[-40.0:41.0:2.0, -60.0:61.0:2.0].reshape(2, -1)
    mesh = cloud(np.column_stack([x, y, np.full(len(x), 100.0)]), ("noseSneerLeft", "noseSneerRight", "jawOpen"))
    mesh.deltas[..., 2] = y / 10 + lumps * np.cos(np.pi * x / 2)
    return mesh


def test_lumps_beside_the_nose_go_and_what_is_smooth_or_elsewhere_stays() -> None:
    place = Smoothing((25.0, 0.0), (10.0, 20.0), 4.0)
    before = _sheet(1.0)
    after = strengthen(before, [Strength("noseSneer", smoothed=(place,))]).deltas
    plain = _sheet(0.0).deltas
    for shape, side in ((0, 1.0), (1, -1.0)):
        x, y = before.vertices[:, 0] * side, before.vertices[:, 1]
        away = np.hypot((x - 25) / 10, y / 20)
        assert np.abs(after[shape] - plain[shape])[away < 0.69].max() < 0.02
        np.testing.assert_array_equal(after[shape][away > 1.6], before.deltas[shape][away > 1.6])
        between = np.abs(after[shape] - plain[shape])[(away > 1.0) & (away < 1.3), 2]
        assert between.min() > 0.1 and between.max() < 0.9
    np.testing.assert_array_equal(after[2], before.deltas[2])


def test_smoothing_comes_after_pulls_and_leaves_the_back_of_the_head() -> None:
    table = {"shape": "noseSneer", "pulls": [{"centre": (25.0, 0.0), "reach": (3.0, 3.0), "move": (0.0, 0.0, 5.0)}]}
    smooth = {"smoothed": [{"centre": (25.0, 0.0), "reach": (10.0, 20.0), "width": 4.0}]}
    sheet = _sheet(0.0)
    at = np.flatnonzero((sheet.vertices[:, :2] == [26.0, 0.0]).all(axis=1))
    pulled, both = (strengthen(sheet, [Strength.of(t)]).deltas[0, at, 2] for t in (table, table | smooth))
    assert both < 0.6 * pulled
    behind = replace(_sheet(1.0), vertices=sheet.vertices - [0.0, 0.0, 60.0])
    np.testing.assert_array_equal(
        strengthen(behind, [Strength.of(smooth | {"shape": "noseSneer"})]).deltas, behind.deltas
    )
