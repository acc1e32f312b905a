"""controller.hardware.bench_real_bus: measures a bus on a pseudo-terminal and writes nothing to its servos."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from controller.hardware import bench_real_bus as module
from controller.hardware.bench_real_bus import bench_real_bus, read_limit_hz
from controller.tools import bench_bus
from controller.tools.bench_bus import Figure
from drivers.base.errors import NoReply
from drivers.sim import SimulatedBus
from drivers.testing import open_servos

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PINGS", 8)
    monkeypatch.setattr(module, "RATES_HZ", (50.0,))
    monkeypatch.setattr(bench_bus, "WARM_UP_CYCLES", 2)


def measured(port: str, protocol: int = 2) -> dict[str, Figure]:
    ((_, figures),) = bench_real_bus(port, 1_000_000, 0.1, lambda text: None, (protocol,))
    return {figure.name.strip(): figure for figure in figures}


@pytest.mark.parametrize(("model", "protocol"), [("xl330-m288", 2), ("sts3215", 1)])
def test_a_bus_is_measured_and_nothing_is_written(model: str, protocol: int) -> None:
    with open_servos(dict.fromkeys((1, 2, 3), model)) as bench:
        found = measured(bench.port, protocol)
        written = [write for servo in (1, 2, 3) for write in bench.writes_to(servo)]
    assert written == []
    assert found["reads of all"].value > 0.0
    assert found["a servo described (ping and four reads), median"].value > 0.0
    assert ("fast reads of all" in found) == (protocol == 2)


def test_a_slow_adapter_is_found_by_its_answers() -> None:
    with SimulatedBus([1, 2], wire=True, latency_s=0.016) as bus:
        found = measured(bus.path)
    delay = found["an answer comes after its time on the wire by"]
    assert delay.value > 14.0
    assert delay.kept is False
    assert "setserial" in delay.reach
    assert found["reads of all"].value < 62.0


def test_the_limit_counts_requests_and_replies_alone() -> None:
    models = ["xl330-m288"] * 24
    assert read_limit_hz(models, 1_000_000, False) == pytest.approx(1e6 / (10 * (14 + 24 + 24 * 15)))
    assert read_limit_hz(models, 4_000_000, True) == pytest.approx(4e6 / (10 * (14 + 24 + 8 + 24 * 8)))
    assert read_limit_hz(["ax-12a"], 1_000_000, False) is None


def test_a_port_without_servos_is_one_message() -> None:
    with SimulatedBus([1], baud=57_600) as bus, pytest.raises(NoReply, match="no servo to measure"):
        bench_real_bus(bus.path, 1_000_000, 0.1, lambda text: None, (2,))


def test_the_time_of_describing_a_servo_is_in_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks, asked = iter(range(10_000)), list[list[int]]()
    monkeypatch.setattr(module.time, "perf_counter", lambda: 0.002 * next(ticks))
    bus: Any = SimpleNamespace(ids=(4, 7), discover=asked.append)
    median, most = module._round_trips(bus)[:2]
    assert (median.unit, most.unit) == ("ms", "ms")
    assert (median.value, most.value) == (pytest.approx(2.0), pytest.approx(2.0))
    assert asked[:3] == [[4], [7], [4]] and len(asked) == module.PINGS
