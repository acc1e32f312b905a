"""surface.head.posing.contact: how much overlap is allowed, who gives way to it, and what stays out of the eyeball."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface import DCPSurface
from surface.head.model.data import Contact
from surface.head.posing import contact as contact_module
from surface.head.posing.contact import (
    CONTACT_SHARE,
    HIDDEN_MM,
    HOLD_MM,
    INNER_SHARE,
    LID_MM,
    OVERLAP_MM,
    SOFT_MM,
    TOUCH_MM,
    ContactSolver,
    EyeballClearance,
    Follower,
    by_lanes,
    contact_rows,
    corner_fade,
    height_limits,
    lip_weights,
    tile_weights,
    weights_at,
)
from surface.head.posing.contact_kernels import SHARE_STEP

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


def test_lips_that_become_round_meet_towards_the_corners_alone_at_the_same_points() -> None:
    apart = lips(0.0).points.copy()
    apart[N * N :, 1] += 3.0  # the upper side
    solver = ContactSolver(contact(), lips(0.0), small_head())
    assert not solver.apply(AHEAD, apart.copy()).any()
    push = solver.apply(AHEAD, apart.copy(), rounding=1.0).reshape(2, COLUMNS).copy()
    assert (push[:, [0, -1]] < -2.0).all() and not push[:, COLUMNS // 2].any()
    half = solver.apply(AHEAD, apart.copy(), rounding=0.5).reshape(2, COLUMNS)
    assert (half[:, [0, -1]] > 0.7 * push[:, [0, -1]]).all()
    assert not solver.apply(AHEAD, apart.copy()).any()


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
    for height, held, firm in (
        (0.5, True, 1.0),
        (1.8, True, 0.5),
        (3.0, True, 0.0),
        (0.5, False, 0.0),
        (-1.0, True, 1.0),
    ):
        depth = RADIUS + height
        least, most, hold = height_limits(np.array([[0.0, -0.6 * depth, 0.8 * depth, depth]]), RADIUS, held=held)
        assert most[0] == pytest.approx(max(height, TOUCH_MM), abs=1e-6), (height, held)
        assert least[0] == pytest.approx(min(max(height, TOUCH_MM), LID_MM if held else TOUCH_MM), abs=1e-6)
        assert hold[0] == pytest.approx(firm, abs=1e-6)
        loose = height_limits(np.array([[0.0, -0.6 * depth, 0.8 * depth, depth]]), RADIUS, held=held, cling=False)
        assert loose[:2] == (least, most) and loose[2][0] == 0.0  # may lift off, and sinks as little


def test_tables_lie_in_memory_sixteen_points_at_a_time() -> None:
    table = np.random.default_rng(2).normal(size=(5, 19)) * np.logspace(-3, 1, 19)
    packed, steps = by_lanes(table)
    first, second = packed.reshape(2, 5, 16)
    again = np.hstack([first, second[:, :3]]) * steps
    assert (np.abs(again - table) <= 0.51 * steps).all() and np.allclose(32767 * steps, np.abs(table).max(axis=0))
    assert not second[:, 3:].any()


def test_points_that_move_no_sample_have_empty_columns() -> None:
    packed, _ = by_lanes(np.zeros((4, 2)))
    assert not packed.any()


def test_weights_are_those_of_the_surface_and_add_up() -> None:
    surface, uv = lips(0.5), np.random.default_rng(3).random((37, 2))
    start, ids, share = weights_at(surface, uv)
    dense = np.zeros((37, surface.n))
    np.add.at(dense, (np.repeat(np.arange(37), np.diff(start)), ids), share)
    np.testing.assert_allclose(dense.sum(axis=1), 1.0)
    exact = surface.basis_matrix(uv).toarray()
    assert np.abs(dense - exact).max() < 0.02 and (dense[dense > 0] > 0.004).all()
    tile_start, tile_ids, packed = tile_weights(start, ids, share)
    again = np.zeros((40, surface.n))
    for tile in range(5):
        rows = slice(tile_start[tile], tile_start[tile + 1])
        again[8 * tile : 8 * tile + 8, tile_ids[rows]] = packed.reshape(-1, 8)[rows].T * SHARE_STEP
    np.testing.assert_allclose(again[:37], dense, atol=0.51 * SHARE_STEP)
    assert not again[37:].any()


def test_two_thirds_of_the_rows_can_touch() -> None:
    assert pytest.approx(2 / 3) == CONTACT_SHARE and contact_rows(contact()) == 6


def ball_lids(height: float, eye: int = 0) -> tuple[DCPSurface, Contact]:
    """A patch so many mm above an eyeball of :func:`small_head`, and the contact of two lids on it, well below the
    cornea of an eye that looks up: the upper side is the higher half."""
    surface = bowl(height)
    centre = small_head().eyes[eye]
    moved = surface.with_points(surface.points + centre)
    u, out = np.meshgrid(np.linspace(0.2, 0.8, COLUMNS), np.linspace(0.0, 0.2, ROWS), indexing="ij")
    places = np.stack([np.stack([u, v0 + sign * out], axis=-1) for sign, v0 in ((1.0, 0.62), (-1.0, 0.38))])
    return moved, Contact("lids", "a", ("b",), eye, 3.0, 0.5, places)


@pytest.mark.parametrize("eye", [0, 1])
def test_lids_are_held_where_they_rested_on_the_eyeball(eye: int) -> None:
    """Lids that rest 0.4 mm above the ball: both sides return towards that height."""
    surface, lids = ball_lids(0.4, eye)
    head = small_head()
    solver = ContactSolver(lids, surface, head)
    samples = surface.evaluate(lids.places.reshape(-1, 2))

    def height(points: np.ndarray) -> np.ndarray:
        at = surface.with_points(points).evaluate(lids.places.reshape(-1, 2)) - head.eyes[eye]
        return np.linalg.norm(at, axis=1) - RADIUS

    ground = height(surface.points)
    assert len(samples) == 2 * COLUMNS * ROWS and ground.min() > 0.0 and ground.max() < 1.2
    for off in (-0.9, 0.8):
        away = surface.points - head.eyes[eye]
        points = surface.points + off * away / np.linalg.norm(away, axis=1, keepdims=True)
        before = height(points)
        push = solver.apply(np.array([0.0, 0.0, -1.0]), points)  # it looks away: no cornea here
        after = height(points)
        assert np.abs(before - ground).min() > 0.5
        assert np.abs(after - ground).max() < 0.75 * np.abs(before - ground).min()
        assert push.shape == (2 * 2 * COLUMNS * contact_rows(lids),)
        # what other parts are told: how far the samples that can touch slid, and how far they were lifted
        slid, lifted = push.reshape(2, -1)
        inner = after.reshape(2, COLUMNS, ROWS)[:, :, :6] - before.reshape(2, COLUMNS, ROWS)[:, :, :6]
        np.testing.assert_allclose(lifted, inner.ravel(), atol=0.02)
        assert np.abs(slid).max() < 0.3


def test_a_lid_that_slides_takes_along_what_is_next_to_it() -> None:
    """Points beside single samples slide round the ball and are lifted as those samples are, less with distance."""
    surface, lids = ball_lids(0.4)
    centre = small_head().eyes[0]
    at = surface.evaluate(lids.places.reshape(-1, 2)).reshape(2, COLUMNS, ROWS, 3)
    chosen = [(0, 3, 0), (0, 5, 4), (1, 7, 2), (1, 2, 5)]
    rest = np.array([at[k] for k in chosen])
    out = (rest - centre) / np.linalg.norm(rest - centre, axis=1, keepdims=True)
    for off, share in ((0.0, 1.0), (1.5, 0.5)):  # of a reach of 3 mm
        points = rest + off * out
        follower = Follower(lids, points, surface, small_head())
        for k, (side, column, row) in enumerate(chosen):
            for kind in (0, 1):
                push = np.zeros((2, 2, COLUMNS, 6))
                push[kind, side, column if off == 0.0 else slice(None), row] = 0.5
                after = points.copy()
                follower.apply(push.ravel(), after)
                before, now = points[k] - centre, after[k] - centre
                turned = np.arctan2(now[1], now[2]) - np.arctan2(before[1], before[2])
                up = RADIUS * turned if kind == 0 else np.linalg.norm(now) - np.linalg.norm(before)
                assert up == pytest.approx(0.5 * share, abs=0.06), (off, kind, k)
                push[kind, side] = 0.0
                push[kind, 1 - side] = 0.5  # the other side is none of its business
                follower.apply(push.ravel(), still := points.copy())
                np.testing.assert_array_equal(still[k], points[k])


def test_followers_of_lips_move_by_the_corrections_of_the_two_columns_beside_them() -> None:
    surface, c = lips(0.0), contact(share=0.6)
    at = surface.evaluate(c.places.reshape(-1, 2)).reshape(2, COLUMNS, ROWS, 3)
    x = at[0, :, 0, 0]
    rng = np.random.default_rng(3)
    across = np.concatenate([rng.uniform(x[0], x[-1], 12), x[[0, 4]], [x[0] - 1.0, x[-1] + 1.0]])
    push = rng.uniform(0.1, 1.0, (2, COLUMNS))
    for side, share in ((0, 0.6), (1, -0.4)):
        row = at[side, :, :6].mean(axis=0)[:, 1:]  # height and depth of the samples
        rest = np.column_stack([across, *np.tile(row[2], (len(across), 1)).T])
        follower, points = Follower(c, rest, surface, small_head()), rest.copy()
        follower.apply(push.ravel(), points)
        t = np.linalg.norm(rest[:, None] - at[side, :, :6].reshape(-1, 3), axis=2).min(axis=1) / 10.0  # of the reach
        wanted = share * np.interp(across, x, push[side]) * (1.0 - t * t * (3.0 - 2.0 * t))
        np.testing.assert_allclose(points[:, 1] - rest[:, 1], wanted, rtol=1e-3)
        np.testing.assert_array_equal(points[:, [0, 2]], rest[:, [0, 2]])


def test_what_follows_lips_fades_out_over_the_reach_of_their_contact() -> None:
    surface, c = lips(0.0), contact()
    at = surface.evaluate(c.places.reshape(-1, 2)).reshape(2, COLUMNS, ROWS, 3)
    rim = at[0, 5, 0]
    for off, share in ((0.0, 1.0), (2.5, 0.84375), (5.0, 0.5), (7.5, 0.15625), (10.1, 0.0)):
        rest = np.array([rim, rim - np.array([0.0, 0.0, off])])  # behind the rim, towards nothing else
        distance = np.linalg.norm(at[:, :, :6].reshape(-1, 3) - rest[1], axis=1).min()
        assert distance == pytest.approx(off, abs=1e-6)
        points = rest.copy()
        Follower(c, rest, surface, small_head()).apply(np.ones(2 * COLUMNS), points)
        for moved, wanted in zip(points[:, 1] - rest[:, 1], (1.0, share), strict=True):
            assert abs(moved) == pytest.approx(wanted * (0.75 if moved > 0.0 else 0.25))


def test_columns_move_by_their_share_and_less_beyond_what_touches() -> None:
    moves = contact_module._column_moves(contact(share=0.75)).reshape(2, COLUMNS, ROWS, 2, COLUMNS)
    fade = np.array([1.0] * 6 + [1 - 7 / 27, 1 - 20 / 27, 0.0])  # a third, two thirds and all of the way: 3 t^2 - 2 t^3
    for side, share in ((0, 0.75), (1, -0.25)):
        for k in range(COLUMNS):
            np.testing.assert_allclose(moves[side, k, :, side, k], share * fade, atol=1e-12)
    assert np.count_nonzero(moves) == 2 * COLUMNS * 8


def test_points_are_moved_by_least_squares_and_only_those_that_act_near_the_samples() -> None:
    """Against numpy's least squares with the damping as rows of its own."""
    rng = np.random.default_rng(5)
    dense = np.zeros((6, 9))
    dense[:, :4] = rng.uniform(0.1, 1.0, (6, 4))
    dense[:, 5] = 0.019  # too little of every sample
    dense[2, 6] = 0.021  # just enough of one
    dense[:, 7] = 0.05
    points = rng.uniform(-3, 3, (12, 3))
    points[7] = [60.0, 0, 0]  # far from every sample
    start = np.arange(7) * 9
    ids, share = np.tile(np.arange(9), 6), dense.ravel()
    used, table = contact_module._inverse(start, ids, share, points, 0.05)
    assert used.tolist() == [0, 1, 2, 3, 6]
    system = np.vstack([dense[:, used], np.sqrt(0.05) * np.eye(5)])
    for k in range(6):
        wanted = np.concatenate([np.eye(6)[k], np.zeros(5)])
        np.testing.assert_allclose(table[k], np.linalg.lstsq(system, wanted, rcond=None)[0])


