"""drivers.sim.servos.chain: who hears, who answers, and what faults do, on a wire of Protocol 2.0 servos."""

from __future__ import annotations

import pytest

from drivers.packets.packet import ALERT, BROADCAST_ID, StatusPacket, StatusReader, decode_fast, encode_instruction
from drivers.packets.packet import ErrorNumber as E
from drivers.packets.packet import Instruction as I
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from tests.drivers.sim.servos.wire2 import POSITION, ask, chain, le, wire, words


# ---------------------------------------------------------------- bit rate, watchdog, twins
def test_servos_at_another_bit_rate_do_not_hear():
    bus = chain(1, 2)
    bus.set_line_baud(1_000_000)
    wire(bus, 1, I.WRITE, words(8) + b"\1")
    assert [r.id for r in ask(bus, BROADCAST_ID, I.PING)] == [2]
    bus.set_line_baud(57_600)
    assert [r.id for r in ask(bus, BROADCAST_ID, I.PING)] == [1]
    bus.set_line_baud(None)
    assert [r.id for r in ask(bus, BROADCAST_ID, I.PING)] == [1, 2]


def test_any_packet_feeds_every_watchdog():
    bus = chain(1, 2)
    for device in (1, 2):
        wire(bus, device, I.WRITE, words(98) + b"\5")
        wire(bus, device, I.WRITE, words(64) + b"\1")
    for k in range(1, 20):
        wire(bus, 2, I.PING, now_s=k * 0.09)
    assert ask(bus, 1, I.READ, words(98, 1), 19 * 0.09)[0].params == b"\5"
    assert ask(bus, 1, I.READ, words(98, 1), 19 * 0.09 + 0.11)[0].params == b"\xff"
    assert ask(bus, 1, I.WRITE, words(116) + le(5), 2.0) == [StatusPacket(1, E.DATA_RANGE, b"")]


def test_two_servos_of_one_id_collide():
    bus = Chain([SimulatedServo(1, position=0x0F0.__float__()), SimulatedServo(1, position=0xA0A.__float__())])
    data = wire(bus, 1, I.READ, POSITION)
    assert data[9:11] == bytes((0xF0 & 0x0A, 0x00 & 0x0A))
    assert StatusReader().feed(data) == []
    assert wire(bus, BROADCAST_ID, I.SYNC_READ, POSITION + b"\1") == data
    wire(bus, 1, I.WRITE, words(65) + b"\1")
    assert [servo.register("LED", 0.0) for servo in bus.servos] == [1, 1]


def test_unknown_servo_is_named():
    with pytest.raises(KeyError, match="no simulated servo has id 9"):
        chain().servo(9)


# ---------------------------------------------------------------- faults
def test_mute_neither_hears_nor_answers_until_cleared():
    bus = chain(faults=("mute:2",))
    assert ask(bus, 2, I.WRITE, words(65) + b"\1") == []
    assert wire(bus, BROADCAST_ID, I.SYNC_WRITE, words(65, 1) + b"\2\1") == b""
    assert bus.servo(2).register("LED", 0.0) == 0
    bus.faults.clear("mute", 1.0)
    assert len(ask(bus, 2, I.PING, now_s=1.0)) == 1


def test_silent_obeys():
    bus = chain(faults=("silent:2",))
    assert ask(bus, 2, I.WRITE, words(65) + b"\1") == []
    assert bus.servo(2).register("LED", 0.0) == 1


def test_late_replies_say_by_how_much():
    bus = chain(faults=("late:2:45ms",))
    frame = encode_instruction(BROADCAST_ID, I.SYNC_READ, POSITION + b"\1\2\3")
    assert [reply.late_s for reply in bus.feed(frame, 0.0)] == [0.0, 0.045, 0.0]
    fast = encode_instruction(BROADCAST_ID, I.FAST_SYNC_READ, POSITION + b"\1\2\3")
    assert [reply.late_s for reply in bus.feed(fast, 0.0)] == [0.0, 0.045, 0.0]


def test_spoilt_replies_of_a_sync_read():
    for fault, good in (("crc:2", [1, 3]), ("flip:2", [1, 3]), ("drop:2", [1, 3]), ("noise:2:4", [1, 2, 3])):
        bus = chain(faults=(fault,))
        data = wire(bus, BROADCAST_ID, I.SYNC_READ, POSITION + b"\1\2\3")
        reader = StatusReader()
        assert [r.id for r in reader.feed(data) + reader.flush()] == good, fault


def test_short_and_wrong_id_replies_have_good_checksums():
    assert ask(chain(faults=("short:2",)), 2, I.READ, POSITION) == [StatusPacket(2, 0, le(2002)[:1])]
    assert ask(chain(faults=("wrongid:2:3",)), 2, I.READ, POSITION) == [StatusPacket(3, 0, le(2002))]


