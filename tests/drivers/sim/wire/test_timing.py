"""drivers.sim.wire.timing: the time formulas of a half-duplex bus."""

from __future__ import annotations

import pytest

from drivers.packets.packet import BROADCAST_ID, encode_instruction
from drivers.packets.packet import Instruction as I
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.wire.timing import USB_FRAME_S, Reply, WireTiming, collide, without_timing

IDS = bytes(range(1, 25))
POSITION = b"\x84\0\4\0"


def transaction(
    params: bytes, instruction: int, baud: int, delay: int = 0, latency_s: float = 0.0
) -> list[tuple[float, bytes]]:
    """Deliveries of one read from 24 servos that begins at 1 s."""
    servos = [SimulatedServo(i) for i in IDS]
    for servo in servos:
        servo.registers.put("Return Delay Time", delay)
    bus, timing = Chain(servos), WireTiming(latency_s)
    (packet,) = bus.reader.feed(encode_instruction(BROADCAST_ID, instruction, params))
    at_s = timing.arrival(1.0, bus.size(packet), baud)
    return timing.deliveries(bus.handle(packet, at_s), baud)


@pytest.mark.parametrize(("baud", "expected_ms"), [(57_600, 69.1), (1_000_000, 3.98), (4_000_000, 0.995)])
def test_sync_read_takes_the_formula(baud: int, expected_ms: float):
    out = transaction(POSITION + IDS, I.SYNC_READ, baud)
    assert b"".join(data for _, data in out).count(b"\xff\xff\xfd\0") == 24
    assert (out[-1][0] - 1.0) * 1e3 == pytest.approx(expected_ms, rel=2e-3)
    assert out[-1][0] - 1.0 == pytest.approx((14 + 24 + 24 * 15) * 10 / baud)


def test_nine_servos_are_within_a_tenth_of_the_formula_by_the_simulated_clock():
    out = transaction(POSITION + IDS[:9], I.SYNC_READ, 1_000_000)
    assert (out[-1][0] - 1.0) * 1e3 == pytest.approx(1.58, rel=1e-6)


def test_every_status_pays_the_return_delay_but_a_fast_reply_only_once():
    bits = 10 / 1_000_000
    slow = transaction(POSITION + IDS, I.SYNC_READ, 1_000_000, delay=250)
    assert slow[-1][0] - 1.0 == pytest.approx((38 + 360) * bits + 24 * 500e-6)
    fast = transaction(POSITION + IDS, I.FAST_SYNC_READ, 1_000_000, delay=250)
    assert fast[-1][0] - 1.0 == pytest.approx((38 + 200) * bits + 500e-6)


def test_the_wire_is_busy_while_a_write_goes_out():
    timing = WireTiming()
    assert timing.arrival(1.0, 134, 1_000_000) == pytest.approx(1.00134)
    assert timing.arrival(1.0001, 38, 1_000_000) == pytest.approx(1.00172)
    assert timing.arrival(2.0, 10, 1_000_000) == pytest.approx(2.0001)


def test_replies_arrive_one_after_the_other_and_late_ones_hold_up_the_rest():
    timing = WireTiming()
    timing.arrival(0.0, 100, 1_000_000)
    out = timing.deliveries([Reply(b"a" * 10, None), Reply(b"b" * 10, None, 0.5), Reply(b"c", None)], 1_000_000)
    assert [time for time, _ in out] == pytest.approx([0.0011, 0.50121])
    assert [data for _, data in out] == [b"a" * 10, b"b" * 10 + b"c"]


@pytest.mark.parametrize("baud", [57_600, 1_000_000, 4_000_000])
def test_no_byte_comes_early_and_none_waits_longer_than_a_usb_frame(baud: int):
    out = transaction(POSITION + IDS, I.SYNC_READ, baud)
    sent = 0
    for time_s, data in out:
        first, sent = sent, sent + len(data)
        assert time_s == pytest.approx(1.0 + (38 + sent) * 10 / baud)
        assert len(data) == 15 or time_s - (1.0 + (38 + first + 15) * 10 / baud) < USB_FRAME_S


def test_latency_timer_holds_the_last_short_packet():
    out = transaction(POSITION + IDS, I.SYNC_READ, 1_000_000, latency_s=0.016)
    assert [len(data) for _, data in out] == [62] * 5 + [50]
    assert b"".join(data for _, data in out).count(b"\xff\xff\xfd\0") == 24
    assert out[-1][0] == pytest.approx(1.00398 + 0.016)
    assert out[-2][0] < 1.004


def test_without_timing_only_lateness_counts():
    replies = [Reply(b"a", None), Reply(b"b", None), Reply(b"c", None, 0.5), Reply(b"d", None)]
    assert without_timing(replies, 1.0) == [(1.0, b"ab"), (1.5, b"cd")]
    assert without_timing([], 1.0) == []


def test_one_reply_passes():
    assert collide([]) == []
    assert collide([Reply(b"ab", None, 0.1)]) == [Reply(b"ab", None, 0.1)]


def test_a_wire_that_idles_high_carries_the_bitwise_and():
    mixed = collide([Reply(b"\xff\xf0\x55", None, 0.1), Reply(b"\xff\x0f\x0f\x12", None)])
    assert mixed == [Reply(b"\xff\x00\x05\x12", None, 0.1)]


def test_bytes_reach_the_host_together_within_half_a_millisecond_of_the_first():
    timing = WireTiming()
    timing.arrival(0.0, 0, 1_000_000)
    out = timing.deliveries([Reply(b"a", None), Reply(b"b", None, 0.0004), Reply(b"c", None, 0.0002)], 1_000_000)
    assert [data for _, data in out] == [b"ab", b"c"]
    assert [time for time, _ in out] == pytest.approx([0.00042, 0.00063])


def test_the_return_delay_comes_before_the_bytes():
    timing = WireTiming()
    timing.arrival(2.0, 10, 100_000)
    out = timing.deliveries([Reply(b"abc", SimulatedServo(1))], 100_000)
    assert out == [(pytest.approx(2.001 + 500e-6 + 3 * 10 / 100_000), b"abc")]


def test_full_usb_packets_go_at_once():
    timing = WireTiming(0.016)
    timing.arrival(0.0, 0, 1_000_000)
    out = timing.deliveries([Reply(b"x" * 62, None), Reply(b"y" * 125, None)], 1_000_000)
    assert [(len(data), time) for time, data in out] == [
        (62, pytest.approx(62e-5)),
        (62, pytest.approx(187e-5)),
        (62, pytest.approx(187e-5)),
        (1, pytest.approx(187e-5 + 0.016)),
    ]
    assert WireTiming(0.016).deliveries([], 1_000_000) == []
