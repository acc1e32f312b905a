"""Seams show no crack, whatever the pose."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.head import Head
from surface.head.model.data import Seam
from surface.head.posing.part import border_edges
from surface.head.posing.seams import OVERLAP_MM, SeamStitch, _vertices_around


def border_points(p, x: float) -> np.ndarray:
    ids = np.unique(border_edges(p.triangles))
    at = p.vertices[ids]
    return at[np.abs(p.uv[ids, 0] - x) < 1e-6]


def off_polyline(points: np.ndarray, line: np.ndarray) -> float:
    line = line[np.argsort(line[:, 1])]
    worst = 0.0
    for p in points:
        a, step = line[:-1], np.diff(line, axis=0)
        t = np.clip(((p - a) * step).sum(1) / np.maximum((step * step).sum(1), 1e-12), 0, 1)[:, None]
        worst = max(worst, float(np.linalg.norm(p - a - t * step, axis=1).min()))
    return worst


def head() -> Head:
    bulge = all_points("mouthPucker", (0, 0, 0))
    bulge.moves[:, 2] = 10 * np.sin(np.linspace(0, 3, 25))
    return Head(small_head(parts=[part("a", -40, groups=[bulge]), part("b", 0.5), part("tooth", 100, "jaw")]))


def test_borders_meet_at_rest_and_posed():
    h = head()
    for values in ({}, {"mouthPucker": 1.0}, {"mouthPucker": 0.3, "headYaw": 1.0}):
        h.pose(h.values(values))
        a, b = border_points(h.part("a"), 1.0), border_points(h.part("b"), 0.0)
        assert len(a) > 2 and len(b) > 2
        assert off_polyline(b, a) < 1e-4
        assert off_polyline(a, b) < 1e-4


def test_slivers_use_vertices_that_are_there():
    p = head().part("b")
    assert p.triangles.max() < len(p.vertices) == len(p.normals) == len(p.uv)


def test_normals_go_over_the_seam_smoothly():
    h = head()
    h.pose(h.values({"mouthPucker": 1.0}))
    assert np.allclose(np.linalg.norm(h.part("b").normals, axis=1), 1.0, atol=0.05)


def test_a_seam_reports_what_it_wrote():
    h = head()
    h.pose(h.values({"mouthPucker": 1.0}))
    assert h.part("b").changed == [(0, len(h.part("b").vertices))]
    h.pose(h.values({"mouthPucker": 1.0}))
    assert all(not p.changed for p in h.parts)


def test_a_seam_writes_to_the_arrays_that_its_parts_have_now():
    h = head()
    h.pose(h.values({"mouthPucker": 1.0}))
    one, two = h.parts[:2]
    before = two.vertices
    two.vertices, two.normals = two.vertices + np.float32(1.0), two.normals.copy()
    moved = two.vertices.copy()
    one.changed = [(0, len(one.vertices))]
    for stitch in h.stitches:
        stitch.close()
    assert np.abs(two.vertices - before).max() > 0.9 and (two.vertices != moved).any()
    np.testing.assert_array_equal(two.vertices[h.stitches[0].ids], before[h.stitches[0].ids])


def test_a_seam_off_the_border_is_none():
    data = small_head()
    far = data.seams[0].uv_a * 0.2 + 0.4
    (stitch,) = Head(replace(data, seams=[replace(data.seams[0], uv_a=far, uv_b=far)])).stitches
    assert [len(a) for a in (stitch.ids, stitch.low, stitch.high, stitch.share)] == [0] * 4
    stitch.close()


def test_a_closed_line_goes_on_at_both_ends_and_an_open_one_does_not() -> None:
    ids, at = np.array([7, 3, 9]), np.array([0.5, 1.5, 2.5])
    closed, opened = np.array([[0, 0], [1, 0], [1, 1], [0, 0.0]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    around_ids, around_at = _vertices_around(ids, at, closed)
    assert around_ids.tolist() == [9, 7, 3, 9, 7] and around_at.tolist() == [-0.5, 0.5, 1.5, 2.5, 3.5]
    same_ids, same_at = _vertices_around(ids, at, opened)
    assert same_ids.tolist() == [7, 3, 9] and same_at.tolist() == [0.5, 1.5, 2.5]
    assert len(_vertices_around(ids[:0], at[:0], closed)[0]) == 0


class Patch:
    """What a seam needs of a part: triangles in the plane, whose (u, v) are their places at rest."""

    def __init__(self, places: list[tuple[float, float]], triangles: list[list[int]]) -> None:
        uv = np.array(places)
        self.mesh, self.changed, self.touched = SimpleNamespace(uv=uv), True, 0
        self.vertices = np.column_stack([uv, 0 * uv[:, 0]]).astype(np.float32)
        self.normals = np.tile(np.float32([0, 0, 1]), (len(uv), 1))
        self.triangles = np.array(triangles)
        self.borders = border_edges(self.triangles)

    def append(self, like: np.ndarray, triangles: np.ndarray) -> None:
        self.vertices = np.vstack([self.vertices, self.vertices[like]])
        self.normals = np.vstack([self.normals, self.normals[like]])
        self.triangles = np.vstack([self.triangles, triangles])

    def touch(self) -> None:
        self.touched += 1

    def areas(self) -> np.ndarray:
        a, b, c = (self.vertices[self.triangles[:, k], :2].astype(float) for k in range(3))
        return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


HEIGHTS = [0.0, 0.2, 0.4, 0.5, 0.9, 1.0]


@pytest.mark.parametrize("reversed_", [False, True])
def test_slivers_fill_exactly_what_lies_between_a_fine_border_and_a_coarse_one(reversed_: bool) -> None:
    """The first patch has six vertices along the seam at x = 0, the second three; then the seam bows."""
    ends = len(HEIGHTS)
    first = Patch([*((0.0, v) for v in HEIGHTS), (-1.0, 0.5)], [[ends, k, k + 1] for k in range(ends - 1)])
    corners = [[0, 3, 1], [1, 3, 2]]
    corners = [t[::-1] for t in corners] if reversed_ else corners
    second = Patch([(0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.5)], corners)
    line = np.array([[0.0, v] for v in np.linspace(0, 1, 5)])
    stitch = SeamStitch(Seam("a", "b", line, line), first, second)
    assert len(second.vertices) == 7 and len(second.triangles) == 5  # three of the first's stand between
    first.vertices[:ends, 0] = [0.0, -0.1, -0.3, -0.2, -0.25, 0.0]
    first.normals[2] = [1.0, 0.0, 0.0]
    stitch.close()
    border = first.vertices[:ends, :2].astype(float)
    ring = np.vstack([border[::-1], [[1.0, 0.5]]])
    whole = 0.5 * abs((ring[:, 0] * np.roll(ring[:, 1], -1) - np.roll(ring[:, 0], -1) * ring[:, 1]).sum())
    areas = second.areas() * (-1 if reversed_ else 1)
    assert areas.sum() == pytest.approx(whole, rel=1e-5)
    edges = second.vertices[np.unique(border_edges(second.triangles)), :2]
    assert np.abs(border[:, None] - edges).max(axis=2).min(axis=1).max() < 1e-5
    directed = second.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    at = np.flatnonzero(np.abs(second.vertices[:, :2] - border[2]).max(axis=1) < 1e-6)
    assert second.normals[at].tolist() == [[1.0, 0.0, 0.0]]
    assert second.touched == 1
    first.changed = second.changed = False
    stitch.close()
    assert second.touched == 1


def test_vertices_between_two_of_the_first_part_are_put_on_its_edge() -> None:
    first = Patch([(0.0, 0.0), (0.0, 1.0), (-1.0, 0.5)], [[2, 0, 1]])
    second = Patch([(0.0, 0.0), (0.0, 0.25), (0.0, 1.0), (1.0, 0.5), (0.0, 1.2)], [[0, 3, 1], [1, 3, 2], [2, 3, 4]])
    line = np.array([[0.0, 0.0], [0.0, 0.5], [0.0, 1.0]])
    stitch = SeamStitch(Seam("a", "b", line, line), first, second)
    assert stitch.ids.tolist() == [0, 1, 2]  # the last one of the second lies beyond the seam
    np.testing.assert_allclose(stitch.share, [0.0, 0.25, 1.0], atol=1e-6)
    assert set(zip(stitch.low.tolist(), stitch.high.tolist(), strict=True)) == {(0, 1)}
    first.vertices[1] = [0.5, 2.0, 0.0]
    stitch.close()
    over = OVERLAP_MM * np.array([-2.0, 0.5]) / np.hypot(2.0, 0.5)  # beyond the edge, where the first part lies
    np.testing.assert_allclose(second.vertices[:3, :2], [[0, 0], np.array([0.125, 0.5]) + over, [0.5, 2.0]], atol=1e-6)
    np.testing.assert_allclose(second.vertices[4, :2], [0.0, 1.2])


LINE = np.array([[0.0, v] for v in np.linspace(0, 1, 5)])


def test_what_lies_beyond_either_end_of_the_first_border_is_left_where_it_is() -> None:
    first = Patch([(0.0, 0.2), (0.0, 0.5), (0.0, 0.8), (-1.0, 0.5)], [[3, 0, 1], [3, 1, 2]])
    heights = [0.0, 0.1, 0.2, 0.6, 0.8, 0.9, 1.0]
    corner = len(heights)
    second = Patch([*((0.0, v) for v in heights), (1.0, 0.5)], [[k, corner, k + 1] for k in range(corner - 1)])
    stitch = SeamStitch(Seam("a", "b", LINE, LINE), first, second)
    assert stitch.ids[:3].tolist() == [2, 3, 4] and len(stitch.ids) == 4  # and a sliver's, at the first's 0.5
    first.vertices[:, 0] += 0.3
    stitch.close()
    assert second.vertices[:corner, 0] == pytest.approx([0, 0, 0.3, 0.3 - OVERLAP_MM, 0.3, 0, 0], abs=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("turned", [False, True])
def test_what_only_the_second_part_has_reaches_over_the_first_on_whichever_side_that_lies(
    side: float, turned: bool
) -> None:
    """Exactly on the edge it would be rounded to either side of it, and a picture would have holes."""
    triangle = [0, 1, 2] if turned else [2, 1, 0]
    first = Patch([(0.0, 0.0), (0.0, 1.0), (side, 0.5)], [triangle])
    second = Patch([(0.0, 0.0), (0.0, 0.3), (0.0, 1.0), (-side, 0.5)], [[0, 3, 1], [1, 3, 2]])
    SeamStitch(Seam("a", "b", LINE, LINE), first, second).close()
    assert second.vertices[:3, 0] == pytest.approx([0.0, side * OVERLAP_MM, 0.0], abs=1e-6)
    assert 0.01 <= OVERLAP_MM <= 0.03  # more than rounding, and nothing that is seen


def test_no_sliver_bridges_a_gap_in_the_second_border() -> None:
    first = Patch([*((0.0, v) for v in (0.0, 0.5, 1.0)), (-1.0, 0.5)], [[3, 0, 1], [3, 1, 2]])
    places = [(0.0, 0.0), (0.0, 0.3), (1.0, 0.1), (0.0, 0.7), (0.0, 1.0), (1.0, 0.9)]
    second = Patch(places, [[0, 2, 1], [3, 5, 4]])
    stitch = SeamStitch(Seam("a", "b", LINE, LINE), first, second)
    assert len(second.triangles) == 2 and len(second.vertices) == 6
    assert stitch.ids.tolist() == [0, 1, 3, 4]
    assert stitch.share == pytest.approx([0.0, 0.6, 0.4, 1.0], abs=1e-6)


@pytest.mark.parametrize(("off", "on"), [(0.0019, True), (0.0021, False)])
def test_vertices_up_to_two_thousandths_off_the_line_are_on_it(off: float, on: bool) -> None:
    first = Patch([(0.0, 0.0), (0.0, 1.0), (-1.0, 0.5)], [[2, 0, 1]])
    second = Patch([(0.0, 0.0), (off, 0.5), (0.0, 1.0), (1.0, 0.5)], [[0, 3, 1], [1, 3, 2]])
    stitch = SeamStitch(Seam("a", "b", LINE, LINE), first, second)
    assert (1 in stitch.ids) == on


def test_a_border_with_one_vertex_on_the_line_is_no_seam() -> None:
    first = Patch([(0.0, 0.5), (-1.0, 0.0), (-1.0, 1.0)], [[0, 2, 1]])
    second = Patch([(0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (1.0, 0.5)], [[0, 3, 1], [1, 3, 2]])
    assert len(SeamStitch(Seam("a", "b", LINE, LINE), first, second).ids) == 0
    second.triangles = np.zeros((0, 3), int)
    second.borders = border_edges(second.triangles)
    first = Patch([(0.0, 0.0), (0.0, 1.0), (-1.0, 0.5)], [[2, 0, 1]])
    stitch = SeamStitch(Seam("a", "b", LINE, LINE), first, second)
    assert [len(a) for a in (stitch.ids, stitch.low, stitch.high, stitch.share)] == [0] * 4


def test_vertices_nearer_than_a_ten_thousandth_of_a_step_are_one() -> None:
    """In points of the line, which has one every 0.25: 0.0001 of it is 0.000025 in v."""
    first = Patch([*((0.0, v) for v in (0.0, 0.500015, 0.75003, 1.0)), (-1.0, 0.5)], [[4, k, k + 1] for k in range(3)])
    second = Patch([(0.0, 0.0), (0.0, 0.5), (0.0, 0.75), (0.0, 1.0), (1.0, 0.5)], [[k, 4, k + 1] for k in range(3)])
    stitch = SeamStitch(Seam("a", "b", LINE, LINE), first, second)
    assert len(second.vertices) == 6 and len(stitch.ids) == 5  # only for the one 0.00003 beside the second's
    assert stitch.low[4] == stitch.high[4] == 2 and stitch.share[4] == 0.0
