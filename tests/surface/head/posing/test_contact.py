"""surface.head.posing.contact: how much overlap is allowed, who gives way to it, and what stays out of the eyeball."""

from __future__ import annotations

import numpy as np
import pytest
from small_head import small_head

from surface import DCPSurface
from surface.head.model.data import Contact
from surface.head.posing.contact import (
    CONTACT_SHARE,
    HOLD_MM,
    LID_MM,
    OVERLAP_MM,
    SOFT_MM,
    TOUCH_MM,
    ContactSolver,
    EyeballClearance,
    Follower,
    HeightLimits,
    contact_rows,
    tiled,
    weights_at,
)

N, ROWS, COLUMNS = 12, 9, 11
AHEAD, UP = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.96, 0.28])
RADIUS = 12.0


def lips(overlap: float) -> DCPSurface:
    """Two plane sheets that part at v = 0.5; their rims, 4 mm behind z = 0, overlap by so many mm."""
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, N - 2), [1] * 3])
    x, t = np.meshgrid(np.linspace(-30, 30, N), np.linspace(0, 1, N), indexing="ij")
    sides = []
    for sign, v in ((-1.0, 0.0), (1.0, 0.5)):
        out = t if sign > 0 else 1.0 - t  # 0 at the rim
        points = np.stack([x, sign * (20.0 * out - 0.5 * overlap), -4.0 + 20.0 * out], axis=-1)
        sides.append(DCPSurface.from_nurbs(3, 3, knots, v + knots / 2, points))
    low, high = sides
    return DCPSurface(np.vstack([low.points, high.points]), np.ones(2 * N * N),
                      [*low.knots_u, *high.knots_u], [*low.knots_v, *high.knots_v])  # fmt: skip


def contact(eye: int = -1, share: float = 0.75) -> Contact:
    u, out = np.meshgrid(np.linspace(0.05, 0.95, COLUMNS), np.linspace(0.0, 0.3, ROWS), indexing="ij")
    places = np.stack([np.stack([u, 0.5 + sign * (1e-6 + out)], axis=-1) for sign in (1.0, -1.0)])
    return Contact("lips", "a", ("b",), eye, 10.0, share, places)


