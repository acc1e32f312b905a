"""drivers.dynamixel.sdk: each known fault of dynamixel-sdk, shown on the bare SDK and gone here.

Numbers S1 to S14 as in the module's docstring. Everything runs over real pseudo-terminals.
"""

from __future__ import annotations

import itertools
import struct
import time
from collections.abc import Callable, Iterator

import dynamixel_sdk as bare
import pytest

from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import (
    ALERT,
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    StatusPacket,
    crc16,
    encode_fast_head,
    encode_fast_part,
    encode_instruction,
    encode_status,
    stuff,
    unstuff,
)
from drivers.servos.port import Port
from tests.drivers.wire import Wire

GOAL, POSITION, CURRENT = 116, 132, 126
GENEROUS_S = 1.0
MINUS_ONE_AND_FD = bytes.fromhex("ffff fd00 0000 0008 0000")
PINGED = b"\xb0\x04\x34"

OURS, BARE = "ours", "bare"
Client = tuple[bare.PortHandler, bare.Protocol2PacketHandler]


@pytest.fixture
def wire() -> Iterator[Wire]:
    with Wire() as far_end:
        yield far_end


@pytest.fixture
def ours(wire: Wire) -> Iterator[tuple[Port, Packets]]:
    port = Port(wire.path, margin_s=GENEROUS_S)
    port.openPort()
    yield port, Packets()
    port.closePort()


@pytest.fixture
def theirs(wire: Wire) -> Iterator[Client]:
    port = bare.PortHandler(wire.path)
    port.openPort()
    yield port, bare.Protocol2PacketHandler()
    if port.ser is not None:
        port.ser.close()


@pytest.fixture
def patient(theirs: Client) -> Client:
    """Theirs, with as much time for an answer as a busy machine may need."""
    port, _ = theirs
    port.setPacketTimeout = lambda size: port.setPacketTimeoutMillis(1e3 * GENEROUS_S)
    return theirs


def table(values: dict[int, bytes]) -> Callable[[InstructionPacket], list[bytes]]:
    """Servos that answer every read, by id, with fixed data cut to the length asked for."""

    def answer(packet: InstructionPacket) -> list[bytes]:
        if packet.instruction == Instruction.PING:
            return [encode_status(packet.id, 0, PINGED)] if packet.id in values else []
        if packet.instruction == Instruction.READ:
            (length,) = struct.unpack_from("<H", packet.params, 2)
            return [encode_status(packet.id, 0, values[packet.id][:length])] if packet.id in values else []
        if packet.instruction == Instruction.SYNC_READ:
            (length,) = struct.unpack_from("<H", packet.params, 2)
            return [encode_status(i, 0, values[i][:length]) for i in packet.params[4:] if i in values]
        return []

    return answer


def four(value: int) -> bytes:
    return struct.pack("<i", value)


# ---------------------------------------------------------------------------- S1, S2 stuffing


def test_s1_a_goal_with_header_bytes_is_stuffed(wire: Wire, ours: tuple, theirs: Client) -> None:
    right = bytes.fromhex("fffffd00010a000374 00fffffdfd0021e7")
    port, packets = theirs
    packets.write4ByteTxOnly(port, 1, GOAL, 0x00FDFFFF)
    assert wire.wait_heard(16) != right, "the bare SDK stuffs by now: this override can go"
    assert b"\xff\xff\xfd\xfd" not in wire.heard
    wire.heard.clear()
    port, packets = ours
    packets.write4ByteTxOnly(port, 1, GOAL, 0x00FDFFFF)
    assert wire.wait_heard(17) == right
    wire.heard.clear()
    packets.write_group(port, GOAL, 4, b"\x01" + four(0x00FDFFFF))
    assert b"\xff\xff\xfd\xfd" in wire.wait_heard(20)


def payloads(alphabet: bytes, length: int) -> Iterator[bytes]:
    return (bytes(p) for n in range(1, length + 1) for p in itertools.product(alphabet, repeat=n))


def as_list(body: bytes) -> list[int]:
    """A status packet of the SDK around stuffed bytes from INST on."""
    length = len(body) + 2
    return [0xFF, 0xFF, 0xFD, 0, 1, length & 0xFF, length >> 8, *body, 0, 0]


