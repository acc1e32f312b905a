"""drivers.sim.servos.protocol2: packets in, replies out, without a port."""

from __future__ import annotations

import pytest

from drivers.packets.packet import (
    BROADCAST_ID,
    StatusPacket,
    decode_fast,
    encode_instruction,
)
from drivers.packets.packet import ErrorNumber as E
from drivers.packets.packet import Instruction as I
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from tests.drivers.sim.servos.wire2 import POSITION, ask, chain, le, wire, words


# ---------------------------------------------------------------- one servo
def test_ping_tells_model_and_firmware():
    assert ask(chain(), 2, I.PING) == [StatusPacket(2, 0, words(1200) + b"\x34")]
    assert ask(chain(), 9, I.PING) == []


def test_broadcast_ping_is_answered_in_order_of_id():
    assert [reply.id for reply in ask(chain(7, 1, 4), BROADCAST_ID, I.PING)] == [1, 4, 7]


def test_vendor_example_of_a_ping_byte_by_byte():
    bus = Chain([SimulatedServo(i, "xm430-w210", firmware=38) for i in (1, 2)])
    sent = bytes.fromhex("FFFFFD00FE0300013142")
    assert b"".join(reply.data for reply in bus.feed(sent, 0.0)).hex().upper() == (
        "FFFFFD00010700550006042 6655D".replace(" ", "") + "FFFFFD0002070055000604266F6D"
    )


def test_read_and_write():
    bus = chain()
    assert ask(bus, 1, I.WRITE, words(116) + le(3000)) == [StatusPacket(1, 0, b"")]
    assert ask(bus, 1, I.READ, words(116, 4)) == [StatusPacket(1, 0, le(3000))]
    assert ask(bus, 2, I.READ, POSITION) == [StatusPacket(2, 0, le(2002))]


@pytest.mark.parametrize(
    ("instruction", "params", "error"),
    [
        (I.READ, words(132), E.DATA_LENGTH),
        (I.READ, words(227, 2), E.ACCESS),
        (I.WRITE, words(116), E.DATA_LENGTH),
        (I.WRITE, words(116) + b"\0", E.DATA_LENGTH),
        (I.WRITE, words(132) + le(0), E.ACCESS),
        (I.WRITE, words(116) + le(5000), E.DATA_LIMIT),
        (I.WRITE, words(11) + b"\2", E.DATA_RANGE),
        (I.REG_WRITE, words(116), E.DATA_LENGTH),
        (I.REG_WRITE, words(116) + le(5000), E.DATA_LIMIT),
        (I.ACTION, b"", E.INSTRUCTION),
        (0x33, b"", E.INSTRUCTION),
        (I.FACTORY_RESET, b"", E.DATA_RANGE),
        (I.CLEAR, b"\1", E.DATA_RANGE),
    ],
)
def test_refusals(instruction: int, params: bytes, error: E):
    assert ask(chain(), 1, instruction, params) == [StatusPacket(1, error, b"")]


def test_status_return_levels():
    bus = chain(1)
    for level, answered in ((2, [I.PING, I.READ, I.WRITE]), (1, [I.PING, I.READ]), (0, [I.PING])):
        wire(bus, 1, I.WRITE, words(68) + bytes((level,)))
        for instruction, params in ((I.PING, b""), (I.READ, POSITION), (I.WRITE, words(65) + b"\1")):
            assert bool(ask(bus, 1, instruction, params)) is (instruction in answered)
        assert bool(ask(bus, BROADCAST_ID, I.SYNC_READ, POSITION + b"\1")) is (level > 0)
        assert bool(wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, POSITION + b"\1")) is (level > 0)
    assert bus.servo(1).register("LED", 0.0) == 1


def test_registered_writes_start_together():
    bus = chain()
    for device in (1, 2):
        assert ask(bus, device, I.REG_WRITE, words(65) + b"\1")[0].error == 0
    assert wire(bus, BROADCAST_ID, I.ACTION) == b""
    assert [bus.servo(i).register("LED", 0.0) for i in (1, 2, 3)] == [1, 1, 0]


