"""drivers.tables.wire: bytes of a cycle, compared with what real drivers send and simulated servos answer."""

from __future__ import annotations

import math

import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError
from drivers.port.serialport import SerialPort
from drivers.tables.wire import cycle_bytes

CYCLES = 24


def counted(monkeypatch: pytest.MonkeyPatch, family: str, model: str, count: int) -> float:
    """Bytes in both directions of a cycle of a real driver over simulated servos, on average."""
    total, servos = [0], [ServoSpec(i + 1, f"s{i}", model, -0.5, 0.5, 5.0, 50.0) for i in range(count)]
    write, read = SerialPort.write, SerialPort.read

    def counting_write(self: SerialPort, data: bytes, *more: object) -> None:
        total[0] += len(data)
        write(self, data, *more)  # type: ignore[arg-type]

    def counting_read(self: SerialPort, *limits: object) -> bytes:
        data = read(self, *limits)  # type: ignore[arg-type]
        total[0] += len(data)
        return data

    monkeypatch.setattr(SerialPort, "write", counting_write)
    monkeypatch.setattr(SerialPort, "read", counting_read)
    with open_bus("simulated", servos, simulates=family) as bus:
        bus.start()
        total[0] = 0
        for _ in range(CYCLES):
            bus.write([0.01] * count)
            bus.read()
        found = total[0] / CYCLES
        bus.stop()
    return found


@pytest.mark.parametrize(("family", "model", "count"), [("dynamixel", "xl330-m288", 12), ("feetech", "sts3215", 8)])
def test_a_cycle_has_about_as_many_bytes_as_are_counted(
    monkeypatch: pytest.MonkeyPatch, family: str, model: str, count: int
) -> None:
    assert cycle_bytes([model] * count) == pytest.approx(counted(monkeypatch, family, model, count), rel=0.12)


def test_servos_that_are_read_one_by_one_have_no_number() -> None:
    assert cycle_bytes(["ax-12a"]) == math.inf
    assert cycle_bytes(["xl330-m288", "ax-12a"]) == math.inf
    assert cycle_bytes(["scs0009"]) == math.inf


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(DriverError, match="xl999"):
        cycle_bytes(["xl999"])