def wrongly_unstuffed(remove: Callable[[list[int]], list[int]]) -> int:
    wrong = 0
    for payload in payloads(b"\xff\xfd\x00", 7):
        body = b"\x55\x00" + payload
        got = remove(as_list(stuff(body)))
        length = (got[5] | got[6] << 8) - 2
        wrong += bytes(got[7 : 7 + length]) != body
    return wrong


def test_s2_unstuffing_is_the_inverse_of_stuffing() -> None:
    assert wrongly_unstuffed(bare.Protocol2PacketHandler().removeStuffing) > 0
    assert wrongly_unstuffed(Packets().removeStuffing) == 0


def test_s2_a_block_of_minus_one_beside_fd_is_read_right(wire: Wire, ours: tuple) -> None:
    nasty = b"\xff\xff\xfd\xff\xfd\xfd"
    wire.answer = table({1: nasty})
    port, packets = ours
    assert packets.readTxRx(port, 1, CURRENT, 6)[:2] == (list(nasty), bare.COMM_SUCCESS)
    assert packets.read_group(port, [1], CURRENT, 6).replies[1].params == nasty


def test_our_stuffing_of_the_sdks_packets_agrees_with_the_codec() -> None:
    body = b"\x03\x74\x00\xff\xff\xfd\x00"
    plain = as_list(body)
    stuffed = Packets().addStuffing(plain)
    assert bytes(stuffed[7:-2]) == stuff(body)
    assert Packets().removeStuffing(stuffed) == plain
    assert unstuff(stuff(body)) == body
    assert Packets().updateCRC(0, list(b"123456789"), 9) == crc16(b"123456789") == 0xFEE8


# ---------------------------------------------------------------------------- S3, S4 late and left-over replies


def test_s3_what_lay_in_the_input_is_never_an_answer(wire: Wire, ours: tuple) -> None:
    wire.answer = table({1: four(1234)})
    port, packets = ours
    wire.send(encode_status(1, 0, four(-7)))
    time.sleep(0.05)
    assert packets.read4ByteTxRx(port, 1, POSITION)[0] == 1234


class LateOnce:
    """The first question's reply comes after the client gave up: just before the reply to the next one."""

    def __init__(self, *values: int) -> None:
        self.replies = [four(value) for value in values]
        self.owed: list[bytes] = []
        self.late = True

    def __call__(self, packet: InstructionPacket) -> list[bytes]:
        data = PINGED if packet.instruction == Instruction.PING else self.replies.pop(0)
        self.owed.append(encode_status(packet.id, 0, data))
        if self.late:
            self.late = False
            return []
        out, self.owed = self.owed, []
        return out


def test_s4_a_late_reply_is_not_the_answer_to_the_next_question(wire: Wire, theirs: Client, ours: tuple) -> None:
    wire.answer = LateOnce(111, 222)
    port, packets = theirs
    assert packets.read4ByteTxRx(port, 1, POSITION)[1] == bare.COMM_RX_TIMEOUT
    port.setPacketTimeout = lambda size: port.setPacketTimeoutMillis(1e3 * GENEROUS_S)
    value, result, _ = packets.read4ByteTxRx(port, 1, GOAL)
    assert (value, result) == (111, bare.COMM_SUCCESS), "the bare SDK tells late replies apart by now"
    port.ser.timeout = GENEROUS_S
    assert port.ser.read(15) == encode_status(1, 0, four(222))  # else it may arrive where the next question is asked
    port.ser.close()

    wire.answer = LateOnce(111, 222)
    port, packets = ours
    assert packets.read4ByteTxRx(port, 1, POSITION)[1] == bare.COMM_RX_TIMEOUT
    assert packets.read4ByteTxRx(port, 1, GOAL)[:2] == (222, bare.COMM_SUCCESS)
    assert port.stray == 1


