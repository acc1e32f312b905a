"""Measures: complete rows with sensible ratios; no figure is judged here."""

from __future__ import annotations

from surface.bench import Measure, measure, sheet


def test_rows_of_a_small_sheet() -> None:
    told: list[str] = []
    surface, mesh = sheet(2_000)
    rows = measure(surface, mesh, seconds=0.002, tell=told.append)
    assert [row.name for row in rows[:3]] == [
        "one read of the weights",
        "all positions",
        "all positions and normals",
    ]
    assert len(rows) == 9
    assert len(told) == 9
    assert all(row.milliseconds > 0 for row in rows)
    assert all(row.kept is None or isinstance(row.kept, bool) for row in rows)


def test_every_vertex_of_the_sheet_has_at_most_sixteen_influences() -> None:
    surface, mesh = sheet(2_000)
    lists = surface.deformation(mesh, normals=False)._lists
    assert (lists.rows == 16).all()
    assert abs(len(mesh.vertices) / 2_000 - 1) < 0.3


def test_bounds_are_read_both_ways() -> None:
    assert Measure("a", 1.0, 1.4, "b", "<= 1.5").kept is True
    assert Measure("a", 1.0, 1.6, "b", "<= 1.5").kept is False
    assert Measure("a", 1.0, 13.0, "b", ">= 12").kept is True
    assert Measure("a", 1.0).kept is None
