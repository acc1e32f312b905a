"""Lids follow the gaze where the mesh's shapes leave them still: as its blink takes them, and no further."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face

from surface.fit.eyes.blink import angle_of, lid_edges
from surface.fit.eyes.following import follow_gaze
from surface.fit.eyes.lids import with_looks
from surface.fit.eyes.openings import find_openings

MIDDLE = 16  # of the columns of an opening
LEFT = ("eyeBlinkLeft", "eyeLookDownLeft")


@pytest.fixture(scope="module")
def plain():
    return with_looks(face())


@pytest.fixture(scope="module")
def openings(plain):
    return find_openings(plain, np.ones(len(plain.faces), bool), 0.0, None)


def edges(mesh, openings, side, shape=None):
    rest = mesh.vertices - CENTRES[side]
    moved = rest if shape is None else rest + mesh.deltas[mesh.names.index(shape)]
    return lid_edges(moved, openings[side].edge, rest)


def followed(mesh, openings):
    return follow_gaze(mesh, openings, CENTRES, RADIUS)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("back", "less"), [(6.0, 1.0), (0.0, 30.0 / (0.66 * 52.9))])
def test_lids_go_by_shares_of_the_opening_but_no_further_than_the_eye_and_never_cross(
    plain, openings, side, back, less
):
    """The first eye is larger than people's, and the lower lid goes as many millimetres as under theirs. The second
    opening is 53 degrees high, about its eye, and the eye turns by 30."""
    centres, name = CENTRES - [0.0, 0.0, back], ("Left", "Right")[side]
    further = replace(plain, deltas=1.3 * plain.deltas)  # lids that meet half-way go less far in a blink
    made, notes = follow_gaze(further, openings, centres, RADIUS + back)
    at = plain.vertices - centres[side]
    rest = lid_edges(at, openings[side].edge, at)
    size = min(1.0, 0.19 * 64.0 / (RADIUS + back))
    for look, upper, lower, most in (("eyeLookDown", -0.66, -0.34, less), ("eyeLookUp", 0.37, 0.24, 1.0)):
        move = made.deltas[made.names.index(f"{look}{name}")]
        found = lid_edges(at + move, openings[side].edge, at)
        moved = (found.upper - rest.upper)[MIDDLE], (found.lower - rest.lower)[MIDDLE]
        assert moved == pytest.approx(np.array([upper, size * lower]) * most * rest.gap[MIDDLE], rel=0.03)
        assert found.gap[1:-1].min() > 0.0  # at its ends both lids are one
    assert len(notes) == 1 and all(f"eyeLook{k}{name}" in notes[0] for k in ("Up", "Down"))


def test_an_upper_lid_goes_no_further_than_in_the_blink(plain, openings):
    half = replace(plain, deltas=0.6 * plain.deltas)
    rest, blink, look = (edges(followed(half, openings)[0], openings, 0, k) for k in (None, *LEFT))
    np.testing.assert_allclose(look.upper[4:-4], blink.upper[4:-4], atol=0.02)
    assert (rest.upper - look.upper).max() < 0.5 * rest.gap.max()


def test_skin_goes_round_the_eye_the_way_of_the_blink_and_far_from_it_nothing_moves(plain, openings):
    """The lower lid keeps its distance from the eye's axis, the upper one goes from that at rest to that in a blink."""
    blink = plain.deltas[plain.names.index("eyeBlinkLeft")] + [0.5, 0.0, 0.0] * (plain.deltas[:1, :, 1:2].any(axis=2).T)
    mesh = replace(plain, deltas=np.concatenate([blink[None], plain.deltas[1:]]))
    made, _ = followed(mesh, openings)
    local = plain.vertices - CENTRES[0]
    middle = np.abs(local[:, 0]) < 8.0
    for look, way in (("eyeLookDownLeft", 1.0), ("eyeLookUpLeft", -1.0)):
        move = made.deltas[made.names.index(look)]
        turned, whole = (angle_of(local + m) - angle_of(local) for m in (move, blink))
        upper = middle & (whole < -0.05) & (angle_of(local) > 0.0) & move.any(axis=1)
        share = turned[upper] / whole[upper]
        before, after, shut = (np.hypot(at[:, 1], at[:, 2]) for at in (local, local + move, local + blink))
        np.testing.assert_allclose(after[upper], before[upper] + share * (shut - before)[upper], atol=1e-6)
        np.testing.assert_allclose(move[upper, 0], share * blink[upper, 0], atol=1e-6)
        assert way * share.mean() > 0.3 and np.abs(blink[upper, 0]).max() > 0.4
        lower = middle & (way * turned < -0.02) & (whole >= 0.0)
        np.testing.assert_allclose(after[lower], before[lower], atol=1e-9)
        away, changed = np.linalg.norm(local, axis=1), move.any(axis=1)
        assert lower.any() and not changed[(away > 2.2 * RADIUS) | (local[:, 2] < 0.0)].any()
    np.testing.assert_array_equal(made.deltas[:3], mesh.deltas[:3])  # the mesh's own