@pytest.mark.slow
def test_s4_a_shorter_reply_than_asked_for_is_refused(wire: Wire, ours: tuple, patient: Client) -> None:
    wire.answer = lambda packet: [encode_status(packet.id, 0, b"\x00")]
    port, packets = patient
    with pytest.raises(IndexError):
        packets.read4ByteTxRx(port, 1, POSITION)
    port.ser.close()
    port, packets = ours
    assert packets.read4ByteTxRx(port, 1, POSITION)[:2] == (0, bare.COMM_RX_TIMEOUT)
    assert packets.read_group(port, [2], POSITION, 4).missing == (2,)


def test_s4_the_length_of_a_long_reply_is_checked_too(wire: Wire, ours: tuple) -> None:
    block = bytes(k % 251 for k in range(300))
    wire.answer = table({1: block})
    port, packets = ours
    assert packets.readTxRx(port, 1, 0, 300)[:2] == (list(block), bare.COMM_SUCCESS)


def test_s4_a_silent_servo_is_asked_for_data_only_after_a_ping(wire: Wire, ours: tuple) -> None:
    port, packets = ours
    port.margin_s = 0.02
    assert packets.ask(port, 1, Instruction.READ, struct.pack("<HH", 132, 4), 4).missing == (1,)
    wire.packets.clear()
    assert packets.ask(port, 1, Instruction.READ, struct.pack("<HH", 132, 4), 4).missing == (1,)
    assert [packet.instruction for packet in wire.packets] == [Instruction.PING]
    assert packets.read_group(port, [1], 132, 4).missing == (1,)
    assert len(wire.packets) == 1, "a group read must not ask a servo that is out of step"
    wire.answer = table({1: four(5)})
    port.margin_s = GENEROUS_S
    assert packets.ask(port, 1, Instruction.READ, struct.pack("<HH", 132, 4), 4).replies[1].params == four(5)
    assert port.suspects == set()


# ---------------------------------------------------------------------------- S10, S11, S13 group transactions


def test_s10_an_alert_in_a_group_read_is_seen(wire: Wire, ours: tuple, patient: Client) -> None:
    wire.answer = lambda packet: [encode_status(i, ALERT, four(2050)) for i in packet.params[4:]]
    port, packets = patient
    group = bare.GroupSyncRead(port, packets, POSITION, 4)
    group.addParam(1)
    assert group.txRxPacket() == bare.COMM_SUCCESS
    assert not hasattr(group, "getError")
    port.ser.close()
    port, packets = ours
    assert packets.read_group(port, [1, 2], POSITION, 4).replies == {
        1: StatusPacket(1, ALERT, four(2050)),
        2: StatusPacket(2, ALERT, four(2050)),
    }


def test_s11_group_writes_check_their_data_before_sending(wire: Wire, ours: tuple, theirs: Client) -> None:
    port, packets = theirs
    group = bare.GroupSyncWrite(port, packets, GOAL, 4)
    assert group.addParam(1, [0, 0])
    with pytest.raises(IndexError):
        group.txPacket()
    port.is_using = False
    port.ser.close()
    port, packets = ours
    for rows in (b"", b"\x01\x00\x00"):
        with pytest.raises(ValueError, match="rows"):
            packets.write_group(port, GOAL, 4, rows)
    with pytest.raises(ValueError, match="parameters"):
        packets.syncWriteTxOnly(port, GOAL, 4, [1, 0, 0], 5)
    assert not port.is_using
    assert wire.heard == b""


def test_s13_goals_are_sent_without_waiting(wire: Wire, ours: tuple) -> None:
    port, packets = ours
    start = time.monotonic()
    for _ in range(3):
        packets.write_group(port, GOAL, 4, b"\x01" + four(9))
    assert time.monotonic() - start < GENEROUS_S
    assert not port.is_using
    wire.wait_heard(57)
    assert [packet.params for packet in wire.packets] == [b"\x74\x00\x04\x00\x01" + four(9)] * 3


# ---------------------------------------------------------------------------- S14 partial and fast group reads


