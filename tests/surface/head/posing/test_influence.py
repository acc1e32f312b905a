"""surface.head.posing.influence"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head
from surface.head.posing.influence import Influence


def summed(head: Head, sums: Influence, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and unit normals of all vertices, before the head turns."""
    points = np.concatenate(head.place_points(values)[0])
    three = np.add.reduceat(sums.weights[:, :, None] * points[sums.ids][:, None, :], sums.start[:-1])
    normals = np.cross(three[:, 1], three[:, 2])
    return three[:, 0], normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("wanted", [{}, {"mouthPucker": 1.0}, {"jawOpen": 0.7, "mouthPucker": 0.4, "jawForward": 1.0}])
def test_sums_are_the_heads_own_vertices(wanted: dict[str, float]) -> None:
    head = Head(small_head())
    sums = Influence(head)
    values = head.values(wanted)
    at, normals = summed(head, sums, values)
    head.pose(values)
    assert at == pytest.approx(np.concatenate([p.vertices for p in head.parts]), abs=2e-4)
    own = np.concatenate([p.normals for p in head.parts])
    assert (normals * own).sum(axis=1).min() > 0.9999


def test_weights_of_a_position_add_up_and_of_a_derivative_cancel() -> None:
    head = Head(small_head())
    sums = Influence(head)
    skin = slice(0, int(sums.part_start[2]))  # the tooth's sums run over a motion, not over points
    total = np.add.reduceat(sums.weights, sums.start[:-1])[skin]
    assert total[:, 0] == pytest.approx(1.0, abs=1e-6)
    assert total[:, 1:] == pytest.approx(0.0, abs=1e-4)


def test_a_vertex_of_a_seam_takes_the_share_of_those_it_lies_between() -> None:
    head = Head(small_head())
    sums = Influence(head)
    stitch = head.zippers[0]
    own = sums.share[sums.part_start[1] + stitch.ids]
    first = sums.share[: sums.part_start[1]]
    low, high = first[stitch.low], first[stitch.high]
    assert len(own) > 5
    assert (own >= np.minimum(low, high) - 1e-6).all()
    assert (own <= np.maximum(low, high) + 1e-6).all()


def test_sums_of_every_vertex_run_over_the_points_of_its_part() -> None:
    head = Head(small_head())
    sums = Influence(head)
    assert sums.points == 25 + 25 + 4
    assert sums.part_start.tolist() == np.cumsum([0, *(len(p.vertices) for p in head.parts)]).tolist()
    assert len(sums.start) == sums.part_start[-1] + 1 and sums.start[-1] == len(sums.ids) == len(sums.weights)
    seam = set((sums.part_start[1] + head.zippers[0].ids).tolist())
    for part, (low, high) in enumerate([(0, 25), (25, 50), (50, 54)]):
        for vertex in range(sums.part_start[part], sums.part_start[part + 1]):
            ids = sums.ids[sums.start[vertex] : sums.start[vertex + 1]]
            assert len(ids) and (vertex in seam or (low <= ids.min() and ids.max() < high))
            if vertex not in seam:
                assert len(np.unique(ids)) == len(ids)
                assert np.abs(sums.weights[sums.start[vertex] : sums.start[vertex + 1]]).max(axis=1).min() > 0.0
    tooth = sums.start[sums.part_start[2] : -1]
    assert (sums.weights[tooth + 3] == [1.0, 0.0, 0.0]).all()


def test_normals_of_a_flipped_mesh_point_the_other_way() -> None:
    data = small_head(seams=[])
    flipped = replace(data.parts[0], points=data.parts[0].points * [-1.0, 1.0, 1.0])
    for part in (data.parts[0], flipped):
        head = Head(replace(data, parts=[part], paint=[]))
        _, normals = summed(head, Influence(head), head.values({}))
        assert (normals * head.parts[0].normals).sum(axis=1).min() > 0.999
