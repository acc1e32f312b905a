"""controller.tools.monitor over simulated servos: what is there is shown, and nothing is touched."""

from __future__ import annotations

import io
import os
import struct
import sys
from collections.abc import Callable

import pytest
from rich.console import Console

from controller.tools.monitor import listen_to_bus, poll_servos
from drivers.base.errors import NoReply, PortMissing
from drivers.packets.packet import encode_instruction, encode_status
from drivers.sim import SimulatedBus

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")


def times(count: int) -> Callable[[], bool]:
    steps = iter([True] * count)
    return lambda: next(steps, False)


@pytest.mark.parametrize(
    ("model", "protocol", "read"), [("xl330-m288", 2, "Present Position"), ("sts3215", 1, "Present Position")]
)
def test_servos_are_asked_and_left_alone(model: str, protocol: int, read: str) -> None:
    out = io.StringIO()
    with SimulatedBus([1, 4], model=model) as bus:
        poll_servos(bus.path, 1_000_000, protocol, Console(file=out, width=200), times(8), 100.0)
        assert all(not bus.servo(i).torque and bus.servo(i).eeprom_writes == {} for i in (1, 4))
    text = out.getvalue()
    assert f"{read} = 2048" in text
    assert "write" not in text
    assert " 4 " in text


def test_a_terminal_shows_one_row_a_servo() -> None:
    out = io.StringIO()
    with SimulatedBus([1, 4]) as bus:
        bus.servo(4).place(2048 + 1024)
        poll_servos(bus.path, 1_000_000, 2, Console(file=out, force_terminal=True, width=140), times(40), 100.0)
    assert "90.0" in out.getvalue()


def test_nobody_there_is_told() -> None:
    with SimulatedBus([1], baud=57_600) as bus, pytest.raises(NoReply, match="1000000 baud") as caught:
        poll_servos(bus.path, 1_000_000, 2, Console(file=io.StringIO()), times(1), 10.0)
    assert "omote scan" in caught.value.hint


@pytest.mark.parametrize(
    ("model", "told"), [("", "4 bytes at 132: d2 04 00 00"), ("xl330-m288", "Present Position = 1234")]
)
def test_listening_says_nothing_and_tells_both_ends_apart(model: str, told: str) -> None:
    out = io.StringIO()
    master, slave = os.openpty()
    os.set_blocking(master, False)
    name = os.ttyname(slave)
    steps = times(4)

    def going() -> bool:
        os.write(master, encode_instruction(3, 2, struct.pack("<HH", 132, 4)))
        os.write(master, encode_status(3, 0, struct.pack("<i", 1234)))
        return steps()

    listen_to_bus(name, 1_000_000, 2, Console(file=out, width=120), going, model)
    with pytest.raises(BlockingIOError):
        os.read(master, 1)
    os.close(master)
    os.close(slave)
    assert "-> 3 read" in out.getvalue()
    assert f"<- 3 {told}" in out.getvalue()


def test_a_missing_port_is_one_error() -> None:
    with pytest.raises(PortMissing):
        listen_to_bus("/dev/not-there", 1_000_000, 2, Console(file=io.StringIO()), times(1))
