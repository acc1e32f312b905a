"""drivers.protocol1.exchange and port: whose answer it is, when a reply says only who sent it and how long it is."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable

import pytest

from drivers.base.errors import DriverError
from drivers.packets.packet1 import Error1, Instruction1, Packet1, Reader1, encode
from drivers.protocol1 import HELLO, WINDOW
from drivers.protocol1.exchange import Exchanges
from drivers.protocol1.registers import window
from drivers.protocol1.telemetry import layout_of
from drivers.servos.layout import NAMES, item_of
from drivers.servos.port import Port
from drivers.sim.serving.virtual import VirtualClock
from drivers.tables.tables import load_table

MARGIN_S = 0.2
MODELS = ("sts3215", "scs0009", "ax-12a", "mx1-28")
Answer = Callable[[Packet1], list["bytes | tuple[float, bytes]"]]


class FarEnd:
    """A port in virtual time, behind which ``answer`` says what comes back for every packet, one after the other."""

    serial = None

    def __init__(self) -> None:
        self.answer: Answer = lambda packet: []
        self.packets: list[Packet1] = []
        self.path, self.baud, self.is_open = "virtual", 1_000_000, False
        self.clock = VirtualClock(1.0)
        self.sleep = self.clock.sleep
        self._reader = Reader1()
        self._coming: deque[tuple[float, bytes]] = deque()

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def write(self, data: bytes) -> None:
        for packet in self._reader.feed(data):
            self.packets.append(packet)
            at_s = max(self.clock(), self._coming[-1][0] if self._coming else 0.0)
            for piece in self.answer(packet):
                delay, piece = piece if isinstance(piece, tuple) else (0.0, piece)
                at_s += delay
                self._coming.append((at_s, piece))

    def read(self, deadline_s: float) -> bytes:
        if self._coming and self._coming[0][0] <= max(deadline_s, self.clock()):
            at_s, data = self._coming.popleft()
            self.clock.wait_until(at_s)
            return data
        self.clock.wait_until(deadline_s)
        return b""

    def drain(self) -> int:
        count = 0
        while data := self.read(0.0):
            count += len(data)
        return count


@pytest.fixture
def wire() -> FarEnd:
    return FarEnd()


@pytest.fixture
def port(wire: FarEnd) -> Port:
    link = Port(wire, margin_s=MARGIN_S)  # type: ignore[arg-type]
    link.openPort()
    return link


def status(data: bytes, servo: int = 1, flags: int = 0) -> bytes:
    return encode(servo, flags, data)


def read(port: Port, length: int, address: int = 56, packets: Exchanges | None = None) -> bytes | None:
    got = (packets or Exchanges()).ask(port, 1, Instruction1.READ, bytes((address, length)), length)
    reply = got.replies.get(1)
    return None if reply is None else reply.params


# ---------------------------------------------------------------------------- the rule of lengths


@pytest.mark.parametrize(("model", "feedback"), list(itertools.product(MODELS, ("full", "position"))))
def test_no_read_has_the_length_of_its_question_or_of_a_hello(model: str, feedback: str) -> None:
    table = load_table(model)
    layout = layout_of(table, feedback)
    sizes = [block.size for block in (layout.feedback, *layout.slow)]
    sizes += [window(table, item)[1] for name in NAMES if (item := item_of(table, name))]
    assert {2, HELLO}.isdisjoint(sizes)
    for name in NAMES:
        if item := item_of(table, name):
            at, size = window(table, item)
            assert at <= item.address
            assert item.end <= at + size <= table.size
    assert len({2, WINDOW, HELLO}) == 3


@pytest.mark.parametrize("length", [1, 4, 8])
def test_an_echo_is_no_answer(wire: FarEnd, port: Port, length: int) -> None:
    wire.answer = lambda packet: [encode(*packet)]
    assert read(port, length) is None
    wire.answer = lambda packet: [encode(*packet), status(bytes(packet.params[1]))]
    assert read(port, length) == bytes(length)
    assert port.suspects == set()


def test_an_echo_of_a_write_is_no_acknowledgement(wire: FarEnd, port: Port) -> None:
    wire.answer = lambda packet: [encode(*packet)]
    assert Exchanges().ask(port, 1, Instruction1.WRITE, b"\x28\x01", 0).missing == (1,)


@pytest.mark.parametrize(("flags", "there"), [(0, True), (Error1.OVERLOAD, True), (Error1.INPUT_VOLTAGE, False)])
def test_a_ping_that_looks_like_its_own_echo_counts_as_one(wire: FarEnd, port: Port, flags: int, there: bool) -> None:
    wire.answer = lambda packet: [status(b"", flags=flags)]
    assert Exchanges().pings(port, 1) is there


# ---------------------------------------------------------------------------- late replies


def test_a_late_reply_answers_no_later_question(wire: FarEnd, port: Port) -> None:
    """Without the greeting in between, the second read would take the first one's data."""
    port.margin_s = 0.05
    late = iter([[(0.08, status(b"\x01\x01\x01\x01"))]])

    def answer(packet: Packet1) -> list[bytes | tuple[float, bytes]]:
        held = next(late, None)
        return held if held is not None else [status(bytes([9]) * packet.params[1])]

    wire.answer = answer
    assert read(port, 4) is None
    assert port.suspects == {1}
    assert read(port, 4) == b"\x09\x09\x09\x09"
    assert port.suspects == set()
    assert [packet.params for packet in wire.packets] == [b"\x38\x04", bytes((0, HELLO)), b"\x38\x04"]
    assert port.stray == 1


