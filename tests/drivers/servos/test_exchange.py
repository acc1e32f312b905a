"""drivers.servos.exchange: replies sorted by sender and length, servos that owe one, and packets for many servos."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.base.errors import DriverError
from drivers.dynamixel.sdk import Packets
from drivers.packets import packet1
from drivers.packets.packet import BROADCAST_ID, Instruction, encode_instruction, encode_status
from drivers.protocol1.exchange import Exchanges as Exchanges1
from drivers.servos.exchange import Exchange
from drivers.servos.port import Port
from drivers.sim.serving.virtual import VirtualClock

ADDRESS, SIZE = 132, 4
MARGIN_S = 0.1
DATA = b"\1\2\3\4"


class FarEnd:
    """A port in virtual time; the test says what arrives after a packet, in pieces of (delay, bytes)."""

    serial = None

    def __init__(self, *pieces: tuple[float, bytes]) -> None:
        self.path, self.baud, self.is_open = "virtual", 1_000_000, True
        self.clock = VirtualClock(1.0)
        self.sleep = self.clock.sleep
        self.sent: list[bytes] = []
        self.pieces = list(pieces)
        self._coming: list[tuple[float, bytes]] = []

    def open(self) -> None:
        self.is_open = True

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        for delay_s, piece in self.pieces:
            self._coming.append((self.clock() + delay_s, piece))
        self.pieces = []

    def read(self, deadline_s: float) -> bytes:
        if self._coming and self._coming[0][0] <= max(deadline_s, self.clock()):
            at_s, data = self._coming.pop(0)
            self.clock.wait_until(at_s)
            return data
        self.clock.wait_until(deadline_s)
        return b""

    def drain(self) -> int:
        self._coming = [(at_s, data) for at_s, data in self._coming if at_s > self.clock()]
        return 0


def wire(*pieces: tuple[float, bytes]) -> tuple[FarEnd, Port]:
    far_end = FarEnd(*pieces)
    port = Port(far_end, margin_s=MARGIN_S)  # type: ignore[arg-type]
    return far_end, port


def read(port: Port, *ids: int) -> Exchange:
    return Packets().read_group(port, ids, ADDRESS, SIZE)


def status(servo: int, data: bytes = DATA, error: int = 0) -> bytes:
    return encode_status(servo, error, data)


def test_replies_come_in_any_order_and_in_pieces() -> None:
    whole = status(2) + status(1, b"\5\6\7\x08")
    _, port = wire((0.01, whole[:7]), (0.02, whole[7:]))
    got = read(port, 1, 2)
    assert {servo: reply.params for servo, reply in got.replies.items()} == {1: b"\5\6\7\x08", 2: DATA}
    assert (got.missing, got.corrupt, port.suspects, port.stray) == ((), False, set(), 0)
    assert not port.is_using


def test_a_servo_that_does_not_answer_is_missing_and_owes_a_reply() -> None:
    _, port = wire((0.01, status(1)))
    got = read(port, 1, 2)
    assert (list(got.replies), got.missing, got.corrupt, port.suspects) == ([1], (2,), False, {2})


@pytest.mark.parametrize(
    "extra",
    [status(9), status(2, b"\1"), status(2, DATA + b"\5"), status(2, b"")],
    ids=["another id", "too short", "too long", "no data and no refusal"],
)
def test_replies_that_nobody_asked_for_are_thrown_away_and_counted(extra: bytes) -> None:
    _, port = wire((0.01, extra + status(1)))
    got = read(port, 1, 2)
    assert (list(got.replies), got.missing, port.stray) == ([1], (2,), 1)


def test_a_refusal_is_a_reply_without_data() -> None:
    _, port = wire((0.01, status(1, b"", 4) + status(2, DATA, 0x80)))
    got = read(port, 1, 2)
    assert got.replies[1].error == 4
    assert got.replies[2].params == DATA
    assert got.missing == ()


def test_two_replies_under_one_id_are_both_worth_nothing() -> None:
    _, port = wire((0.01, status(1) + status(2) + status(2, b"\0\0\0\0") + b"\0"))
    got = read(port, 1, 2, 3)
    assert (list(got.replies), got.missing, got.corrupt, port.stray) == ([1], (2, 3), True, 2)


def test_three_replies_under_one_id_are_three_strays() -> None:
    _, port = wire((0.01, status(1) + 3 * status(2) + b"\0"))
    assert read(port, 1, 2).missing == (2,)
    assert port.stray == 3


def test_damage_is_only_said_where_a_reply_is_missing() -> None:
    _, port = wire((0.01, b"\xff\xff noise" + status(1)))
    assert not read(port, 1).corrupt
    _, port = wire((0.01, status(1) + status(2)[:-1] + b"\0"))
    got = read(port, 1, 2)
    assert (got.missing, got.corrupt) == ((2,), True)


def test_a_reply_behind_the_deadline_is_none() -> None:
    _, port = wire((MARGIN_S + 0.05, status(1)))
    assert read(port, 1).missing == (1,)


def test_who_owes_a_reply_is_left_out_of_groups_and_greeted_before_a_question() -> None:
    far_end, port = wire((0.01, status(1)))
    port.suspects.add(2)
    got = read(port, 1, 2)
    assert (list(got.replies), got.missing) == ([1], (2,))
    assert far_end.sent == [encode_instruction(BROADCAST_ID, Instruction.SYNC_READ, b"\x84\0\4\0\1")]
    del far_end.sent[:]
    assert read(port, 2).missing == (2,)
    assert far_end.sent == [], "nobody is left to ask"
    assert Packets().read(port, 2, ADDRESS, SIZE).missing == (2,)
    assert far_end.sent == [encode_instruction(2, Instruction.PING)], "no answer to the greeting, no question"
    del far_end.sent[:]
    far_end.pieces = [(0.01, status(2, b"\xb0\4\x34"))]
    assert Packets().revive(port, 2)
    assert port.suspects == set()


def test_a_packet_that_cannot_be_sent_leaves_the_port_free() -> None:
    far_end, port = wire()

    def unplugged(data: bytes) -> None:
        raise DriverError("gone")

    far_end.write = unplugged  # type: ignore[method-assign]
    for send in (Packets().send, Packets().send_only):
        with pytest.raises(DriverError, match="gone"):
            send(port, b"x")
        assert not port.is_using


def test_a_packet_nobody_answers_leaves_the_port_free() -> None:
    far_end, port = wire()
    Packets().send_only(port, b"abc")
    assert (far_end.sent, port.is_using) == ([b"abc"], False)


Frames = Callable[[int, int, bytes], list[bytes]]


@pytest.mark.parametrize("rows", [b"", b"\1\2", b"\1\2\3\4"])
def test_rows_that_are_not_whole_are_refused(rows: bytes) -> None:
    with pytest.raises(ValueError, match=r"not whole rows of 1 \+ 2"):
        Packets().group_frames(116, 2, rows)


def test_rows_become_as_few_packets_as_a_servo_can_take() -> None:
    rows = b"".join(bytes((i, 1, 2)) for i in range(200))
    assert Packets().group_frames(116, 2, rows) == [
        encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, b"\x74\0\2\0" + rows)
    ]
    frames = Exchanges1().group_frames(30, 2, rows)
    packets = packet1.Reader1().feed(b"".join(frames))
    assert [len(frame) <= 250 for frame in frames] == [True] * 3
    assert [packet.params[:2] for packet in packets] == [b"\x1e\2"] * 3
    assert b"".join(packet.params[2:] for packet in packets) == rows
    assert [len(packet.params) for packet in packets] == [242, 242, 122]


def test_numbers_are_as_wide_as_the_protocol_has_them() -> None:
    assert Packets().number(0x1234) == b"\x34\x12"
    assert Exchanges1().number(0x12) == b"\x12"


def test_noise_alone_is_damage_where_a_reply_is_missing() -> None:
    _, port = wire((0.01, b"\1\2\3" + status(1)))
    assert read(port, 1, 2).corrupt
    _, port = wire((0.01, status(1)))
    assert not read(port, 1, 2).corrupt
