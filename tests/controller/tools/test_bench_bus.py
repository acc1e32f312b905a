"""controller.tools.bench_bus: what it says of the wire, and one short run of it all."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import FrozenInstanceError
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.tools import bench_bus as module
from controller.tools.bench_bus import Figure, Loop, bench_bus, limit_hz, measure_loop, to_json
from drivers.base.bus import ServoSpec
from drivers.sim import SimulatedBus


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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    ("servos", "baud", "fast", "count"),
    [
        (24, 1_000_000, False, (14 + 24 * 5) + (14 + 24) + 24 * 15),
        (24, 1_000_000, True, (14 + 24 * 5) + (14 + 24) + (8 + 24 * 8)),
        (1, 57_600, False, 19 + 15 + 15),
        (1, 57_600, True, 19 + 15 + 16),
    ],
)
def test_every_byte_of_the_wire_is_counted(servos: int, baud: int, fast: bool, count: int) -> None:
    assert limit_hz(servos, baud, fast) == baud / (10 * count)


class Hours:
    """Clocks that only a cycle moves on: 1 s on the wall, 0.25 s of this thread, 4 ms where a cycle is measured."""

    def __init__(self) -> None:
        self.cycles = 0

    def monotonic(self) -> float:
        return 100.0 + self.cycles

    def thread_time(self) -> float:
        return 7.0 + 0.25 * self.cycles

    def perf_counter(self) -> float:
        return 5.0 + 0.004 * self.cycles

    def monotonic_ns(self) -> int:
        return round(1e9 * self.monotonic())


def test_a_loop_without_pause_is_measured_by_its_clocks(monkeypatch: pytest.MonkeyPatch) -> None:
    hours, seen = Hours(), list[np.ndarray]()
    monkeypatch.setattr(module, "time", hours)

    def cycle(angles: np.ndarray) -> np.ndarray:
        hours.cycles += 1
        seen.append(angles.copy())
        return np.array([True, hours.cycles % 2 == 0])

    loop = measure_loop(cycle, 10.0, 0.0)
    assert (loop.rate_hz, loop.processor, loop.late_ms) == (0.5, 0.25, {})
    assert loop.cycle_ms == pytest.approx(dict.fromkeys(("mean", "p50", "p95", "p99", "max"), 4.0))
    assert len(seen) == 40 + 10  # the first ones warm up
    swing = 0.3 * np.sin(np.array([*range(40), *range(10)]) / 50)
    np.testing.assert_allclose(seen, np.repeat(swing[:, None], 24, axis=1))
    monkeypatch.undo()
    seen.clear()
    measure_loop(lambda angles: seen.append(angles.copy()) is None, 0.05, 0.0)
    assert len(seen) > 400  # a whole swing and the beginning of the next
    np.testing.assert_allclose(seen[40 + 314], seen[40])
    np.testing.assert_allclose(seen[40 + 313][0], 0.3 * np.sin(313 / 50))


def figures_of(monkeypatch: pytest.MonkeyPatch, rates: dict[str, list[float]], **loops: Any) -> dict[str, Figure]:
    """The table of a run whose loops measure what is given; ``loops`` : of the paced ones, and ``realtime``, ``share``.

    Each kind of loop takes its next rate of each round.
    """
    left = {kind: iter(values) for kind, values in rates.items()}
    spread = {"p50": 1.0, "p99": 2.0}
    made: list[Any] = []

    def servos(specs: Any, **options: Any) -> Any:
        made.append((specs, options))
        return nullcontext(SimpleNamespace(path="port"))

    def omote(path: str, specs: Any, seconds: float, fast: bool, rate_hz: float) -> Loop:
        assert (path, len(specs), seconds) == ("port", 24, 1.5)
        if rate_hz == 0.0:
            return Loop(next(left["fast" if fast else "plain"]), 1.0, spread, {})
        assert not fast and rate_hz in (50, 100)
        return loops["paced"] if rate_hz == 50 else loops["ticks"]

    def sdk(path: str, seconds: float, rate_hz: float) -> Loop:
        assert rate_hz in (0.0, 50)
        return loops["sdk_paced"] if rate_hz else Loop(next(left["sdk"]), 1.0, spread, {})

    def plain_bytes(path: str, seconds: float, fast: bool) -> Loop:
        return Loop(next(left["fast_bytes" if fast else "plain_bytes"]), 1.0, spread, {})

    monkeypatch.setattr(module, "SimulatedBus", servos)
    monkeypatch.setattr(module, "_run_omote", omote)
    monkeypatch.setattr(module, "_run_sdk", sdk)
    monkeypatch.setattr(module, "_run_bytes", plain_bytes)
    monkeypatch.setattr(module, "request_realtime", lambda: loops["realtime"])
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    monkeypatch.setattr(module, "StealTime", lambda: SimpleNamespace(fraction=lambda: loops["share"]))
    ((title, figures),) = bench_bus(1.5, lambda text: None)
    priority = ", real-time priority" if loops["realtime"] else ""
    assert title == f"24 servos at 1000000 baud, wire-timed{priority}"
    ((specs, options),) = made
    assert options == {"process": True, "wire": True, "baud": 1_000_000}
    assert list(specs) == [ServoSpec(i, f"servo{i}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in range(1, 25)]
    assert len({figure.name for figure in figures}) == len(figures) - 2  # two rows are there for both kinds of read
    assert all(next(values, None) is None for values in left.values())
    return {f"{figure.name} {figure.reach}": figure for figure in figures}


RATES = {
    "plain": [1.0, 0.92 * limit_hz(24, 1_000_000, False), 1e6],
    "fast": [1e6, 0.85 * limit_hz(24, 1_000_000, True), 1.0],
    "plain_bytes": [limit_hz(24, 1_000_000, False) / 2] * 3,
    "fast_bytes": [limit_hz(24, 1_000_000, True) / 4] * 3,
    "sdk": [1.0, 0.92 * limit_hz(24, 1_000_000, False), 1e6],
}


def test_figures_at_their_bounds_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    paced = Loop(50.0, 0.12, {"p50": 6.0, "p99": 7.0}, {})
    found = figures_of(
        monkeypatch,
        RATES,
        paced=paced,
        sdk_paced=Loop(50.0, 0.24, {"p50": 16.0, "p99": 17.0}, {}),
        ticks=Loop(100.0, 1.0, {}, {"p50": 0.5, "p99": 3.0}),
        realtime=False,
        share=0.25,
    )
    assert {name: (figure.value, figure.unit, figure.kept) for name, figure in found.items()} == {
        "write and sync read ": (pytest.approx(0.92 * 1e6 / 5320), "Hz", None),
        "  of the wire limit >= 92% of 188 Hz": (pytest.approx(92.0), "%", True),
        "  the same bytes without a driver ": (pytest.approx(25.0), "%", None),
        "write and fast sync read ": (pytest.approx(0.85 * 1e6 / 3720), "Hz", None),
        "  of the wire limit >= 85% of 269 Hz": (pytest.approx(85.0), "%", True),
        "bare SDK, write and sync read ": (pytest.approx(0.92 * 1e6 / 5320), "Hz", None),
        "  omote is quicker by >= 1": (1.0, "x", True),
        "processor at 50 Hz <= 12 %": (12.0, "% of a core", True),
        "bare SDK, the same ": (24.0, "% of a core", None),
        "  omote uses less by >= 2": (2.0, "x", True),
        "write and read, median ": (6.0, "ms", None),
        "write and read, 99 of 100 ": (7.0, "ms", None),
        "bare SDK, median ": (16.0, "ms", None),
        "bare SDK, 99 of 100 ": (17.0, "ms", None),
        "tick at 100 Hz late by, median ": (0.5, "ms", None),
        "tick at 100 Hz late by, 99 of 100 <= 3 ms": (3.0, "ms", True),
        "taken by the host meanwhile ": (25.0, "% of all cores", None),
    }


def test_figures_past_their_bounds_are_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    rates = {**RATES, "plain": [170.0] * 3, "fast": [220.0] * 3, "sdk": [340.0] * 3}
    found = figures_of(
        monkeypatch,
        rates,
        paced=Loop(50.0, 0.125, {"p50": 6.0, "p99": 7.0}, {}),
        sdk_paced=Loop(50.0, 0.0625, {"p50": 16.0, "p99": 17.0}, {}),
        ticks=Loop(100.0, 1.0, {}, {"p50": 0.5, "p99": 2.01}),
        realtime=True,
        share=None,
    )
    assert {name: figure.value for name, figure in found.items() if figure.kept is not None} == {
        "  of the wire limit >= 92% of 188 Hz": pytest.approx(100 * 170 / limit_hz(24, 1_000_000, False)),
        "  of the wire limit >= 85% of 269 Hz": pytest.approx(100 * 220 / limit_hz(24, 1_000_000, True)),
        "  omote is quicker by >= 1": 0.5,
        "processor at 50 Hz <= 12 %": 12.5,
        "  omote uses less by >= 2": 0.5,
        "tick at 100 Hz late by, 99 of 100 <= 2 ms": 2.01,
    }
    assert not any(figure.kept for figure in found.values())
    assert "taken by the host meanwhile " not in found  # a machine that does not report it


@pytest.mark.slow
def test_goals_of_each_driver_reach_the_servos(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[object, list[int], list[int]]] = []
    buses: list[SimulatedBus] = []
    angles = np.array([0.9, -0.9, 0.0, 0.3])
    goals = 2048 + angles * 2048 / np.pi

    def servos(specs: Any, **options: Any) -> SimulatedBus:
        buses.append(SimulatedBus(specs, wire=True, baud=1_000_000))
        return buses[-1]

    def loop(cycle: Any, seconds: float, rate_hz: float) -> Loop:
        answer = np.all(cycle(angles))
        for _ in range(500):  # a driver that limits the speed of its servos needs some time
            if abs(buses[-1].servo(1).goal - goals[0]) > 1:
                cycle(angles)
        watchdogs = [buses[-1].servo(i).register("Bus Watchdog") for i in range(1, 5)]
        seen.append((bool(answer), [buses[-1].servo(i).goal for i in range(1, 5)], watchdogs))
        spread = {"p50": 1.0, "p99": 1.0}
        return Loop(1.0, 1.0, spread, spread)

    monkeypatch.setattr(module, "SERVOS", 4)
    monkeypatch.setattr(module, "ROUNDS", 1)
    monkeypatch.setattr(module, "SimulatedBus", servos)
    monkeypatch.setattr(module, "measure_loop", loop)
    monkeypatch.setattr(module, "request_realtime", lambda: False)
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    bench_bus(0.1, lambda text: None)
    kinds = ["plain", "fast", "plain_bytes", "fast_bytes", "sdk", "paced", "ticks", "sdk_paced"]
    assert len(seen) == len(kinds)
    for kind, (answered, reached, watchdogs) in zip(kinds, seen, strict=True):
        assert answered is True, kind
        assert watchdogs == [0] * 4, kind
        assert reached == ([2048] * 4 if "bytes" in kind else pytest.approx(goals, abs=1)), kind


def test_the_face_is_run_beside_the_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[tuple[int, float, bool]] = []
    lateness = {1000: 2.0, 30: 0.5}

    def program(rate: int, seconds: float, ordinary: bool) -> tuple[dict[str, Any], float]:
        runs.append((rate, seconds, ordinary))
        late = 3.0 if ordinary else lateness[rate]
        bus = {"jitter_ms": {"p99": late}, "realtime": not ordinary, "skipped": 2, "ticks": 98}
        return {"face": {"frames_per_second": 30.5}, "buses": [bus]}, 0.25

    monkeypatch.setattr(module, "_run_program", program)
    monkeypatch.setattr(module, "restore_priority", lambda: None)
    monkeypatch.setattr(module, "StealTime", lambda: SimpleNamespace(fraction=lambda: 0.5))
    told: list[str] = []

    def tables(seconds: float) -> list[Figure]:
        figures: list[Figure] = module._bench_face(seconds, told.append)
        return figures

    found = tables(1.0)
    assert runs == [(1000, 10.0, True), (1000, 10.0, False), (30, 10.0, False)]  # a short one would tell little
    assert told == [
        "beside the face, as fast as it can, ordinary priority",
        "beside the face, as fast as it can",
        "beside the face, 30 frames/s",
    ]
    late = [figure for figure in found if figure.reach]
    assert [(figure.value, figure.reach, figure.kept) for figure in late] == [
        (3.0, "<= 3 ms", True), (2.0, "<= 2 ms", True), (0.5, "<= 0.5 ms", True)
    ]  # fmt: skip
    assert {(figure.name, figure.value, figure.unit) for figure in found[:5]} == {
        ("face, as fast as it can, ordinary priority", 30.5, "frames/s"),
        ("  bus tick at 100 Hz late by, 99 of 100", 3.0, "ms"),
        ("  beside it a program that only sleeps", 0.25, "ms"),
        ("  ticks left out", 2, "of 100"),
        ("  taken by the host meanwhile", 50.0, "% of all cores"),
    }
    lateness[30] = 0.51
    assert [figure.kept for figure in tables(20.0) if figure.reach] == [True, True, False]
    assert {seconds for _, seconds, _ in runs[3:]} == {20.0}


def test_json_holds_every_entry_of_a_figure() -> None:
    text = to_json([("a", [Figure("  b", 1.5, "Hz", ">= 1", True), Figure("c", 2.0, "ms")])])
    assert json.loads(text) == {
        "a": [
            {"name": "b", "value": 1.5, "unit": "Hz", "reach": ">= 1", "kept": True},
            {"name": "c", "value": 2.0, "unit": "ms", "reach": "", "kept": None},
        ]
    }
    assert text.startswith('{\n  "a": [\n    {')


def test_records_cannot_be_changed() -> None:
    for record in (Figure, Loop):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
