"""drivers.core.dead_man_switch: motors are switched off when their program is gone, and only then."""

from __future__ import annotations

import json
import logging
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers import open_bus
from drivers.base.errors import DriverError
from drivers.core import dead_man_switch as module
from drivers.core.dead_man_switch import DeadManSwitch, switch_off, watch
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


def wait_until(done: Callable[[], bool], limit_s: float = 60.0) -> None:
    end = time.monotonic() + limit_s
    while not done():
        assert time.monotonic() < end
        time.sleep(0.01)


def orders(path: str) -> bytes:
    return json.dumps({"path": path, "baud": 1_000_000, "frames": [OFF.hex()]}).encode() + b"\n"


def test_it_lets_go_on_a_port_that_is_free(wire: SimulatedBus) -> None:
    assert switch_off(wire.path, 1_000_000, [OFF.hex()])
    wait_until(lambda: torques(wire) == [False, False])


def test_it_stands_back_from_a_port_that_another_program_has(wire: SimulatedBus) -> None:
    port = SerialPort(wire.path)
    port.open()
    assert not switch_off(wire.path, 1_000_000, [OFF.hex()])
    port.close()
    assert torques(wire) == [True, True]


def test_a_port_that_is_gone_is_no_error() -> None:
    assert not switch_off("/dev/no-such-port", 1_000_000, [OFF.hex()])


@pytest.mark.parametrize(
    ("words", "parent", "lets_go"),
    [(b"", "me", True), (b"", "gone", True), (b"bye\n", "me", False), (None, "me", False)],
    ids=["end", "orphaned", "goodbye", "no orders"],
)
def test_it_acts_on_an_end_without_a_goodbye(
    wire: SimulatedBus, words: bytes | None, parent: str, lets_go: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    reading, writing = os.pipe()
    hearing, answering = os.pipe()
    thread = threading.Thread(target=watch, args=(reading, answering, os.getppid() if parent == "me" else -1))
    thread.start()
    if words is not None:
        os.write(writing, orders(wire.path))
        assert select.select([hearing], [], [], 20)[0]
        assert os.read(hearing, 100) == b"ready\n"
        os.write(writing, words)
    if parent == "me":
        time.sleep(0.05)
        assert torques(wire) == [True, True], "nothing happens while the program is there"
        os.close(writing)
    thread.join(20)
    assert not thread.is_alive()
    wait_until(lambda: torques(wire) == [not lets_go] * 2)
    assert ("were switched off" in capfd.readouterr().err) is lets_go
    for descriptor in (reading, hearing, answering, *([] if parent == "me" else [writing])):
        os.close(descriptor)


def test_a_dismissed_dead_man_switch_leaves_the_servos_alone(wire: SimulatedBus) -> None:
    switch = DeadManSwitch(wire.path, 1_000_000, [OFF])
    assert switch.watching
    switch.dismiss()
    switch.dismiss()
    assert not switch.watching
    assert torques(wire) == [True, True]


def test_what_a_group_of_processes_is_told_does_not_end_it(wire: SimulatedBus) -> None:
    switch = DeadManSwitch(wire.path, 1_000_000, [OFF])
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        switch._process.send_signal(number)
    time.sleep(0.1)
    assert switch.watching
    switch._process.stdin.close()
    assert switch._process.wait(20) == 0
    wait_until(lambda: torques(wire) == [False, False])


CANNOT_IMPORT = """
import sys
from drivers.core import dead_man_switch
wait = dead_man_switch._parent_died
def wait_and_forget(*given):
    loaded = {name.partition(".")[0] for name in sys.modules}
    if loaded & {"numpy", "numba", "subprocess", "asyncio", "tomllib"}:
        raise SystemExit("it is not small: " + " ".join(sorted(loaded)))
    left = wait(*given)
    sys.meta_path.clear(), sys.path.clear(), sys.path_hooks.clear()
    return left
dead_man_switch._parent_died = wait_and_forget
sys.exit(dead_man_switch.main())
"""


def test_nothing_has_to_be_imported_once_it_stands_ready(wire: SimulatedBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "command", lambda name, pid, bare: [sys.executable, "-S", "-c", CANNOT_IMPORT, pid])
    switch = DeadManSwitch(wire.path, 1_000_000, [OFF])
    switch._process.stdin.close()
    assert switch._process.wait(20) == 0
    wait_until(lambda: torques(wire) == [False, False])


# ---------------------------------------------------------------------------- one that cannot do it


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("echo no such module >&2; exit 3", "ended with status 3, see its message above"),
        ("read orders; echo failed ImportError: no serial", "ImportError: no serial"),
        ("exec sleep 60", "was not ready within 0.2 s"),
    ],
    ids=["dies", "fails", "hangs"],
)
def test_a_dead_man_switch_that_does_not_stand_ready_is_told_and_ended(
    script: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "command", lambda *words, bare: ["/bin/sh", "-c", script])
    with pytest.raises(DriverError, match=why) as caught:
        DeadManSwitch("/dev/ttyUSB7", 1_000_000, [OFF], ready_s=0.2 if "sleep" in script else 20.0)
    assert "/dev/ttyUSB7" in str(caught.value)
    assert "watchdog_ms = 0" in caught.value.hint
    assert ("no such module" in capfd.readouterr().err) is ("no such module" in script)


def test_orders_that_cannot_be_carried_out_are_told() -> None:
    with pytest.raises(DriverError, match="protocol_nowhere"):
        DeadManSwitch("nowhere://there", 1_000_000, [OFF])


def test_a_python_that_does_not_start_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(DriverError, match="/python does not start: No such file"):
        DeadManSwitch("/dev/ttyUSB7", 1_000_000, [OFF])