def test_lips_and_lids_have_their_own_damping_and_lips_no_eyeball() -> None:
    surface, c = lips(1.0), contact()
    places = c.places.reshape(-1, 2)
    plain = EyeballClearance(surface, places, np.zeros(3), 0.0)
    np.testing.assert_allclose(plain.samples[:, :3], surface.evaluate(places), atol=0.15)
    np.testing.assert_array_equal(plain.samples[:, 2], plain.samples[:, 3])
    eyed = EyeballClearance(surface, places, np.zeros(3), RADIUS)
    start, ids, share = weights_at(surface, places)
    for clearance, damping in ((plain, 0.02), (eyed, 0.05)):
        used, table = contact_module._inverse(start, ids, share, surface.points, damping)
        np.testing.assert_array_equal(clearance.ids, used)
        np.testing.assert_array_equal(clearance.table, table)


def test_distances_are_those_of_the_nearest_point() -> None:
    rng = np.random.default_rng(6)
    points, others = rng.normal(size=(20, 3)) + 40.0, rng.normal(size=(30, 3)) + 40.0
    wanted = np.linalg.norm(points[:, None] - others, axis=2).min(axis=1)
    np.testing.assert_allclose(contact_module._nearest(points, others), wanted, atol=1e-6)
    assert contact_module._nearest(others[:1], others)[0] < 1e-5


