"""drivers.core.keeper: motors are let go when their program is gone, and only then."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from drivers import open_bus
from drivers.core.keeper import Keeper, let_go, watch
from drivers.packets.packet1 import BROADCAST_ID, Instruction1, encode
from drivers.port.serialport import SerialPort
from drivers.sim import SimulatedBus
from tests.drivers.protocol1.test_startup import servos_of

OFF = encode(BROADCAST_ID, Instruction1.SYNC_WRITE, bytes((24, 1, 1, 0, 2, 0)))


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus((1, 2), model="ax-12a") as simulated:
        for servo in (1, 2):
            simulated.servo(servo).put("Torque Enable", 1)
        yield simulated


def torques(wire: SimulatedBus) -> list[bool]:
    return [wire.servo(servo).torque for servo in (1, 2)]


def test_it_lets_go_on_a_port_that_is_free(wire: SimulatedBus) -> None:
    assert let_go(wire.path, 1_000_000, [OFF.hex()])
    end = time.monotonic() + 5
    while torques(wire) != [False, False]:
        assert time.monotonic() < end


def test_it_stands_back_from_a_port_that_another_program_has(wire: SimulatedBus) -> None:
    port = SerialPort(wire.path)
    port.open()
    assert not let_go(wire.path, 1_000_000, [OFF.hex()])
    port.close()
    assert torques(wire) == [True, True]


def test_a_port_that_is_gone_is_no_error() -> None:
    assert not let_go("/dev/no-such-port", 1_000_000, [OFF.hex()])


@pytest.mark.parametrize(
    ("words", "parent", "let_go"),
    [("", "me", True), ("", "gone", True), ("bye\n", "me", False), (None, "me", False)],
    ids=["end", "orphaned", "goodbye", "no orders"],
)
def test_it_acts_on_an_end_without_a_goodbye(
    wire: SimulatedBus, monkeypatch: pytest.MonkeyPatch, words: str | None, parent: str, let_go: bool
) -> None:
    monkeypatch.setattr(sys, "path", sys.path[:])
    reading, writing = os.pipe()
    pid = os.getppid() if parent == "me" else -1
    orders = {"path": wire.path, "baud": 1_000_000, "frames": [OFF.hex()], "parent": pid, "import": sys.path[:]}
    thread = threading.Thread(target=watch, args=(reading,))
    thread.start()
    if words is not None:
        os.write(writing, json.dumps(orders).encode() + b"\n" + words.encode())
    if parent == "me":
        time.sleep(0.05)
        assert torques(wire) == [True, True], "nothing happens while the program is there"
        os.close(writing)
    thread.join(10)
    assert not thread.is_alive()
    assert torques(wire) == [not let_go] * 2
    os.close(reading)
    if parent != "me":
        os.close(writing)


def test_a_dismissed_keeper_leaves_the_servos_alone(wire: SimulatedBus) -> None:
    keeper = Keeper(wire.path, 1_000_000, [OFF])
    assert keeper.watching
    keeper.dismiss()
    keeper.dismiss()
    assert not keeper.watching
    assert torques(wire) == [True, True]


def test_a_bus_without_a_watchdog_has_one_while_it_is_open(wire: SimulatedBus) -> None:
    servos = servos_of("ax-12a")[:2]
    for watchdog_ms, has in ((200, True), (0, False)):
        with open_bus("dynamixel", servos, port=wire.path, margin_s=0.3, watchdog_ms=watchdog_ms) as bus:
            bus.start()
            keeper = bus._keeper
            assert (keeper is not None) is has
            bus.stop()
            bus.start()
            assert bus._keeper is keeper
        assert not has or not keeper.watching
