"""omote's binary frame against its specification in docs/links.md, written out here by hand."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.binary_format import BinaryDecoder, BinaryEncoder, stuff, unstuff
from tests.controller.formats.faces import face


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE, bit by bit."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def frame(
    values: dict[int, int],
    *,
    version: int = 1,
    sequence: int = 7,
    ms: int = 1500,
    flags: int = 3,
    count: int = 59,
    more: bytes = b"",
) -> bytes:
    """A frame before it is stuffed."""
    bits = sum(1 << at for at in values).to_bytes((count + 7) // 8, "little")
    body = struct.pack("<BHIBB", version, sequence, ms, flags, count) + bits
    body += b"".join(struct.pack("<h", values[at]) for at in sorted(values)) + more
    return body + struct.pack("<H", crc16(body))


def test_the_checksum_is_the_one_of_the_catalogue() -> None:
    assert crc16(b"123456789") == 0x29B1


def test_a_frame_written_by_hand_is_read() -> None:
    (found,) = BinaryDecoder(P).feed(stuff(frame({17: 8192, 52: -16384})))
    assert (found.values[17], found.values[52], int(found.mask.sum())) == (0.5, -1.0, 2)
    assert (found.time_s, found.sequence, found.face) == (1.5, 7, True)


def test_a_frame_is_what_the_specification_says() -> None:
    values = P.neutral()
    values[[0, 58]] = 1.0, -0.25
    mask = np.zeros(len(P), dtype=bool)
    mask[[0, 58]] = True
    encoder = BinaryEncoder(P)
    encoder.encode(face(1))
    (data,) = encoder.encode(Frame(values, mask, 1.5))
    assert data == stuff(frame({0: 16384, 58: -4096}, sequence=1))


def test_a_whole_face_fits_sixty_times_a_second_into_115200_baud() -> None:
    longest = max(len(message) + 1 for seed in range(50) for message in BinaryEncoder(P).encode(face(seed, 1e5)))
    assert longest <= 139 and longest * 10 * 60 < 115_200 * 0.75


@pytest.mark.slow
@given(some.binary(max_size=1200))
def test_stuffed_bytes_have_no_zero_and_come_back(data: bytes) -> None:
    stuffed = stuff(data)
    assert 0 not in stuffed and unstuff(stuffed) == data and len(stuffed) <= len(data) + 1 + len(data) // 254


@pytest.mark.parametrize(
    ("data", "stuffed"),
    [("", "01"), ("00", "0101"), ("0000", "010101"), ("11220033", "0311220233"), ("11223344", "0511223344"),
     ("11000000", "0211010101")],
)  # fmt: skip
def test_stuffing_is_that_of_the_paper(data: str, stuffed: str) -> None:
    """The examples of the Wikipedia page on COBS, without the zero that ends them."""
    assert stuff(bytes.fromhex(data)).hex() == stuffed and unstuff(bytes.fromhex(stuffed)).hex() == data


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "a wrong checksum"),
        (b"\1", "a wrong checksum"),
        (b"\5ab", "not stuffed"),
        (b"\0", "a wrong checksum"),
        (b"\5a\3b", "not stuffed"),
        (stuff(frame({0: 1})[:-1] + b"?"), "a wrong checksum"),
        (stuff(frame({0: 1}, more=b"xy")), "a wrong length"),
        (stuff(frame({0: 1}, version=2)), "version 2; this omote reads version 1"),
        (stuff(b"\1\2\3" + struct.pack("<H", crc16(b"\1\2\3"))), "a wrong checksum"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(data: bytes, why: str) -> None:
    decoder = BinaryDecoder(P)
    assert decoder.feed(data) == [] and decoder.refused == {why: 1}


def test_a_datagram_may_hold_the_zero_that_ends_a_frame_and_more_than_one_frame() -> None:
    encoder = BinaryEncoder(P)
    first, second = (message for seed in (1, 2) for message in encoder.encode(face(seed)))
    for datagram in (first, first + b"\0", b"\0" + first + b"\0", first + b"\0" + second + b"\0"):
        decoder = BinaryDecoder(P)
        found = decoder.feed(datagram)
        assert [frame.sequence for frame in found] == [0, 1][: len(found)] and not decoder.refused
        assert len(found) == 1 + (second in datagram)


def test_any_bit_that_changes_is_found() -> None:
    (message,) = BinaryEncoder(P).encode(face(4))
    for at in range(8 * len(message)):
        damaged = bytearray(message)
        damaged[at // 8] ^= 1 << at % 8
        assert BinaryDecoder(P).feed(bytes(damaged)) == []


def test_a_sender_with_fewer_or_more_parameters_is_read_as_far_as_both_know_them() -> None:
    (few,) = BinaryDecoder(P).feed(stuff(frame({3: 16384}, count=10)))
    assert few.mask.sum() == 1 and len(few.values) == len(P)
    (more,) = BinaryDecoder(P).feed(stuff(frame({3: 16384, 70: 5}, count=80)))
    assert more.mask.sum() == 1 and len(more.values) == len(P)


def test_numbers_go_on_rising_where_sixteen_bits_begin_again() -> None:
    decoder = BinaryDecoder(P)
    found = [decoder.feed(stuff(frame({0: 1}, sequence=n)))[0].sequence for n in (65534, 65535, 0, 1)]
    assert found == [65534, 65535, 65536, 65537]
    turns = {(9, 7, 10): [9, 7, 10], (40_000, 7_232): [40_000, 7_232], (40_000, 7_231): [40_000, 65_536 + 7_231]}
    for sent, wanted in turns.items():  # frames out of order are no new turn
        late = BinaryDecoder(P)
        assert [late.feed(stuff(frame({0: 1}, sequence=n)))[0].sequence for n in sent] == wanted


def test_values_beyond_two_are_cut_off() -> None:
    values = P.neutral()
    values[:2] = 5.0, -1e30
    (found,) = BinaryDecoder(P).feed(BinaryEncoder(P).encode(Frame(values, np.ones(len(P), dtype=bool)))[0])
    assert found.values[:2] == pytest.approx([2.0, -2.0], abs=1e-3)
