"""Lids as they are drawn: above the eyeballs between vertices, too, and shut by a blink."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from eye_face import CENTRES
from face_measures import Window
from scipy.sparse import csr_matrix

from surface.fit.eyes import drawn_lids
from surface.fit.eyes.drawn_lids import BLINKS, MAX_CORRECTIONS, DrawnLids, seat_drawn_lids
from surface.fit.points.eyeball import surface_height
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


@pytest.mark.parametrize(("reached", "left"), [(1.0, 0.0), (0.4, 0.0), (0.05, 2.0)])
def test_skin_is_not_folded_to_close_a_gap_that_the_lids_hardly_reach(reached, left, monkeypatch) -> None:
    """An eye of which ``reached`` of the lids' way shuts: the way is at most three times what it closes."""
    at = np.array([[0.0, 2.0, 12.0]])
    lids = bare_lids(at)
    monkeypatch.setattr(lids, "_open", lambda p: (np.zeros(1), np.maximum(2.0 - reached * (2.0 - p[:, 1]), 0.0)))
    monkeypatch.setattr(lids, "_needs", lambda points, x, seen: seen)
    monkeypatch.setattr(lids, "_cleared", lambda points, axis, solver: points)

    class Solver:
        def apply(self, axis, points) -> None: ...

        def move_sides(self, amounts, points) -> None:
            points[:, 1] += amounts

    part = SimpleNamespace(points=at + np.array([0.0, 8.0 / reached, 0.0]))  # at rest the eye is 10 mm open
    closed, was_open, is_open = lids._closed(part, at, at, Solver())
    assert (was_open, is_open) == (2.0, pytest.approx(left, abs=0.1))
    assert np.linalg.norm(closed - at) <= drawn_lids.MOST_MOVED * (was_open - is_open) + 1e-9


def bare_lids(at: np.ndarray, radius: float = 12.0) -> DrawnLids:
    """Lids whose samples are their control points, of an eye at the origin."""
    lids = object.__new__(DrawnLids)
    lids._eye, lids._radius = np.zeros(3), radius
    lids._samples = csr_matrix(np.eye(len(at)))
    lids._dense = np.eye(len(at))
    lids._square = lids._dense.T @ lids._dense
    lids._ids = np.arange(len(at))
    return lids


def test_samples_lack_the_height_that_they_are_less_than_asked_above_the_eyeball() -> None:
    side = np.array([0.8, 0.0, 0.6])  # off the cornea, 7.2 mm in front of the centre
    at = np.array([12.0 * side, 13.0 * side, 11.0 * side, [0.0, 0.0, 12.0], [12.0, 0.0, 0.0]])
    unit, lacks = bare_lids(at)._sampled(at, drawn_lids.FORWARD, 0.045)
    np.testing.assert_allclose(unit[:3], np.tile(side, (3, 1)))
    np.testing.assert_allclose(lacks[:3], [0.54, 0.0, 1.54])
    assert lacks[3] == pytest.approx(12.0 * (0.045 + surface_height(unit[3:4], drawn_lids.FORWARD)[0]) - 12.0)
    assert lacks[3] > 1.0 and lacks[4] == 0.0  # the cornea stands out; beside the eyeball lids may lie as they do
    for depth, share in ((0.05, 0.0), (0.2, 0.5), (0.35, 1.0), (0.125, 0.15625)):
        low = 10.0 * np.array([[np.sqrt(1 - (1.2 * depth) ** 2), 0.0, 1.2 * depth]])
        assert bare_lids(low)._sampled(low, drawn_lids.FORWARD, 0.0)[1][0] == pytest.approx(2.0 * share)


def test_what_lacks_height_is_lifted_a_fifth_further_and_the_rest_held() -> None:
    side = np.array([0.8, 0.0, 0.6])
    at = np.array([11.0 * side, 20.0 * side])
    lids = bare_lids(at)
    moves = lids._lift(at, drawn_lids.FORWARD, 0.0)
    # of the first: (0.05 + 0.95 + 0.02) x = 1.2 times the missing 1 mm
    np.testing.assert_allclose(moves, [1.2 / 1.02 * side, [0.0, 0.0, 0.0]], atol=1e-12)
    for lacking, lifted in ((0.0024, False), (0.0026, True)):
        near = np.array([(1.0 - lacking) * 12.0 * side, 20.0 * side])
        assert len(lids._lift(near, drawn_lids.FORWARD, 0.0)) == (2 if lifted else 0)


def test_triangles_are_sampled_at_ten_places() -> None:
    found = drawn_lids._shares(np.array([[0, 1, 2], [2, 1, 3]]), 4).toarray()
    wanted = {(3 - i - j, i, j) for i in range(4) for j in range(4 - i)}
    assert found.shape == (20, 4)
    for rows, columns in ((found[:10], [0, 1, 2]), (found[10:], [2, 1, 3])):
        assert {tuple(row) for row in np.rint(3 * rows[:, columns]).astype(int).tolist()} == wanted
        np.testing.assert_allclose(rows.sum(axis=1), 1.0)


def test_displacements_are_added_to_a_group_and_rounded() -> None:
    group = Group("eyeBlinkLeft", np.array([1, 3], np.int32), np.array([[1.0, 2, 3], [4, 5, 6]], np.float32))
    more = np.zeros((5, 3))
    more[0], more[1], more[4] = (0.12345678, 0, 0), (-1.0, -2.0, -3.0), (0, 0, -0.5)
    found = drawn_lids._with_more(group, more)
    assert found.name == "eyeBlinkLeft" and found.ids.tolist() == [0, 3, 4] and found.ids.dtype == np.int32
    np.testing.assert_allclose(found.moves, [[0.1235, 0, 0], [4, 5, 6], [0, 0, -0.5]], atol=1e-7)
    assert more[1, 0] == -1.0


def test_gaps_are_closed_a_fiftieth_of_a_radius_further_in_every_column_beside_them() -> None:
    lids = bare_lids(np.zeros((1, 3)))
    columns = np.array([[-4.0, 0.0, 4.0], [-4.0, 1.0, 4.0]])
    lids._columns = lambda points: columns  # type: ignore[method-assign]
    x = np.arange(-6.0, 6.5, 0.5)
    seen = np.where(x == 2.0, 1.5, 0.0)
    found = lids._needs(np.zeros((1, 3)), x, seen)
    # columns are 4 mm apart, 8 steps: the gap at 2 counts from -2 to 6
    np.testing.assert_allclose(found, [[0.0, 1.74, 1.74], [0.0, 1.74, 1.74]])
    assert not lids._needs(np.zeros((1, 3)), x, 0.0 * seen).any()
    far = lids._needs(np.zeros((1, 3)), x, np.where(x == 5.0, 1.5, 0.0))
    np.testing.assert_allclose(far[:, 1], [0.0, 1.74])  # 4.5 is beyond, 1 to 5 is not


def test_a_shape_alone_is_a_pose() -> None:
    pose = drawn_lids._pose("jawOpen")
    assert pose.jaw == 1.0 and np.count_nonzero(pose.shapes) == 1 and not pose.head.any()