def test_id_change_is_answered_under_the_old_id():
    bus = chain(1)
    assert ask(bus, 1, I.WRITE, words(7) + b"\x09") == [StatusPacket(1, 0, b"")]
    assert ask(bus, 1, I.PING) == []
    assert ask(bus, 9, I.PING)[0].id == 9


def test_reboot_answers_then_is_deaf():
    bus = chain(1)
    wire(bus, 1, I.WRITE, words(65) + b"\1")
    assert ask(bus, 1, I.REBOOT, now_s=1.0) == [StatusPacket(1, 0, b"")]
    assert ask(bus, 1, I.PING, now_s=1.2) == []
    assert ask(bus, 1, I.READ, words(65, 1), now_s=1.3) == [StatusPacket(1, 0, b"\0")]


# ---------------------------------------------------------------- broadcast
def test_broadcast_write_reaches_all_and_broadcast_read_none():
    bus = chain()
    assert wire(bus, BROADCAST_ID, I.WRITE, words(65) + b"\1") == b""
    assert [servo.register("LED", 0.0) for servo in bus.servos] == [1, 1, 1]
    assert wire(bus, BROADCAST_ID, I.READ, POSITION) == b""
    assert wire(bus, BROADCAST_ID, 0x33) == b""
    assert wire(bus, BROADCAST_ID, I.WRITE, words(65)) == b""


@pytest.mark.parametrize(("firmware", "option", "offset"), [(41, 0xFF, 0), (42, 0xFF, 9), (42, 1, 0)])
def test_broadcast_factory_reset_of_everything_is_ignored_by_newer_firmware(firmware, option, offset):
    bus = chain(4, model="xm430-w350", firmware=firmware)
    wire(bus, 4, I.WRITE, words(20) + le(9))
    assert wire(bus, BROADCAST_ID, I.FACTORY_RESET, bytes((option,))) == b""
    assert bus.servos[0].register("Homing Offset", 0.0) == offset


def test_secondary_id_obeys_without_answering_and_never_in_eeprom():
    bus = chain()
    for device in (1, 2):
        wire(bus, device, I.WRITE, words(12) + b"\x20")
    assert wire(bus, 0x20, I.WRITE, words(65) + b"\1") == b""
    assert [servo.register("LED", 0.0) for servo in bus.servos] == [1, 1, 0]
    assert wire(bus, 0x20, I.READ, POSITION) == b""
    wire(bus, 0x20, I.WRITE, words(20) + le(5))
    assert bus.servo(1).register("Homing Offset", 0.0) == 0
    wire(bus, 1, I.WRITE, words(12) + b"\x03")
    wire(bus, 3, I.WRITE, words(65) + b"\1")  # a primary id of the same number wins
    wire(bus, 3, I.WRITE, words(116) + le(77))
    assert (bus.servo(1).goal, bus.servo(3).goal) == (2001, 77)


# ---------------------------------------------------------------- many servos
def test_sync_read_answers_in_the_order_asked_and_goes_on_behind_a_gap():
    bus = chain()
    replies = ask(bus, BROADCAST_ID, I.SYNC_READ, POSITION + bytes((3, 9, 1)))
    assert replies == [StatusPacket(3, 0, le(2003)), StatusPacket(1, 0, le(2001))]


def test_chain_stop_silences_everybody_behind_a_gap():
    bus = chain(faults=("chain-stop",))
    assert [r.id for r in ask(bus, BROADCAST_ID, I.SYNC_READ, POSITION + bytes((3, 9, 1)))] == [3]
    bulk = b"\x02" + POSITION + b"\x09" + POSITION + b"\x01" + POSITION
    assert [r.id for r in ask(bus, BROADCAST_ID, I.BULK_READ, bulk)] == [2]
    assert [r.id for r in ask(bus, BROADCAST_ID, I.PING)] == [1, 2, 3]


def test_sync_read_of_a_bad_range_gives_errors_without_data():
    replies = ask(chain(), BROADCAST_ID, I.SYNC_READ, words(226, 4) + b"\1\2")
    assert replies == [StatusPacket(1, E.ACCESS, b""), StatusPacket(2, E.ACCESS, b"")]


