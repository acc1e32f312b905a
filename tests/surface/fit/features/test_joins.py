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
