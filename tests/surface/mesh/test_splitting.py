"""Which cells of a quad tree are quartered: by points, by chords, along loops, on either side of slits."""

from __future__ import annotations

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
    monkeypatch.setattr(splitting, "MOST_CELLS", 16)
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