def test_sync_write():
    bus = chain()
    body = words(116, 4) + b"".join(bytes((i,)) + le(100 * i) for i in (1, 3, 9))
    assert wire(bus, BROADCAST_ID, I.SYNC_WRITE, body) == b""
    assert [servo.goal for servo in bus.servos] == [100, 2002, 300]


def test_a_sync_write_cut_short_keeps_its_whole_entries():
    bus = chain()
    body = words(116, 4) + b"\1" + le(100) + b"\2" + le(200)[:3]
    wire(bus, BROADCAST_ID, I.SYNC_WRITE, body)
    assert [servo.goal for servo in bus.servos] == [100, 2002, 2003]


def test_bulk_read_and_write():
    bus = chain()
    write = b"\1" + words(116, 4) + le(111) + b"\2" + words(65, 1) + b"\1" + b"\3" + words(116, 4) + b"\0"
    assert wire(bus, BROADCAST_ID, I.BULK_WRITE, write) == b""
    assert [servo.goal for servo in bus.servos] == [111, 2002, 2003]
    assert bus.servo(2).register("LED", 0.0) == 1
    read = b"\2" + words(65, 1) + b"\1" + words(116, 4)
    assert ask(bus, BROADCAST_ID, I.BULK_READ, read) == [StatusPacket(2, 0, b"\1"), StatusPacket(1, 0, le(111))]


@pytest.mark.parametrize(
    "instruction", [I.SYNC_READ, I.FAST_SYNC_READ, I.BULK_READ, I.FAST_BULK_READ, I.SYNC_WRITE, I.BULK_WRITE]
)
def test_group_instructions_to_one_id_or_with_broken_parameters_do_nothing(instruction: int):
    bus = chain()
    assert wire(bus, 1, instruction, POSITION + b"\1") == b""
    assert wire(bus, BROADCAST_ID, instruction, b"\1\0") == b""
    assert [servo.goal for servo in bus.servos] == [2001, 2002, 2003]


def test_fast_sync_read_is_one_unstuffed_packet_with_a_crc_for_each():
    bus = chain()
    for servo in bus.servos:
        servo.registers.put("LED", 1)
        servo.registers.memory[126:132] = bytes.fromhex("FFFFFD00FFFF")
        servo.drive.sense = lambda now_s: 0.0
    data = wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, words(126, 6) + bytes((3, 1)))
    assert len(data) == 8 + 2 * (4 + 6)
    expected = [StatusPacket(i, 0, bytes.fromhex("FFFFFD00FFFF")) for i in (3, 1)]
    assert decode_fast(data, [(3, 6), (1, 6)]) == expected


@pytest.mark.parametrize("fault", ["mute:2", "silent:2", "drop:2"])
def test_fast_reply_ends_at_the_first_silent_servo(fault: str):
    bus = chain(faults=(fault,))
    data = wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, POSITION + bytes((1, 2, 3)))
    assert decode_fast(data, [(1, 4), (2, 4), (3, 4)]) == [StatusPacket(1, 0, le(2001))]
    assert wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, POSITION + bytes((2, 3))) == b""


def test_fast_bulk_read():
    data = wire(chain(), BROADCAST_ID, I.FAST_BULK_READ, b"\2" + words(144, 2) + b"\1" + words(146, 1))
    assert decode_fast(data, [(2, 2), (1, 1)]) == [StatusPacket(2, 0, words(50)), StatusPacket(1, 0, b"\x1e")]


@pytest.mark.parametrize(("model", "firmware"), [("xl320", None), ("xl330-m288", 45), ("mx-28", None)])
def test_servos_that_know_no_fast_reads_do_not_answer_them(model, firmware):
    bus = chain(1, model=model, firmware=firmware)
    assert wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, words(0, 2) + b"\1") == b""
    assert len(ask(bus, BROADCAST_ID, I.SYNC_READ, words(0, 2) + b"\1")) == 1


