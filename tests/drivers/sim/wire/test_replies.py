"""drivers.sim.wire.replies: bytes that meet on the wire."""

from __future__ import annotations

from drivers.sim.wire.replies import Reply, collide


def test_one_reply_passes():
    assert collide([]) == []
    assert collide([Reply(b"ab", None, 0.1)]) == [Reply(b"ab", None, 0.1)]


def test_a_wire_that_idles_high_carries_the_bitwise_and():
    mixed = collide([Reply(b"\xff\xf0\x55", None, 0.1), Reply(b"\xff\x0f\x0f\x12", None)])
    assert mixed == [Reply(b"\xff\x00\x05\x12", None, 0.1)]