@pytest.mark.parametrize(("ahead", "goes"), [(12.0, 1.0), (1.0, 0.0)])
def test_a_lash_beside_the_opening_goes_the_share_of_its_blink_that_the_lid_goes(plain, openings, ahead, goes):
    """It hangs on the upper lid beyond the corner, below the lids' middle, and goes down with them; what lies as far
    back as the eye's centre does not."""
    at, down = np.array([14.0, -1.0, ahead]), np.deg2rad(20.0)
    c, s = np.cos(down), np.sin(down)
    shut = np.array([at[0], c * at[1] - s * at[2], c * at[2] + s * at[1]])
    deltas = np.concatenate([plain.deltas, np.zeros((len(plain.names), 1, 3))], axis=1)
    deltas[plain.names.index("eyeBlinkLeft"), -1] = shut - at
    mesh = replace(plain, vertices=np.vstack([plain.vertices, CENTRES[0] + at]), deltas=deltas)
    made, _ = followed(mesh, openings)
    moved = at + made.deltas[made.names.index("eyeLookDownLeft"), -1]
    rest, blink, look = (edges(made, openings, 0, k) for k in (None, *LEFT))
    share = (look.upper - rest.upper)[MIDDLE] / (blink.upper - rest.upper)[MIDDLE]
    turned = (angle_of(at[None]) - angle_of(moved[None]))[0]
    assert turned == pytest.approx(goes * share * down, rel=0.03, abs=1e-9)


def test_shapes_that_move_the_upper_lid_stay_and_those_of_the_other_side_are_made(plain, openings):
    blink = plain.deltas[plain.names.index("eyeBlinkLeft")]
    k = plain.names.index("eyeLookDownLeft")
    own = replace(plain, deltas=np.where(np.arange(len(plain.names))[:, None, None] == k, 0.3 * blink, plain.deltas))
    made, notes = followed(own, openings)
    np.testing.assert_array_equal(made.deltas[k], own.deltas[k])
    assert "eyeLookDownRight" in notes[0] and "eyeLookDownLeft" not in notes[0]
    hardly = replace(own, deltas=np.where(np.arange(len(plain.names))[:, None, None] == k, 0.02 * blink, plain.deltas))
    assert "eyeLookDownLeft" in followed(hardly, openings)[1][0]


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_without_a_blink_that_shuts_the_eye_nobody_knows_how_its_lids_move(plain, openings, share):
    open_eyes = replace(plain, deltas=plain.deltas * share)
    made, notes = followed(open_eyes, openings)
    np.testing.assert_array_equal(made.deltas, open_eyes.deltas)
    assert notes == []


def test_a_blink_of_the_lower_lid_alone_shows_nothing_of_the_upper_one(plain, openings):
    deltas = plain.deltas.copy()
    k = plain.names.index("eyeBlinkLeft")
    rise = np.where(plain.vertices[:, 1] < CENTRES[0, 1], -2.0 * deltas[k, :, 1], 0.0)
    deltas[k] = np.column_stack([0 * rise, np.abs(rise), 0 * rise])
    _, notes = followed(replace(plain, deltas=deltas), openings)
    assert "Left" not in notes[0] and "eyeLookDownRight" in notes[0]
