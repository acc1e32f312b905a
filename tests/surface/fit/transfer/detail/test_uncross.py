"""Skin that passes through itself goes back to a stiffer map there, and nowhere else."""

import numpy as np

from surface.check.crossings import Crossings
from surface.fit.transfer.detail.uncross import crossing, uncrossed

X, Y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-20.0, 20.0, 21)], indexing="ij"))
K = np.arange(441).reshape(21, 21)
A, B, C, D = (k.ravel() for k in (K[:-1, :-1], K[1:, :-1], K[1:, 1:], K[:-1, 1:]))
ONE = np.vstack([np.column_stack([A, B, C]), np.column_stack([A, C, D])])
TRIANGLES = np.vstack([ONE, ONE[:, ::-1] + 441])
UPPER, LOWER = (np.column_stack([X, Y, np.full(441, z)]) for z in (2.0, 0.0))
REST = np.vstack([UPPER, LOWER])
ABLE = np.ones(len(REST), bool)
PART = np.zeros(len(TRIANGLES), np.int64)


def crossed(at: np.ndarray) -> int:
    same = np.arange(len(REST))
    return len(crossing(Crossings(at, TRIANGLES, same, 0 * TRIANGLES[:, 0], np.ones((1, 1), bool)), at, REST, ABLE))


def dented() -> np.ndarray:
    """The upper sheet is pressed through the lower one near a corner."""
    at = REST + 5.0 * np.eye(3)[0]
    at[:441, 2] -= 4.0 * np.exp(-((X - 8.0) ** 2 + (Y - 8.0) ** 2) / 20.0)
    return at


def test_skin_that_crosses_goes_back_and_the_rest_stays() -> None:
    at, still = dented(), REST + 5.5 * np.eye(3)[0]
    assert crossed(at) > 10
    made = uncrossed(at, still, REST, TRIANGLES, PART, ABLE)
    assert crossed(made) == 0
    far = np.hypot(X - 8.0, Y - 8.0) > 22.0
    np.testing.assert_array_equal(made[:441][far], at[:441][far])


def test_only_skin_that_is_asked_about_goes_back_and_none_where_the_stiffer_map_is_no_better() -> None:
    at = dented()
    assert uncrossed(at, REST, REST, TRIANGLES, PART, ~ABLE) is at
    assert uncrossed(at, at.copy(), REST, TRIANGLES, PART, ABLE) is at
    assert uncrossed(REST, at, REST, TRIANGLES, PART, ABLE) is REST


def test_what_lies_between_places_that_cross_goes_back_with_them_and_the_end_is_gentle() -> None:
    """An ear that hair hides crosses in a few places; of the rest of it the scan says as little."""
    at = REST + 5.0 * np.eye(3)[0]
    for angle in 2.0 * np.pi * np.arange(6) / 6:
        far = (X - 5.0 * np.cos(angle)) ** 2 + (Y - 5.0 * np.sin(angle)) ** 2
        at[:441, 2] -= 4.0 * np.exp(-far / 2.0)
    still = REST + 5.5 * np.eye(3)[0]
    made = uncrossed(at, still, REST, TRIANGLES, PART, ABLE)
    assert crossed(made) == 0
    out = np.hypot(X, Y)
    np.testing.assert_allclose(made[441:][out < 8.0], still[441:][out < 8.0])
    along = made[441:][(Y == 0.0) & (X > 0.0), 0] - at[441:][(Y == 0.0) & (X > 0.0), 0]
    assert np.abs(np.diff(along)).max() < 0.2, "no step at the edge"
    np.testing.assert_array_equal(made[441:][out > 27.0], at[441:][out > 27.0])


def test_two_skins_go_back_where_they_cross_but_not_along_their_seam() -> None:
    """The same sheets as two parts: both are 2 mm apart everywhere, as skins are on both sides of a seam."""
    at, still = dented(), REST + 5.5 * np.eye(3)[0]
    two = np.repeat([0, 1], len(ONE))
    assert uncrossed(at, still, REST, TRIANGLES, two, ABLE) is at
    apart = REST + np.where(np.arange(len(REST))[:, None] < 441, [0.0, 0.0, 4.0], 0.0)
    assert uncrossed(at, still, apart, TRIANGLES, two, ABLE) is not at


def test_a_few_vertices_and_what_crosses_where_it_would_go_back_to_stay() -> None:
    at, still = dented(), REST + 5.5 * np.eye(3)[0]
    few = np.append(np.hypot(X - 8.0, Y - 8.0) < 2.5, np.zeros(441, bool))
    assert uncrossed(at, still, REST, TRIANGLES, PART, few) is at
    assert uncrossed(at, at + 0.5 * np.eye(3)[0], REST, TRIANGLES, PART, ABLE) is at