def test_an_eye_is_that_of_its_side() -> None:
    head = small_head()
    assert contact_module.eye_of(contact(-1), head)[1] == 0.0
    for eye in (0, 1):
        centre, radius = contact_module.eye_of(contact(eye), head)
        assert radius == 12.0 and centre.tolist() == head.eyes[eye].tolist()


def overlap_left(points: np.ndarray) -> float:
    """The deepest overlap of lips beyond what is allowed."""
    upper, lower = rims(lips(0.0), points)
    return float((lower - upper).max() - OVERLAP_MM[0])


def test_sides_are_parted_until_little_is_left_and_three_times_at_most() -> None:
    for overlap, passes in ((0.1, 1), (0.3, 1), (1.5, 2), (3.0, 2)):
        solver, points = ContactSolver(contact(), lips(overlap), small_head()), lips(overlap).points.copy()
        solver.apply(AHEAD, points)
        assert passes <= solver.passes <= (3 if passes > 1 else 1), overlap
        assert overlap_left(points) < 0.12
    solver.apply(AHEAD, lips(3.0).points.copy())
    assert solver.passes == 0  # it knew the answer
    solver._apart[:] = 0.0  # nothing helps
    solver.apply(AHEAD, lips(2.9).points.copy())
    assert solver.passes == 3


