"""T-splines with star points: B-splines by definition away from them, limits of subdivision at them, no cracks."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from relief import CELLS, bulge, cube_grips, cube_tsm
from scipy.spatial import cKDTree

from surface import SurfaceFileError
from surface.readers import NamedSurface, read_surface, summary, tcharts
from surface.readers.inversion import invert
from surface.readers.starpatch import COUNT, Sampled
from surface.readers.tcharts import outlines


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> NamedSurface:
    file = tmp_path_factory.mktemp("cube") / "cube.tsm"
    file.write_text(cube_tsm())
    (item,) = read_surface(file)
    return item


def loop_points(item: NamedSurface, per_unit: int = 8) -> list[np.ndarray]:
    """Places along every loop, at equal parts of the knot intervals."""
    out = []
    for loop in item.domain.loops:
        ring = np.asarray(loop)
        rows = [
            a + (b - a) * t
            for a, b in pairwise([*ring, ring[0]])
            for t in np.linspace(0, 1, round(np.abs(b - a).max()) * per_unit, endpoint=False)[:, None]
        ]
        inside = np.array(rows)
        middle = 0.5 * (inside.min(axis=0) + inside.max(axis=0))
        out.append(item.surface.evaluate(inside + 1e-11 * (middle - inside)))
    return out


@pytest.mark.slow
def test_away_from_star_points_it_is_the_b_spline(cube: NamedSurface) -> None:
    share = np.array([1, 23, 23, 1]) / 48  # of a uniform cubic in the middle of a span
    wanted = []
    for axis in range(3):
        grid = [[bulge(tuple(np.insert((i, j), axis, CELLS))) for j in range(1, 5)] for i in range(1, 5)]
        wanted.append(np.einsum("i,j,ijc->c", share, share, np.array(grid)))
    _, distance = invert(cube.surface, np.array(wanted))
    assert distance.max() < 1e-9


def test_across_an_edge_of_the_cube_it_is_still_the_b_spline(cube: NamedSurface) -> None:
    rows = [(2, CELLS), (1, CELLS), (0, CELLS), (0, CELLS - 1)]  # x, y: over the edge x = 0 of the side y = CELLS
    grid = np.array([[bulge((x, y, z)) for z in range(1, 5)] for x, y in rows])
    share = np.array([1, 23, 23, 1]) / 48
    _, distance = invert(cube.surface, np.einsum("i,j,ijc->c", share, share, grid)[None])
    assert distance.max() < 1e-9


def test_star_points_are_where_subdivision_ends(cube: NamedSurface) -> None:
    places, quads = cube_grips()
    corner = places.index((0, 0, 0))
    own = [q for q in quads if corner in q]
    beside = {v for q in own for v in (q[q.index(corner) - 1], q[(q.index(corner) + 1) % 4])}
    across = [q[(q.index(corner) + 2) % 4] for q in own]
    at = np.array([bulge(p) for p in places])
    limit = (9 * at[corner] + 4 * at[list(beside)].sum(axis=0) + at[across].sum(axis=0)) / 24  # valence 3
    every = np.concatenate(loop_points(cube))
    assert len(own) == 3
    assert np.sort(np.linalg.norm(every - limit, axis=1))[:3] == pytest.approx([0, 0, 0], abs=1e-7)


def test_charts_meet_without_cracks(cube: NamedSurface) -> None:
    every = np.concatenate(loop_points(cube))
    distance, _ = cKDTree(every).query(every, k=2)  # each place has itself, and its like on the other side
    assert distance[:, 1].max() < 1e-7


def test_the_deviation_is_small_and_told(cube: NamedSurface) -> None:
    assert 0 < cube.deviation < 0.3
    assert f"fitted near star points within {cube.deviation:.3g}" in summary(cube)


def test_control_points_follow_the_grips(cube: NamedSurface) -> None:
    ties = cube.ties
    assert ties is not None and len(ties.points) == len(cube_grips()[0]) and ties.count == cube.surface.n
    np.testing.assert_allclose(ties.apply(ties.points), cube.surface.points, atol=1e-12)
    np.testing.assert_allclose(ties.apply(np.ones((len(ties.points), 1))), 1.0, atol=1e-12)


def test_outlines_of_joined_rectangles() -> None:
    rects = [(0.0, 1.0, 0.0, 1.0), (1.0, 3.0, 0.0, 2.0), (0.0, 1.0, 2.0, 3.0)]
    rings = outlines(rects, 1e-9)
    area = [0.5 * float(r[:, 0] @ np.roll(r[:, 1], -1) - r[:, 1] @ np.roll(r[:, 0], -1)) for r in rings]
    assert sorted(area) == [1.0, 5.0]
    assert sorted(len(r) for r in rings) == [4, 6]


def test_a_crease_inside_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.tsm"
    file.write_text(cube_tsm() + "ec 3 0\n")
    with pytest.raises(SurfaceFileError, match="edge 3 is creased inside"):
        read_surface(file)


def test_a_face_that_is_no_rectangle_is_named(tmp_path: Path) -> None:
    text = cube_tsm().replace("e 0 1\n", "e 0 2\n", 1)
    file = tmp_path / "a.tsm"
    file.write_text(text)
    with pytest.raises(SurfaceFileError, match=r"line \d+: knot intervals on opposite sides of face \d+ do not add up"):
        read_surface(file)


def inside_limit(item: NamedSurface, at: np.ndarray) -> np.ndarray:
    """(k, 3) the surface at places (k, 2) on its loops, from inside."""
    out = np.full((len(at), 3), np.nan)
    for way in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        beside = at + 1e-9 * np.array(way)
        known = item.domain.inside(beside) & np.isnan(out[:, 0])
        out[known] = item.surface.evaluate(beside[known])
    return out


def test_seams_lie_along_all_borders_and_are_one_line_in_space(cube: NamedSurface) -> None:
    length = sum(np.abs(np.diff(line, axis=0)).sum() for pair in cube.seams for line in pair)
    around = sum(np.abs(np.asarray(loop) - np.roll(loop, 1, axis=0)).sum() for loop in cube.domain.loops)
    assert length == pytest.approx(around)  # the form is closed
    share = np.linspace(0.0, 1.0, 5)[:, None]
    for pair in cube.seams:
        places = [np.concatenate([a + share * (b - a) for a, b in pairwise(line)]) for line in pair]
        first, second = (inside_limit(cube, at) for at in places)
        np.testing.assert_allclose(first, second, atol=1e-6)


def test_corners_follow_seams_and_all_places_of_one_follow_the_same(cube: NamedSurface) -> None:
    corners = [k for k, (line, _) in enumerate(cube.seams) if np.array_equal(line[0], line[-1]) and len(line) == 2]
    assert corners == list(range(corners[0], len(cube.seams)))
    leads = {tuple(cube.seams[k][0][0]) for k in corners}
    followers = [tuple(cube.seams[k][1][0]) for k in corners]
    assert len(set(followers)) == len(followers) and not leads & set(followers)
    at = [inside_limit(cube, np.array(places)) for places in (list(leads), followers)]
    assert cKDTree(at[0]).query(at[1])[0].max() < 1e-6


def test_charts_lie_further_apart_than_a_face_is_wide(cube: NamedSurface) -> None:
    boxes = sorted((np.min(loop, axis=0)[0], np.max(loop, axis=0)[0]) for loop in map(np.asarray, cube.domain.loops))
    ends = np.maximum.accumulate([high for _, high in boxes])
    apart = [low - end for (low, _), end in zip(boxes[1:], ends, strict=False) if low > end]
    assert len(apart) > 20 and min(apart) >= 1.0


@pytest.mark.slow
def test_short_knot_intervals_are_scaled_and_the_form_stays(tmp_path: Path) -> None:
    text, found = cube_tsm(2), []
    for length in ("1", "0.001"):
        rows = [f"{row[:-2]} {length}" if row.startswith("e ") else row for row in text.splitlines()]
        (tmp_path / "cube.tsm").write_text("\n".join(rows) + "\n")
        found += read_surface(tmp_path / "cube.tsm")
    assert found[0].domain.rect == pytest.approx(found[1].domain.rect)
    np.testing.assert_allclose(found[0].surface.points, found[1].surface.points, atol=1e-9)


def test_a_patch_is_clamped_over_its_own_width_and_height() -> None:
    link = SimpleNamespace(edge=0)
    sheet = tcharts._Sheet(SimpleNamespace(file=SimpleNamespace(edges={0: 1.0, 1: 3.0}, links={0: link})))  # type: ignore[arg-type]
    sheet._add_sides = lambda *_: None  # type: ignore[method-assign]
    sheet._next = 10.0
    samples = np.ones((COUNT, COUNT, 1))
    off = sheet.add_patch(7, Sampled([5], (2.0, 8.0), samples, samples), {5: np.array([1.0, 2.0, 3.0])})
    assert off == pytest.approx(0.0, abs=1e-12) and sheet._count == 1
    assert sheet._ties == [{5: pytest.approx(1.0)}] * 49 and sheet._weights == [1.0] * 49
    for axis, size, low in ((0, 2.0, 10.0), (1, 8.0, 0.0)):
        line = [0.0, 0, 0, 0, 0.25 * size, 0.5 * size, 0.75 * size, size, size, size, size]
        windows = np.array([line[k : k + 5] for k in range(7)]) + low
        own = np.repeat(windows, 7, axis=0) if axis == 0 else np.tile(windows, (7, 1))
        np.testing.assert_allclose(sheet._knots[axis], own)
    np.testing.assert_allclose(sheet._loops[0], [[10, 0], [12, 0], [12, 8], [10, 8]])
    assert sheet._next == pytest.approx(12.0 + tcharts.GAP * 2.0)