@pytest.mark.slow
def test_s7_s14_a_silent_servo_does_not_cost_the_others_theirs(wire: Wire, ours: tuple, theirs: Client) -> None:
    wire.answer = table({1: four(10), 3: four(30)})
    port, packets = theirs
    group = bare.GroupSyncRead(port, packets, POSITION, 4)
    for servo in (1, 2, 3):
        group.addParam(servo)
    assert group.txRxPacket() != bare.COMM_SUCCESS
    assert not group.isAvailable(1, POSITION, 4)
    port.ser.close()
    port, packets = ours
    port.margin_s = 2.0  # a busy machine answers late
    got = packets.read_group(port, [1, 2, 3], POSITION, 4)
    assert {servo: reply.params for servo, reply in got.replies.items()} == {1: four(10), 3: four(30)}
    assert (got.missing, got.corrupt, port.suspects) == ((2,), False, {2})


def fast_reply(values: dict[int, int], damage: int | None = None, cut: int | None = None) -> bytes:
    head = encode_fast_head([4] * len(values))
    crc, out = crc16(head), head
    for servo, value in values.items():
        part, crc = encode_fast_part(servo, 0, four(value), crc)
        if servo == damage:
            part = bytes((part[0], part[1], part[2] ^ 1)) + part[3:]
        if servo == cut:
            break
        out += part
    return out


def fast_group(client: Client) -> bare.GroupSyncRead:
    group = bare.GroupSyncRead(*client, POSITION, 4)
    for servo in (3, 7, 4):
        group.addParam(servo)
    return group


@pytest.mark.slow
def test_s14_fast_reads_keep_every_servo_whose_own_bytes_are_right(wire: Wire, ours: tuple, theirs: Client) -> None:
    values = {3: 166, 7: 2079, 4: 1023}
    port, packets = ours
    wire.answer = lambda packet: [fast_reply(values)]
    got = packets.read_group(port, [3, 7, 4], POSITION, 4, "fast")
    assert {servo: reply.params for servo, reply in got.replies.items()} == {i: four(v) for i, v in values.items()}
    assert wire.heard == bytes.fromhex("fffffd00fe0a008a84000400030704 20f2")

    for spoil, left in (({"damage": 7}, {3, 4}), ({"cut": 7}, {3})):
        wire.answer = lambda packet, spoil=spoil: [fast_reply(values, **spoil)]
        port.closePort()
        group = fast_group(theirs)
        assert group.fastSyncRead() != bare.COMM_SUCCESS
        assert not group.isAvailable(3, POSITION, 4)
        theirs[0].ser.close()
        port.openPort()
        port.margin_s = 1.0  # a busy machine answers late
        got = packets.read_group(port, [3, 7, 4], POSITION, 4, "fast")
        assert set(got.replies) == left
        assert set(got.missing) == {3, 7, 4} - left
        port.closePort()
        theirs[0].openPort()


def test_fast_replies_are_not_unstuffed(wire: Wire, ours: tuple) -> None:
    values = {1: struct.unpack("<i", b"\xff\xff\xfd\x00")[0], 2: struct.unpack("<i", b"\xff\xff\xfd\xfd")[0]}
    wire.answer = lambda packet: [fast_reply(values)]
    port, packets = ours
    got = packets.read_group(port, [1, 2], POSITION, 4, "fast")
    assert {servo: reply.params for servo, reply in got.replies.items()} == {i: four(v) for i, v in values.items()}


# ---------------------------------------------------------------------------- the SDK's own names over our handlers


def test_corrupt_replies_are_told_from_silence(wire: Wire, ours: tuple) -> None:
    def flipped(packet: InstructionPacket) -> list[bytes]:
        good = bytearray(encode_status(packet.id, 0, four(1)))
        good[9] ^= 0x10
        return [bytes(good)]

    wire.answer = flipped
    port, packets = ours
    port.margin_s = 1.0  # a busy machine answers late
    assert packets.read4ByteTxRx(port, 1, POSITION)[1] == bare.COMM_RX_CORRUPT
    wire.answer = table({1: four(1)})
    assert packets.read4ByteTxRx(port, 1, POSITION)[:2] == (1, bare.COMM_SUCCESS)


