"""Seams show no crack, whatever the pose."""

from dataclasses import replace

import numpy as np
from small_head import all_points, part, small_head

from surface.head import Head
from surface.head.posing.part import border_edges


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
