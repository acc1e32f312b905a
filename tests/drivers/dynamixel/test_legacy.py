"""drivers.dynamixel.legacy: known faults of dynamixel-sdk's Protocol 1.0, shown on the bare SDK and gone here."""

from __future__ import annotations

from collections.abc import Iterator

import dynamixel_sdk as bare
import pytest

from drivers.dynamixel.legacy import Packets1
from drivers.packets.packet1 import Error1
from drivers.servos.port import Port
from drivers.sim import SimulatedBus

POSITION = 36
Client = tuple[bare.PortHandler, bare.Protocol1PacketHandler]


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus((1, 2), model="mx1-28") as simulated:
        simulated.servo(2).place(1000)
        yield simulated


@pytest.fixture
def theirs(wire: SimulatedBus) -> Iterator[Client]:
    port = bare.PortHandler(wire.path)
    port.setBaudRate(1_000_000)
    port.setPacketTimeout = lambda length: bare.PortHandler.setPacketTimeoutMillis(port, 300.0)
    yield port, bare.PacketHandler(1.0)
    port.closePort()


@pytest.fixture
def ours(wire: SimulatedBus) -> Iterator[tuple[Port, Packets1]]:
    port = Port(wire.path, margin_s=0.3)
    port.openPort()
    yield port, Packets1()
    port.closePort()


def test_s4_the_bare_sdk_takes_the_checksum_of_a_short_reply_for_data(wire: SimulatedBus, theirs: Client) -> None:
    wire.fault("short:1:1")
    checksum = ~(1 + 3) & 0xFF
    assert theirs[1].read2ByteTxRx(theirs[0], 1, POSITION) == (checksum << 8, bare.COMM_SUCCESS, 0), "it is at 2048"


def test_s4_a_short_reply_is_no_value_here(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    wire.fault("short:1:1")
    port, packets = ours
    port.margin_s = 0.05
    assert packets.read2ByteTxRx(port, 1, POSITION) == (0, bare.COMM_RX_TIMEOUT, 0)


def test_s4_the_bare_sdk_takes_the_echo_of_its_question_for_the_answer(wire: SimulatedBus, theirs: Client) -> None:
    """FF FF 01 04 02 24 02 D2 is a read of two bytes at 36, and reads as a status with flags 2 and data 24 02."""
    wire.fault("echo")
    assert theirs[1].read2ByteTxRx(theirs[0], 1, POSITION) == (0x0224, bare.COMM_SUCCESS, Error1.ANGLE_LIMIT)


def test_s4_four_bytes_are_never_an_echo_here(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    wire.fault("echo")
    assert ours[1].read4ByteTxRx(ours[0], 1, POSITION) == (2048, bare.COMM_SUCCESS, 0)


def test_s4_a_late_reply_answers_another_question_of_the_bare_sdk(wire: SimulatedBus, theirs: Client) -> None:
    port, packets = theirs
    wire.fault("late:1:80ms:count=1")
    port.setPacketTimeout = lambda length: bare.PortHandler.setPacketTimeoutMillis(port, 40.0)
    assert packets.read2ByteTxRx(port, 1, POSITION)[1] == bare.COMM_RX_TIMEOUT
    port.setPacketTimeout = lambda length: bare.PortHandler.setPacketTimeoutMillis(port, 300.0)
    assert packets.read2ByteTxRx(port, 1, 8) == (2048, bare.COMM_SUCCESS, 0), "asked for the limit, which is 4095"


def test_s4_a_late_reply_answers_nothing_here(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    port, packets = ours
    wire.fault("late:1:80ms:count=1")
    port.margin_s = 0.04
    assert packets.read4ByteTxRx(port, 1, POSITION)[1] == bare.COMM_RX_TIMEOUT
    port.margin_s = 0.3
    assert packets.read2ByteTxRx(port, 1, 8) == (4095, bare.COMM_SUCCESS, 0)


def test_s5_the_port_is_free_after_an_exception(
    wire: SimulatedBus, theirs: Client, ours: tuple[Port, Packets1], monkeypatch: pytest.MonkeyPatch
) -> None:
    for port, packets in (theirs, ours):
        with monkeypatch.context() as patch:
            patch.setattr(type(port), "readPort", _interrupt)
            patch.setattr("drivers.port.serialport.SerialPort.read", _interrupt)
            with pytest.raises(KeyboardInterrupt):
                packets.read2ByteTxRx(port, 1, POSITION)
    assert theirs[0].is_using
    assert not ours[0].is_using


def _interrupt(*_: object) -> bytes:
    raise KeyboardInterrupt


def test_s11_too_little_data_is_told(theirs: Client, ours: tuple[Port, Packets1]) -> None:
    with pytest.raises(IndexError):
        theirs[1].writeTxRx(theirs[0], 1, 30, 2, [1])
    with pytest.raises(ValueError, match="cut short"):
        ours[1].writeTxRx(ours[0], 1, 30, 2, [1])


def bulk(port: bare.PortHandler, packets: bare.Protocol1PacketHandler) -> bare.GroupBulkRead:
    group = bare.GroupBulkRead(port, packets)
    for servo in (1, 2):
        group.addParam(servo, POSITION, 2)
    return group


def test_p1_bulk_reads_do_not_work_with_the_bare_sdk(theirs: Client) -> None:
    with pytest.raises(TypeError, match="bulkReadTx"):
        bulk(*theirs).txRxPacket()


def test_p1_bulk_reads_work_here(ours: tuple[Port, Packets1]) -> None:
    group = bulk(*ours)
    assert group.txRxPacket() == bare.COMM_SUCCESS
    assert [group.getData(servo, POSITION, 2) for servo in (1, 2)] == [2048, 1000]


def test_p1_a_bulk_read_takes_no_reply_of_another_length(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    wire.fault("short:2:1")
    ours[0].margin_s = 0.05
    assert bulk(*ours).txRxPacket() == bare.COMM_RX_TIMEOUT


def test_other_transactions_of_the_sdk_work_here(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    port, packets = ours
    assert packets.ping(port, 1) == (29, bare.COMM_SUCCESS, 0)
    assert packets.ping(port, 9)[1] == bare.COMM_RX_TIMEOUT
    assert packets.write2ByteTxRx(port, 1, 30, 4096) == (bare.COMM_SUCCESS, Error1.RANGE)
    assert packets.write2ByteTxOnly(port, 1, 30, 600) == bare.COMM_SUCCESS
    assert packets.regWriteTxRx(port, 1, 30, 2, [0, 4]) == (bare.COMM_SUCCESS, 0)
    assert packets.action(port, bare.BROADCAST_ID) == bare.COMM_SUCCESS
    group = bare.GroupSyncWrite(port, packets, 30, 2)
    assert group.addParam(2, [0xE8, 0x03])
    assert group.txPacket() == bare.COMM_SUCCESS
    assert packets.read2ByteTxRx(port, 2, 30) == (1000, bare.COMM_SUCCESS, 0)
    assert wire.servo(1).goal == 1024
    port.is_using = True
    assert packets.ping(port, 1)[1] == bare.COMM_PORT_BUSY


def test_s10_error_flags_of_bulk_reads_are_kept(wire: SimulatedBus, ours: tuple[Port, Packets1]) -> None:
    wire.servo(2).latch(0x20)
    got = ours[1].read_group(ours[0], [1, 2], POSITION, 4, "bulk")
    assert {servo: reply.code for servo, reply in got.replies.items()} == {1: 0, 2: Error1.OVERLOAD}
