"""Measures: complete rows with sensible ratios; no figure is judged here."""

from __future__ import annotations

import pytest

from surface.bench.bench import Measure, group, measure, sheet


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
