"""Skin by its melanin and blood, and wrinkles at rest."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.head.model.data import Group
from surface.head.model.look import OWN_MELANIN, TONES, skin_albedo, skin_tone, with_age, with_forehead


def test_skin_darkens_with_melanin_in_every_channel():
    tones = np.array([skin_tone(m) for m in np.linspace(0, 1, 21)])
    assert (np.diff(tones, axis=0) < 0).all()
    assert (tones[:, 0] > tones[:, 1]).all() and (tones[:, 1] > tones[:, 2]).all()
    np.testing.assert_allclose(tones[[0, -1]], TONES[[0, -1]])


def test_blood_reddens():
    pale, ruddy = skin_tone(0.2, -0.5), skin_tone(0.2, 0.5)
    assert ruddy[0] / ruddy[1] > 1.2 * pale[0] / pale[1]


def test_paint_stays_as_it_is_for_the_heads_own_melanin_but_for_what_covers_it():
    base = skin_tone(OWN_MELANIN)[None]
    np.testing.assert_allclose(skin_albedo(base, OWN_MELANIN, 0.0, np.ones((1, 1))), base)
    red = base * (1.0, 0.6, 0.7)
    light, dark = (skin_albedo(red, m, 0.0, np.ones((1, 1))) / skin_tone(m) for m in (0.0, 1.0))
    np.testing.assert_allclose(light, [[1.0, 0.6, 0.7]])
    assert (dark[0, 1:] > light[0, 1:]).all()
    np.testing.assert_allclose(skin_albedo(red, 0.5, 0.0, np.zeros((1, 1)))[0], skin_tone(0.5))


@pytest.mark.parametrize(("group", "moves"), [("wrinkleEyeLeft", True), ("mouthPucker", False)])
def test_age_sinks_wrinkles_at_rest_and_nothing_else(group, moves):
    head = small_head(parts=[part("a", -40, groups=[all_points(group, (0, 0, -1))])], seams=[])
    old = with_age(head, 0.5).parts[0].points - head.parts[0].points
    assert (old[:, 2] < -0.1).all() if moves else not old.any()
    np.testing.assert_array_equal(with_age(head, 0.0).parts[0].points, head.parts[0].points)


def test_tones_lie_between_those_of_the_table_in_density():
    for k in range(5):
        np.testing.assert_allclose(skin_tone(0.2 * k + 0.1), np.sqrt(TONES[k] * TONES[k + 1]))
    np.testing.assert_allclose(skin_tone(0.2), TONES[1])
    np.testing.assert_allclose(skin_tone(0.2, 0.5), TONES[1] * np.exp([-0.025, -0.17, -0.13]))


@pytest.mark.parametrize(("melanin", "redness"), [(0.0, 1.0), (0.6, 0.5), (1.0, 2.0)])
def test_paint_is_covered_by_melanin_up_to_45_per_cent(melanin, redness):
    painted = np.array([[0.5, 0.3, 0.2], [0.0, 0.3, 1e-4]])
    ratio = np.maximum(painted, 1e-4) / TONES[1]
    wanted = skin_tone(melanin, 0.3) * ratio ** (redness * (1.0 - 0.45 * melanin))
    np.testing.assert_allclose(skin_albedo(painted, melanin, 0.3, np.full((2, 1), redness)), wanted)


@pytest.mark.parametrize(
    ("name", "share"),
    [("wrinkleForehead", 0.75), ("wrinkleFrownLeft", 0.5), ("wrinkleEyeRight", 0.8), ("wrinkleCheekLeft", 0.9)],
)
def test_wrinkles_stand_at_rest_by_their_share_of_the_age(name, share):
    head = small_head(parts=[part("a", -40, groups=[all_points(name, (0, 1, -2))])], seams=[])
    for age in (0.5, 1.0):
        moved = with_age(head, age).parts[0].points - head.parts[0].points
        np.testing.assert_allclose(moved, np.tile([0, age * share, -2 * age * share], (25, 1)))
    np.testing.assert_array_equal(with_age(head, -1.0).parts[0].points, head.parts[0].points)


def test_lines_of_the_forehead_are_as_deep_as_a_look_says_the_lowest_first():
    rows = part("a", -40)
    order = np.argsort(rows.points[:, 1], kind="stable")[::-1]  # the highest line comes first in the group
    moves = np.tile(np.float32([0.0, 0.0, -2.0]), (25, 1))
    others = [Group(name, order.astype(np.int32), moves) for name in ("wrinkleForeheadLeft", "wrinkleEyeLeft")]
    head = small_head(parts=[replace(rows, groups=others)], seams=[])
    folded, eye = with_forehead(head, (1.5, 0.5, 0.0)).parts[0].groups
    height = np.round(rows.points[order, 1], 6)
    lines = np.unique(height)
    assert len(lines) == 5
    for line, depth in zip(lines, (1.5, 0.5, 0.0, 0.0, 0.0), strict=True):
        np.testing.assert_allclose(folded.moves[height == line], depth * moves[:5])
    np.testing.assert_array_equal(eye.moves, moves)
    assert with_forehead(head, (1.0, 1.0, 1.0)) is head
