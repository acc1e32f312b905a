"""Measures: complete rows with sensible ratios; no figure is judged here."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from time import sleep
from typing import Any

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.bench import bench
from surface.bench.bench import Measure, alternating, build_table, group, large_table, least_of, measure, sheet
from surface.deform.lists import build_lists


def test_rows_of_a_small_sheet() -> None:
    reported: list[str] = []
    surface, mesh = sheet(12_000)
    rows = measure(surface, mesh, seconds=0.002, report=reported.append)
    begins = (
        "one read of the weights",
        "all positions",
        "all positions and normals",
        "every point moved",
        "one point moved",
        "group of ",
        "group of ",
        "scipy CSR @ dense",
        "numpy 52 blendshapes, ",
        "stencil table",
    )
    assert len(rows) == len(begins)
    assert all(row.name.startswith(begin) for row, begin in zip(rows, begins, strict=True))
    assert len({row.name for row in rows}) == len(rows)
    assert len(reported) == len(rows)
    assert all(row.milliseconds > 0 for row in rows)
    assert all(row.kept is None or isinstance(row.kept, bool) for row in rows)


def test_every_vertex_of_the_sheet_has_at_most_sixteen_influences() -> None:
    surface, mesh = sheet(2_000)
    lists = build_lists(surface, mesh, False)
    assert (lists.rows == 16).all()
    assert abs(len(mesh.vertices) / 2_000 - 1) < 0.3


def test_a_group_reaches_the_vertices_it_says() -> None:
    surface, mesh = sheet(3_000)
    for share in (0.0, 0.1, 0.3):
        ids, part = group(surface, mesh, share)
        weights = surface.basis_matrix(mesh.uv, side=mesh.side)[:, ids]
        assert part == pytest.approx((weights.sum(axis=1) > 0).mean(), abs=1e-12)
        assert part >= share
        assert len(ids) == 1 or group(surface, mesh, part)[0].tolist() == ids.tolist()


def test_bounds_are_read_both_ways() -> None:
    assert Measure("a", 1.0, 1.4, "b", "<= 1.5").kept is True
    assert Measure("a", 1.0, 1.6, "b", "<= 1.5").kept is False
    assert Measure("a", 1.0, 13.0, "b", ">= 12").kept is True
    assert Measure("a", 1.0).kept is None


def test_times_are_the_least_of_at_least_five_calls() -> None:
    calls: list[str] = []
    times = least_of([lambda: calls.append("a"), lambda: (calls.append("b"), sleep(0.002))], 0.0)
    assert calls[:2] == ["a", "b"]  # once to compile, not measured
    assert calls[2:] == ["a", "b"] * 5
    assert 0 <= times[0] < times[1]
    assert times[1] >= 2.0  # milliseconds


def test_moves_go_there_and_back() -> None:
    surface, mesh = sheet(1_500)
    deformation = surface.deformation(mesh)
    call, start = alternating(deformation, np.array([3])), deformation.points[3].copy()
    call()
    away = deformation.points[3].copy()
    assert (away > start).all()
    call()
    assert np.array_equal(deformation.points[3], start)
    call()
    assert np.array_equal(deformation.points[3], away)


def test_large_and_build_tables_are_complete() -> None:
    names = [row.name for row in large_table(3_000, 0.001)]
    assert len(names) == 4 and "two threads" in names[1] and names[3] == "memory of weights and lists"
    reports: list[float] = []
    rows = build_table(200, 2, lambda stage, part: reports.append(part))
    assert [row.reach for row in rows] == ["<= 1", "<= 1"]
    assert reports[-1] == 1.0 and all(0 <= part <= 1 for part in reports)
    assert all(row.milliseconds > 0 and row.ratio == row.milliseconds / 10_000 for row in rows)


@pytest.mark.parametrize(
    ("ratio", "reach", "kept"),
    [(1.5, "<= 1.5", True), (3, ">= 3", True), (2.9, ">= 3", False), (0.9, "0.9 to 1.1", True),
     (1.1, "0.9 to 1.1", True), (1.2, "0.9 to 1.1", False), (0.8, "0.9 to 1.1", False), (None, "<= 1", None)],
)  # fmt: skip
def test_bounds_include_their_ends(ratio: float | None, reach: str, kept: bool | None) -> None:
    assert Measure("a", 1.0, ratio, "b", reach).kept is kept


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Times that calls are said to take, ms: 1, 2, 3 and so on; the list holds those given out."""
    given: list[float] = []

    def least(call: Callable[[], object], seconds: float = 0.3) -> float:
        call()
        assert seconds == 0.125
        given.append(len(given) + 1.0)
        return given[-1]

    monkeypatch.setattr(bench, "least", least)
    return given


