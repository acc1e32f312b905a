"""drivers.packets.packet1: the vendor's Protocol 1.0 examples, and resynchronisation."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.packets.packet1 import Error1, Instruction1, Packet1, Reader1, encode

I = Instruction1  # noqa: E741
VECTORS = {
    "FF FF 01 02 01 FB": (1, I.PING, ""),
    "FF FF 01 02 00 FC": (1, 0, ""),
    "FF FF 01 04 02 2B 01 CC": (1, I.READ, "2B 01"),
    "FF FF 01 03 00 20 DB": (1, 0, "20"),
    "FF FF 01 05 03 0C 64 AA DC": (1, I.WRITE, "0C 64 AA"),
    "FF FF FE 04 03 03 01 F6": (254, I.WRITE, "03 01"),
    "FF FF 01 05 04 1E F4 01 E2": (1, I.REG_WRITE, "1E F4 01"),
    "FF FF FE 02 05 FA": (254, I.ACTION, ""),
    "FF FF 00 02 06 F7": (0, I.FACTORY_RESET, ""),
    "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67": (
        254,
        I.SYNC_WRITE,
        "1E 04 00 10 00 50 01 01 20 02 60 03",
    ),
    "FF FF FE 09 92 00 02 01 1E 02 02 24 1D": (254, I.BULK_READ, "00 02 01 1E 02 02 24"),
    "FF FF 01 04 00 00 80 7A": (1, 0, "00 80"),
    "FF FF 02 04 00 00 80 79": (2, 0, "00 80"),
    "FF FF 01 02 24 D8": (1, Error1.OVERLOAD | Error1.OVERHEATING, ""),
    "FF FF FE 06 82 38 02 01 02 3C": (254, I.SYNC_READ, "38 02 01 02"),
    "FF FF 01 04 00 00 08 F2": (1, 0, "00 08"),
    "FF FF FE 0A 83 2A 02 01 00 08 02 00 08 35": (254, I.SYNC_WRITE, "2A 02 01 00 08 02 00 08"),
}
PACKETS = st.lists(
    st.builds(
        Packet1,
        st.integers(0, 253),
        st.integers(0, 255),
        st.lists(st.sampled_from([0xFF, 0xFF, 0, 1, 2, 3]), max_size=12).map(bytes) | st.binary(max_size=30),
    ),
    max_size=6,
)


@pytest.mark.parametrize("text", VECTORS)
def test_vendor_examples(text: str):
    device, code, params = VECTORS[text]
    frame = bytes.fromhex(text)
    assert encode(device, code, bytes.fromhex(params)) == frame
    assert Reader1().feed(frame) == [Packet1(device, code, bytes.fromhex(params))]


@pytest.mark.parametrize(
    ("device", "params", "why"), [(255, b"", "255"), (-1, b"", "-1"), (1, bytes(254), "254 bytes")]
)
def test_what_no_packet_can_carry(device: int, params: bytes, why: str):
    with pytest.raises(ValueError, match=why):
        encode(device, 1, params)


@given(PACKETS, st.randoms(use_true_random=False))
def test_reader_gives_back_packets_cut_anywhere(packets: list[Packet1], random):
    stream = b"".join(encode(*packet) for packet in packets)
    reader, received, at = Reader1(), [], 0
    while at < len(stream):
        step = random.randint(1, 9)
        received += reader.feed(stream[at : at + step])
        at += step
    assert received == packets
    assert (reader.noise_bytes, reader.pending, reader.broken_frames) == (0, 0, 0)


@given(PACKETS, st.lists(st.binary(max_size=6), min_size=6, max_size=6))
def test_a_pause_brings_out_what_noise_had_swallowed(packets: list[Packet1], noise: list[bytes]):
    # Noise may spell a valid packet only with a chance of 1/256 per header; such cases are left out.
    reader, received = Reader1(), []
    for packet, garbage in zip(packets, noise, strict=False):
        frame = encode(*packet)
        received += reader.feed(garbage.replace(b"\xff", b"\xfe") + frame)
        received += reader.flush()
    assert received == packets
    assert reader.pending == 0


def test_a_header_of_three_ff_is_taken_at_its_end():
    reader = Reader1()
    assert reader.feed(b"\xff" + encode(1, 1)) == [Packet1(1, 1, b"")]
    assert (reader.noise_bytes, reader.broken_frames) == (1, 0)


def test_damage_costs_one_packet_and_is_counted():
    reader = Reader1()
    bad = bytearray(encode(1, 2, b"\x2b\x01"))
    bad[5] ^= 4
    assert reader.feed(bytes(bad) + encode(2, 1)) == [Packet1(2, 1, b"")]
    assert reader.broken_frames == 1
    assert reader.feed(b"\xff\xff\x01\x01\x00" + encode(3, 1)) == [Packet1(3, 1, b"")]
    assert reader.broken_frames == 2


def test_a_packet_that_never_ends_is_given_up():
    reader = Reader1()
    assert reader.feed(b"\xff\xff\x01\x60\x02" + encode(3, 1)) == []
    assert reader.flush() == [Packet1(3, 1, b"")]
    reader.feed(encode(1, 2, b"\x2b\x01")[:-1])
    assert reader.take_pending() == encode(1, 2, b"\x2b\x01")[:-1]
    assert reader.pending == 0


def test_a_third_ff_is_no_id_whatever_length_would_follow():
    for servo in (0, 1, 2, 5, 253):
        reader = Reader1()
        assert reader.feed(b"\xff\xff" + encode(servo, 1)) == [Packet1(servo, 1, b"")]
        assert (reader.noise_bytes, reader.broken_frames, reader.pending) == (2, 0, 0)


def test_the_shortest_length_is_two():
    reader = Reader1()
    assert reader.feed(b"\xff\xff\x01\x02\x00") == []
    assert reader.pending == 5
    assert reader.feed(b"\xfc") == [Packet1(1, 0, b"")]
    assert reader.feed(b"\x00\xff") == [] and reader.pending == 1