@pytest.mark.parametrize("seal", [0.5, 1.0])
def test_a_seal_closes_its_share_of_an_opening_that_was_closed_at_rest(seal: float) -> None:
    rest, opened = lips(0.0), lips(-3.0)
    points = opened.points.copy()
    push = ContactSolver(contact(), rest, small_head()).apply(AHEAD, points, seal)
    upper, lower = rims(opened, points)
    np.testing.assert_allclose(upper - lower, 3.0 * (1.0 - seal) - HIDDEN_MM * seal, atol=0.2)
    assert push.max() < 0.0  # followers come along


def test_a_seal_closes_sides_that_an_identity_left_slightly_apart() -> None:
    surface = lips(-0.4)
    points = surface.points.copy()
    ContactSolver(contact(), surface, small_head()).apply(AHEAD, points, 1.0)
    upper, lower = rims(surface, points)
    assert (upper - lower).max() < -0.5 * HIDDEN_MM


def test_a_meshs_own_lips_that_are_slightly_apart_are_closed_in_the_middle_and_left_at_the_corners() -> None:
    """The skin beside a corner would be folded otherwise, for the corner itself cannot move."""
    surface = lips(-0.4)
    gaps = []
    for own in (replace(contact(), cling=False), contact()):
        solver = ContactSolver(own, surface, small_head())
        solver.apply(AHEAD, surface.points.copy(), 1.0)
        gaps.append(solver.gaps()[0])
    ends, middle = [0, -1], slice(4, 7)
    assert (gaps[0][ends] > 0.2).all() and (gaps[0][middle] < -0.5 * HIDDEN_MM).all()
    assert (gaps[1] < -0.4 * HIDDEN_MM).all(), "an identity's are closed everywhere"
    fade = corner_fade(COLUMNS)
    assert fade[[0, 1, 2, 3, -2, -1]] == pytest.approx([2 / 27, 0.5, 25 / 27, 1.0, 0.5, 2 / 27])


