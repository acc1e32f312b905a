"""Feetech's own scservo_sdk as a client of simulated STS and SCS servos: all its transaction kinds."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from drivers.sim import SimulatedBus

pytestmark = pytest.mark.usefixtures("patient_sdk")

scs = pytest.importorskip("scservo_sdk", reason="needs feetech-servo-sdk")

TORQUE, ACCELERATION, GOAL, PRESENT, LOCK, OFFSET = 40, 41, 42, 56, 55, 31


class PatientPort(scs.PortHandler):
    """The SDK's port with time for a busy machine: it waits only some milliseconds by itself."""

    def setPacketTimeout(self, packet_length: int) -> None:
        super().setPacketTimeout(packet_length)
        self.packet_timeout += 3000.0


@pytest.fixture
def bus() -> Iterator[SimulatedBus]:
    with SimulatedBus([1, 2, 3], model="sts3215") as running:
        yield running


@pytest.fixture
def port(bus: SimulatedBus) -> Iterator[PatientPort]:
    handler = PatientPort(bus.path)
    assert handler.openPort()
    assert handler.setBaudRate(1_000_000)
    yield handler
    handler.closePort()


packets = scs.PacketHandler(0)  # little-endian: STS


def good(result: tuple) -> tuple:
    """What a transaction brought, when it went well."""
    *values, communication, error = result
    assert communication == scs.COMM_SUCCESS
    assert error == 0
    return tuple(values)


def test_ping_tells_the_model(port: PatientPort) -> None:
    assert good(packets.ping(port, 2)) == (777,)


def test_reads_of_every_width(bus: SimulatedBus, port: PatientPort) -> None:
    bus.servo(1).place(1234)
    assert good(packets.read2ByteTxRx(port, 1, PRESENT)) == (1234,)
    assert good(packets.read1ByteTxRx(port, 1, 5)) == (1,)
    assert good(packets.read4ByteTxRx(port, 1, PRESENT)) == (1234,)
    assert good(packets.readTxRx(port, 1, PRESENT, 2)) == ([0xD2, 0x04],)


def test_writes_move_the_shaft(bus: SimulatedBus, port: PatientPort) -> None:
    good(packets.write1ByteTxRx(port, 1, TORQUE, 1))
    good(packets.write2ByteTxRx(port, 1, GOAL, 2100))
    assert bus.servo(1).torque
    while good(packets.read2ByteTxRx(port, 1, PRESENT))[0] < 2098:
        pass
    packets.write1ByteTxOnly(port, 1, TORQUE, 0)
    end = time.monotonic() + 60
    while bus.servo(1).torque:
        assert time.monotonic() < end


def test_permanent_memory_counts_as_written_while_its_lock_is_open(bus: SimulatedBus, port: PatientPort) -> None:
    good(packets.write1ByteTxRx(port, 2, LOCK, 1))
    good(packets.write2ByteTxRx(port, 2, OFFSET, 100))
    assert (bus.servo(2).register("Homing Offset"), bus.servo(2).eeprom_writes) == (100, {})
    good(packets.write1ByteTxRx(port, 2, LOCK, 0))
    good(packets.write2ByteTxRx(port, 2, OFFSET, 200))
    assert (bus.servo(2).register("Homing Offset"), bus.servo(2).eeprom_writes) == (200, {"Homing Offset": 1})


def test_registered_writes_wait_for_the_action(bus: SimulatedBus, port: PatientPort) -> None:
    for servo in (1, 2):
        good(packets.write1ByteTxRx(port, servo, TORQUE, 1))
        good(packets.regWriteTxRx(port, servo, GOAL, 2, [scs.SCS_LOBYTE(2200), scs.SCS_HIBYTE(2200)]))
    assert [bus.servo(i).goal for i in (1, 2)] == [2048, 2048]
    assert packets.action(port, scs.BROADCAST_ID) == scs.COMM_SUCCESS
    good(packets.ping(port, 1))
    assert [bus.servo(i).goal for i in (1, 2)] == [2200, 2200]


def test_group_write_and_group_read(bus: SimulatedBus, port: PatientPort) -> None:
    write = scs.GroupSyncWrite(port, packets, GOAL, 2)
    for servo in (1, 2, 3):
        assert write.addParam(servo, [scs.SCS_LOBYTE(1990 + servo), scs.SCS_HIBYTE(1990 + servo)])
    assert write.txPacket() == scs.COMM_SUCCESS
    read = scs.GroupSyncRead(port, packets, GOAL, 2)
    assert all(read.addParam(servo) for servo in (1, 2, 3))
    assert read.txRxPacket() == scs.COMM_SUCCESS
    assert all(read.isAvailable(servo, GOAL, 2) for servo in (1, 2, 3))
    assert [read.getData(servo, GOAL, 2) for servo in (1, 2, 3)] == [1991, 1992, 1993]


def test_a_silent_id_times_out(bus: SimulatedBus) -> None:
    port = scs.PortHandler(bus.path)
    assert port.setBaudRate(1_000_000)
    _, communication, _ = packets.ping(port, 9)
    port.closePort()
    assert communication == scs.COMM_RX_TIMEOUT


def test_scs_servos_speak_with_the_high_byte_first() -> None:
    big = scs.PacketHandler(1)
    with SimulatedBus([4], model="scs0009") as bus:
        port = PatientPort(bus.path)
        assert port.setBaudRate(1_000_000)
        bus.servo(4).place(300)
        assert good(big.read2ByteTxRx(port, 4, PRESENT)) == (300,)
        good(big.write2ByteTxRx(port, 4, GOAL, 700))
        port.closePort()
        assert bus.servo(4).goal == 700
    scs.PacketHandler(0)  # the byte order is a global of the SDK: left as the other tests expect it
