"""drivers.sim.servos.mixed: servos of both protocols on one wire, each hearing all of it."""

from __future__ import annotations

import pytest
from dynamixel_sdk import PacketHandler, PortHandler

from drivers.packets import packet as two
from drivers.packets import packet1 as one
from drivers.sim import SimulatedBus
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

pytestmark = pytest.mark.usefixtures("patient_sdk")

PING1 = one.encode(1, one.Instruction1.PING)
PING2 = two.encode_instruction(2, two.Instruction.PING)
BOTH = (PING1 + PING2, PING2 + PING1)


def chain(*faults: str, ids: tuple[int, int] = (1, 2)) -> Chain:
    old, new = SimulatedServo(ids[0], "ax-12a"), SimulatedServo(ids[1], "xl330-m288")
    return Chain([old, new], faults=faults)


def talk(bus: Chain, data: bytes, now_s: float = 0.0) -> bytes:
    return b"".join(reply.data for reply in bus.feed(data, now_s))


def answers(data: bytes) -> tuple[list[int], list[int]]:
    """Ids that answered in Protocol 1.0 and in 2.0."""
    return [p.id for p in one.Reader1().feed(data) if p.id != 0xFD], [p.id for p in two.StatusReader().feed(data)]


@pytest.mark.parametrize("data", BOTH)
def test_each_protocol_is_answered_by_its_own_servos(data: bytes) -> None:
    assert answers(talk(chain(), data)) == ([1], [2])


def test_bytes_may_come_one_by_one() -> None:
    bus = chain()
    assert answers(b"".join(talk(bus, bytes((byte,))) for byte in PING2 + PING1 + PING2)) == ([1], [2, 2])


def test_a_header_in_the_others_data_blocks_nobody() -> None:
    """FF FF 03 50 in Protocol 2.0 data looks like the beginning of a long packet of Protocol 1.0."""
    bus = chain()
    write = two.encode_instruction(2, two.Instruction.WRITE, b"\x74\x00\xff\xff\x03\x50")
    talk(bus, write)
    assert answers(talk(bus, PING1)) == ([1], [])
    assert bus.reader.pending == 0


def test_one_id_in_both_protocols_is_two_servos() -> None:
    bus = chain(ids=(1, 1))
    assert answers(talk(bus, PING1)) == ([1], [])
    assert answers(talk(bus, two.encode_instruction(1, two.Instruction.PING))) == ([], [1])


def test_servos_keep_their_id_and_rate_in_their_own_part() -> None:
    bus = chain()
    talk(bus, one.encode(1, one.Instruction1.WRITE, b"\x03\x09"))
    assert answers(talk(bus, PING1 + one.encode(9, one.Instruction1.PING))) == ([9], [])
    bus.set_line_baud(57_600)
    assert talk(bus, PING2) == b""


@pytest.mark.parametrize(("fault", "left"), [("mute:1", ([], [2])), ("mute:2", ([1], [])), ("mute:*", ([], []))])
def test_faults_find_their_servo_in_either_protocol(fault: str, left: tuple[list[int], list[int]]) -> None:
    bus = chain(fault)
    assert answers(talk(bus, PING1 + PING2)) == left
    bus.faults.clear("mute", 0.0)
    assert answers(talk(bus, PING1 + PING2)) == ([1], [2])


def test_a_double_id_collides_within_a_protocol() -> None:
    bus = chain("dup:2")
    read = two.encode_instruction(2, two.Instruction.READ, b"\x84\x00\x04\x00")
    assert answers(talk(bus, read)) == ([], [])
    assert answers(talk(bus, PING1)) == ([1], [])


def test_the_watchdog_hears_packets_of_either_protocol() -> None:
    bus = chain()
    for params in (b"\x40\x00\x01", b"\x62\x00\x05"):
        talk(bus, two.encode_instruction(2, two.Instruction.WRITE, params))
    for k in range(20):
        talk(bus, PING1, 0.05 * k)
    assert bus.servo(2).register("Bus Watchdog", 0.95) == 5
    talk(bus, PING1, 2.0)
    assert bus.servo(2).register("Bus Watchdog", 2.0) == 255


def test_an_unplugged_adapter_is_the_whole_wire() -> None:
    bus, told = chain(), []
    bus.on_unplug = lambda fault, begins: told.append(begins)
    bus.faults.add(["unplug:for=1s", "echo"], 0.0)
    bus.faults.advance(2.0)
    assert told == [True, False]
    assert bus.echo


def test_the_sdk_speaks_both_protocols_on_one_port() -> None:
    with SimulatedBus([SimulatedServoSpec(1, "mx1-28"), SimulatedServoSpec(2, "xl330-m288")]) as wire:
        port = PortHandler(wire.path)
        port.setPacketTimeout = lambda length: PortHandler.setPacketTimeoutMillis(port, 3000.0)
        port.setBaudRate(1_000_000)
        assert PacketHandler(1.0).ping(port, 1) == (29, 0, 0)
        assert PacketHandler(2.0).ping(port, 2) == (1200, 0, 0)
        port.closePort()


class SimulatedServoSpec:
    """An id with a model."""

    def __init__(self, device_id: int, model: str) -> None:
        self.id, self.model = device_id, model
