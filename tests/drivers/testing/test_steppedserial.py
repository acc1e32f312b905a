"""drivers.testing.steppedserial: pyserial's methods in time that nobody waits for."""

from __future__ import annotations

import time

import pytest
import serial

from drivers.testing import ServoBus, open_servos

PING = bytes.fromhex("FFFFFD0001030001194E")  # e-Manual, Protocol 2.0, Ping


@pytest.fixture
def bus() -> ServoBus:
    return open_servos("xl330-m288", [1], stepped=True)


def test_a_read_waits_for_bytes_and_no_longer(bus: ServoBus) -> None:
    port = bus.serial(timeout=60)
    begun = time.monotonic()
    port.write(PING)
    assert port.in_waiting == 0
    assert port.read(14)[:9] == bytes.fromhex("FFFFFD000107005500")
    assert bus.time_s == pytest.approx(24 * 10 / 1e6 + 500e-6, rel=0.01), "24 bytes and the return delay of 500 us"
    assert port.read(1) == b""
    assert bus.time_s == pytest.approx(60, abs=0.01)
    assert time.monotonic() - begun < 30


def test_a_read_gives_what_it_is_asked_for(bus: ServoBus) -> None:
    port = bus.serial(timeout=1)
    port.write(PING + PING)
    port.sleep(0.1)
    assert port.in_waiting == 28
    answer = port.read(4) + port.read(10)
    assert answer[:9] == bytes.fromhex("FFFFFD000107005500") and len(answer) == 14
    assert port.in_waiting == 14
    port.reset_input_buffer()
    assert port.in_waiting == 0 and port.read(1) == b""


def test_a_read_that_would_never_end_is_told(bus: ServoBus) -> None:
    port = bus.serial()
    port.write(PING)
    assert len(port.read(14)) == 14
    with pytest.raises(TimeoutError, match="no byte is on its way"):
        port.read(1)


def test_it_opens_and_closes_and_keeps_its_rate(bus: ServoBus) -> None:
    port = bus.serial(timeout=0.1)
    port.baudrate = 57_600
    port.write(PING)
    assert port.read(14) == b"", "the servo listens at 1 Mbaud"
    port.baudrate = 1_000_000
    port.close()
    port.close()
    with pytest.raises(serial.PortNotOpenError):
        port.write(PING)
    port.open()
    with pytest.raises(serial.SerialException):
        port.open()
    port.write(PING)
    port.flush()
    port.reset_output_buffer()
    assert len(port.read(14)) == 14
