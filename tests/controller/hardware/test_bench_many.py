"""controller.hardware.bench_many: each of several buses is measured; no rate is judged here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from controller.base.errors import ControllerError
from controller.hardware import bench_many as module
from controller.hardware.bench_many import bench_many
from controller.tools.bench_bus import WARM_UP_CYCLES, Loop, limit_hz
from drivers.base.bus import ServoSpec


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


class Wires:
    """Stands for simulated buses: their processes use half a second of the processor from one reading to the next."""

    def __init__(self) -> None:
        self.opened: list[tuple[list[ServoSpec], dict[str, object]]] = []

    def __call__(self, specs: list[ServoSpec], **how: object) -> AbstractContextManager[object]:
        self.opened.append((specs, how))
        used_s = count(0.0, 0.5)

        class Wire:
            path = f"bus{len(self.opened)}"
            processor_s = property(lambda _: next(used_s))

        return nullcontext(Wire())


def test_what_is_measured_becomes_figures_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two buses of three servos for two seconds: with the driver, with its bytes alone, and with own processes."""
    wires, asked, said = Wires(), list[tuple[object, ...]](), list[str]()
    limit, fast_limit = (limit_hz(3, 1_000_000, fast) for fast in (False, True))

    def measure(paths: list[str], opened: partial[object], seconds: float, rate_hz: float, **how: object) -> list[Loop]:
        asked.append((paths, opened.func.__name__, seconds, rate_hz, how))
        rates = (99.0, 98.9) if rate_hz else (100.0, 300.0)
        return [Loop(rate, 0.2, {"p50": 2.0 + k}, {"p99": 0.5 + k}) for k, rate in enumerate(rates)]

    monkeypatch.setattr(module, "SimulatedBus", wires)
    monkeypatch.setattr(module, "_measure_at_once", measure)
    monkeypatch.setattr(module, "steal_figures", lambda steal: [])
    monkeypatch.setattr(module, "shorten_thread_switches", lambda: None)
    ((title, figures),) = bench_many(2, 3, 1_000_000, 2.0, said.append)
    assert title == "2 buses of 3 servos at 1000000 baud, wire-timed" and len(said) == 7
    for specs, how in wires.opened:
        assert how == {"process": True, "wire": True, "baud": 1_000_000}
        assert [(spec.id, spec.name) for spec in specs] == [(1, "servo1"), (2, "servo2"), (3, "servo3")]
        assert all((spec.min_rad, spec.max_rad) == (-1.0, 1.0) for spec in specs)
    paths, free = ["bus1", "bus2"], ("_driver", "bytes_alone", "_driver")
    alone = [(paths, name, 2.0, 0.0, {"processes": True} if k == 2 else {}) for k, name in enumerate(free)]
    assert asked == [*alone, *alone, (paths, "_driver", 2.0, 100.0, {})]
    half, end = len(figures) // 2 - 2, 4
    for values, most in ((figures[:half], limit), (figures[half:-end], fast_limit)):
        percent = [100 * rate / most for rate in (100.0, 300.0)]
        typical, simulated_us = 100 * 1e3 / most / 3.0, 1e6 * 1.0 / (400.0 * 2.0 + 2 * WARM_UP_CYCLES)
        assert [each.value for each in values] == pytest.approx(
            [
                100.0,
                percent[0],
                percent[0],
                300.0,
                percent[1],
                percent[1],
                1000.0,
                1000.0,
                *([typical] * 3),
                simulated_us,
            ]
        )
        assert [each.unit for each in values] == ["Hz", "%", "%"] * 2 + ["us", "us", "%", "%", "%", "us"]
    assert [(each.name, each.kept) for each in figures[-end:]] == [
        ("bus 1, at 100 Hz", True),
        ("  bus 1, tick late by, 99 of 100", None),
        ("bus 2, at 100 Hz", False),
        ("  bus 2, tick late by, 99 of 100", None),
    ]
    assert [each.value for each in figures[-end:]] == pytest.approx([99.0, 0.5, 98.9, 1.5])
    assert figures[-end].reach == ">= 99%" and all(each.unit for each in figures)


@pytest.mark.parametrize(("share", "kept"), [(0.919, False), (0.92, True)])
def test_a_bus_keeps_its_bound_from_that_share_of_the_limit_on(share: float, kept: bool) -> None:
    loop = Loop(100.0 * share, 0.1, {"p50": 1.0}, {})
    rate, reached, _ = module._free_figures("sync read", 100.0, 0.92, [loop], [loop])
    assert (rate.kept, reached.kept, reached.reach) == (None, kept, ">= 92% of 100 Hz")


def test_the_bytes_of_a_driver_are_of_every_servo_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """One cycle is one write and one read of positions, without what a driver reads now and then besides."""
    asked, fresh = list[object](), np.array([True, True])
    bus = SimpleNamespace(
        start=lambda: asked.append("start"),
        write=lambda angles: asked.append(len(angles)),
        read=lambda: SimpleNamespace(fresh=fresh),
    )
    monkeypatch.setattr(
        module, "open_bus", lambda family, specs, **how: asked.append((family, how)) or nullcontext(bus)
    )
    specs: list[ServoSpec] = [object(), object()]  # type: ignore[list-item]
    with module._driver(specs, 57_600, True, "path") as cycle:
        assert cycle(np.zeros(24)) is True
        fresh[1] = False
        assert cycle(np.zeros(24)) is False
    options = {"fast": True, "feedback": "position", "slow_group": 0, "watchdog_ms": 0}
    assert asked == [("dynamixel", {"port": "path", "baud": 57_600, **options}), "start", 2, 2]


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
