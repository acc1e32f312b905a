"""benchmarks/pose_bound.py: its shares are those of the vertices and lists of the head, and its sums are whole."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest
from small_head import small_head

from controller.base.paths import find_config
from surface.head import Head


@pytest.fixture
def bound(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("pose_bound")


def test_only_branches_with_a_vertex_that_moves_are_to_be_read(bound: ModuleType) -> None:
    """Of the two patches one moves; the other has a seam with it, which takes no sum."""
    head = Head(small_head())
    steps = bound.foresight(head, "mouthPucker")
    assert len(steps) == bound.STEPS
    weights, vertices, (moving, still) = steps[3]
    part, other = head.part("a"), head.part("b")
    assert len(still) == 0 and len(moving) > 0
    before, after = (part.surface.points + k / 8 * np.isin(np.arange(25), [11, 12, 13])[:, None] * [0.0, 0, 6]
                     for k in (3, 4))  # fmt: skip
    way = [part.surface.with_points(at).evaluate(part.mesh.uv) for at in (before, after)]
    moved = np.linalg.norm(way[1] - way[0], axis=1) > 2.5e-4
    start = part.deformation.mesh.cell_start
    assert moving.tolist() == [k for k in range(len(start) - 1) if moved[start[k] : start[k + 1]].any()]
    assert vertices == pytest.approx(moved.sum() / (len(part.mesh.uv) + len(other.mesh.uv)))
    work = part.deformation.weights_of_cells
    assert weights == pytest.approx(work[moving].sum() / (work.sum() + other.deformation.weights_of_cells.sum()))


def test_sums_of_branches_are_theirs_and_no_others(bound: ModuleType) -> None:
    head = Head(small_head())
    wanted = bound.placed(head, head.values({"mouthPucker": 0.5}))
    part, cells = head.part("a"), np.array([0], np.int32)
    rows = slice(*part.deformation.mesh.cell_start[:2])
    for p in bound.skins(head):
        p.vertices[:] = np.nan
    bound.Sums(head).compute([cells, cells[:0]])
    np.testing.assert_array_equal(part.vertices[rows], wanted[0][rows])
    assert np.isnan(part.vertices[rows.stop : len(wanted[0])]).all() and np.isnan(head.part("b").vertices).all()


def test_groups_reach_what_their_points_reach_and_less_without_small_moves(bound: ModuleType) -> None:
    head = Head(small_head())
    part = head.part("a")
    lists = part.deformation.lists
    cells = np.unique(np.concatenate([lists.entries_of(i)[0] for i in (11, 12, 13)]))
    work = [p.deformation.weights_of_cells for p in bound.skins(head)]
    share = work[0][cells].sum() / sum(w.sum() for w in work)
    assert bound.reached(head, "mouthPucker", 5.0) == pytest.approx(share) and share > 0.0
    assert bound.reached(head, "mouthPucker", 7.0) == 0.0


def test_times_of_what_is_left_are_measured(bound: ModuleType) -> None:
    whole, placing, sums = bound.least_times(Head(small_head()), "mouthPucker", 1)
    assert min(whole, placing, sums) > 0.0


def test_of_placing_only_contacts_are_needed_whose_samples_move(bound: ModuleType) -> None:
    head = Head.load(find_config("heads", "ict"))
    watched = bound.Placing(head)

    def needed(name: str) -> set[str]:
        return set(watched.needed(head.values({}), head.values({name: 0.5})))

    blink, yaw = needed("eyeBlinkLeft"), needed("headYaw")
    assert {"face: groups", "face: lids", "left_lids", "sockets: left_lids"} <= blink
    assert "face: groups" in yaw
    assert not {label for label in yaw if label.rpartition(": ")[2] in {"lips", "left_lids", "right_lids"}}
    assert 0.0 < watched.least_time("eyeBlinkLeft", 1) < 1e3
