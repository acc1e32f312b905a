"""Lids as they are drawn: above the eyeballs between vertices, too, and shut by a blink."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES
from face_measures import Window

from surface.fit.eyes.drawn_lids import BLINKS, MAX_CORRECTIONS, DrawnLids, seat_drawn_lids
from surface.head import Group, Head, HeadData

AHEAD = 40.0 + 6.0  # z of what lies before the middle of an eyeball


def spoilt(head: HeadData, sunk_mm: float, share: float) -> HeadData:
    """The head with its lids moved towards the eyeballs, and with blinks that go a share of their way."""
    face = head.parts[0]
    off = face.points - head.eyes[(face.points[:, 0] < 0).astype(int)]
    away = np.linalg.norm(off, axis=1)
    inwards = -off / away[:, None] * ((away < 16.0) & (off[:, 2] > 0))[:, None]
    groups = [Group(g.name, g.ids, np.float32(share) * g.moves) if g.name in BLINKS else g for g in face.groups]
    parts = [replace(face, points=face.points + sunk_mm * inwards, groups=groups), *head.parts[1:]]
    return replace(head, parts=parts, contacts=[replace(c, cling=True) for c in head.contacts])


def eye_seen(head: Head, side: int, yaw: float = 0.0, **values: float) -> float:
    """Greatest height, mm, of an eye that is seen past the skin, by a viewer ``yaw`` rad aside."""
    head.pose(head.values(values))
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    x, y, _ = turn @ CENTRES[side]
    window = Window((x - 16, x + 16), (y - 16, y + 16), 0.1, turn)
    eye, skin = window.depth(head.parts[1 + side]), window.depth(head.parts[0])
    return float((eye > skin).sum(axis=0).max() * window.step)


def holes(head: Head, side: int, **values: float) -> int:
    """Pixels of 0.1 mm in which an eyeball comes through skin that lies less than 3 mm behind its surface."""
    head.pose(head.values(values))
    x, y, _ = CENTRES[side]
    window = Window((x - 14, x + 14), (y - 12, y + 12), 0.1)
    eye, skin = window.depth(head.parts[1 + side]), window.depth(head.parts[0])
    return int(((eye > skin) & (skin > eye - 3.0) & (eye > AHEAD)).sum())


@pytest.fixture(scope="module")
def heads(head: Head) -> tuple[Head, Head, list[str]]:
    """The head with lids that cut through the eyeballs and blinks that leave a gap, the same seated, and its notes."""
    before = spoilt(head.data, 1.5, 0.75)
    after, notes = seat_drawn_lids(before)
    return Head(before), Head(after), notes


@pytest.mark.slow
def test_lids_that_cut_through_an_eyeball_are_lifted_out_of_it(heads) -> None:
    before, after, _ = heads
    for side, name in enumerate(BLINKS):
        assert holes(before, side) > 20 and holes(before, side, **{name: 1.0}) > 1000
        assert holes(after, side) == holes(after, side, **{name: 1.0}) == 0
        assert eye_seen(after, side) > 6.0


@pytest.mark.slow
def test_lids_are_drawn_half_a_millimetre_above_the_eyeball(heads) -> None:
    """Middles of the triangles in front of the eye, at rest: the cornea is 0.65 radii, 0.4447 before the middle."""
    after = heads[1]
    after.pose(after.values({}))
    local = after.parts[0].vertices.astype(float)[after.parts[0].triangles].mean(axis=1) - after.data.eyes[0]
    away, radius = np.linalg.norm(local, axis=1), after.data.eye_radius
    cornea = np.linalg.norm(local - [0.0, 0.0, 0.4447 * radius], axis=1) - 0.65 * radius
    height = np.minimum(away - radius, cornea)[(local[:, 2] > 0.5 * radius) & (away < 1.5 * radius)]
    assert 0.4 < height.min() < 0.6


@pytest.mark.slow
def test_a_blink_that_leaves_a_gap_is_lengthened_until_it_is_drawn_shut(heads) -> None:
    before, after, notes = heads
    for side, name in enumerate(BLINKS):
        for yaw in (-0.5, 0.0, 0.5):
            assert eye_seen(before, side, yaw, **{name: 1.0}) > 1.0
            assert eye_seen(after, side, yaw, **{name: 1.0}) <= 0.5
        assert sum(note.startswith(name) for note in notes) == 1
    jaw = [next(g for g in h.data.parts[0].groups if g.name == "jawOpen") for h in (before, after)]
    np.testing.assert_array_equal(jaw[0].moves, jaw[1].moves)


@pytest.mark.slow
def test_a_blink_that_goes_a_third_of_its_way_is_left_alone(head: Head) -> None:
    after, notes = seat_drawn_lids(spoilt(head.data, 0.0, 0.3))
    assert not notes and eye_seen(Head(after), 0, eyeBlinkLeft=1.0) > 5.0
    np.testing.assert_allclose(after.parts[0].points, head.data.parts[0].points, atol=0.05)


@pytest.mark.slow
def test_a_head_without_lids_stays_as_it_is(head: Head) -> None:
    bare = replace(head.data, contacts=[])
    assert seat_drawn_lids(bare) == (bare, [])


class Part(DrawnLids):
    """Lids of a head that is no more than the gap, mm, its blink leaves, and that takes a share of what is added."""

    def __init__(self, share: float) -> None:
        self.share, self.asked = share, 0

    def corrections(self, head):
        self.asked += 1
        return {"gap": head}, head, 0.1

    def with_more(self, head, more):
        return head - self.share * more["gap"]


@pytest.mark.parametrize(
    ("share", "left", "asked"), [(0.5, 0.5, MAX_CORRECTIONS + 1), (1.0, 0.0, 2), (-1.0, 8.0, MAX_CORRECTIONS + 1)]
)
def test_what_a_head_takes_only_in_part_is_corrected_again(share, left, asked) -> None:
    """The least of the gaps after a correction counts; before it, other shapes are not corrected either."""
    lids = Part(share)
    assert lids.shut(4.0) == (left, 4.0, left)
    assert lids.asked == asked
