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