def test_a_seal_leaves_an_opening_that_stands_open_at_rest() -> None:
    surface = lips(-3.0)
    points = surface.points.copy()
    ContactSolver(contact(), surface, small_head()).apply(AHEAD, points, 1.0)
    np.testing.assert_allclose(points, surface.points, atol=1e-6)


def test_what_was_found_for_the_same_surface_is_used_again_and_for_another_found_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    solved: list[float] = []
    real = contact_module._find_inverse
    monkeypatch.setattr(contact_module, "_FOUND", type(contact_module._FOUND)())
    monkeypatch.setattr(contact_module, "_find_inverse", lambda *words: solved.append(words[-1]) or real(*words))
    one, same, other = (EyeballClearance(lips(x), low_places(), np.zeros(3), 0.0) for x in (0.2, 0.2, 0.3))
    assert len(solved) == 2 and one.table is same.table and not one.table.flags.writeable
    assert other.table is not one.table
    EyeballClearance(lips(0.2), low_places(), np.zeros(3), 1.0)
    assert len(solved) == 3 and solved[-1] != solved[0]
    for overlap in np.linspace(1.0, 2.0, 20):
        EyeballClearance(lips(overlap), low_places(), np.zeros(3), 0.0)
    assert len(contact_module._FOUND) == contact_module._MAX_CACHED


def test_outer_rows_of_lips_take_points_of_the_inner_ones_and_lie_where_all_put_them() -> None:
    surface, given = lips(0.5), contact()
    found = lip_weights(given, surface)
    rows = contact_rows(given)
    places = given.places[:, :, :rows].reshape(-1, 2)
    start, ids, share = weights_at(surface, places)
    inner = np.arange(rows) < round(INNER_SHARE * rows)
    assert 0 < inner.sum() < rows
    dense, all_of = (np.zeros((len(places), surface.n)) for _ in range(2))
    np.add.at(all_of, (np.repeat(np.arange(len(places)), np.diff(start)), ids), share)
    np.add.at(dense, (np.repeat(np.arange(len(places)), np.diff(found.start)), found.ids), found.share)
    within = np.tile(inner, 2 * COLUMNS)
    used = all_of[within].any(axis=0)
    assert not dense[:, ~used].any() and all_of[:, ~used].any()
    np.testing.assert_allclose(dense.sum(axis=1), 1.0)
    np.testing.assert_allclose(dense[within], all_of[within], atol=1e-12)
    np.testing.assert_allclose(dense @ surface.points + found.offset, all_of @ surface.points, atol=1e-9)
    assert np.abs(found.offset[within]).max() < 1e-9 < np.abs(found.offset[~within]).max()


def test_lips_are_not_solved_again_for_points_that_their_samples_do_not_depend_on() -> None:
    """What is moved goes up as much as before, wherever it is now."""
    surface = lips(0.5)
    head = replace(small_head(), parts=[replace(small_head().parts[0], points=surface.points)])
    solver = ContactSolver(contact(), surface, head)
    seen = np.unique(lip_weights(contact(), surface).ids)
    other = np.setdiff1d(solver._sides.ids, seen)
    assert len(other)
    first = surface.points.copy()
    solver.apply(AHEAD, first)
    assert solver.passes > 0
    moved = surface.points.copy()
    moved[other] += [1.0, 2.0, 3.0]
    again = moved.copy()
    solver.apply(AHEAD, again)
    assert solver.passes == 0 and np.abs(first - surface.points).max() > 0.1
    np.testing.assert_allclose(again - moved, first - surface.points, atol=1e-12)
    fresh = moved.copy()
    ContactSolver(contact(), surface, head).apply(AHEAD, fresh)
    assert np.array_equal(fresh, again)  # to the bit


def test_a_row_of_lips_far_from_all_others_takes_all_of_its_points() -> None:
    given = contact()
    places = given.places.copy()
    rows = contact_rows(given)
    places[:, :, rows - 1, 1] = np.array([0.99, 0.01])[:, None]
    given = replace(given, places=places)
    surface = lips(0.5)
    found = lip_weights(given, surface)
    start, ids, share = weights_at(surface, places[:, :, :rows].reshape(-1, 2))
    for k in range(rows - 1, 2 * COLUMNS * rows, rows):
        assert np.array_equal(found.ids[found.start[k] : found.start[k + 1]], ids[start[k] : start[k + 1]])
        np.testing.assert_allclose(found.share[found.start[k] : found.start[k + 1]], share[start[k] : start[k + 1]])