def test_fast_read_of_a_bad_range_keeps_its_places():
    data = wire(chain(), BROADCAST_ID, I.FAST_SYNC_READ, words(226, 4) + b"\1\2")
    assert [(r.id, r.error) for r in decode_fast(data, [(1, 4), (2, 4)])] == [(1, E.ACCESS), (2, E.ACCESS)]


def test_only_the_first_of_a_fast_reply_pays_the_return_delay():
    bus = chain()
    for instruction, delays in ((I.SYNC_READ, [True] * 3), (I.FAST_SYNC_READ, [True, False, False])):
        frame = encode_instruction(BROADCAST_ID, instruction, POSITION + b"\1\2\3")
        assert [reply.servo is not None for reply in bus.feed(frame, 0.0)] == delays


def test_status_packets_on_the_wire_are_not_instructions():
    bus = chain()
    echo = wire(bus, 1, I.PING)
    assert bus.feed(echo, 0.0) == []


@pytest.mark.parametrize("params", [b"", POSITION, b"\x74\0\xff\xff\xfd\0"])
def test_size_on_the_wire_counts_the_stuffing(params: bytes):
    bus, frame = chain(), encode_instruction(1, I.WRITE, params)
    (packet,) = bus.reader.feed(frame)
    assert bus.size(packet) == len(frame)


def fast(*faults: str) -> bytes:
    return wire(chain(faults=faults), BROADCAST_ID, I.FAST_SYNC_READ, POSITION + bytes((1, 2)))


def test_what_faults_do_to_a_part_of_a_joint_reply():
    """Each part is error byte, id, four bytes of data and two of CRC; eight bytes of the packet's head come first."""
    good = fast()
    assert fast("short:1:1") == good[:11] + good[14:]
    assert fast("short:2:0") == good[:18] + good[22:]
    assert fast("wrongid:2:9") == good[:17] + b"\x09" + good[18:]
    noisy = fast("noise:2:3")
    assert (noisy[:16], noisy[19:]) == (good[:16], good[16:])
    flipped = fast("flip:2")
    assert (int.from_bytes(flipped[16:], "big") ^ int.from_bytes(good[16:], "big")).bit_count() == 1


def test_bulk_packets_end_with_their_last_whole_entry():
    bus = chain()
    entry = b"\1" + words(65, 1) + b"\1"
    wire(bus, BROADCAST_ID, I.BULK_WRITE, entry + b"\2" + words(65, 1))
    wire(bus, 1, I.BULK_WRITE, b"\3" + words(65, 1) + b"\1")
    assert [servo.register("LED", 0.0) for servo in bus.servos] == [1, 0, 0]
    wire(bus, BROADCAST_ID, I.BULK_WRITE, b"\2" + words(65, 1) + b"\1")
    assert bus.servo(2).register("LED", 0.0) == 1


def test_a_reboot_is_answered_with_the_alert_of_before():
    bus = chain(1)
    bus.servo(1).latch(0x20, 0.0)
    assert ask(bus, 1, I.REBOOT) == [StatusPacket(1, 0x80, b"")]
    assert ask(bus, 1, I.PING, now_s=1.0)[0].error == 0


def test_refusals_carry_the_alert():
    bus = chain(1)
    bus.servo(1).latch(0x20, 0.0)
    for instruction, params, error in (
        (0x33, b"", E.INSTRUCTION),
        (I.READ, words(227, 2), E.ACCESS),
        (I.REG_WRITE, words(132) + le(0), E.ACCESS),
        (I.ACTION, b"", E.INSTRUCTION),
        (I.CLEAR, b"", E.DATA_RANGE),
        (I.FACTORY_RESET, b"\7", E.DATA_RANGE),
    ):
        assert ask(bus, 1, instruction, params) == [StatusPacket(1, 0x80 | error, b"")]


def test_silent_twins_do_not_collide_in_group_reads():
    bus = Chain([SimulatedServo(1, position=5.0), SimulatedServo(1, position=9.0), SimulatedServo(2, position=7.0)])
    bus.faults.add(["silent:1"], 0.0)
    replies = ask(bus, BROADCAST_ID, I.SYNC_READ, POSITION + b"\1\2")
    assert replies == [StatusPacket(2, 0, le(7))]