def test_ratios_are_against_the_row_that_they_name(clock: list[float]) -> None:
    surface, mesh = sheet(12_000)
    rows = measure(surface, mesh, seconds=0.125)
    assert [row.milliseconds for row in rows[:7]] == clock[:7] == [1, 2, 3, 4, 5, 6, 7]
    by_name = {row.name: row for row in rows}
    read, full = by_name["one read of the weights"], by_name["all positions"]
    assert (read.ratio, read.against, read.reach) == (None, "", "")
    assert (full.ratio, full.against, full.reach) == (2.0, read.name, "<= 1.8")
    normals = by_name["all positions and normals"]
    assert (normals.ratio, normals.against, normals.reach) == (1.5, full.name, "<= 3.5")
    for name, took in (("every point", 4.0), ("one point", 5.0)):
        row = by_name[f"{name} moved, with normals"]
        assert (row.ratio, row.against, row.reach) == (took / 2, full.name, "")
    assert bench.GROUP_FRACTIONS == (0.02, 0.1)
    for row, share in zip(rows[5:7], bench.GROUP_FRACTIONS, strict=True):
        ids, part = group(surface, mesh, share)
        assert row.name == f"group of {len(ids)} moved, which reaches {part:.1%}".replace("%", " %")
        assert row.ratio == pytest.approx(row.milliseconds / (part * 2.0))
        assert (row.against, row.reach) == ("its part of all positions", "<= 1.5")
    assert [row.ratio for row in rows[7:]] == [row.milliseconds / 2.0 for row in rows[7:]]


def test_a_peer_that_computes_a_share_counts_as_often(clock: list[float]) -> None:
    surface, mesh = sheet(1_500)
    asked: list[object] = []

    def prepare(*given: object) -> Callable[[], object]:
        asked.extend(given)
        return list

    others = [bench.peers.Peer("whole", prepare), bench.peers.Peer("tenth", prepare, 10.0, ">= 3")]
    said: list[str] = []
    rows = bench.peer_rows(others, surface, mesh, 4.0, 0.125, said.append)
    assert rows == [
        Measure("whole, positions", 1.0, 0.25, "all positions", ""),
        Measure("tenth, positions", 20.0, 5.0, "all positions", ">= 3"),
    ]
    assert said == ["whole", "tenth"] and asked == [surface, mesh, surface, mesh]


def test_libraries_are_compared_with_all_positions_of_the_sheet(
    clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.peers, "libraries", lambda mesh: [bench.peers.Peer("lib", lambda *_: list)])
    rows = bench.speed_table(1_500, 0.125)
    assert rows[-1].name == "lib, positions" and rows[-1].ratio == rows[-1].milliseconds / rows[1].milliseconds
    assert rows[1].name == "all positions"