def test_a_servo_that_answers_no_greeting_is_asked_nothing(wire: FarEnd, port: Port) -> None:
    port.margin_s = 0.02
    assert read(port, 4) is None
    assert read(port, 4) is None
    assert [packet.params for packet in wire.packets] == [b"\x38\x04", bytes((0, HELLO))]


def test_a_greeting_answered_late_is_thrown_away(wire: FarEnd, port: Port) -> None:
    port.margin_s = 0.05
    port.suspects.add(1)
    delays = iter([0.08, 0.0, 0.0])
    wire.answer = lambda packet: [(next(delays), status(bytes(packet.params[1])))]
    assert read(port, 4) is None
    assert read(port, 4) == bytes(4)
    assert port.stray <= 1


# ---------------------------------------------------------------------------- damage


@pytest.mark.parametrize("bit", range(8))
def test_no_single_bit_anywhere_makes_a_wrong_answer(wire: FarEnd, port: Port, bit: int) -> None:
    good = status(b"\x00\x08\x07\xfe")
    for at in range(len(good)):
        frame = bytearray(good)
        frame[at] ^= 1 << bit
        reader = Reader1()
        packets = reader.feed(bytes(frame)) + reader.flush()
        assert all((packet.id, len(packet.params)) != (1, 4) for packet in packets)


def test_noise_before_a_reply_is_passed_over_and_damage_is_told(wire: FarEnd, port: Port) -> None:
    wire.answer = lambda packet: [b"\xff\xff\x01\x00\xff", status(b"\x05\x06\x07\x08")]
    assert read(port, 4) == b"\x05\x06\x07\x08"
    port.margin_s = 0.02
    wire.answer = lambda packet: [status(b"\x05\x06\x07\x08")[:-1] + b"\0"]
    got = Exchanges().ask(port, 1, Instruction1.READ, b"\x38\x04", 4)
    assert (got.replies, got.missing, got.corrupt) == ({}, (1,), True)


def test_two_replies_of_one_servo_are_worth_nothing(wire: FarEnd, port: Port) -> None:
    port.margin_s = 0.02
    wire.answer = lambda packet: [status(b"\1\1\1\1") + status(b"\2\2\2\2")]
    assert read(port, 4) is None


def test_a_partial_sync_read_keeps_what_arrived(wire: FarEnd, port: Port) -> None:
    port.margin_s = 0.05
    wire.answer = lambda packet: [status(b"\1\0\0\0", 1), status(b"\3\0", 2), status(b"\7\0\0\0", 7)]
    got = Exchanges().read_group(port, [1, 2, 7], 56, 4, "sync")
    assert ({servo: reply.params[0] for servo, reply in got.replies.items()}, got.missing) == ({1: 1, 7: 7}, (2,))
    assert port.suspects == {2}
    assert Exchanges().read_group(port, [2], 56, 4, "sync").missing == (2,), "it is not asked before it greets"


@pytest.mark.parametrize(
    ("manner", "frames"),
    [
        ("sync", ["FFFFFE06823804010236"]),
        ("bulk", ["FFFFFE09920004013804023872"]),
        ("", ["FFFF0104023804BC", "FFFF0204023804BB"]),
    ],
)
def test_how_many_are_asked_at_once(wire: FarEnd, port: Port, manner: str, frames: list[str]) -> None:
    wire.answer = lambda packet: [
        status(b"\0\0\0\0", servo) for servo in ((1, 2) if packet.id == 0xFE else (packet.id,))
    ]
    assert Exchanges().read_group(port, [1, 2], 56, 4, manner).missing == ()
    sent = [encode(*packet).hex().upper() for packet in wire.packets]
    assert [frame[:-2] for frame in sent] == [frame[:-2] for frame in frames]


def test_rows_that_fill_no_packet_are_sent_in_several(wire: FarEnd, port: Port) -> None:
    packets = Exchanges()
    packets.longest = 20
    rows = b"".join(bytes((servo, servo, 0)) for servo in range(1, 8))
    packets.write_group(port, 42, 2, rows)
    packets.send(port, encode(1, Instruction1.PING))
    port.is_using = False
    assert [packet.params for packet in wire.packets[:2]] == [b"\x2a\x02" + rows[:12], b"\x2a\x02" + rows[12:]]
    with pytest.raises(ValueError, match="whole rows"):
        packets.write_group(port, 42, 2, rows[:-1])


# ---------------------------------------------------------------------------- refusals, the port


def test_a_refusal_is_an_answer_where_the_family_has_them(wire: FarEnd, port: Port) -> None:
    class Refusing(Exchanges):
        refusals = Error1.RANGE

    wire.answer = lambda packet: [status(b"", flags=Error1.RANGE)]
    assert Refusing().ask(port, 1, Instruction1.READ, b"\x38\x04", 4).replies[1].code == Error1.RANGE
    port.margin_s = 0.02
    assert Exchanges().ask(port, 1, Instruction1.READ, b"\x38\x04", 4).missing == (1,)


def test_the_deadline_counts_what_is_still_leaving(wire: FarEnd, port: Port) -> None:
    port.setBaudRate(9600)
    before = wire.clock()
    port.transmit(encode(1, Instruction1.WRITE, bytes(90)))
    port.expect(10)
    assert port.deadline_s - before == pytest.approx((96 + 10) * 10 / 9600 + MARGIN_S)


def test_a_second_thread_in_a_transaction_is_told(port: Port) -> None:
    port.is_using = True
    with pytest.raises(DriverError, match="two threads"):
        port.is_using = True
