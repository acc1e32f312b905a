"""controller.hardware.bench_many: each of several buses is measured; no rate is judged here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from controller.base.errors import ControllerError
from controller.hardware import bench_many as module
from controller.hardware.bench_many import bench_many
from controller.tools.bench_bus import limit_hz


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
@pytest.mark.slow
def test_every_bus_has_its_own_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "request_realtime", lambda: False)
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    ((title, figures),) = bench_many(2, 3, 1_000_000, 0.2, lambda text: None)
    assert title.startswith("2 buses of 3 servos")
    for kind, fast, share in (("write and sync read", False, 92), ("write and fast sync read", True, 85)):
        limit = limit_hz(3, 1_000_000, fast)
        at = [k for k, figure in enumerate(figures) if figure.name.endswith(kind)]
        assert [figures[k].name for k in at] == [f"bus 1, {kind}", f"bus 2, {kind}"]
        for k in at:
            rate, share_of_limit, bare = figures[k : k + 3]
            assert 0.0 < rate.value <= 1.01 * limit
            assert 0.0 < bare.value <= 101.0
            assert share_of_limit.value == pytest.approx(100 * rate.value / limit)
            assert share_of_limit.reach == f">= {share}% of {limit:.0f} Hz"
            assert share_of_limit.kept == (share_of_limit.value >= share)
    by_name = {each.name: each.value for each in figures if each.name.endswith("read, processor of a cycle")}
    assert list(by_name) == ["sync read, processor of a cycle", "fast sync read, processor of a cycle"]
    assert all(10.0 < value < 20_000.0 for value in by_name.values())
    simulated = [figure.value for figure in figures if figure.name.endswith("simulated servos, processor of a cycle")]
    assert len(simulated) == 2
    assert all(value > 10.0 for value in simulated) or sys.platform != "linux"
    names = ("half of all cycles, of the wire limit", "  each driven from a process of its own", "  without a driver")
    for name in names:
        assert [0.0 < figure.value <= 101.0 for figure in figures if figure.name == name] == [True, True]


@contextmanager
def falling(path: str) -> Iterator[object]:
    """Stands for opening a bus: one of them cannot be opened, and one takes its process with it."""
    if path == "bad":
        raise OSError("no room for it")
    if path == "killed":
        os._exit(9)
    yield lambda angle_rad: True


@pytest.mark.parametrize(
    ("paths", "processes", "said"),
    [
        (["good", "bad"], False, "bus 2 on bad: OSError: no room for it"),
        (["good", "bad"], True, "bus 2 on bad: OSError: no room for it"),
        (["killed", "good"], True, "bus 1 on killed: its process ended with status 9"),
    ],
)
def test_a_bus_that_fails_is_named_with_the_reason(paths: list[str], processes: bool, said: str) -> None:
    with pytest.raises(ControllerError) as caught:
        module._measure_at_once(paths, falling, 0.1, 0.0, processes=processes)
    assert str(caught.value).startswith(said) and "good" not in str(caught.value)
    assert "--buses" in caught.value.hint


def test_loops_of_processes_come_in_the_order_of_the_buses() -> None:
    assert all(
        loop.rate_hz > 0.0 for loop in module._measure_at_once(["one", "two"], falling, 0.1, 0.0, processes=True)
    )


@pytest.mark.parametrize(
    ("servos", "baud", "fast", "hz"),
    [
        (12, 1_000_000, False, 357.1),
        (12, 1_000_000, True, 490.2),
        (12, 4_000_000, True, 1960.8),
        (24, 4_000_000, False, 751.9),
        (12, 10_500_000, False, 3750.0),
        (24, 10_500_000, False, 1973.7),
    ],
)
def test_the_limit_at_the_rates_of_large_servos(servos: int, baud: int, fast: bool, hz: float) -> None:
    """By hand: 12 servos write 14 + 60 bytes, ask with 26, and answer with 180, or with 104 at once; P-series and
    X-series have goals and positions of four bytes alike."""
    assert limit_hz(servos, baud, fast) == pytest.approx(hz, abs=0.1)