def test_spoilt_part_of_a_fast_reply_leaves_the_others_readable():
    for fault in ("crc:2", "flip:2", "wrongid:2:9"):
        bus = chain(faults=(fault,))
        data = wire(bus, BROADCAST_ID, I.FAST_SYNC_READ, POSITION + b"\1\2\3")
        assert [r.id for r in decode_fast(data, [(1, 4), (2, 4), (3, 4)])] == [1, 3], fault


def test_alert_with_valid_data():
    assert ask(chain(faults=("alert:2",)), 2, I.READ, POSITION) == [StatusPacket(2, ALERT, le(2002))]


def test_hardware_error_at_a_time():
    bus = chain(faults=("hw:2:0x20:at=1s",))
    wire(bus, 2, I.WRITE, words(64) + b"\1")
    assert ask(bus, 2, I.READ, words(70, 1), 0.9)[0] == StatusPacket(2, 0, b"\0")
    assert ask(bus, 2, I.READ, words(70, 1), 1.1)[0] == StatusPacket(2, ALERT, b"\x20")
    assert not bus.servo(2).torque


def test_voltage_dip_and_back():
    bus = chain(faults=("volts:2:3.0:at=1s:for=1s",))
    assert ask(bus, 2, I.READ, words(144, 2), 0.5)[0].params == words(50)
    assert ask(bus, 2, I.READ, words(144, 2), 1.5)[0] == StatusPacket(2, ALERT, words(30))
    assert ask(bus, 2, I.READ, words(144, 2), 2.5)[0] == StatusPacket(2, ALERT, words(50))


def test_overheating_one_servo():
    bus = chain(faults=("temp:2:75",))
    assert ask(bus, 2, I.READ, words(146, 1))[0] == StatusPacket(2, ALERT, b"\x4b")
    assert ask(bus, 1, I.READ, words(146, 1))[0].error == 0
    bus.faults.clear("temp", 1.0)
    assert ask(bus, 2, I.READ, words(146, 1), 1.0)[0] == StatusPacket(2, ALERT, b"\x1e")


def test_stall_and_release():
    bus = chain(faults=("stall:1",))
    wire(bus, 1, I.WRITE, words(64) + b"\1")
    wire(bus, 1, I.WRITE, words(116) + le(2200))
    assert bus.servo(1).position_ticks(0.5) == 2001
    bus.faults.clear("stall", 0.5)
    wire(bus, 1, I.WRITE, words(116) + le(2200), 0.5)
    assert bus.servo(1).position_ticks(5.0) == 2200


def test_wiring_faults():
    bus = chain(faults=("watchdog-ignored:1", "eeprom-busy:2:20ms", "baud:3:57600", "echo"))
    assert bus.servo(1).watchdog_ignored
    assert bus.echo
    bus.set_line_baud(1_000_000)
    assert ask(bus, 3, I.PING) == []
    assert len(ask(bus, 2, I.WRITE, words(20) + le(1))) == 1
    assert ask(bus, 2, I.PING, now_s=0.01) == []
    assert len(ask(bus, 2, I.PING, now_s=0.03)) == 1
    bus.faults.clear(None, 1.0)
    assert not bus.servo(1).watchdog_ignored
    assert not bus.echo
    assert bus.servo(2).eeprom_busy_s == 0.0
    assert len(ask(bus, 3, I.PING, now_s=1.0)) == 1


def test_a_servo_of_a_wrong_bit_rate_comes_back_at_the_wires_or_at_the_usual_one():
    for line_baud, baud in ((57_600, 57_600), (None, 1_000_000)):
        bus = chain(faults=("baud:3:115200",))
        bus.set_line_baud(line_baud)
        assert bus.servo(3).baud == 115_200
        bus.faults.clear("baud", 1.0)
        assert bus.servo(3).baud == baud


def test_duplicate_id_as_a_fault():
    bus = chain(faults=("dup:2",))
    assert StatusReader().feed(wire(bus, 2, I.READ, POSITION)) == []
    assert len(ask(bus, 1, I.READ, POSITION)) == 1
    assert [twin.id for twin in bus.twins(2)] == [2] and bus.twins(1) == []
    bus.faults.clear("dup", 1.0)
    assert len(ask(bus, 2, I.READ, POSITION, 1.0)) == 1 and bus.twins(2) == []


def test_unplug_is_passed_on():
    bus = chain()
    seen = []
    bus.on_unplug = lambda fault, begins: seen.append((fault.alias, begins))
    bus.faults.add(["unplug:at=1s:for=2s:as=/tmp/other"], 0.0)
    bus.faults.advance(1.0)
    bus.faults.advance(3.0)
    assert seen == [("/tmp/other", True), ("/tmp/other", False)]


def test_everybody_mute_stays_mute_under_a_new_id():
    bus = chain(1)
    wire(bus, 1, I.WRITE, words(7) + b"\5")
    bus.faults.add(["mute:*"], 0.0)
    assert ask(bus, 5, I.PING) == []
