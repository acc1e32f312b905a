"""The benchmark measures what it says and keeps its ratios consistent; figures themselves are never tested."""

from __future__ import annotations

import pytest

from controller.tools.bench_surface import bench_head


def test_the_head_tables_hold_full_and_incremental_updates() -> None:
    told: list[str] = []
    tables = bench_head("ict", 0.0, told.append)
    (_, poses), (_, engine) = tables
    whole = poses[0]
    assert whole.name == "pose, every parameter changed"
    for row in poses[1:]:
        assert row.ratio == pytest.approx(row.milliseconds / whole.milliseconds)
    names = " ".join(row.name for row in engine)
    for wanted in ("all positions", "one point moved", "reaches", "scipy CSR", "blendshapes"):
        assert wanted in names
    assert all(row.milliseconds > 0 for row in [*poses, *engine])
    assert told