# ---------------------------------------------------------------------------- beside a bus


def test_a_bus_without_a_watchdog_has_one_while_it_is_open(wire: SimulatedBus) -> None:
    servos = servos_of("ax-12a")[:2]
    for watchdog_ms, has in ((200, True), (0, False)):
        with open_bus("dynamixel", servos, port=wire.path, margin_s=0.5, watchdog_ms=watchdog_ms) as bus:
            bus.start()
            switch = bus._switch
            assert (switch is not None) is has
            bus.stop()
            bus.start()
            assert bus._switch is switch
            assert "unkept" not in bus.report().errors
        assert not has or not switch.watching


def test_a_bus_simulated_in_this_program_needs_none() -> None:
    with (
        SimulatedBus((1, 2), link="memory://kept", model="ax-12a"),
        open_bus("dynamixel", servos_of("ax-12a")[:2], port="memory://kept", margin_s=0.5) as bus,
    ):
        bus.start()
        assert bus._switch is None
        assert "unkept" not in bus.report().errors


def test_a_bus_without_its_dead_man_switch_says_so_once_and_goes_on(
    wire: SimulatedBus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with open_bus("dynamixel", servos_of("ax-12a")[:2], port=wire.path, margin_s=0.5) as bus:
        with monkeypatch.context() as broken:
            broken.setattr(sys, "executable", str(tmp_path / "python"))
            for _ in range(2):
                bus.start()
                bus.stop()
        assert [record.levelno for record in caplog.records if "if this program is killed" in record.message] == [
            logging.WARNING
        ]
        assert "watchdog_ms = 0" in caplog.text
        assert bus.report().errors["unkept"] == 1
        bus.start()
        assert bus._switch is not None, "after the fault is fixed, the next start has one"


def test_a_dead_man_switch_that_ends_while_the_bus_runs_is_told_and_replaced(
    wire: SimulatedBus, caplog: pytest.LogCaptureFixture
) -> None:
    with open_bus("dynamixel", servos_of("ax-12a")[:2], port=wire.path, margin_s=0.5) as bus:
        bus.start()
        first = bus._switch
        first._process.kill()

        def told() -> bool:
            bus.read()
            return "unkept" in bus.report().errors

        wait_until(told)
        assert "has ended; stop and start again" in caplog.text
        bus.stop()
        bus.start()
        assert bus._switch is not first
        assert bus._switch.watching


# ---------------------------------------------------------------------------- beside a program that is killed

PROGRAM = """
import sys, time
sys.path[:0] = sys.argv[2:]
from drivers import open_bus
from drivers.base.bus import ServoSpec
servos = [ServoSpec(k, f"s{k}", "ax-12a", -1.0, 1.0, 8.0, 200.0) for k in (1, 2)]
bus = open_bus("dynamixel", servos, port=sys.argv[1], margin_s=0.5)
bus.open()
bus.start()
for k in range(100_000):
    bus.write([0.1, 0.1])
    bus.read()
    if k == 3:
        print("ready", bus.report().errors.get("unkept", 0), flush=True)
    time.sleep(0.005)
"""


def torque_after_kill(wire: SimulatedBus, folder: Path, command: list[str], **how: object) -> list[bool]:
    """Let a program drive both servos from a folder, kill it, and see whether they are let go."""
    (folder / "serial.py").write_text("raise SystemExit('of the current folder')\n")
    (folder / "link").symlink_to(wire.path)
    for servo in (1, 2):
        wire.servo(servo).put("Torque Enable", 0)
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, **how) as child:  # type: ignore[call-overload]
        try:
            assert child.stdout.readline() == b"ready 0\n"
            assert torques(wire) == [True, True]
        finally:
            child.kill()
    end = time.monotonic() + 60
    while any(torques(wire)) and time.monotonic() < end:
        time.sleep(0.01)
    return torques(wire)


@pytest.mark.slow
@pytest.mark.parametrize("stderr", ["open", "closed"])
def test_after_a_kill_the_servos_are_let_go(wire: SimulatedBus, root: Path, tmp_path: Path, stderr: str) -> None:
    """Also of a program that finds omote by itself only, from another folder, at a port with a relative path."""
    script = tmp_path / "programs" / "drive.py"
    script.parent.mkdir()
    script.write_text(PROGRAM)
    found = [str(root), *(folder for folder in sys.path if folder.endswith("site-packages"))]
    command = [sys.executable, "-S", str(script), "link", *found]
    if stderr == "closed":
        command = ["/bin/sh", "-c", 'exec "$@" 2>&-', "sh", *command]
    environment = {"HOME": str(tmp_path), "PATH": os.environ["PATH"]}
    assert torque_after_kill(wire, tmp_path, command, env=environment) == [False, False]


def test_a_line_is_waited_for_until_its_time_and_not_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float | None] = []

    class Selector(module.selectors.SelectSelector):
        def select(self, timeout: float | None = None) -> list[object]:
            waited.append(timeout)
            return super().select(0.0)

    monkeypatch.setattr(module.selectors, "DefaultSelector", Selector)
    reading, writing = os.pipe()
    assert module._read_line(reading, time.monotonic() - 1.0) is None
    assert module._read_line(reading, time.monotonic() + 60.0) is None
    assert waited[0] == 0.0
    assert 0.0 < waited[1] <= 60.0
    os.write(writing, b"one\ntw")
    assert module._read_line(reading) == b"one\n"
    assert waited[2:] == [None] * 4
    os.close(writing)
    assert module._read_line(reading) == b"tw", "the end of the input ends a line"
    os.close(reading)
