"""Seams between charts."""

import numpy as np
from scipy.sparse import csr_matrix

from surface.fit.features.joins import find_seams
from surface.fit.source.chart import Chart


def chart(*loops: list[int], offset: float = 0.0) -> Chart:
    """Loops of vertices; vertex k has (u, v) = (k, offset)."""
    ids = [np.array(loop) for loop in loops]
    uv = [np.column_stack([i.astype(float), np.full(len(i), offset)]) for i in ids]
    none = np.zeros(0)
    return Chart(np.zeros((0, 2)), csr_matrix((0, 0)), none, np.zeros((0, 2)), none.astype(bool), uv, ids)


def test_two_parts_share_a_run_in_opposite_directions():
    (seam,) = find_seams({"a": chart([1, 2, 3, 4, 5]), "b": chart([4, 3, 2, 9, 8], offset=7.0)})
    assert (seam.part_a, seam.part_b) == ("a", "b")
    assert seam.uv_a[:, 0].tolist() == [2, 3, 4]
    assert seam.uv_b[:, 0].tolist() == [2, 3, 4]
    assert (seam.uv_b[:, 1] == 7.0).all()


def test_a_run_over_the_first_point_of_a_loop_is_one_run():
    (seam,) = find_seams({"a": chart([3, 4, 5, 6, 1, 2]), "b": chart([4, 3, 2, 1, 9])})
    assert seam.uv_a[:, 0].tolist() == [1, 2, 3, 4]
    assert seam.uv_b[:, 0].tolist() == [1, 2, 3, 4]


def test_a_whole_hole_filled_by_another_part():
    (seam,) = find_seams({"a": chart([90, 91, 92], [1, 2, 3, 4]), "b": chart([4, 3, 2, 1])})
    assert seam.uv_a[:, 0].tolist() == [1, 2, 3, 4, 1]
    np.testing.assert_array_equal(seam.uv_a, seam.uv_b)


def test_a_cut_within_one_chart():
    (seam,) = find_seams({"a": chart([1, 2, 3, 4, 3, 2, 1, 8, 9])})
    assert {seam.part_a, seam.part_b} == {"a"}
    assert seam.uv_a[:, 0].tolist() == [1, 2, 3, 4]


def test_parts_that_do_not_touch_have_no_seam():
    assert find_seams({"a": chart([1, 2, 3]), "b": chart([4, 5, 6])}) == []


def test_seams_hold_every_edge_that_two_loops_share_once_and_in_order():
    """Loops of random parts of a ring of vertices; brute force over all edges is the oracle."""
    rng = np.random.default_rng(0)
    counted = 0
    for _ in range(60):
        own = rng.permutation(12)
        loops = {"a": [list(own)], "b": []}
        first, length = int(rng.integers(12)), int(rng.integers(3, 12))
        run = [int(own[(first + k) % 12]) for k in range(length)]
        spare = [100, 101]
        turned = int(rng.integers(length + 2))
        other = (run[:: rng.choice([-1, 1])] + spare)[::1]
        loops["b"].append(other[turned:] + other[:turned])
        edges = [{frozenset(e) for e in zip(x, x[1:] + x[:1], strict=True)} for x in (loops["a"][0], loops["b"][0])]
        both = {frozenset(map(float, e)) for e in edges[0] & edges[1]}
        seams = find_seams({"a": chart(loops["a"][0]), "b": chart(loops["b"][0], offset=5.0)})
        found = [frozenset(e) for s in seams for e in zip(s.uv_a[:-1, 0], s.uv_a[1:, 0], strict=True)]
        assert len(found) == len(both) and set(found) == both
        assert len(seams) == 1  # one run
        for seam in seams:
            np.testing.assert_array_equal(seam.uv_a[:, 0], seam.uv_b[:, 0])
        counted += len(found)
    assert counted > 200


def test_two_runs_of_the_same_loops_are_two_seams():
    seams = find_seams({"a": chart([1, 2, 3, 50, 4, 5, 6, 51]), "b": chart([6, 5, 4, 60, 3, 2, 1, 61])})
    assert sorted(s.uv_a[:, 0].tolist() for s in seams) == [[1, 2, 3], [4, 5, 6]]
    three = find_seams({"a": chart([1, 2, 9]), "b": chart([2, 1, 8]), "c": chart([1, 2, 7])})
    assert three == []  # an edge of three is no seam
