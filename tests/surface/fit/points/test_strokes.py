"""Paint given by vertices becomes lines in (u, v)."""

from dataclasses import replace

import numpy as np
from slit_sheet import N, slit_sheet

from surface.fit.points.strokes import (
    PIECES,
    arc_length,
    evenly,
    make_paint,
    mirrored,
    smooth_line,
    uv_of,
    vertex_row,
)
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands

MESH = slit_sheet()
CHART = make_chart(MESH, find_islands(MESH), normalise=False)


def at(i: int, j: int) -> int:
    return i * (N + 1) + j


def test_a_vertex_is_found_in_the_chart():
    np.testing.assert_allclose(CHART.uv[vertex_row(CHART, at(3, 5))], [3 / N, 5 / N])


def test_points_on_the_mesh_are_found_in_uv():
    points = 0.5 * (MESH.vertices[at(3, 5)] + MESH.vertices[at(4, 5)])
    np.testing.assert_allclose(uv_of(CHART, MESH, points[None]), [[3.5 / N, 5 / N]], atol=0.2 / N)


def test_the_mirror_image_of_a_vertex():
    assert mirrored(CHART, MESH, np.array([at(3, 5)])).tolist() == [at(N - 3, 5)]
    steep = replace(MESH, vertices=MESH.vertices + [0, 0, 5] * MESH.vertices[:, [1]])  # depth counts as height does
    assert mirrored(CHART, steep, np.array([at(3, 5)])).tolist() == [at(N - 3, 5)]


def test_smooth_lines_pass_through_their_points():
    points = np.array([[0.0, 0], [1, 1], [2, 0], [3, 1]])
    np.testing.assert_allclose(smooth_line(points, closed=False)[::PIECES], points)
    np.testing.assert_allclose(smooth_line(points, closed=True)[::PIECES], points)
    assert len(smooth_line(points, closed=True)) == 4 * PIECES


def test_layers_of_absent_parts_are_dropped_and_mirrors_added():
    layers = [
        {"part": "face", "attribute": "gloss", "value": [1.0], "kind": "spots", "lines": [[at(3, 5)]],
         "feather": 0.1, "mirror": True},
        {"part": "nose", "attribute": "gloss", "value": [1.0], "kind": "all"},
        {"part": "face", "attribute": "occlusion", "value": [0.5], "kind": "hole", "hole": 0, "feather": 0.1},
    ]  # fmt: skip
    spots, hole = make_paint(layers, {"face": CHART}, MESH)
    assert [line[0] for line in spots["lines"]] == [
        [round(3 / N, 5), round(5 / N, 5)],
        [round(21 / N, 5), round(5 / N, 5)],
    ]
    assert "mirror" not in spots
    assert hole["kind"] == "region" and len(hole["lines"][0]) == 18


def test_a_straight_line_of_even_points_stays_straight_and_even_to_its_ends():
    points = np.array([[0.0, 0], [2, 1], [4, 2], [6, 3]])
    line = smooth_line(points, closed=False)
    np.testing.assert_allclose(line, np.linspace([0, 0], [6, 3], 3 * PIECES + 1), atol=1e-12)
    two = smooth_line(points[:2], closed=False)
    np.testing.assert_allclose(two, np.linspace([0, 0], [2, 1], PIECES + 1), atol=1e-12)


def test_a_smooth_line_has_no_kinks_and_passes_a_middle_by_its_four_neighbours():
    points = np.array([[0.0, 0], [1, 4], [5, 2], [6, 7], [9, 1]])
    for closed in (False, True):
        line = smooth_line(points, closed=closed)
        middle = line[PIECES + PIECES // 2]  # Catmull-Rom: (-1 9 9 -1) / 16 of the neighbours
        np.testing.assert_allclose(middle, (-points[0] + 9 * points[1] + 9 * points[2] - points[3]) / 16)
    first = line[PIECES // 2]
    np.testing.assert_allclose(first, (-points[4] + 9 * points[0] + 9 * points[1] - points[2]) / 16)
    last = line[4 * PIECES + PIECES // 2]
    np.testing.assert_allclose(last, (-points[3] + 9 * points[4] + 9 * points[0] - points[1]) / 16)


def test_points_along_a_line_are_evenly_far_apart():
    line = np.array([[0.0, 0], [3, 4], [3, 14], [0, 14]])
    np.testing.assert_allclose(arc_length(line), [0, 5, 15, 18])
    np.testing.assert_allclose(evenly(line, 4), [[0, 0], [3, 5], [3, 11], [0, 14]])
