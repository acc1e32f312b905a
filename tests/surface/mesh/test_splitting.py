"""Which cells of a quad tree are quartered: by points, by chords, along loops, on either side of slits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapes

from surface import DCPSurface, Domain, Slit
from surface.mesh import splitting
from surface.mesh.quadtree import Lattice
from surface.mesh.splitting import Limits, SplitTests, inner_side

NONE = Limits(None, None, 6, 0, None, None)


def splitter(surface: DCPSurface, limits: Limits, domain: Domain | None = None, cells: int = 4) -> SplitTests:
    lines = np.linspace(0, 1, cells + 1)
    lattice = Lattice(lines, lines, limits.max_depth)
    return SplitTests(surface, domain or Domain((0, 1, 0, 1)), lattice, (100.0, 100.0), limits)


def grid(cells: int) -> np.ndarray:
    return np.argwhere(np.ones((cells, cells), dtype=bool))


def sharing_area(surface: DCPSurface, cells: int) -> np.ndarray:
    """(n,): control points whose subdomain has an area in common with each cell of a regular grid."""
    s, low = surface.supports, grid(cells) / cells
    high = low + 1 / cells
    across = (s[:, 0] < high[:, :1]) & (s[:, 1] > low[:, :1])
    return (across & (s[:, 2] < high[:, 1:]) & (s[:, 3] > low[:, 1:])).sum(axis=1)


def test_cells_with_more_points_than_wanted_are_quartered() -> None:
    surface = shapes.hills(7)  # knots at quarters: subdomains end where cells do
    counts = sharing_area(surface, 4)
    assert counts.min() == counts.max() == 16
    uneven = shapes.scattered(40, 3)
    for table in (surface, uneven):
        counts = sharing_area(table, 4)
        for most in sorted({int(counts.min()), int(counts.max()), 15, 16, 17}):
            chosen = splitter(table, NONE._replace(max_points=most)).split(0, grid(4))
            assert np.array_equal(chosen, counts > most), most


def test_cells_above_the_least_depth_are_quartered() -> None:
    tests = splitter(shapes.hills(7), NONE._replace(min_depth=2))
    assert tests.split(0, grid(4)).all() and tests.split(1, grid(8)).all()
    assert not tests.split(2, grid(16)).any()


def test_a_cylinder_is_quartered_until_its_sagitta_is_small() -> None:
    h = np.sqrt(0.5)
    net = np.array([[[10.0, 0, 0], [10, 0, 40]], [[10, 10, 0], [10, 10, 40]], [[0, 10, 0], [0, 10, 40]]])
    arc = DCPSurface.from_nurbs(2, 1, [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], net, np.array([[1, 1], [h, h], [1, 1]]))
    ends = arc.evaluate([[0.25, 0.0], [0.5, 0.0]])
    half = np.linalg.norm(ends[1] - ends[0]) / 2
    sagitta = 10 - np.sqrt(100 - half**2)
    for factor, expected in ((1.02, False), (0.9, True)):
        tests = splitter(arc, NONE._replace(chord_error=factor * sagitta))
        assert tests.split(0, np.array([[1, 2]]))[0] == expected


def test_errors_at_edges_and_in_the_middle() -> None:
    x, y = np.meshgrid([0.0, 1, 2], [0.0, 1, 2])
    flat = np.stack([x, y, 0 * x], axis=-1).reshape(9, 3)
    for k, expected in enumerate((0, 3, 0, 3, 3, 3, 0, 3, 0)):
        if k in (0, 2, 6, 8):
            continue
        points = flat.copy()
        points[k, 2] = 3.0
        assert splitting._chord_errors(points[None])[0] == pytest.approx(expected), k
    bowl = flat.copy()
    bowl[[2, 6], 2] = 4.0  # one diagonal passes through the middle, the other 4 above it
    bowl[[1, 3, 5, 7], 2] = 2.0
    assert splitting._chord_errors(bowl[None])[0] == pytest.approx(0)
    assert splitting._off_line(np.zeros((1, 3)), np.array([[5.0, 1, 0]]), np.array([[4.0, 0, 0]]))[0] == pytest.approx(
        np.sqrt(2)
    )


def test_a_point_between_the_samples_raises_the_error_of_its_cell() -> None:
    surface = shapes.hills(36)
    points = surface.points * np.array([1, 1, 0])
    points[12 * 36 + 25, 2] = 20.0
    tests = splitter(surface.with_points(points), NONE._replace(chord_error=1.0), cells=1)
    assert tests.split(0, np.array([[0, 0]])).all()
    flat = splitter(surface.with_points(points * [1, 1, 0]), NONE._replace(chord_error=1.0), cells=1)
    assert not flat.split(0, np.array([[0, 0]])).any()


def test_cells_outside_loops_are_left_and_those_along_them_follow() -> None:
    domain = Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.2)])
    tests = splitter(shapes.hills(7), NONE._replace(min_depth=1), domain, cells=8)
    tests.follow_loops(1e9)
    inside = np.abs(grid(8) + 0.5 - 4).max(axis=1) < 1
    away = np.hypot(*((grid(8) + 0.5) / 8 - 0.5).T) > 0.32
    chosen = tests.split(0, grid(8))
    assert chosen[inside].all() and not chosen[away].any()
    fine = splitter(shapes.hills(7), NONE, domain, cells=8)
    fine.follow_loops(0.02)
    on = np.unique(np.floor(np.asarray(domain.loops[0]) * 8).astype(int), axis=0)
    found = fine.split(0, grid(8))
    assert found[on[:, 0] * 8 + on[:, 1]].all()
    assert found.sum() == len(on)


def test_cells_that_are_partly_covered_are_quartered() -> None:
    knots = [[0.0, 0, 0.3, 0.3]]
    surface = DCPSurface([[0.0, 0, 0]], [1], knots, [[0.0, 0, 1, 1]])
    chosen = splitter(surface, NONE._replace(chord_error=1.0)).split(0, grid(4)).reshape(4, 4)
    assert np.array_equal(chosen.all(axis=1), [True, True, False, False])  # it vanishes at 0
    assert not chosen[2:].any()


def test_points_on_a_slit_take_the_side_of_their_cell() -> None:
    domain = Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, 0.2, 0.8), Slit("v", 0.25, 0.4, 0.6)])
    uv = np.array(
        [[[0.5, 0.5], [0.1, 0.5], [0.25, 0.5], [0.2, 0.5]], [[0.5, 0.5], [0.8, 0.5], [0.3, 0.3], [0.25, 0.5]]]
    )
    centre = np.array([[0.1, 0.4], [0.3, 0.6]])
    assert inner_side(uv, centre, domain).tolist() == [[2, 0, 3, 0], [0, 0, 0, 0]]


def test_millions_of_cells_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(splitting, "MAX_CELLS", 16)
    tests = splitter(shapes.hills(7), NONE)
    tests.split(0, grid(4))
    with pytest.raises(ValueError, match="max_depth: 17 cells at level 3; ask for a larger chord_error or max_points"):
        tests.split(3, grid(5)[:17])


def test_anchors_are_where_blending_functions_are_greatest() -> None:
    surface = DCPSurface(
        [[0.0, 0, 0], [1, 0, 0]], [1, 1], [[0.0, 0.2, 0.6, 1], [0, 1]], [[0.0, 0.1, 0.3, 0.8, 1], [0, 1]]
    )
    uv, points = splitting._anchors(surface, Domain((0, 1, 0, 1)))
    assert np.allclose(uv, [[0.4, 0.4], [0.5, 0.5]])
    assert np.allclose(points, surface.evaluate(uv))
    assert len(splitting._anchors(surface, Domain((0.45, 1, 0, 1)))[0]) == 1


@pytest.mark.parametrize(
    ("changes", "fits"),
    [
        ({"roots": (1, 4_000_000)}, True),
        ({"roots": (4_000_000, 1)}, True),
        ({"roots": (1, 4_000_001)}, False),
        ({"roots": (4_000_001, 1)}, False),
        ({"roots": (1, 1)}, True),
        ({"roots": (1, 0)}, False),
        ({"roots": (1, 1, 1)}, False),
        ({"max_points": 1}, True),
        ({"max_points": 0}, False),
        ({"chord_error": 0.0}, False),
        ({"loop_error": 0.0}, False),
        ({"chord_error": 1e-9, "loop_error": 1e-9}, True),
        ({"min_depth": -1}, False),
        ({"min_depth": 6}, True),
        ({"min_depth": 7}, False),
        ({"max_depth": 20}, True),
        ({"max_depth": 21}, False),
    ],
)
def test_limits_are_checked_at_their_ends(changes: dict[str, object], fits: bool) -> None:
    limits = NONE._replace(**changes)
    if fits:
        limits.check()
        return
    name = "min_depth, max_depth" if next(iter(changes)).endswith("depth") else next(iter(changes))
    with pytest.raises(ValueError, match=f"^{name}: "):
        limits.check()


UNEVEN = Lattice(np.array([0.0, 0.1, 0.45, 1.0]), np.array([-1.0, 0.5, 0.8]), 4)


def cells_of(lattice: Lattice, level: int) -> np.ndarray:
    return np.argwhere(np.ones(np.array(lattice.shape) << level, dtype=bool))


def borders_of(lines: np.ndarray, level: int) -> np.ndarray:
    """Borders of the cells of a level: every root in equal parts."""
    parts = [np.linspace(a, b, 1 << level, endpoint=False) for a, b in itertools.pairwise(lines)]
    return np.concatenate([*parts, lines[-1:]])


@pytest.mark.parametrize("level", [0, 1, 3])
def test_cells_are_equal_parts_of_their_root_and_hold_what_lies_in_them(level: int) -> None:
    tests = SplitTests(shapes.hills(7), Domain((0, 1, -1, 0.8)), UNEVEN, (1.0, 1.0), NONE)
    cells, u, v = cells_of(UNEVEN, level), borders_of(UNEVEN.lines_u, level), borders_of(UNEVEN.lines_v, level)
    rects = tests._rects(level, cells)
    i, j = cells.T
    np.testing.assert_allclose(rects, np.column_stack([u[i], u[i + 1], v[j], v[j + 1]]), atol=1e-15)
    rng = np.random.default_rng(level)
    uv = np.vstack(
        [rng.uniform([-0.2, -1.3], [1.3, 1.1], (300, 2)), [[0.1, 0.5], [0.45, -1.0], [1.0, 0.0], [0.5, 0.8]]]
    )
    codes = tests._find(level, uv)
    for place, code in zip(uv, codes, strict=True):
        holding = (rects[:, 0] <= place[0]) & (place[0] < rects[:, 1])
        holding &= (rects[:, 2] <= place[1]) & (place[1] < rects[:, 3])
        wanted = [splitting.quadtree.codes(UNEVEN, level, cells[holding])[0]] if holding.any() else [-1]
        assert [code] == wanted, place


def test_cells_along_a_loop_are_active_and_too_coarse_where_their_longer_side_is_longer_than_wanted() -> None:
    """With lengths of (10, 70) per unit and cells of uneven roots, either side may be the longer one."""
    ring = shapes.circle(0.3, -0.2, 0.28, 2.0)
    domain, scale = Domain((0, 1, -1, 0.8), loops=[ring]), (10.0, 7.0)
    tests = SplitTests(shapes.hills(7), domain, UNEVEN, scale, NONE)
    places = shapes.circle(0.3, -0.2, 0.28, 2.0, n=500)
    for wanted in (0.3, 0.5, 0.7, 1.0, 2.0, 3.0):
        tests.rings = [(places, np.full(len(places), wanted))]
        for level in (0, 1, 2):
            rects = tests._rects(level, cells_of(UNEVEN, level))
            active, coarse = tests._active(rects, cells_of(UNEVEN, level), level)
            middle = np.column_stack([(rects[:, 0] + rects[:, 1]) / 2, (rects[:, 2] + rects[:, 3]) / 2])
            on = [((places >= r[[0, 2]]) & (places < r[[1, 3]])).all(axis=1).any() for r in rects]
            longer = np.maximum((rects[:, 1] - rects[:, 0]) * 10.0, (rects[:, 3] - rects[:, 2]) * 7.0)
            np.testing.assert_array_equal(active, np.array(on) | domain.inside(middle))
            np.testing.assert_array_equal(coarse, np.array(on) & (longer > wanted))


def test_loops_are_followed_in_lengths_on_the_surface() -> None:
    """An ellipse of (u, v) that is a circle of radius 8 in lengths: chords of sqrt(8 radius error) bow by the error."""
    domain = Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.4, 0.5, n=900)])
    lattice = Lattice(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 6)
    tests = SplitTests(shapes.hills(7), domain, lattice, (20.0, 40.0), NONE)
    tests.follow_loops(0.01)
    ((points, size),) = tests.rings
    np.testing.assert_allclose(size, np.sqrt(8 * 8.0 * 0.01), rtol=0.05)
    steps = np.linalg.norm((np.roll(points, -1, axis=0) - points) * [20.0, 40.0], axis=1)
    around = 2 * np.pi * 8.0
    assert steps.max() <= around / 2000 * 1.001 and len(points) < 4000  # and no finer than it need be
    tests.rings.clear()
    tests.follow_loops(2.0)
    ((points, size),) = tests.rings
    assert len(points) == 900  # those of the loop: all nearer than 4
    np.testing.assert_allclose(size, 2 * 8.0 * np.sqrt(1 - 0.75**2), rtol=0.01)  # the chord 6 from the middle
    tests.rings.clear()
    tests.follow_loops(5.0)  # edges shorter than three errors are never asked for
    np.testing.assert_allclose(tests.rings[0][1], 15.0)


def bilinear(heights: np.ndarray) -> DCPSurface:
    """A sheet over the unit square that is bilinear between heights (n, m) at evenly spaced places."""
    n, m = heights.shape
    knots_u, knots_v = (np.concatenate([[0.0], np.linspace(0, 1, k), [1.0]]) for k in (n, m))
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, m), indexing="ij")
    return DCPSurface.from_nurbs(1, 1, knots_u, knots_v, np.stack([x, y, heights], axis=-1))


def test_a_cell_is_as_far_from_the_surface_as_the_farthest_anchor_above_its_bilinear_patch() -> None:
    x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 5), indexing="ij")
    surface = bilinear(x * y + 0.5 * x - y)  # bilinear all over, so it is bilinear within any cell, too
    lattice = Lattice(np.array([0.0, 0.3, 1.0]), np.array([0.0, 0.55, 1.0]), 3)
    tests = SplitTests(surface, Domain((0, 1, 0, 1)), lattice, (1.0, 1.0), NONE)
    for level in (0, 2):
        cells = cells_of(lattice, level)
        rects = tests._rects(level, cells)
        s, t = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], indexing="xy")
        u = rects[:, :1] + s.ravel() * (rects[:, 1:2] - rects[:, :1])
        v = rects[:, 2:3] + t.ravel() * (rects[:, 3:] - rects[:, 2:3])
        corners = np.stack([u, v, u * v + 0.5 * u - v], axis=-1)
        worst = np.full(len(cells), 1e-12)
        tests.anchors = None
        tests._add_anchors(level, cells, corners, worst)
        assert len(tests.anchors[0]) >= 20 and worst.max() < 1e-11
        # 0.2 along the normal of the plane that a flat cell lies in, whatever the place in the cell
        flat = np.stack([u, v, 0.5 * u - v], axis=-1)
        normal = np.array([-0.5, 1.0, 1.0]) / 1.5
        uv = tests.anchors[0]
        lifted = np.column_stack([uv, 0.5 * uv[:, 0] - uv[:, 1]]) + np.linspace(0.1, 0.4, len(uv))[:, None] * normal
        tests.anchors = uv, lifted + 3.0 * np.array([1.0, 0.0, 0.5])  # aside within the plane: that does not count
        worst = np.full(len(cells), 0.15)
        tests._add_anchors(level, cells, flat, worst)
        for rect, found in zip(rects, worst, strict=True):
            held = ((uv >= rect[[0, 2]]) & (uv < rect[[1, 3]])).all(axis=1)
            assert found == pytest.approx(max(np.linspace(0.1, 0.4, len(uv))[held], default=0.0) if held.any() and
                                          np.linspace(0.1, 0.4, len(uv))[held].max() > 0.15 else 0.15)  # fmt: skip


def test_borders_of_what_is_covered_are_followed_up_to_64_cells_along_a_side() -> None:
    surface = DCPSurface([[0.0, 0, 0]], [1], [[0.0, 0, 0.3, 0.3]], [[0.0, 0, 1, 1]])
    for roots_u, roots_v, expected in ((63, 4, True), (64, 4, False), (4, 63, True), (4, 64, False)):
        lattice = Lattice(np.linspace(0, 1, roots_u + 1), np.linspace(0, 1, roots_v + 1), 6)
        tests = SplitTests(surface, Domain((0, 1, 0, 1)), lattice, (1.0, 1.0), NONE._replace(chord_error=1.0))
        on_border = np.array([[int(0.3 * roots_u), 1]])
        assert tests.split(0, on_border)[0] == expected
        assert not tests.split(1, 2 * on_border + [0, 1])[0] or roots_u < 32 > roots_v


def test_points_are_counted_before_chords_and_only_where_there_is_something_to_draw() -> None:
    """Every reason alone quarters a cell, also where another one does not."""
    surface = shapes.hills(7)
    domain = Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.2)])
    for limits in (NONE._replace(max_points=1), NONE._replace(chord_error=1e-9), NONE._replace(min_depth=1)):
        for other in (limits, limits._replace(max_points=limits.max_points or 1000)):
            tests = splitter(surface, other, domain, cells=8)
            tests.follow_loops(1e9)
            chosen = tests.split(0, grid(8)).reshape(8, 8)
            assert chosen[3:5, 3:5].all() and not chosen[[0, 7]].any() and not chosen[:, [0, 7]].any()
