"""Progress rises from 0 to 1 over every stage."""

from __future__ import annotations

import shapes

from surface.base.progress import part_of


def test_a_step_is_a_part_of_the_whole() -> None:
    reports: list[tuple[str, float]] = []
    step = part_of(lambda *report: reports.append(report), 0.25, 0.75)
    step("a", 0.0)
    step("a", 0.5)
    step("b", 1.0)
    assert reports == [("a", 0.25), ("a", 0.5), ("b", 0.75)]


def test_tessellation_and_lists_report_their_progress() -> None:
    surface, reports = shapes.hills(), []
    mesh = surface.tessellate(
        chord_error=0.1, domain=shapes.face_like(), progress=lambda stage, part: reports.append((stage, part))
    )
    parts = [part for _, part in reports]
    assert parts == sorted(parts)
    assert 0 <= parts[0] < 0.1
    assert parts[-1] == 1.0
    assert list(dict.fromkeys(stage for stage, _ in reports)) == [
        "quad tree", "triangles", "trimming", "vertices", "cells",
    ]  # fmt: skip
    reports.clear()
    surface.deformation(mesh, progress=lambda stage, part: reports.append((stage, part)))
    assert reports[-1] == ("weights", 1.0)
