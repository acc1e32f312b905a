"""drivers.sim.wire.line: packets of one length out of a stream of bytes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.wire.line import FixedReader


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
