"""Seams show no crack, whatever the pose."""

from dataclasses import replace

import numpy as np
from small_head import all_points, part, small_head

from surface.head import Head
from surface.head.posing.part import border_edges
from surface.head.posing.seams import _around


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


def test_a_seam_off_the_border_is_none():
    data = small_head()
    far = data.seams[0].uv_a * 0.2 + 0.4
    (stitch,) = Head(replace(data, seams=[replace(data.seams[0], uv_a=far, uv_b=far)])).zippers
    assert [len(a) for a in (stitch.ids, stitch.low, stitch.high, stitch.share)] == [0] * 4
    stitch.close()


def test_a_closed_line_goes_on_at_both_ends_and_an_open_one_does_not() -> None:
    ids, at = np.array([7, 3, 9]), np.array([0.5, 1.5, 2.5])
    closed, opened = np.array([[0, 0], [1, 0], [1, 1], [0, 0.0]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    around_ids, around_at = _around(ids, at, closed)
    assert around_ids.tolist() == [9, 7, 3, 9, 7] and around_at.tolist() == [-0.5, 0.5, 1.5, 2.5, 3.5]
    same_ids, same_at = _around(ids, at, opened)
    assert same_ids.tolist() == [7, 3, 9] and same_at.tolist() == [0.5, 1.5, 2.5]
    assert len(_around(ids[:0], at[:0], closed)[0]) == 0
