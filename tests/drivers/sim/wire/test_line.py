"""drivers.sim.wire.line: packets of one length, faults of a line, and when replies and other things are due."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.boards.ssc32 import Ssc32
from drivers.sim.wire.line import PAUSE_S, FixedReader, Line, ReplyQueue
from drivers.sim.wire.timing import Reply, WireTiming


@given(st.lists(st.binary(min_size=3, max_size=3)), st.data())
def test_packets_come_whole_however_the_bytes_come(bodies: list[bytes], data: st.DataObject) -> None:
    packets = [b"\xa5" + body for body in bodies]
    stream, reader, found = b"".join(packets), FixedReader(0xA5, 4), []
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        found += reader.feed(stream[:size])
        stream = stream[size:]
    assert found == packets and reader.pending == 0


def test_what_comes_before_a_packet_is_passed_over_and_what_is_cut_short_given_up() -> None:
    reader = FixedReader(0xA5, 4)
    assert reader.feed(b"\x01\x02\xa5\x01\x02\x03\x09") == [b"\xa5\x01\x02\x03"]
    assert reader.pending == 0
    assert reader.feed(b"\xa5\x01") == [] and reader.pending == 2
    assert reader.flush() == [] and reader.pending == 0
    reader.feed(b"\xa5\x07")
    assert reader.take_pending() == b"\xa5\x07" and reader.pending == 0


class EchoLine(Line):
    """A device that answers every packet with itself, 1 s late where it begins with L."""

    def make_reader(self) -> FixedReader:
        return FixedReader(0xA5, 3)

    def carry_out(self, packet: bytes, now_s: float) -> list[Reply]:
        return [Reply(packet, None, 1.0 if packet[1:2] == b"L" else 0.0)]

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        return []


PACKET = b"\xa5ab"


def test_a_line_counts_packets_and_begins_faults_that_are_due() -> None:
    line = EchoLine()
    line.faults.add(["echo:at=5s:for=2s"], 0.0)
    assert line.feed(PACKET + PACKET + b"\xa5", 4.0) == [Reply(PACKET, None)] * 2
    assert (line.packets, line.echo) == (2, False)
    line.feed(b"ab", 5.0)
    assert (line.packets, line.echo) == (3, True)
    line.feed(PACKET, 7.0)
    assert not line.echo
    assert line.size(PACKET) == 3
    with pytest.raises(ValueError, match="by hand"):
        line.place(1, 0.0, 0.0)


def test_a_slow_reader_gets_replies_in_bursts() -> None:
    line, timed = EchoLine(), [(0.05, b"a"), (0.2, b"b"), (0.21, b"c")]
    assert line.heard(timed) == timed
    line.faults.add(["slow-reader:200ms"], 0.0)
    assert line.heard(timed) == [(pytest.approx(0.2), b"a"), (pytest.approx(0.2), b"b"), (pytest.approx(0.4), b"c")]
    line.faults.clear("slow-reader", 1.0)
    assert line.heard(timed) == timed


def test_the_port_learns_of_an_unplug_and_its_end() -> None:
    line, seen = EchoLine(), []
    line.faults.add(["unplug:for=1s"], 0.0)  # nobody waits for it yet
    line.on_unplug = lambda fault, begins: seen.append(begins)
    line.faults.advance(1.0)
    line.faults.add(["unplug"], 2.0)
    assert seen == [False, True]


def test_replies_without_wire_time_are_due_at_once_or_late() -> None:
    line = EchoLine()
    queue = ReplyQueue(line, 1_000_000, None)
    assert queue.due_s == math.inf
    queue.receive(PACKET + b"\xa5Lb" + PACKET, 3.0)
    assert list(queue.replies) == [(3.0, PACKET), (4.0, b"\xa5Lb"), (3.0, PACKET)]
    assert queue.due_s == 3.0
    line.echo = True
    queue.replies.clear()
    queue.receive(PACKET, 5.0)
    assert list(queue.replies) == [(5.0, PACKET), (5.0, PACKET)]


def test_replies_on_a_wire_take_ten_bits_a_byte_both_ways_at_the_lines_rate() -> None:
    line = EchoLine()
    queue = ReplyQueue(line, 100_000, WireTiming())
    queue.receive(PACKET, 1.0)
    assert list(queue.replies) == [(pytest.approx(1.0 + 6 * 10 / 100_000), PACKET)]
    line.set_line_baud(1_000_000)
    queue.replies.clear()
    queue.receive(PACKET, 2.0)
    assert list(queue.replies) == [(pytest.approx(2.0 + 6 * 10 / 1_000_000), PACKET)]


def test_an_incomplete_packet_is_given_up_after_a_pause_counted_from_the_last_byte() -> None:
    line = EchoLine()
    queue = ReplyQueue(line, 1_000_000, None)
    queue.receive(b"\xa5", 1.0)
    queue.receive(b"a", 1.05)
    assert queue.due_s == pytest.approx(1.05 + PAUSE_S)
    queue.advance(1.05 + 0.99 * PAUSE_S)
    assert line.reader.pending == 2
    queue.advance(queue.due_s)
    assert (line.reader.pending, queue.due_s) == (0, math.inf)
    queue.receive(b"\xa5", 2.0)
    queue.receive(b"ab", 2.01)
    assert queue.due_s == 2.01, "the reply; nothing is left to give up"
    queue.replies.clear()
    assert queue.due_s == math.inf


def test_a_reader_that_keeps_its_line_does_not_keep_the_queue_busy() -> None:
    queue = ReplyQueue(Ssc32(), 115_200, None)
    queue.receive(b"#1P15", 1.0)
    queue.advance(1.0 + PAUSE_S)
    assert queue.due_s == math.inf
    queue.receive(b"00\rQP1\r", 9.0)
    assert list(queue.replies) == [(9.0, bytes((150,)))]


def test_faults_are_due_without_traffic_and_a_clear_drops_everything() -> None:
    line = EchoLine()
    queue = ReplyQueue(line, 1_000_000, None)
    line.faults.add(["echo:at=5s"], 0.0)
    assert queue.due_s == 5.0
    queue.advance(4.9)
    assert not line.echo
    queue.advance(5.0)
    assert (line.echo, queue.due_s) == (True, math.inf)
    queue.receive(PACKET + b"\xa5", 6.0)
    queue.clear()
    assert (list(queue.replies), line.reader.pending) == ([], 0)


def test_bytes_without_a_head_are_no_packet_however_many_they_are() -> None:
    for count in range(1, 12):
        reader = FixedReader(0xA5, 4)
        assert reader.feed(b"\x01" * count) == []
        assert reader.pending == 0
