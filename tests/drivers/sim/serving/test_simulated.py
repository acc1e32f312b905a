"""drivers.sim.serving.simulated: dynamixel-sdk, pyserial and bare bytes as clients of a served bus."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from dynamixel_sdk import (
    COMM_RX_TIMEOUT,
    GroupBulkRead,
    GroupBulkWrite,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

from drivers.base.errors import DriverError, PortError
from drivers.packets.packet import Instruction as I
from drivers.packets.packet import StatusPacket, StatusReader, encode_instruction
from drivers.sim import SimulatedBus

pytestmark = pytest.mark.usefixtures("patient_sdk")

PING_1 = bytes.fromhex("FFFFFD0001030001194E")
packets = PacketHandler(2.0)


@pytest.fixture
def bus() -> Iterator[SimulatedBus]:
    with SimulatedBus((1, 2, 3)) as running:
        yield running


class PatientPort(PortHandler):
    """The SDK's port with time for a busy machine: it spins beside the bus's thread, and waits only 34 ms."""

    def setPacketTimeout(self, packet_length: int) -> None:
        super().setPacketTimeout(packet_length)
        self.packet_timeout += 3000.0


@pytest.fixture
def port(bus: SimulatedBus) -> Iterator[PortHandler]:
    handler = PatientPort(bus.path)
    assert handler.setBaudRate(1_000_000)
    yield handler
    handler.closePort()


def exchange(path: str, data: bytes, expect: int, wait_s: float = 60.0) -> bytes:
    """Write bytes to the port as a bare program would and read up to `expect` of what comes back."""
    client = os.open(path, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(client, data)
        received, deadline = b"", time.monotonic() + wait_s
        while len(received) < expect and (left := deadline - time.monotonic()) > 0:
            if select.select([client], [], [], left)[0]:
                received += os.read(client, 4096)
        return received
    finally:
        os.close(client)


def wait_until(condition, limit_s: float = 60.0) -> None:
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.005)


# ---------------------------------------------------------------- the SDK, every kind of transaction
def test_sdk_ping_read_write(bus: SimulatedBus, port: PortHandler):
    assert packets.ping(port, 2) == (1200, 0, 0)
    assert packets.write4ByteTxRx(port, 2, 112, 77) == (0, 0)
    assert packets.read4ByteTxRx(port, 2, 112) == (77, 0, 0)
    assert packets.read2ByteTxRx(port, 2, 144) == (50, 0, 0)
    assert packets.read1ByteTxRx(port, 2, 146) == (30, 0, 0)
    assert packets.write4ByteTxRx(port, 2, 132, 1) == (0, 7)
    assert bus.servo(2).register("Profile Velocity") == 77


def test_sdk_silent_id_times_out(bus: SimulatedBus):
    port = PortHandler(bus.path)
    port.setBaudRate(1_000_000)
    assert packets.ping(port, 9)[1] == COMM_RX_TIMEOUT
    port.closePort()


def test_sdk_broadcast_ping(port: PortHandler):
    every = ({i: [1200, 52] for i in (1, 2, 3)}, 0)
    wait_until(lambda: packets.broadcastPing(port) == every)  # the SDK waits 0.8 s, which a busy machine can exceed


def test_sdk_reg_write_action_reboot_clear_factory_reset(bus: SimulatedBus, port: PortHandler):
    assert packets.regWriteTxRx(port, 1, 65, 1, [1]) == (0, 0)
    assert bus.servo(1).register("LED") == 0
    assert packets.action(port, 1) == 0
    wait_until(lambda: bus.servo(1).register("LED") == 1)
    assert packets.clearMultiTurn(port, 1) == (0, 0)
    assert packets.reboot(port, 1) == (0, 0)
    wait_until(lambda: len(exchange(bus.path, PING_1, 14, 0.05)) == 14)
    assert bus.servo(1).register("LED") == 0
    assert packets.write4ByteTxRx(port, 1, 20, 5) == (0, 0)
    assert packets.factoryReset(port, 1, 0x02) == (0, 0)
    assert bus.servo(1).register("Homing Offset") == 0


def test_sdk_sync_write_and_read_move_the_shafts(bus: SimulatedBus, port: PortHandler):
    torque, goal = GroupSyncWrite(port, packets, 64, 1), GroupSyncWrite(port, packets, 116, 4)
    present = GroupSyncRead(port, packets, 126, 10)
    for device in (1, 2, 3):
        torque.addParam(device, [1])
        goal.addParam(device, list((2000 + 100 * device).to_bytes(4, "little")))
        present.addParam(device)
    assert torque.txPacket() == 0
    assert goal.txPacket() == 0
    wait_until(lambda: present.txRxPacket() == 0 and present.getData(3, 132, 4) == 2300)
    wait_until(lambda: present.txRxPacket() == 0 and present.getData(1, 132, 4) == 2100)
    assert [bus.servo(i).torque for i in (1, 2, 3)] == [True] * 3
    assert bus.servo(2).goal == 2200
    assert present.fastSyncRead() == 0
    assert [present.getData(i, 132, 4) for i in (1, 2, 3)] == [2100, 2200, 2300]


def test_sdk_bulk_write_and_read(bus: SimulatedBus, port: PortHandler):
    write, read = GroupBulkWrite(port, packets), GroupBulkRead(port, packets)
    write.addParam(1, 112, 4, [9, 0, 0, 0])
    write.addParam(2, 65, 1, [1])
    assert write.txPacket() == 0
    read.addParam(1, 112, 4)
    read.addParam(2, 65, 1)
    assert read.txRxPacket() == 0
    assert (read.getData(1, 112, 4), read.getData(2, 65, 1)) == (9, 1)
    assert read.fastBulkRead() == 0
    assert (read.getData(1, 112, 4), read.getData(2, 65, 1)) == (9, 1)


def test_sdk_stuffed_reply(bus: SimulatedBus, port: PortHandler):
    # Indirect data holds FF FF FD 00, which must come stuffed and arrive as it was.
    client = serial.Serial(bus.path, 1_000_000, timeout=10)
    client.write(encode_instruction(1, I.WRITE, b"\xd0\0" + b"\xff\xff\xfd\0"))
    assert len(client.read(11)) == 11
    client.close()
    assert packets.read4ByteTxRx(port, 1, 208) == (0x00FDFFFF, 0, 0)


def test_sdk_at_the_wrong_bit_rate_hears_nobody(bus: SimulatedBus, port: PortHandler):
    wrong = PortHandler(bus.path)
    assert wrong.setBaudRate(57_600)
    assert packets.ping(wrong, 1)[1] == COMM_RX_TIMEOUT
    wrong.closePort()
    assert port.setBaudRate(1_000_000)
    assert packets.ping(port, 1)[1] == 0


# ---------------------------------------------------------------- bytes
def test_a_bare_program_needs_no_settings(bus: SimulatedBus):
    assert StatusReader().feed(exchange(bus.path, PING_1, 14)) == [StatusPacket(1, 0, b"\xb0\x04\x34")]


def test_pieces_noise_and_a_second_program(bus: SimulatedBus):
    with serial.Serial(bus.path, 1_000_000, timeout=10) as client:
        client.write(b"\xff\xff\x00noise" + PING_1[:5])
        time.sleep(0.02)
        client.write(PING_1[5:])
        assert len(client.read(14)) == 14
    with serial.Serial(bus.path, 1_000_000, timeout=10) as client:
        client.write(PING_1)
        assert len(client.read(14)) == 14


def test_a_packet_that_never_ends_is_given_up(bus: SimulatedBus):
    with serial.Serial(bus.path, 1_000_000, timeout=10) as client:
        client.write(PING_1[:-1])
        time.sleep(0.25)
        client.write(PING_1)
        assert len(client.read(14)) == 14
        assert client.in_waiting == 0


# ---------------------------------------------------------------- faults while it runs
def test_faults_come_and_go(bus: SimulatedBus):
    bus.fault("mute:1", "crc:2:count=1")
    answer = exchange(bus.path, PING_1 + encode_instruction(3, I.PING), 14)  # the first was heard when 3 has answered
    assert len(answer) == 14 and answer[4] == 3
    bus.clear("mute")
    assert len(exchange(bus.path, PING_1, 14)) == 14
    with pytest.raises(DriverError, match="mute:x"):
        bus.fault("mute:x")


def test_late_reply_comes_late(bus: SimulatedBus):
    bus.fault("late:1:60ms")
    began = time.monotonic()
    assert len(exchange(bus.path, PING_1, 14)) == 14
    assert time.monotonic() - began >= 0.06


def test_echo_gives_back_what_was_sent(bus: SimulatedBus):
    bus.fault("echo")
    data = exchange(bus.path, PING_1, 24)
    assert data[:10] == PING_1
    assert StatusReader().feed(data[10:])[0].id == 1


def test_unplug_and_replug_under_another_name(bus: SimulatedBus, tmp_path: Path):
    first = bus.path
    client = serial.Serial(first, 1_000_000, timeout=0.2)
    bus.fault(f"unplug:for=0.1s:as={tmp_path / 'an other'}")
    with pytest.raises((serial.SerialException, OSError)):
        for _ in range(50):
            client.write(PING_1)
            client.read(1)
    client.close()
    wait_until(lambda: bus.path == str(tmp_path / "an other"))
    assert len(exchange(bus.path, PING_1, 14)) == 14


def test_unplug_strikes_at_its_time_without_any_traffic(tmp_path: Path):
    with SimulatedBus((1,), link=tmp_path / "port", faults=("unplug:at=0.05s:for=0.5s",)) as bus:
        first = os.readlink(bus.path)
        wait_until(lambda: not (tmp_path / "port").is_symlink() or os.readlink(tmp_path / "port") != first)
        wait_until((tmp_path / "port").is_symlink)
        assert len(exchange(str(tmp_path / "port"), PING_1, 14)) == 14


def test_wire_timing_keeps_a_reply_back():
    with SimulatedBus(range(1, 25), baud=57_600, wire=True) as bus:
        request = encode_instruction(0xFE, I.SYNC_READ, b"\x84\0\4\0" + bytes(range(1, 25)))
        began = time.monotonic()
        with serial.Serial(bus.path, 57_600, timeout=10) as client:
            client.write(request)
            assert len(client.read(360)) == 360
        assert time.monotonic() - began >= (38 + 360) * 10 / 57_600 + 24 * 500e-6


# ---------------------------------------------------------------- looking at servos, ending
def test_views_of_servos(bus: SimulatedBus):
    view = bus.servo(2)
    view.place(1234)
    assert view.position_ticks == 1234
    view.put("Torque Enable", 1)
    assert view.torque
    with pytest.raises(ValueError, match="servo 2 holds its shaft"):
        view.place(1)
    view.latch(0x20)
    assert (view.torque, view.register("Hardware Error Status"), view.eeprom_writes) == (False, 0x20, {})
    with pytest.raises(KeyError):
        bus.servo(99)


def test_specs_with_models_and_a_link_that_goes_away(tmp_path: Path):
    class Spec:
        id, model = 5, "xm430-w350"

    link = tmp_path / "head"
    with SimulatedBus((Spec(),), link=link) as bus:
        assert bus.path == str(link)
        assert bus.servo(5).register("Model Number") == 1020
    assert not link.is_symlink()
    bus.close()


def test_bad_settings_leave_nothing_open(tmp_path: Path):
    before = len(os.listdir("/proc/self/fd"))
    for options in ({"faults": ("nonsense",)}, {"model": "nonsense"}):
        for process in (False, True):
            with pytest.raises(DriverError, match="nonsense"):
                SimulatedBus((1,), link=tmp_path / "port", process=process, **options).__enter__()
    assert os.listdir(tmp_path) == []
    assert len(os.listdir("/proc/self/fd")) == before


# ---------------------------------------------------------------- as a child process
def test_child_process_serves_takes_faults_and_ends(tmp_path: Path):
    link = tmp_path / "port"
    with SimulatedBus((1, 2), link=link, process=True, faults=("mute:2",)) as bus:
        assert len(exchange(bus.path, PING_1, 14)) == 14
        bus.fault("mute:1")
        wait_until(lambda: exchange(bus.path, PING_1, 14, 0.03) == b"")
        bus.clear()
        wait_until(lambda: len(exchange(bus.path, PING_1, 14, 0.03)) == 14)
        with pytest.raises(RuntimeError, match="in a thread"):
            bus.servo(1)
    assert not link.is_symlink()


def test_child_survives_an_interrupt_of_the_terminal(tmp_path: Path):
    with SimulatedBus((1,), process=True) as bus:
        os.kill(bus._child.pid, signal.SIGINT)
        assert len(exchange(bus.path, PING_1, 14)) == 14


def test_child_dies_with_a_parent_that_is_killed(tmp_path: Path):
    program = (
        "import sys, time; from drivers.sim import SimulatedBus\n"
        "with SimulatedBus((1,), link=sys.argv[1], process=True) as bus:\n"
        "    sys.stdout.write(str(bus._child.pid) + chr(10)); sys.stdout.flush(); time.sleep(60)\n"
    )
    root = Path(__file__).resolve().parents[4]
    with subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "port")], stdout=subprocess.PIPE, cwd=root
    ) as parent:
        child = int(parent.stdout.readline())
        assert len(exchange(str(tmp_path / "port"), PING_1, 14)) == 14
        parent.kill()
        parent.wait()
    wait_until(lambda: not (tmp_path / "port").is_symlink())
    wait_until(lambda: not running(child))


def running(process_id: int) -> bool:
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def test_a_child_that_cannot_start_says_why(tmp_path: Path):
    with pytest.raises(PortError, match=r"did not start: .*cannot make the link"):
        SimulatedBus((1,), link=tmp_path / "none" / "port", process=True).__enter__()


def test_what_was_written_is_carried_out_also_where_the_server_saw_only_the_first_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As on a busy computer: it looked for bytes before they came, and for commands after that."""
    real, late = select.select, threading.Event()

    def looked_before(watched: list[Any], *others: Any) -> tuple[list[Any], list[Any], list[Any]]:
        ready = real(watched, *others)[0]
        if late.is_set() and watched[0] in ready:
            late.clear()
            return watched[:1], [], []
        return ready, [], []

    monkeypatch.setattr("drivers.sim.serving.serve.select", SimpleNamespace(select=looked_before))
    with SimulatedBus([1]) as bus, serial.Serial(bus.path, 1_000_000) as port:
        for value in (1, 0) * 20:
            late.set()
            port.write(encode_instruction(1, I.WRITE, b"\x40\0" + bytes((value,))))
            bus.sync()
            assert bus.servo(1).torque == bool(value)