def rims(surface: DCPSurface, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """y of the upper and of the lower rim, away from the corners."""
    u = np.linspace(0.3, 0.7, 9)
    s = surface.with_points(points)
    return s.evaluate(np.column_stack([u, np.full(9, 0.5 + 1e-6)]))[:, 1], s.evaluate(
        np.column_stack([u, np.full(9, 0.5 - 1e-6)])
    )[:, 1]


def test_the_overlap_that_is_allowed_at_rest() -> None:
    """Lips may overlap by 0.28 mm and lids by 0.9: what triangles cut off their edges."""
    assert OVERLAP_MM == (0.28, 0.9) and SOFT_MM == 0.1
    assert (TOUCH_MM, LID_MM, HOLD_MM) == (0.05, 1.2, (1.2, 2.4))


@pytest.mark.parametrize("overlap", [-3.0, 0.0, 0.17])
def test_sides_that_overlap_less_than_is_allowed_stay(overlap: float) -> None:
    surface = lips(overlap)
    points = surface.points.copy()
    push = ContactSolver(contact(), surface, small_head()).apply(AHEAD, points)
    np.testing.assert_array_equal(points, surface.points)
    assert not push.any() and push.shape == (2 * COLUMNS,)


@pytest.mark.parametrize("overlap", [0.6, 1.5, 3.0])
def test_sides_that_overlap_more_part_until_they_overlap_as_allowed(overlap: float) -> None:
    surface = lips(overlap)
    points = surface.points.copy()
    push = ContactSolver(contact(), surface, small_head()).apply(AHEAD, points)
    upper, lower = rims(surface, points)
    left = lower - upper
    assert left.max() < OVERLAP_MM[0] + 0.12 and left.min() > OVERLAP_MM[0] - 0.2
    before_upper, before_lower = rims(surface, surface.points)
    up, down = upper - before_upper, before_lower - lower
    assert (up > 0).all() and (down > 0).all()
    np.testing.assert_allclose(up / (up + down), 0.75, atol=0.02)  # the contact's share
    np.testing.assert_allclose(points[:, [0, 2]], surface.points[:, [0, 2]])
    assert push[COLUMNS // 2] == pytest.approx(overlap - OVERLAP_MM[0], abs=0.1)


def test_the_same_points_get_the_same_answer_and_others_another() -> None:
    surface = lips(1.5)
    solver = ContactSolver(contact(), surface, small_head())
    first = surface.points.copy()
    push = solver.apply(AHEAD, first).copy()
    again, wider = surface.points.copy(), surface.points.copy()
    wider[N * N :, 1] += 1.0  # the upper side
    np.testing.assert_array_equal(solver.apply(AHEAD, again), push)
    np.testing.assert_array_equal(again, first)
    assert solver.apply(AHEAD, wider.copy()).max() < push.max()


def test_another_part_follows_the_side_it_is_near_to() -> None:
    surface = lips(1.5)
    head, c = small_head(), contact()
    push = ContactSolver(c, surface, head).apply(AHEAD, surface.points.copy())
    rest = np.array([[0.0, 0.2, -4.0], [0.0, -0.2, -4.0], [0.0, 60.0, 40.0], [2.0, 9.0, 5.0]])
    upper, lower = lips(0.0).points, lips(0.0)
    assert len(upper) == 2 * N * N
    follower, points = Follower(c, rest, lower, head), rest.copy()
    follower.apply(push, points)
    moved = points - rest
    assert moved[0, 1] == pytest.approx(0.75 * push[COLUMNS // 2], rel=0.02)
    assert moved[1, 1] == pytest.approx(-0.25 * push[COLUMNS // 2], rel=0.02)
    assert not moved[2].any() and not moved[:, [0, 2]].any()


def bowl(height: float) -> DCPSurface:
    """A patch about 30 degrees wide, so many mm above an eyeball at the origin, in front of it."""
    a = np.radians(np.linspace(-35, 35, N))
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, N - 2), [1] * 3])
    x, y = np.meshgrid(np.sin(a), np.sin(a), indexing="ij")
    way = np.stack([x, y, np.ones_like(x)], axis=-1)
    points = (RADIUS + height) * way / np.linalg.norm(way, axis=-1, keepdims=True)
    return DCPSurface.from_nurbs(3, 3, knots, knots, points)


def low_places() -> np.ndarray:
    """Places well below the cornea of an eye that looks up."""
    u, v = np.meshgrid(np.linspace(0.1, 0.9, 15), np.linspace(0.02, 0.15, 6))
    return np.column_stack([u.ravel(), v.ravel()])


def heights(surface: DCPSurface, points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(surface.with_points(points).evaluate(low_places()), axis=1) - RADIUS


def test_what_lines_lids_is_kept_out_of_the_eyeball_and_may_leave_it() -> None:
    surface = bowl(2.0)
    clearance = EyeballClearance(surface, low_places(), np.zeros(3), RADIUS)
    away = surface.points * 1.2
    before = away.copy()
    clearance.apply(UP, away)
    np.testing.assert_array_equal(away, before)
    inside = surface.points * (RADIUS - 0.8) / (RADIUS + 2.0)
    assert heights(surface, inside).max() < -0.5
    clearance.apply(UP, inside)
    assert heights(surface, inside).min() > TOUCH_MM - 0.15 and heights(surface, inside).max() < 0.8


def test_an_error_within_the_tolerance_is_left() -> None:
    surface = bowl(2.0)
    clearance = EyeballClearance(surface, low_places(), np.zeros(3), RADIUS)
    lowest = heights(surface, surface.points).min()
    near = surface.points * ((RADIUS - 0.02) / (RADIUS + lowest))  # 0.07 mm too low, nowhere more
    before = near.copy()
    clearance.apply(UP, near)
    np.testing.assert_array_equal(near, before)


def test_limits_hold_what_rests_near_and_free_what_rests_far() -> None:

    def sample(height: float) -> np.ndarray:
        return np.array([[0.0, RADIUS * np.arctan2(-0.6, 0.8), RADIUS + height]])

    for height, held, off in (
        (0.5, True, 1.0),
        (1.8, True, 0.5),
        (3.0, True, 0.0),
        (0.5, False, 1.0),
        (-1.0, True, 1.0),
    ):
        limits = HeightLimits(sample(height), RADIUS, held=held)
        most = max(height, TOUCH_MM)
        assert limits.find(sample(most + 1.0), AHEAD) == pytest.approx(off * held, abs=1e-6), (height, held)
        assert limits.lifts[0] == pytest.approx(-1.6 * off * held, abs=1e-6)
        least = min(most, LID_MM if held else TOUCH_MM)
        assert limits.find(sample(least - 0.25), AHEAD) == pytest.approx(0.25, abs=1e-6)
        assert limits.lifts[0] == pytest.approx(0.4, abs=1e-6)


def test_weights_are_those_of_the_surface_and_add_up() -> None:
    surface, uv = lips(0.5), np.random.default_rng(3).random((37, 2))
    start, ids, share = weights_at(surface, uv)
    dense = np.zeros((37, surface.n))
    np.add.at(dense, (np.repeat(np.arange(37), np.diff(start)), ids), share)
    np.testing.assert_allclose(dense.sum(axis=1), 1.0)
    exact = surface.basis_matrix(uv).toarray()
    assert np.abs(dense - exact).max() < 0.02 and (dense[dense > 0] > 0.004).all()
    tile_start, tile_ids, packed = tiled(start, ids, share)
    again = np.zeros((40, surface.n))
    for tile in range(5):
        rows = slice(tile_start[tile], tile_start[tile + 1])
        again[8 * tile : 8 * tile + 8, tile_ids[rows]] = packed.reshape(-1, 8)[rows].T
    np.testing.assert_allclose(again[:37], dense, atol=1e-6)
    assert not again[37:].any()


def test_two_thirds_of_the_rows_can_touch() -> None:
    assert pytest.approx(2 / 3) == CONTACT_SHARE and contact_rows(contact()) == 6
