"""surface.head.posing.influence"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import hills
from small_head import part as patch
from small_head import small_head

from surface.head import Head, Neck
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
    data = small_head(neck=Neck((0.0, -50.0, 0.0), 0.0, -18.0, 10.0))
    finer = replace(data.parts[1], budget=(0, 0.003, 6))
    head = Head(replace(data, parts=[data.parts[0], finer, data.parts[2]]))
    sums = Influence(head)
    stitch = head.stitches[0]
    own = sums.share[sums.part_start[1] + stitch.ids]
    first = sums.share[: sums.part_start[1]]
    assert first == pytest.approx(head.part("a").share, abs=1e-6) and 0.1 < first.mean() < 0.9
    low, high = first[stitch.low], first[stitch.high]
    assert len(own) > 5 and ((stitch.share > 0.1) & (stitch.share < 0.9)).any()
    assert own == pytest.approx(low + stitch.share * (high - low), abs=1e-6)


def test_sums_of_a_part_with_several_cells_and_uneven_weights() -> None:
    surface = hills(20, 60.0)
    weights = np.random.default_rng(4).uniform(0.4, 2.0, surface.n)
    ku, kv = surface.padded
    degrees = np.stack(surface.degrees, axis=1)
    fields = {"jaw": np.zeros(surface.n), "lids": np.zeros(surface.n), "knots_u": ku, "knots_v": kv}
    one = replace(patch("a", -40), points=surface.points.copy(), weights=weights, degrees=degrees, **fields)
    data = small_head(parts=[one], seams=[], paint=[])
    head = Head(data)
    assert len(head.parts[0].mesh.cell_start) > 5
    at, normals = summed(head, Influence(head), head.values({}))
    points, su, sv = head.parts[0].surface.derivatives(head.parts[0].mesh.uv)
    wanted = np.cross(su, sv)
    assert at == pytest.approx(points, abs=1e-4)
    assert (normals * wanted).sum(axis=1) == pytest.approx(np.linalg.norm(wanted, axis=1), rel=1e-4)


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_rigid_parts_keep_their_normals_whatever_side_they_face(turn: int) -> None:
    tooth = patch("tooth", 0, "jaw")
    data = small_head(parts=[replace(tooth, points=np.roll(tooth.points, turn, axis=1))], seams=[], paint=[])
    head = Head(data)
    facing = np.abs(head.parts[0].normals).mean(axis=0)
    assert facing.argmax() == (2 + turn) % 3 and facing.max() > 0.8
    values = head.values({"jawOpen": 0.6, "jawForward": 0.5})
    at, normals = summed(head, Influence(head), values)
    head.pose(values)
    assert at == pytest.approx(head.parts[0].vertices, abs=1e-4)
    assert (normals * head.parts[0].normals).sum(axis=1).min() > 0.9999


def test_sums_of_every_vertex_run_over_the_points_of_its_part() -> None:
    head = Head(small_head())
    sums = Influence(head)
    assert sums.points == 25 + 25 + 4
    assert sums.part_start.tolist() == np.cumsum([0, *(len(p.vertices) for p in head.parts)]).tolist()
    assert len(sums.start) == sums.part_start[-1] + 1 and sums.start[-1] == len(sums.ids) == len(sums.weights)
    seam = set((sums.part_start[1] + head.stitches[0].ids).tolist())
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


@pytest.mark.slow
def test_a_closed_part_is_summed_over_its_own_points():
    from relief import named, tube

    from surface.fit.surfaces import SurfaceOptions, head_of

    head = Head(head_of(named(tube=tube(60, 200)), name="h", options=SurfaceOptions(unit="mm")))
    sums = Influence(head)
    assert sums.points == 60 and sums.ids.max() < 60
    points, _ = head.place_points(head.values({}))
    rows = np.repeat(np.arange(len(sums.start) - 1), np.diff(sums.start))
    at = np.zeros((len(sums.start) - 1, 3))
    np.add.at(at, rows, sums.weights[:, :1] * points[0][sums.ids])
    np.testing.assert_allclose(at, head.parts[0].vertices, atol=1e-3)