@pytest.mark.parametrize(
    ("times", "ratios", "bound"),
    [((10.0, 6.0, 5.0, 3.0), (2.0, 0.6, 0.6), "<= 0.70"), ((10.0, 9.0, 5.0, 4.0), (2.0, 0.9, 0.8), "<= 0.92")],
)
def test_two_threads_gain_as_much_as_two_readers_of_memory(
    times: tuple[float, ...], ratios: tuple[float, ...], bound: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def least_of(calls: list[Callable[[], object]], seconds: float) -> list[float]:
        assert seconds == 0.25
        sums = calls[2](), sum(calls[3]())  # type: ignore[call-overload]
        assert sums[0] == pytest.approx(sums[1], rel=1e-4)  # both read the same weights
        return list(times)

    monkeypatch.setattr(bench, "least_of", least_of)
    said: list[str] = []
    rows = large_table(3_000, 0.25, said.append)
    assert [row.milliseconds for row in rows] == [times[0], times[1], times[3], 0.0]
    assert [row.ratio for row in rows[:3]] == pytest.approx(ratios)
    assert [row.reach for row in rows] == ["<= 0.8", bound, "", "<= 0.6"]
    assert [row.against for row in rows] == ["one read of the weights", "one thread", "one thread", "the weights alone"]
    assert 0.1 < (rows[3].ratio or 0.0) < 0.6
    assert said == ["3000 vertices", "two threads"]


def test_trees_are_built_by_points_and_by_chords(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []
    tessellate = DCPSurface.tessellate
    monkeypatch.setattr(
        DCPSurface, "tessellate", lambda self, **given: asked.append(given) or tessellate(self, **given)
    )
    reports: list[float] = []
    rows = build_table(400, 2, lambda stage, share: reports.append(share))
    limits = [{k: v for k, v in given.items() if k != "progress"} for given in asked[1:]]
    assert limits == [
        {"roots": (8, 8), "max_depth": 2, "max_points": 16},
        {"roots": (8, 8), "max_depth": 2, "chord_error": 1e-9},
    ]
    starts = [k for k, share in enumerate(reports) if share < (reports[k - 1] if k else 1.0)]
    assert len(starts) == 2  # one rise for each row
    for part in (reports[: starts[1]], reports[starts[1] :]):
        assert part == sorted(part) and part[0] < 0.1 and part[-1] == 1.0
    names = [row.name for row in rows]
    assert names[0].startswith("tree and lists by 16 points a cell: 400 points, ")
    assert names[1] == "tree and lists by chord error: 400 points, 1089 vertices"  # (8 * 4 + 1)^2
    assert [row.against for row in rows] == ["10 s", "10 s"]
    defaults = {name: p.default for name, p in inspect.signature(build_table).parameters.items()}
    assert defaults["points"] == 100_000 and (8 * 2 ** defaults["level"] + 1) ** 2 == pytest.approx(1e6, rel=0.06)


@pytest.mark.parametrize("count", [1, 25, 400, 1000])
def test_a_bumpy_sheet_is_200_long_and_wide(count: int) -> None:
    surface = bench.bumpy(count)
    side = max(5, round(np.sqrt(count)))
    assert surface.n == side * side
    assert all((degree == 3).all() for degree in surface.degrees)
    np.testing.assert_allclose(np.ptp(surface.points, axis=0)[:2], 200.0)
    assert surface.points[:, :2].min() == 0.0 and 5.0 < np.abs(surface.points[:, 2]).max() <= 20.0
    assert surface.rect == (0.0, 1.0, 0.0, 1.0)
    # straight lines in the net stay straight, so places rise evenly in the middle of the spans
    if count == 1000:
        u = np.array([[0.4, 0.5], [0.5, 0.5], [0.5, 0.4]])
        np.testing.assert_allclose(surface.evaluate(u)[:, :2] - 100.0, [[-20, 0], [0, 0], [0, -20]], atol=2.0)
    # it has hills and valleys along both directions
    grid = surface.points[:, 2].reshape(side, side)
    assert count < 400 or (np.ptp(grid, axis=0).max() > 20.0 and np.ptp(grid, axis=1).max() > 20.0)


@pytest.mark.parametrize("vertices", [300, 2_000, 20_000, 60_000])
def test_cells_of_a_sheet_are_spans_of_about_eight_by_eight_vertices(vertices: int) -> None:
    surface, mesh = sheet(vertices)
    assert len(mesh.vertices) == pytest.approx(vertices, rel=0.22)
    spans = round(np.sqrt(surface.n)) - 3
    assert vertices / spans**2 == pytest.approx(64, rel=0.45)
    steps = (round(np.sqrt(len(mesh.vertices))) - 1) / spans
    assert steps == round(steps) and np.log2(steps) == round(np.log2(steps))  # a span is quartered whole


def test_moves_are_a_hundredth_of_the_size() -> None:
    surface, mesh = sheet(1_500)
    deformation = surface.deformation(mesh)
    call, start = alternating(deformation, np.array([3, 9])), deformation.points[[3, 9]].copy()
    call()
    np.testing.assert_allclose(deformation.points[[3, 9]] - start, 2.0)


def test_shares_count_the_copies_of_a_closed_surface() -> None:
    torus = shapes.torus()
    mesh = torus.tessellate(chord_error=0.5)
    for ids in ([0], [5, 60], [125]):
        weights = torus.basis_matrix(mesh.uv, side=mesh.side)[:, ids]
        assert bench.fraction_reached(torus, mesh, np.array(ids)) == pytest.approx((weights.sum(axis=1) > 0).mean())


def test_the_nearest_points_are_those_around_the_middle() -> None:
    surface = bench.bumpy(81)
    assert bench.nearest(surface, 1).tolist() == [40]
    assert bench.nearest(surface, 5).tolist() == [31, 39, 40, 41, 49]
