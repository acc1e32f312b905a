"""Measures: complete rows with sensible ratios; no figure is judged here."""

from __future__ import annotations

from time import sleep

import numpy as np
import pytest

from surface.bench.bench import Measure, alternating, build_table, group, large_table, least_of, measure, sheet


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
    lists = surface.deformation(mesh, normals=False).lists
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
