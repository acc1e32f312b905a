"""drivers.packets.packet: the vendor's example packets byte by byte, stuffing, resynchronisation."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.packets.packet import (
    ALERT,
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    InstructionReader,
    StatusPacket,
    StatusReader,
    crc16,
    decode_fast,
    encode_fast_head,
    encode_fast_part,
    encode_instruction,
    encode_status,
    stuff,
    unstuff,
)

I = Instruction  # noqa: E741

INSTRUCTIONS = {
    "FF FF FD 00 01 03 00 01 19 4E": (1, I.PING, ""),
    "FF FF FD 00 FE 03 00 01 31 42": (254, I.PING, ""),
    "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15": (1, I.READ, "84 00 04 00"),
    "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89": (1, I.WRITE, "74 00 00 02 00 00"),
    "FF FF FD 00 01 09 00 04 68 00 C8 00 00 00 AE 8E": (1, I.REG_WRITE, "68 00 C8 00 00 00"),
    "FF FF FD 00 01 03 00 05 02 CE": (1, I.ACTION, ""),
    "FF FF FD 00 01 04 00 06 01 A1 E6": (1, I.FACTORY_RESET, "01"),
    "FF FF FD 00 01 03 00 08 2F 4E": (1, I.REBOOT, ""),
    "FF FF FD 00 01 08 00 10 01 44 58 4C 22 B1 DC": (1, I.CLEAR, "01 44 58 4C 22"),
    "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA": (254, I.SYNC_READ, "84 00 04 00 01 02"),
    "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87": (
        254,
        I.SYNC_WRITE,
        "74 00 04 00 01 96 00 00 00 02 AA 00 00 00",
    ),
    "FF FF FD 00 FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05": (
        254,
        I.BULK_READ,
        "01 90 00 02 00 02 92 00 01 00",
    ),
    "FF FF FD 00 FE 10 00 93 01 20 00 02 00 A0 00 02 1F 00 01 00 50 B7 68": (
        254,
        I.BULK_WRITE,
        "01 20 00 02 00 A0 00 02 1F 00 01 00 50",
    ),
    "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2": (254, I.FAST_SYNC_READ, "84 00 04 00 03 07 04"),
    "FF FF FD 00 FE 09 00 8A 44 02 04 00 01 02 72 F2": (254, I.FAST_SYNC_READ, "44 02 04 00 01 02"),
    "FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD 00 21 E7": (1, I.WRITE, "74 00 FF FF FD 00"),
    "FF FF FD 00 01 06 00 03 40 00 01 DB 66": (1, I.WRITE, "40 00 01"),
    "FF FF FD 00 FE 0D 00 83 40 00 01 00 01 00 02 00 03 00 FE 51": (
        254,
        I.SYNC_WRITE,
        "40 00 01 00 01 00 02 00 03 00",
    ),
    "FF FF FD 00 FE 06 00 03 62 00 05 98 14": (254, I.WRITE, "62 00 05"),
    "FF FF FD 00 FE 0D 00 9A 01 90 00 02 00 02 92 00 01 00 19 2F": (
        254,
        I.FAST_BULK_READ,
        "01 90 00 02 00 02 92 00 01 00",
    ),
}
STATUSES = {
    "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D": (1, 0, "06 04 26"),
    "FF FF FD 00 02 07 00 55 00 06 04 26 6F 6D": (2, 0, "06 04 26"),
    "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0": (1, 0, "A6 00 00 00"),
    "FF FF FD 00 01 04 00 55 00 A1 0C": (1, 0, ""),
    "FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE": (2, 0, "1F 08 00 00"),
    "FF FF FD 00 01 06 00 55 00 77 00 C3 69": (1, 0, "77 00"),
    "FF FF FD 00 02 05 00 55 00 24 8B A9": (2, 0, "24"),
    "FF FF FD 00 01 0F 00 55 00 FF FF FD FD 00 00 00 00 08 00 00 61 00": (
        1,
        0,
        "FF FF FD 00 00 00 00 08 00 00",
    ),
    "FF FF FD 00 01 0B 00 55 00 FF FF FD FD FF FD FD 54 60": (1, 0, "FF FF FD FF FD FD"),
    "FF FF FD 00 02 08 00 55 80 02 08 00 00 BC 26": (2, 0x80, "02 08 00 00"),
    "FF FF FD 00 01 04 00 55 04 BA 8C": (1, 4, ""),
    "FF FF FD 00 01 04 00 55 07 B0 8C": (1, 7, ""),
}
FAST = {
    "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E": (
        (3, "A6 00 00 00"),
        (7, "1F 08 00 00"),
        (4, "FF 03 00 00"),
    ),
    "FF FF FD 00 FE 11 00 55 00 01 D0 07 00 00 0C 83 00 02 09 00 00 00 11 40": (
        (1, "D0 07 00 00"),
        (2, "09 00 00 00"),
    ),
    "FF FF FD 00 FE 0C 00 55 00 01 77 00 48 0E 00 02 24 D5 EB": ((1, "77 00"), (2, "24")),
}
TRICKY = st.lists(st.sampled_from([0xFF, 0xFF, 0xFD, 0x00, 0x55, 0xFE]), max_size=24).map(bytes)
PAYLOAD = TRICKY | st.binary(max_size=40)
PACKETS = st.lists(
    st.builds(InstructionPacket, st.integers(0, 252), st.sampled_from([1, 2, 3, 0x82, 0x83]), PAYLOAD),
    max_size=6,
)


def raw(text: str) -> bytes:
    return bytes.fromhex(text)


def joint(parts: tuple[tuple[int, str], ...]) -> bytes:
    """The joint reply of devices that hold these bytes."""
    head = encode_fast_head([len(raw(data)) for _, data in parts])
    out, crc = head, crc16(head)
    for device, data in parts:
        part, crc = encode_fast_part(device, 0, raw(data), crc)
        out += part
    return out


def bitwise_crc(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (0x18005 if crc & 0x8000 else 0)
    return crc


def test_crc_check_value_of_the_catalogue():
    assert crc16(b"123456789") == 0xFEE8


@given(st.binary(max_size=300), st.integers(0, 300))
def test_crc_is_the_bitwise_definition_and_can_be_continued_anywhere(data: bytes, cut: int):
    assert crc16(data) == bitwise_crc(data)
    assert crc16(data[cut:], crc16(data[:cut])) == crc16(data)


@pytest.mark.parametrize("text", INSTRUCTIONS)
def test_vendor_instruction_encodes_and_decodes(text: str):
    device, instruction, params = INSTRUCTIONS[text]
    assert encode_instruction(device, instruction, raw(params)) == raw(text)
    assert InstructionReader().feed(raw(text)) == [InstructionPacket(device, instruction, raw(params))]


@pytest.mark.parametrize("text", STATUSES)
def test_vendor_status_encodes_and_decodes(text: str):
    device, error, params = STATUSES[text]
    assert encode_status(device, error, raw(params)) == raw(text)
    (reply,) = StatusReader().feed(raw(text))
    assert reply == StatusPacket(device, error, raw(params))
    assert (reply.alert, reply.error_number) == (error >= ALERT, error & 0x7F)


@pytest.mark.parametrize("text", FAST)
def test_vendor_joint_reply_encodes_and_decodes(text: str):
    parts = FAST[text]
    assert joint(parts) == raw(text)
    assert len(raw(text)) == 8 + sum(4 + len(raw(data)) for _, data in parts)
    devices = [(device, len(raw(data))) for device, data in parts]
    assert decode_fast(raw(text), devices) == [StatusPacket(device, 0, raw(data)) for device, data in parts]
    assert StatusReader().feed(raw(text)) == [StatusPacket(BROADCAST_ID, 0, raw(text)[8:-2])]


def test_every_shared_vector_is_a_valid_frame(shared: Path):
    vectors = json.loads((shared / "data/protocol-vectors/dynamixel_protocol2.json").read_text())
    assert len(vectors) == 19
    for vector in vectors:
        frame = bytes.fromhex(vector["hex"])
        assert StatusReader().feed_frames(frame) == [frame], vector["name"]


@pytest.mark.parametrize("device", [-1, 253, 255, 256])
def test_an_id_no_packet_can_carry_is_refused(device: int):
    with pytest.raises(ValueError, match=str(device)):
        encode_instruction(device, I.PING)


@given(PAYLOAD)
def test_unstuff_inverts_stuff_and_no_header_survives(data: bytes):
    stuffed = stuff(data)
    assert unstuff(stuffed) == data
    assert no_header_in(stuffed)


def no_header_in(stuffed: bytes) -> bool:
    return all(stuffed[i + 3 : i + 4] == b"\xfd" for i in range(len(stuffed)) if stuffed[i : i + 3] == b"\xff\xff\xfd")


@given(PACKETS, st.randoms(use_true_random=False))
def test_reader_gives_back_packets_cut_anywhere(packets: list[InstructionPacket], random):
    stream = b"".join(encode_instruction(*packet) for packet in packets)
    reader, received, at = InstructionReader(), [], 0
    while at < len(stream):
        step = random.randint(1, 20)
        received += reader.feed(stream[at : at + step])
        at += step
    assert received == packets
    assert (reader.noise_bytes, reader.pending, reader.broken_frames) == (0, 0, 0)


@given(PACKETS, st.lists(st.binary(max_size=9) | TRICKY, min_size=7, max_size=7))
def test_reader_finds_every_packet_between_noise(packets: list[InstructionPacket], noise: list[bytes]):
    # The sender pauses after each packet, as hosts do; what noise swallowed comes out at the pause.
    reader, received = InstructionReader(), []
    for packet, garbage in zip(packets, noise, strict=False):
        received += reader.feed(garbage + encode_instruction(*packet))
        received += reader.flush()
    assert received == packets
    assert reader.pending == 0


@given(PAYLOAD, st.data())
def test_a_flipped_bit_is_never_taken_for_a_packet(params: bytes, data):
    frame = bytearray(encode_instruction(7, I.WRITE, params))
    bit = data.draw(st.integers(0, len(frame) * 8 - 1))
    frame[bit // 8] ^= 1 << bit % 8
    reader = InstructionReader()
    assert reader.feed(bytes(frame)) + reader.flush() == []


def test_packet_behind_one_with_a_damaged_length_arrives_without_a_pause():
    good = encode_instruction(2, I.PING)
    damaged = bytearray(encode_instruction(1, I.WRITE, b"\x74\x00\x00\x02\x00\x00"))
    damaged[6] = 2
    reader = InstructionReader()
    assert reader.feed(bytes(damaged) + good) == [InstructionPacket(2, I.PING, b"")]
    assert (reader.broken_frames, reader.noise_bytes, reader.pending) == (1, len(damaged), 0)


def test_what_only_looks_like_a_packet_inside_an_incomplete_one_does_not_end_it():
    outer = encode_instruction(1, I.WRITE, b"\x74\x00" + bytes(40))[:12]
    inner = bytearray(encode_instruction(2, I.WRITE, b"\x74\x00\x00\x02\x00\x00"))
    inner[-1] ^= 1
    for begun in (bytes(inner), bytes(inner[:-2])):
        reader = InstructionReader()
        assert reader.feed(outer + begun) == []
        assert (reader.broken_frames, reader.noise_bytes, reader.pending) == (0, 0, len(outer) + len(begun))


@pytest.mark.parametrize(
    "bad", ["FF FF FD 00 01 02 00", "FF FF FD 00 01 FF 7F", "FF FF FD 00 FD 03 00", "FF FF FD 00 FF 03 00"]
)
def test_impossible_heads_are_dropped_at_once(bad: str):
    reader = InstructionReader()
    assert reader.feed(raw(bad)) == []
    assert reader.pending == 0
    assert reader.broken_frames == 1


def test_a_stuffed_header_starts_nothing():
    reader = InstructionReader()
    assert reader.feed(raw("FF FF FD FD") + encode_instruction(3, I.PING)) == [InstructionPacket(3, I.PING, b"")]
    assert reader.noise_bytes == 4


def test_noise_that_ends_like_a_header_is_kept_until_it_is_decided():
    reader = InstructionReader()
    frame = encode_instruction(3, I.PING)
    assert reader.feed(b"\x12\x34" + frame[:2]) == []
    assert reader.pending == 2
    assert reader.feed(frame[2:]) == [InstructionPacket(3, I.PING, b"")]


def test_endless_noise_holds_no_memory():
    reader = StatusReader()
    for _ in range(50):
        assert reader.feed_frames(bytes(range(250)) * 8) == []
        assert reader.pending <= 2


def test_readers_pass_over_the_other_sides_packets():
    wire = encode_instruction(1, I.PING) + encode_status(1, 0, b"\x06\x04\x26")
    assert InstructionReader().feed(wire) == [InstructionPacket(1, I.PING, b"")]
    assert StatusReader().feed(wire) == [StatusPacket(1, 0, b"\x06\x04\x26")]


def test_status_without_an_error_byte_is_no_status():
    assert StatusReader().feed(encode_instruction(1, I.STATUS)) == []


def test_take_pending_hands_over_a_reply_cut_short():
    text = next(iter(FAST))
    reader = StatusReader()
    assert reader.feed(raw(text)[:20]) == []
    devices = [(device, 4) for device, _ in FAST[text]]
    assert [reply.id for reply in decode_fast(reader.take_pending(), devices)] == [3]
    assert reader.pending == 0


@pytest.mark.parametrize("at", range(8, 32))
def test_damage_in_a_joint_reply_costs_only_the_damaged_device(at: int):
    text = next(iter(FAST))
    frame = bytearray(raw(text))
    frame[at] ^= 0x10
    devices = [(device, 4) for device, _ in FAST[text]]
    hit = (at - 8) // 8
    assert [reply.id for reply in decode_fast(bytes(frame), devices)] == [
        device for slot, (device, _) in enumerate(devices) if slot != hit
    ]


def test_joint_reply_of_another_read_is_refused():
    text = next(iter(FAST))
    assert decode_fast(raw(text), [(3, 2), (7, 2), (4, 2)]) == []
    assert decode_fast(raw(text), [(3, 4), (8, 4), (4, 4)]) == [
        StatusPacket(3, 0, struct.pack("<I", 166)),
        StatusPacket(4, 0, struct.pack("<I", 1023)),
    ]
    assert decode_fast(b"\x00\xff" + raw(text), [(3, 4), (7, 4), (4, 4)])[1].id == 7


def test_a_stuffed_header_is_no_broken_frame_whatever_follows():
    for tail in ("FF FF FD 00", "01 03 00 55", "FF 03 00 55"):
        reader = InstructionReader()
        assert reader.feed(raw("FF FF FD FD " + tail)) == []
        assert reader.broken_frames == 0
    assert InstructionReader().feed(raw("FF FF FD")) == []
