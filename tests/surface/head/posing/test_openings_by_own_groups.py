"""Lips that lie sealed open where a user's own groups, or points that the user moved, really part them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.head import Head, OwnGroup
from surface.head.posing.decimated_head import DecimatedHead

SHIPPED = Path(__file__).parents[4] / "configs/heads/ict"


@pytest.fixture
def head() -> Head:
    return Head.load(SHIPPED)


def lips_gap(head: Head, **pose: float) -> float:
    """How far the samples of the upper and the lower lip are apart in height at most, mm, on the posed surface."""
    head.pose(head.values(pose))
    contact = next(c for c in head.contacts if c.eye < 0)
    face = head.part(contact.part)
    surface = face.surface.with_points(face.control_points)
    upper, lower = (surface.evaluate(side.reshape(-1, 2)).reshape(*side.shape[:2], 3) for side in contact.places)
    return float((upper[..., 1].min(axis=1) - lower[..., 1].max(axis=1)).max())


def opening(head: Head) -> tuple[np.ndarray, Floats]:
    """Control points of the face that mouthLowerDown moves, and their moves on both sides together (k, 3)."""
    moves = np.zeros_like(head.part("face").rig.rest)  # type: ignore[attr-defined]
    for side in ("Left", "Right"):
        group = head.group(f"mouthLowerDown{side}")["face"]
        np.add.at(moves, group.ids, group.moves)
    ids = np.flatnonzero(moves.any(axis=1))
    return ids, moves[ids]


def test_an_own_group_opens_lips_as_far_as_it_moves_them(head: Head) -> None:
    ids, moves = opening(head)
    full = lips_gap(head, mouthLowerDownLeft=1.0, mouthLowerDownRight=1.0)
    assert full > 4.0
    head.add_groups([OwnGroup("gape", "face", ids, moves), OwnGroup("shut", "face", ids, -moves)])
    assert lips_gap(head, gape=1.0) == pytest.approx(full, abs=0.05)
    assert lips_gap(head, shut=-1.0) == pytest.approx(full, abs=0.05)
    assert lips_gap(head, gape=-1.0) < 0.3 and lips_gap(head, shut=1.0) < 0.3
    assert lips_gap(head, gape=0.1) < 0.3, "hardly anything opens no lips"
    assert lips_gap(head) < 0.3
    head.add_groups([])
    assert lips_gap(head, mouthLowerDownLeft=1.0, mouthLowerDownRight=1.0) == pytest.approx(full, abs=0.01)


def test_points_that_were_moved_at_rest_open_lips_until_they_are_moved_back(head: Head) -> None:
    ids, moves = opening(head)
    full, rig = lips_gap(head, mouthLowerDownLeft=1.0, mouthLowerDownRight=1.0), head.part("face").rig  # type: ignore[attr-defined]
    before = rig.rest[ids].copy()
    rig.rest[ids] += moves
    rig.invalidate()
    assert lips_gap(head) == pytest.approx(full, abs=0.05)
    rig.rest[ids] = before
    rig.invalidate()
    assert lips_gap(head) < 0.3


def test_a_small_move_of_ones_own_leaves_lips_together(head: Head) -> None:
    face = head.part("face")
    cheek = int(np.argmax(face.surface.points[:, 0]))
    head.add_groups([OwnGroup("cheek", "face", np.array([cheek]), np.array([[0.0, 5.0, 0.0]]))])
    assert lips_gap(head, cheek=1.0) == pytest.approx(lips_gap(head), abs=1e-6)


def test_the_decimated_head_opens_the_same_lips(head: Head) -> None:
    ids, moves = opening(head)
    head.add_groups([OwnGroup("gape", "face", ids, moves)])
    decimated = DecimatedHead(head, head.parts, "fast", {})
    values = head.values({"gape": 1.0})
    decimated.pose(values)
    head.pose(values)
    face = next(p for p in decimated.parts if p.part.name == "face")
    kept = head.part("face").vertices[face.kept]
    np.testing.assert_allclose(decimated.vertices[face.first : face.last], kept, atol=0.02)
