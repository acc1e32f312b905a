"""controller.tools.bench_bus: what it says of the wire, and one short run of it all."""

from __future__ import annotations

import json

import numpy as np
import pytest

from controller.tools import bench_bus as module
from controller.tools.bench_bus import bench_bus, limit_hz, measure_loop, to_json


@pytest.mark.parametrize(
    ("servos", "baud", "fast", "hz"),
    [(24, 1_000_000, False, 188), (24, 1_000_000, True, 269), (12, 57_600, False, 20.6), (32, 4_000_000, True, 826)],
)
def test_the_limit_is_that_of_the_bytes(servos: int, baud: int, fast: bool, hz: float) -> None:
    assert limit_hz(servos, baud, fast) == pytest.approx(hz, rel=5e-3)


def test_a_paced_loop_keeps_its_rate_and_a_free_one_its_own() -> None:
    seen: list[float] = []
    paced = measure_loop(lambda angle: seen.append(float(angle[0])) is None, 0.2, 100.0)
    assert 0.0 < paced.rate_hz < 120.0
    assert paced.late_ms["p50"] >= 0.0
    assert np.abs(seen).max() <= 0.3
    free = measure_loop(lambda angle: True, 0.05, 0.0)
    assert free.rate_hz > 120.0
    assert measure_loop(lambda angle: False, 0.02, 0.0).rate_hz == 0.0, "a cycle without an answer is none"
    assert free.late_ms == {}


def test_a_run_measures_both_drivers_on_one_wire(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SERVOS", 4)
    monkeypatch.setattr(module, "ROUNDS", 1)
    monkeypatch.setattr(module, "request_realtime", lambda: False)
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    told: list[str] = []
    tables = json.loads(to_json(bench_bus(0.1, told.append)))
    (lines,) = tables.values()
    values = {line["name"]: line["value"] for line in lines}
    assert 0.0 < values["of the wire limit"] <= 101.0
    assert 0.0 < values["the same bytes without a driver"] <= 101.0
    assert values["bare SDK, write and sync read"] > 0.0
    assert {line["reach"] for line in lines} >= {"<= 12 %", ">= 2", ">= 1", "<= 3 ms"}
    assert len(told) == 4
