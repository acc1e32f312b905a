"""Parts of a head: the head's rotation, and what is reported as changed."""

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head, Neck
from surface.head.model.parameters import HEAD_RAD, rotation
from surface.head.posing.part import border_edges


@pytest.fixture
def head() -> Head:
    return Head(small_head(seams=[], neck=Neck((0.0, -50.0, 0.0), 0.0, -18.0, 10.0)))


def test_what_is_above_turns_whole_and_what_is_below_stays(head):
    p = head.part("a")
    rest, normals = p.vertices.copy(), p.normals.copy()
    head.pose(head.values({"headYaw": 1, "headRoll": 0.5}))
    turn = rotation(*(HEAD_RAD * [1, 0, 0.5]))
    pivot = np.array([0.0, -50, 0])
    high, low = rest[:, 1] > 10, rest[:, 1] < -18
    assert high.any() and low.any()
    np.testing.assert_allclose(p.vertices[high], (rest[high] - pivot) @ turn.T + pivot, atol=1e-4)
    np.testing.assert_allclose(p.normals[high], normals[high] @ turn.T, atol=1e-6)
    np.testing.assert_allclose(p.vertices[low], rest[low], atol=1e-5)
    np.testing.assert_allclose(
        np.linalg.norm(p.vertices - pivot, axis=1), np.linalg.norm(rest - pivot, axis=1), rtol=1e-5
    )


def test_rigid_parts_turn_whole(head):
    p = head.part("tooth")
    rest = p.vertices.copy()
    head.pose(head.values({"headPitch": 1}))
    pivot = np.array([0.0, -50, 0])
    np.testing.assert_allclose(p.vertices, (rest - pivot) @ rotation(0, HEAD_RAD[1]).T + pivot, atol=1e-4)


def test_a_turned_head_still_changes_little_by_little(head):
    head.pose(head.values({"headYaw": 0.4}))
    head.pose(head.values({"headYaw": 0.4, "mouthPucker": 1}))
    assert head.part("a").changed and not head.part("b").changed and not head.part("tooth").changed
    want = head.part("a").vertices.copy()
    head.pose(head.values({}))
    head.pose(head.values({"headYaw": 0.4, "mouthPucker": 1}))
    np.testing.assert_allclose(head.part("a").vertices, want, atol=1e-4)


def test_borders_are_edges_of_one_triangle():
    triangles = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
    assert {tuple(e) for e in border_edges(triangles).tolist()} == {(0, 1), (2, 0), (1, 3), (3, 2)}


def test_what_changed_is_reported_in_whole_and_once(head):
    tooth, sheet = head.part("tooth"), head.part("a")
    head.pose(head.values({"jawOpen": 0.5}))
    assert tooth.changed == [(0, len(tooth.vertices))] and sheet.changed == []
    head.pose(head.values({"jawOpen": 0.5}))
    assert tooth.changed == [] and sheet.changed == []
    head.pose(head.values({"jawOpen": 0.5, "headRoll": 0.2}))
    assert tooth.changed == [(0, len(tooth.vertices))] and sheet.changed == [(0, len(sheet.vertices))]
    np.testing.assert_allclose(tooth.turn, rotation(0.0, 0.0, 0.2 * HEAD_RAD[2]))
    head.pose(head.values({"jawForward": 1.0}))
    head.pose(head.values({"jawForward": 0.5}))
    assert tooth.changed


def test_control_points_are_those_of_the_pose(head):
    tooth, sheet = head.part("tooth"), head.part("a")
    head.pose(head.values({"jawForward": 0.5, "headYaw": 0.4}))
    np.testing.assert_allclose(tooth.control_points - tooth.surface.points, np.tile([0.0, 0.0, 4.0], (25, 1)))
    np.testing.assert_array_equal(sheet.control_points, sheet.surface.points)
    head.pose(head.values({"mouthPucker": 1.0}))
    moved = np.linalg.norm(sheet.control_points - sheet.surface.points, axis=1)
    assert np.flatnonzero(moved).tolist() == [11, 12, 13] and moved[12] == pytest.approx(6.0)


def test_added_vertices_are_copies_behind_the_parts_own(head):
    part = head.part("a")
    count, triangles = len(part.vertices), len(part.triangles)
    part.append(np.array([3, 1]), np.array([[0, 1, count]]))
    for name in ("vertices", "normals", "uv"):
        array = getattr(part, name)
        np.testing.assert_array_equal(array[count:], array[[3, 1]])
    assert {k: len(a) for k, a in part.attributes.items()} == {"albedo": count + 2}
    assert len(part.triangles) == triangles + 1 and part.triangles[-1].tolist() == [0, 1, count]


def test_a_part_that_was_never_posed_stands_at_rest(head):
    for posed in (head.part("tooth"), head.part("a")):
        data = next(p for p in head.data.parts if p.name == posed.name)
        part = type(posed)(data, head.data, posed.mesh, posed.surface, {})
        np.testing.assert_array_equal(part.control_points, part.surface.points)
        np.testing.assert_array_equal(part.turn, np.eye(3))
        np.testing.assert_allclose(part.vertices, posed.mesh.vertices, atol=1e-5)
        assert part.changed == [(0, len(part.vertices))] and part.stored is False
        assert part.share.shape == (len(part.vertices),)
    assert (head.part("tooth").share == 1.0).all()


def test_a_part_that_is_touched_has_changed_in_whole(head):
    part = head.part("b")
    part.changed = []
    part.touch()
    assert part.changed == [(0, len(part.vertices))]


def test_points_are_placed_without_moving_the_part(head):
    values = head.values({"jawForward": 0.5, "mouthPucker": 1.0, "headYaw": 1.0})
    before = {p.name: p.vertices.copy() for p in head.parts}
    placed = dict(zip((p.name for p in head.parts), head.place_points(values)[0], strict=True))
    for p in head.parts:
        np.testing.assert_array_equal(p.vertices, before[p.name])
    np.testing.assert_allclose(placed["tooth"], [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 4]], atol=1e-12)
    moved = placed["a"] - head.part("a").surface.points
    assert np.flatnonzero(moved.any(axis=1)).tolist() == [11, 12, 13] and moved[12, 2] == pytest.approx(6.0)