def test_two_answers_under_one_id_are_both_worth_nothing(wire: Wire, ours: tuple) -> None:
    wire.answer = lambda packet: [encode_status(2, 0, four(1)), encode_status(2, 0, four(2))]
    port, packets = ours
    port.margin_s = 1.0  # a busy machine answers late
    got = packets.read_group(port, [1, 2], POSITION, 4)
    assert (got.replies, got.missing, got.corrupt) == ({}, (1, 2), True)


def test_an_echo_is_stripped_and_no_reply_is_lost_with_it(wire: Wire, ours: tuple) -> None:
    answer = table({1: four(10), 2: four(20)})

    def echoing(packet: InstructionPacket) -> list[bytes]:
        return [encode_instruction(packet.id, packet.instruction, packet.params), *answer(packet)]

    wire.answer = echoing
    port, packets = ours
    for _ in range(3):
        packets.write_group(port, GOAL, 4, b"\x01" + four(9))
        assert packets.read4ByteTxRx(port, 1, POSITION)[0] == 10
        got = packets.read_group(port, [1, 2], POSITION, 4)
        assert (got.missing, got.replies[2].params) == ((), four(20))


def test_sdk_code_runs_on_our_handlers(wire: Wire, ours: tuple) -> None:
    wire.answer = table({1: four(10), 2: four(20)})
    port, packets = ours
    assert packets.ping(port, 1) == (1200, bare.COMM_SUCCESS, 0)
    group = bare.GroupSyncRead(port, packets, POSITION, 4)
    group.addParam(1)
    group.addParam(2)
    assert group.txRxPacket() == bare.COMM_SUCCESS
    assert [group.getData(servo, POSITION, 4) for servo in (1, 2)] == [10, 20]
    assert packets.read2ByteTxRx(port, 2, POSITION) == (20, bare.COMM_SUCCESS, 0)


class Bytes:
    """A port that hands out what lies ready, all at once, and keeps what is given back to it."""

    def __init__(self, data: bytes) -> None:
        self._held, self.is_using = bytearray(data), True

    def readPort(self, count: int) -> bytes:  # the SDK's name
        data, self._held = bytes(self._held), bytearray()
        return data


def test_replies_that_come_together_are_returned_one_by_one() -> None:
    replies = [encode_status(servo, 0, bytes((servo,))) for servo in (1, 2, 3, 4)]
    port, cut = Bytes(encode_instruction(9, 1) + b"".join(replies)[:-3]), b"".join(replies)[-3:]
    for servo in (1, 2, 3):
        frame, result = Packets().rxPacket(port, False)  # type: ignore[arg-type]
        assert (frame[4], frame[9], result) == (servo, servo, bare.COMM_SUCCESS)
        assert not port.is_using
    port._held += cut
    assert Packets().rxPacket(port, False)[0] == list(replies[3])  # type: ignore[arg-type]
    assert Packets().rxPacket(port, False) == ([], bare.COMM_RX_TIMEOUT)  # type: ignore[arg-type]


class Pieces:
    """A port whose reply comes in pieces, and which counts how often it was asked for more."""

    def __init__(self, *pieces: bytes) -> None:
        self._pieces, self.asked = list(pieces), 0

    def first(self) -> bytes:
        return self._pieces.pop(0)

    def more(self) -> bytes:
        self.asked += 1
        return self._pieces.pop(0)


def test_of_a_reply_in_pieces_more_is_awaited_until_it_is_whole_or_none_comes() -> None:
    port = Pieces(b"abc", b"de", b"fghij")
    assert Packets()._receive(port, 10) == b"abcdefghij"
    assert port.asked == 2
    cut = Pieces(b"abc", b"")
    assert (Packets()._receive(cut, 10), cut.asked) == (b"abc", 1)


def test_broadcast_ping_finds_everybody(wire: Wire, ours: tuple) -> None:
    wire.answer = lambda packet: [encode_status(i, 0, bytes((i, 4, 38))) for i in (3, 9, 200)]
    port, packets = ours
    found, result = packets.broadcastPing(port)
    assert result == bare.COMM_SUCCESS
    assert found == {i: [0x400 + i, 38] for i in (3, 9, 200)}
    assert wire.packets == [InstructionPacket(BROADCAST_ID, Instruction.PING, b"")]
