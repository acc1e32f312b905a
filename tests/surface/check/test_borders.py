"""Borders, seams and holes of sheets, against every pair of edges, scipy's components and closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from surface.check import borders
from surface.check.components import joined
from surface.check.mouth import Mouth
from surface.check.network import Network
from surface.check.places import Places
from surface.check.subject import Subject
from tests.surface.check import plain

ABOVE = np.add(plain.EYES, [0.0, 200.0, 0.0])  # eyes far from the borders here


def sheet(name: str, x: tuple[float, float], y: tuple[float, float] = (-40.0, 40.0), step: float = 4.0, **more: object):
    points, triangles = plain.sheet(x, y, step)
    return plain.part(name, points, triangles, **more)  # type: ignore[arg-type]


def holed(x: tuple[float, float], y: tuple[float, float], z: float = 0.0, **more: object):
    """A sheet of skin from -80 to 80 mm with a hole."""
    points, triangles = plain.sheet((-80, 80), (-80, 80), 4.0, z)
    return plain.part("face", points, plain.without(points, triangles, x, y), **more)  # type: ignore[arg-type]


def texts(head: Subject, mouth: Mouth | None = None) -> list[str]:
    return [f.text for f in borders.holes(head, mouth, Places(head, None), borders.find_borders(head))]


@pytest.mark.parametrize(("count", "width"), [(400, 20.0), (4, 20.0 / np.sqrt(2.0))])
def test_the_width_of_a_loop_is_the_diameter_of_a_circle_and_the_side_of_a_square(count: int, width: float) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    ring = 10.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    assert borders._measure_loop(np.stack([ring[:-1], ring[1:]], axis=1))[1] == pytest.approx(width, rel=1e-3)


def test_the_width_of_a_slit_is_twice_its_height() -> None:
    corners = np.array([[0.0, 0, 0], [1000, 0, 0], [1000, 1, 0], [0, 1, 0]])
    slit = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    assert borders._measure_loop(slit)[1] == pytest.approx(2.0, rel=2e-3)


@pytest.mark.parametrize(("gap", "scale", "sewn"), [(0.3, 1, True), (0.5, 1, False), (0.7, 2, True), (0.9, 2, False)])
def test_borders_that_lie_together_are_sewn(gap: float, scale: int, sewn: bool) -> None:
    head = plain.subject(sheet("a", (0, 40)), sheet("b", (40 + gap, 80)), eyes=scale * plain.EYES)
    found = borders.find_borders(head)
    assert len(found.part) == 2 * (10 + 20) * 2
    at = found.at(head.rest)
    along = (np.abs(at[..., 0] - 40.0) < 1.0).all(axis=1)
    np.testing.assert_array_equal(found.sewn, along & sewn)
    np.testing.assert_array_equal(found.sewn, found.mate >= 0)
    mates = found.mate[found.sewn]
    assert (found.part[mates] == 1 - found.part[found.sewn]).all()
    assert (np.abs(at[mates].mean(axis=1)[:, 1] - at[found.sewn].mean(axis=1)[:, 1]) < 1e-3).all()
    assert (found.ids - found.ends == np.where(found.part == 0, 0, len(head.rest[0]))[:, None]).all()


def test_vertices_in_one_place_are_one_and_slivers_are_none() -> None:
    points, triangles = plain.sheet((0, 40), (0, 40), 4.0)
    split = plain.part("face", points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    rim = borders.find_borders(plain.subject(split))
    assert len(rim.part) == 40 and not rim.sewn.any()
    doubled = np.vstack([triangles, [[0, 0, 1], [5, 6, 6], [7, 3, 7]]])
    assert len(borders._weld(plain.subject(plain.part("face", points, doubled)), 0)) == len(triangles)


def test_only_sheets_that_deform_with_the_skin_have_borders() -> None:
    mouth = sheet("m", (0, 40), material="mouth")
    tongue = sheet("t", (50, 90), material="tongue")
    others = [sheet("e", (0, 40), material="eye"), sheet("s", (0, 40), follows="skull")]
    found = borders.find_borders(plain.subject(*others, mouth, tongue))
    assert set(found.part.tolist()) == {2, 3}
    assert len(borders.find_borders(plain.subject(*others)).part) == 0
    assert texts(plain.subject(*others)) == []


def test_a_hole_is_named_with_its_length_and_place_and_the_outer_border_is_none() -> None:
    assert texts(plain.subject(holed((0, 0), (0, 0)))) == []
    found = texts(plain.subject(holed((8, 28), (40, 52))))
    assert found == ["a hole in part 'face', 64 mm around: left forehead"]


@pytest.mark.parametrize("height", [4.0, 8.0])
def test_a_hole_beside_another_is_one_of_its_own(height: float) -> None:
    points, triangles = plain.sheet((-80, 80), (-80, 80), 4.0)
    left = plain.without(points, triangles, (8, 28), (40, 40 + height))
    both = plain.part("face", points, plain.without(points, left, (-28, -8), (40, 52)))
    found = texts(plain.subject(both))
    assert sorted(t.rpartition(": ")[2] for t in found) == ["left forehead", "right forehead"]


@pytest.mark.parametrize(("step", "named"), [(1.0, False), (1.5, True)])
def test_a_slit_narrower_than_a_hole_is_none(step: float, named: bool) -> None:
    """By four times its area by its length round, 2.4 mm on a head of twice the usual size: a slit of 42 by 1 mm has
    1.95 mm, one of 42 by 1.5 mm has 2.9 mm."""
    points, triangles = plain.sheet((-42, 42), (-42, 42), step)
    slit = plain.part("face", points, plain.without(points, triangles, (-21, 21), (0, step)))
    assert len(texts(plain.subject(slit, eyes=np.add(2.0 * plain.EYES, [0.0, 900.0, 0.0])))) == named


def test_the_width_of_a_loop() -> None:
    corner = np.array([[0.0, 0, 0], [30, 0, 0], [30, 6, 0], [0, 6, 0]]) @ np.linalg.qr(np.eye(3) + 0.3)[0] + 7.0
    middle, width = borders._measure_loop(np.stack([corner, np.roll(corner, -1, axis=0)], axis=1))
    np.testing.assert_allclose(middle, corner.mean(axis=0))
    assert width == pytest.approx(4.0 * 180.0 / 72.0)
    assert borders._measure_loop(np.ones((1, 2, 3)))[1] == 0.0


@pytest.mark.parametrize(("x", "opening"), [(31.8, True), (31.8 + 20.0, True), (31.8 + 20.8, False), (-31.8, False)])
def test_the_rim_of_an_eye_with_an_eyeball_is_no_hole(x: float, opening: bool) -> None:
    head = plain.subject(sheet("face", (-40, 40)), plain.eyeball(0))
    assert borders._in_openings(head, None, np.array([[x, 0.0, 0.0], [0.0, 0.0, 0.0]])).tolist() == [opening, False]


@pytest.mark.parametrize(("away", "opening"), [(37.0, True), (-37.0, True), (38.0, False)])
def test_the_rim_of_the_mouth_is_no_hole(away: float, opening: bool) -> None:
    head, mouth = plain.subject(sheet("face", (-40, 40)), eyes=None), plain.line_of_lips(-66.0)
    for axis in range(3):
        at = np.array([0.0, -66.0, 0.0]) + away * np.eye(3)[axis]
        assert borders._in_openings(head, mouth, at[None]).tolist() == [opening]
    assert not borders._in_openings(head, None, at[None]).any()


def opened(mm: float, pose: str = "jawOpen", **options: object) -> Subject:
    """Two sheets that share a border at x = 0, of which a pose moves the right one away, its far end by as much."""
    right = sheet("b", (-40, 0))
    right.moves = {pose: np.tile(np.float32([-mm, 0, 0]), (len(right.rest), 1)),
                   "cheekPuff": np.tile(np.float32([0, 0, 0.5]), (len(right.rest), 1))}  # fmt: skip
    left = sheet("a", (0, 40))
    return plain.subject(left, plain.part("b", right.rest, right.triangles, moves=right.moves), **options)


@pytest.mark.parametrize(("mm", "said"), [(0.9, None), (1.3, "1.3 mm"), (3.4, "3.4 mm"), (9.0, "4.0 mm or more")])
def test_a_seam_that_opens_in_a_pose_is_named_with_how_far(mm: float, said: str | None) -> None:
    found = texts(opened(mm, eyes=ABOVE))
    assert len(found) == (said is not None)
    if said is not None:
        assert found[0].startswith(f"with jawOpen = 1 a seam opens by {said}: ")
    assert texts(opened(1.9, eyes=2.0 * ABOVE)) == []


def test_a_seam_that_opens_at_the_mouth_is_none() -> None:
    head = opened(9.0, eyes=ABOVE)
    assert len(texts(head, plain.line_of_lips(0.0, 20.0))) == 1
    assert texts(head, plain.line_of_lips(0.0, 60.0)) == []


def test_a_seam_that_slides_along_itself_stays_shut() -> None:
    head = opened(0.0, eyes=ABOVE)
    head.head.parts[1].moves["mouthLeft"] = np.tile(np.float32([0, 8.0, 0]), (len(head.rest[1]), 1))  # type: ignore[attr-defined]
    head.__dict__["claimed"] = ("mouthLeft",)
    found = texts(head)  # but for its ends, from which the neighbour has slid away
    assert len(found) == 1 and "4.0 mm or more" in found[0]
    kept = borders.find_borders(head)
    at = kept.at(head.posed({"mouthLeft": 1.0}))
    distance, _ = kept.network.nearest(at, np.arange(len(kept.part)), 4.0, 1.2)
    inner = kept.sewn & (np.abs(at.mean(axis=1)[:, 1]) < 30.0)
    assert distance[inner].max() < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_components_are_those_of_scipy(seed: int) -> None:
    links = np.random.default_rng(seed).integers(0, 60, (45, 2))
    _, wanted = connected_components(coo_array((np.ones(45), links.T), (60, 60)), directed=False)
    label = joined(60, *np.ascontiguousarray(links.T))
    assert [label[k] for k in range(60)] == [int(np.flatnonzero(wanted == wanted[k])[0]) for k in range(60)]
    assert joined(3, *np.zeros((2, 0), np.int64)).tolist() == [0, 1, 2]


def test_chains_are_edges_that_share_ends() -> None:
    ids = np.array([[0, 1], [5, 6], [1, 2], [6, 7], [8, 9]])
    assert [c.tolist() for c in borders._find_chains(ids)] == [[0, 2], [1, 3], [4]]
    assert borders._find_chains(np.zeros((0, 2), np.int64)) == []


def test_ends_that_lie_together_are_one() -> None:
    at = np.array([[[0.0, 0, 0], [5, 0, 0]], [[5.2, 0, 0], [9, 0, 0]], [[9.5, 0, 0], [12, 0, 0]]]) + 30.0
    pairs = np.array([[4, 7], [9, 2], [11, 3]])
    found = borders.Borders(
        np.zeros(3, int), pairs, pairs, np.zeros(3, bool), np.full(3, -1), Network(pairs, np.zeros(3))
    )
    joined = borders._join_ends(found, at, np.arange(3), 0.4)
    assert joined[0, 1] == joined[1, 0] and len(set(joined.ravel().tolist())) == 5
    assert len(borders._join_ends(found, at, np.array([0, 2]), 0.4)) == 2
    assert borders._join_ends(found, at, np.zeros(0, np.int64), 0.4).shape == (0, 2)


def test_loose_ends_of_a_rim_that_a_seam_divides_are_one() -> None:
    """Two halves of a rim, 1 mm apart at one end and 2 at the other, and an edge far away."""
    points = np.array([[0, 0, 0], [9, 9, 0], [9, 9, 0], [20, 0, 0], [0, -1, 0], [20, -2, 0], [60, 0, 0], [70, 0, 0]])
    ends = np.array([[0, 1], [1, 2], [3, 4], [5, 6]])
    joined = borders._join_loose(ends, points.astype(np.float64), 3.0)
    assert [c.tolist() for c in borders._find_chains(joined)] == [[0, 1, 2], [3]]
    assert [c.tolist() for c in borders._find_chains(borders._join_loose(ends, 1.6 * points, 3.0))] == [[0, 1, 2], [3]]
    apart = borders._join_loose(ends, 4.0 * points, 3.0)
    assert [c.tolist() for c in borders._find_chains(apart)] == [[0, 1], [2], [3]]
    assert borders._join_loose(ends[:0], points[:0].astype(np.float64), 3.0).shape == (0, 2)
    around = np.array([[0, 0, 1], [1, 0, 1], [1, 0, 1], [0, 1, 1], [0, 1, 1], [0, 0, 1]])  # a closed loop beside an end
    loop = np.array([[7, 8], [8, 9], [9, 7]])
    both = borders._join_loose(np.vstack([ends, loop]), np.vstack([points, around]).astype(np.float64), 3.0)
    assert [c.tolist() for c in borders._find_chains(both)] == [[0, 1, 2], [3], [4, 5, 6]]


def test_sheets_are_joined_by_triangles_and_by_seams() -> None:
    head = plain.subject(sheet("a", (0, 40)), sheet("b", (40, 80)), sheet("c", (100, 120)))
    label = borders._find_sheets(head, borders.find_borders(head))
    first, second, third = np.split(label, np.cumsum([len(r) for r in head.rest])[:-1])
    assert set(first) == set(second) == {0} and set(third) == {len(first) + len(second)}


def ragged(length: float) -> Subject:
    """A sheet whose upper border has teeth of very short edges, each ``length`` mm long."""
    x = np.concatenate([np.arange(-40.0, -5.0, 4.0), np.arange(-5.0, 5.0, length), np.arange(5.0, 41.0, 4.0)])
    upper = np.column_stack([x, np.where(np.arange(len(x)) % 2, 40.0, 40.0 - 0.3 * length), np.zeros(len(x))])
    lower = np.column_stack([x, np.full(len(x), 0.0), np.zeros(len(x))])
    a = np.arange(len(x) - 1)
    b, up = a + 1, len(x)
    triangles = np.vstack([np.column_stack([a, b, b + up]), np.column_stack([a, b + up, a + up])])
    return plain.subject(plain.part("face", np.vstack([lower, upper]), triangles), eyes=ABOVE)


@pytest.mark.parametrize("length", [0.15, 0.3, 3.0])
def test_a_border_of_very_short_edges_is_not_sewn_to_itself(length: float) -> None:
    """The edge after the next lies within the reach of a seam, and the border would fall into pieces, all but one of
    them holes."""
    head = ragged(length)
    found = borders.find_borders(head)
    assert not found.sewn.any()
    assert len(list(borders._find_loops(head, found))) == 0 and texts(head) == []


def behind(part: str) -> Subject:
    """A sheet of skin with a hole, in front of or behind a whole one."""
    hole = holed((8, 28), (40, 52), 0.0 if part == "front" else -20.0)
    whole = plain.part("over", *plain.sheet((-90, 90), (-90, 90), 4.0, -20.0 if part == "front" else 0.0))
    return plain.subject(hole, whole)


def test_a_hole_under_other_skin_is_none() -> None:
    assert len(texts(behind("front"))) == 1
    assert texts(behind("back")) == []


def test_where_the_skin_of_a_mesh_ends_is_a_warning() -> None:
    points, triangles = plain.sheet((-80, 80), (-80, 80), 4.0)
    ended = plain.without(points, triangles, (-40, 40), (0, 60))
    ear = plain.sheet((-80, 80), (-80, 80), 4.0, 30.0)
    lobe = plain.part("ear", ear[0] + [300.0, 0, 0], plain.without(*ear, (8, 28), (40, 52)))
    for faces, warned in ((ended, True), (triangles, False)):
        head = plain.subject(plain.part("face", points, faces), lobe, eyes=ABOVE)
        found = list(borders.holes(head, None, Places(head, None), borders.find_borders(head)))
        assert [f.warning for f in found] == [warned] * len(found) and len(found) == 1 + warned


def test_a_hole_is_looked_at_from_eight_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[float, float]] = []
    turned = borders.view_rotation

    def look(yaw: float, pitch: float) -> np.ndarray:
        asked.append((yaw, pitch))
        return turned(yaw, pitch)

    class Blind:
        def __init__(self, *_: object) -> None:
            pass

        def draw(self, shapes: list[object]) -> SimpleNamespace:
            return SimpleNamespace(parts=np.zeros((3, 3), int))

    monkeypatch.setattr(borders, "view_rotation", look)
    monkeypatch.setattr(borders, "View", Blind)
    at = np.array([[0.0, 0, 0], [9, 0, 0], [9, 9, 0]])
    ends = np.stack([at, np.roll(at, -1, axis=0)], axis=1)
    subject = SimpleNamespace(rest=None, shapes=lambda rest: [None])
    assert not borders.is_seen(subject, SimpleNamespace(material="skin"), ends)  # type: ignore[arg-type]
    assert asked == [(0, 0), (60, 0), (-60, 0), (120, 0), (-120, 0), (180, 0), (0, -60), (0, 60)]
