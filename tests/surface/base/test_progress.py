"""Progress rises from 0 to 1 over every stage."""

from __future__ import annotations

import shapes

from surface.base.progress import between


def test_a_step_is_a_part_of_the_whole() -> None:
    told: list[tuple[str, float]] = []
    step = between(lambda *told_now: told.append(told_now), 0.25, 0.75)
    step("a", 0.0)
    step("a", 0.5)
    step("b", 1.0)
    assert told == [("a", 0.25), ("a", 0.5), ("b", 0.75)]


def test_tessellation_and_lists_tell_how_far_they_are() -> None:
    surface, told = shapes.hills(), []
    mesh = surface.tessellate(
        chord_error=0.1, domain=shapes.face_like(), progress=lambda stage, part: told.append((stage, part))
    )
    parts = [part for _, part in told]
    assert parts == sorted(parts)
    assert 0 <= parts[0] < 0.1
    assert parts[-1] == 1.0
    assert list(dict.fromkeys(stage for stage, _ in told)) == [
        "quad tree", "triangles", "trimming", "vertices", "cells",
    ]  # fmt: skip
    told.clear()
    surface.deformation(mesh, progress=lambda stage, part: told.append((stage, part)))
    assert told[-1] == ("weights", 1.0)
