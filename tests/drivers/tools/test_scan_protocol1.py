"""drivers.tools.scan_protocol1: servos of either maker are found by pings, and what they are is read."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.packets.packet1 import Instruction1, Packet1, Reader1, encode
from drivers.sim.serving.virtual import VirtualClock
from drivers.tools import scan_protocol1
from drivers.tools.scan_protocol1 import Heard, describe, identity, ping_all, registers_on

Answer = Callable[[Packet1], bytes]


class FarEnd:
    """A port in virtual time: what comes back for every packet is what the test says."""

    serial = None

    def __init__(self, answer: Answer) -> None:
        self.path, self.baud, self.is_open = "virtual", 1_000_000, True
        self.clock = VirtualClock(1.0)
        self.sleep = self.clock.sleep
        self.answer = answer
        self.packets: list[Packet1] = []
        self._reader, self._data = Reader1(), b""

    def write(self, data: bytes) -> None:
        for packet in self._reader.feed(data):
            self.packets.append(packet)
            self._data += self.answer(packet)

    def read(self, deadline_s: float) -> bytes:
        data, self._data = self._data, b""
        if not data:
            self.clock.wait_until(deadline_s)
        return data

    def drain(self) -> int:
        self._data = b""
        return 0


@pytest.fixture
def in_virtual_time(monkeypatch: pytest.MonkeyPatch) -> Callable[[Answer], FarEnd]:
    def make(answer: Answer) -> FarEnd:
        far_end = FarEnd(answer)
        monkeypatch.setattr(scan_protocol1.time, "monotonic", far_end.clock)
        return far_end

    return make


def test_every_id_is_pinged_once_and_those_that_answer_are_found(
    in_virtual_time: Callable[[Answer], FarEnd],
) -> None:
    far_end = in_virtual_time(lambda packet: encode(packet.id, 0) if packet.id in (0, 9, 253) else b"")
    asked: list[int] = []
    assert ping_all(far_end, asked.append) == Heard((0, 9, 253), False)
    assert asked == list(range(254))
    assert far_end.packets == [Packet1(servo, Instruction1.PING, b"") for servo in range(254)]


def test_an_answer_with_data_is_none_and_broken_bytes_are_noise(in_virtual_time: Callable[[Answer], FarEnd]) -> None:
    assert ping_all(in_virtual_time(lambda p: encode(p.id, 0, b"\1") if p.id == 4 else b"")) == Heard((), False)
    assert ping_all(in_virtual_time(lambda p: encode(4, 0)[:-1] + b"\0" if p.id == 4 else b"")) == Heard((), True)
    assert ping_all(in_virtual_time(lambda p: b"\xff\xff\4" if p.id == 4 else b"")) == Heard((), True)


def test_echoes_are_no_servos(in_virtual_time: Callable[[Answer], FarEnd]) -> None:
    echo = in_virtual_time(lambda p: encode(*p) + (encode(p.id, 0) if p.id == 7 else b""))
    assert ping_all(echo) == Heard((7,), False)
    assert ping_all(in_virtual_time(lambda p: encode(*p))).ids == ()


@pytest.mark.parametrize("baud", [1_000_000, 9_600])
def test_the_last_id_is_waited_for_longer_and_the_others_no_longer_than_a_ping_takes(
    in_virtual_time: Callable[[Answer], FarEnd], baud: int
) -> None:
    far_end = in_virtual_time(lambda packet: b"")
    far_end.baud = baud
    begin_s = far_end.clock()
    ping_all(far_end)
    gap_s = 12 * 10 / baud + 0.0016
    assert far_end.clock() - begin_s == pytest.approx(254 * gap_s + scan_protocol1.WAIT_S, rel=0.01)


AX = bytes((12, 0, 24, 5, 1, 250))
STS = bytes((3, 10, 0, 9, 3, 5))
SCS = bytes((3, 10, 0, 5, 4, 5))


@pytest.mark.parametrize(
    ("head", "servo", "found"),
    [
        (AX, 5, (12, 24)),
        (STS, 5, (777, 3)),
        (SCS, 5, (1284, 3)),
        (bytes((77, 1, 8, 5, 1, 5)), 5, (333, 8)),
        (bytes((77, 1, 8, 6, 1, 5)), 5, (262, 77)),
    ],
    ids=["Dynamixel", "Feetech, low byte first", "Feetech, high byte first", "unknown with its id at 3", "id at 5"],
)
def test_the_maker_is_known_by_where_the_id_lies(head: bytes, servo: int, found: tuple[int, int]) -> None:
    far_end = FarEnd(lambda packet: encode(packet.id, 0, head))
    assert identity(registers_on(far_end, 1_000_000), servo) == found
    assert far_end.packets == [Packet1(servo, Instruction1.READ, b"\0\6")]


def test_a_reply_that_is_lost_is_asked_for_again_three_times() -> None:
    far_end = FarEnd(lambda packet: b"")
    assert describe(far_end, 5) is None
    assert len(far_end.packets) == 3
    assert far_end.clock() > 1.0 + 3 * scan_protocol1.WAIT_S


def test_a_model_that_nobody_knows_keeps_its_number() -> None:
    far_end = FarEnd(lambda packet: encode(packet.id, 0, bytes((77, 1, 8, 5, 1, 250))))
    info = describe(far_end, 5)
    assert info is not None
    assert (info.id, info.model_number, info.model, info.firmware, info.voltage_v) == (5, 333, "model 333", 8, None)