@pytest.mark.parametrize("process", [False, True])
def test_a_fault_that_the_far_end_cannot_have_is_told(process: bool) -> None:
    with SimulatedBus([1], family="maestro", model="rc-180", process=process) as board:
        with pytest.raises(DriverError, match="a bus of this kind has only") as caught:
            board.fault("mute:*", "hw:1:0x20")
        assert caught.value.hint
        board.fault("mute:*")
        board.clear()


def test_a_bus_whose_process_has_ended_says_so_and_closes() -> None:
    with SimulatedBus((1,), process=True) as bus:
        child = bus._child
        child.kill()
        child.wait()
        with pytest.raises(PortError, match="has ended"):
            bus.fault("mute:1")
        with pytest.raises(PortError, match="has ended"):
            bus.clear()
        child.stdin.write(b"what is left in its buffer\n")
        bus.close()
        assert bus._child is None
        bus.close()


def test_a_port_that_cannot_come_back_under_another_name_keeps_its_own(tmp_path: Path, caplog) -> None:
    link, taken = tmp_path / "port", tmp_path / "taken"
    taken.write_text("a file")
    with SimulatedBus((1,), link=link) as bus:
        bus.fault(f"unplug:for=0.05s:as={taken}")
        wait_until(lambda: "does not come back" in caplog.text and link.is_symlink())
        assert len(exchange(str(link), PING_1, 14)) == 14
        assert bus.path == str(link)
    assert taken.read_text() == "a file"
