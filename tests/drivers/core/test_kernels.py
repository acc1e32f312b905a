"""drivers.core.kernels: compiled before a bus is under torque, and right for every packet."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core import kernels
from drivers.packets.packet import crc16, encode_fast_head, encode_fast_part, encode_status
from drivers.tables.tables import TRIPPED

KERNELS = [value for value in vars(kernels).values() if hasattr(value, "signatures")]


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.__name__)
def test_nothing_is_compiled_at_its_first_call(kernel) -> None:  # type: ignore[no-untyped-def]
    assert len(kernel.signatures) == 1
    assert not kernel._can_compile


def test_a_checksum_goes_on_from_any_byte() -> None:
    data = np.random.default_rng(1).integers(0, 256, 50, dtype=np.uint8)
    for cut in (0, 1, 25, 50):
        begun = kernels.crc_span(data, 0, cut, 0)
        assert kernels.crc_span(data, cut, 50, begun) == crc16(data.tobytes())


def test_travel_that_was_not_used_is_saved_up_to_a_burst() -> None:
    wide, budget, last = np.full(2, 9.0), np.zeros(2), np.zeros(2)
    target, speed = np.array([1.0, -1.0]), np.array([0.5, 10.0])
    assert kernels.limit_targets(target, -wide, wide, speed, 0.1, 0.2, target.copy(), budget, last) == (0, 0, 1)
    np.testing.assert_allclose(last, [0.05, -1.0])
    here = last.copy()
    assert kernels.limit_targets(here, -wide, wide, speed, 100.0, 0.2, here.copy(), budget, last) == (0, 0, 0)
    np.testing.assert_allclose(budget, [0.1, 2.0])


@pytest.mark.parametrize(
    ("data", "sign", "value"),
    [
        (b"\xfe\xff", kernels.UNSIGNED, 0xFFFE),
        (b"\xfe\xff", kernels.TWOS_COMPLEMENT, -2),
        (b"\xff\xff\xff\x7f", kernels.TWOS_COMPLEMENT, 2**31 - 1),
        (b"\x03\x04", kernels.SIGN_MAGNITUDE, -3),
        (b"\x03\x00", kernels.SIGN_MAGNITUDE, 3),
        (b"", kernels.TWOS_COMPLEMENT, 0),
    ],
)
def test_registers_of_every_kind_of_sign(data: bytes, sign: int, value: int) -> None:
    octets = np.frombuffer(b"\x55\x55" + data, np.uint8)
    assert kernels.register(octets, 1, np.array([1, len(data), sign])) == value


def test_a_header_is_found_only_as_a_whole() -> None:
    data = np.frombuffer(b"\xff\xff\xfd\xff\xff", np.uint8)
    assert kernels.has_header(data, 0, 3)
    assert not kernels.has_header(data, 0, 2)
    assert not kernels.has_header(data, 1, 5)


AXES = np.array([[1.0, -1.0], [0.0, 0.5], [2048.0, 512.0], [0.001, 0.005]])


def test_a_reversed_servo_has_its_angle_speed_and_current_turned() -> None:
    known = np.array([[2148.0, 612.0], [3.0, 3.0], [0.2, 0.2], [4.0, 1.0], [5.0, 5.0], [30.0, 30.0]])
    out = np.empty((4, 2))
    kernels.to_si(known, AXES, 5.0, out)
    np.testing.assert_allclose(out, [[0.1, 0.0], [3.0, -3.0], [0.2, -0.2], [1.0, 4.0]], atol=1e-12)


def test_goals_are_rounded_and_kept_inside_both_pairs_of_limits() -> None:
    bounds = np.array([[2000, 400], [2100, 600], [1900, 0], [2200, 1023]], np.int32)
    for angles, before, after in (
        ([0.0104, -0.5], [2048, 512], [2058, 600]),  # the second would be 712
        ([9.0, -9.0], [2048, 512], [2100, 600]),
        ([-9.0, 9.0], [2048, 512], [2000, 400]),
        ([9.0, 0.0], [2150, 612], [2150, 612]),  # outside the first pair: no further
        ([9.0, 9.0], [2300, 2000], [2200, 400]),  # outside the servo's own: to its highest step
        ([-9.0, -9.0], [1800, -50], [1900, 600]),
    ):
        goals, sent = np.array(before, np.int32), np.empty(2)
        kernels.to_steps(np.array(angles), AXES, bounds, goals, sent)
        assert goals.tolist() == after
        np.testing.assert_allclose(sent, [(after[0] - 2048) * 0.001, 0.5 - (after[1] - 512) * 0.005])


def test_the_servos_own_lowest_and_highest_step_are_the_last_word() -> None:
    bounds = np.array([[0, 0], [4095, 4095], [1000, 1000], [3000, 3000]], np.int32)
    for angle, step in ((9.0, 3000), (-9.0, 1000)):
        goals, sent = np.array([2048, 2048], np.int32), np.empty(2)
        kernels.to_steps(np.array([angle, -100 * angle]), AXES, bounds, goals, sent)
        assert goals.tolist() == [step, step]


def test_targets_are_clipped_and_those_that_are_no_number_kept() -> None:
    wanted = np.array([5.0, -5.0, np.nan, 0.5, -np.inf])
    low, high, speed = np.full(5, -1.0), np.full(5, 2.0), np.full(5, 1e9)
    target, budget, last = np.full(5, 0.25), np.zeros(5), np.zeros(5)
    assert kernels.limit_targets(wanted, low, high, speed, 0.1, 0.1, target, budget, last) == (2, 2, 0)
    assert target.tolist() == last.tolist() == [2.0, -1.0, 0.25, 0.5, 0.25]


def status(servo: int, error: int, data: bytes) -> bytes:
    return encode_status(servo, error, data)


def replies_of(*packets: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arguments of `check_replies` for status packets that carry no stuffed bytes."""
    spans, end = [], 0
    for packet in packets:
        spans.append((packet[4], end + 8, end + len(packet)))
        end += len(packet)
    heads = np.frombuffer(b"".join(packet[:8] for packet in packets), np.uint8).reshape(-1, 8)
    states = np.array([crc16(packet[:8]) for packet in packets], np.int64)
    return np.frombuffer(b"".join(packets), np.uint8), np.array(spans, np.int64), heads, states


def test_replies_are_taken_only_where_every_byte_is_right() -> None:
    data, spans, heads, states = replies_of(status(1, 0, b"\x01\x02"), status(9, 0x80, b"\x03\x04"))
    assert kernels.check_replies(data, spans, heads, states)
    for at in range(len(data)):
        damaged = data.copy()
        damaged[at] ^= 0x40
        assert not kernels.check_replies(damaged, spans, heads, states), at


def test_stuffed_replies_are_left_alone() -> None:
    plain = bytearray(status(1, 0, b"\xff\xff\xfd"))  # carries one FD more
    assert not kernels.check_replies(*replies_of(bytes(plain)))


FIELDS = np.zeros((1, 7, 3), np.int64)
FIELDS[0, :6] = [(1, 2, 0), (3, 2, 1), (5, 2, 1), (7, 1, 0), (8, 1, 0), (9, 1, 0)]
"""Position, velocity, current, temperature, hardware error and torque behind the error byte; no watchdog."""


def cycle(
    payload: bytes, error: int = 0, fields: np.ndarray = FIELDS
) -> tuple[bool, np.ndarray, np.ndarray, np.ndarray]:
    """Take one reply of a servo that stands second on its bus and was at 30 degrees with its torque on."""
    data, spans, heads, states = replies_of(status(5, error, payload))
    octets = np.array([[9, 0], [9, 0], [9, 1], [0, 0]], np.uint8)
    known = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 4.0], [5.0, 5.0], [6.0, 30.0]])
    scales = np.array([[0.1, 0.5], [0.1, 0.002], [1.0, 1.0]])
    out = np.zeros((4, 2))
    places = np.array([1], np.int64)
    taken = kernels.take_replies(
        data, False, spans, heads, states, places, fields, scales, AXES, 10.0, octets, known, out
    )
    return taken, octets, known, out


def test_an_ordinary_reply_brings_motion_and_time() -> None:
    taken, octets, known, out = cycle(bytes((0x64, 0x02, 0xFE, 0xFF, 0x0A, 0x00, 30, 0, 1)))
    assert taken
    np.testing.assert_allclose(known[:, 1], [612.0, -1.0, 0.02, 10.0, 5.0, 30.0])
    np.testing.assert_allclose(known[:, 0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert octets[3].tolist() == [0, 1]
    np.testing.assert_allclose(out[:, 1], [0.0, 1.0, -0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(out[:, 0], [(1.0 - 2048) * 0.001, 2.0, 3.0, 6.0])


@pytest.mark.parametrize(
    ("payload", "error"),
    [
        (bytes((0x64, 2, 0, 0, 0, 0, 31, 0, 1)), 0),  # warmer
        (bytes((0x64, 2, 0, 0, 0, 0, 30, 4, 1)), 0),  # a hardware error
        (bytes((0x64, 2, 0, 0, 0, 0, 30, 0, 0)), 0),  # its torque is off
        (bytes((0x64, 2, 0, 0, 0, 0, 30, 0, 1)), 0x80),  # an alert
        (bytes(9), 0),  # all zero: its indirect addresses are gone
    ],
)
def test_a_reply_that_tells_something_new_is_left_alone(payload: bytes, error: int) -> None:
    taken, octets, known, out = cycle(payload, error)
    assert not taken
    assert known[:, 1].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 30.0]
    assert octets[3].tolist() == [0, 0]
    assert not out.any()


def test_a_reply_of_motion_alone_may_be_zero_and_a_tripped_watchdog_is_new() -> None:
    motion = FIELDS.copy()
    motion[0, 3:] = 0
    assert cycle(bytes(9), fields=motion)[0]
    watched = FIELDS.copy()
    watched[0, 6] = (10, 1, 0)
    ordinary = bytes((0x64, 2, 0, 0, 0, 0, 30, 0, 1))
    assert cycle(ordinary + b"\x05", fields=watched)[0]
    assert not cycle(ordinary + bytes((TRIPPED,)), fields=watched)[0]


def test_a_torque_above_one_is_on() -> None:
    assert cycle(bytes((0x64, 2, 0, 0, 0, 0, 30, 0, 2)))[0]


def test_joint_replies_are_checked_part_by_part() -> None:
    frame = encode_fast_head([2, 1])
    head, crc = frame, crc16(frame)
    spans = []
    for servo, data in ((4, b"\x01\x02"), (7, b"\x03")):
        begin = len(frame)
        part, crc = encode_fast_part(servo, 0, data, crc)
        frame += part
        spans.append((servo, begin, len(frame)))
    heads, states = np.frombuffer(head, np.uint8).reshape(1, 8), np.array([crc16(head)], np.int64)
    data = np.frombuffer(frame, np.uint8)
    assert kernels.check_joint(data, np.array(spans, np.int64), heads, states)
    assert not kernels.check_joint(data, np.array([(5, *spans[0][1:]), spans[1]], np.int64), heads, states)
    for at in range(len(data)):
        damaged = data.copy()
        damaged[at] ^= 1
        assert not kernels.check_joint(damaged, np.array(spans, np.int64), heads, states), at


def test_goals_go_into_a_frame_low_byte_first() -> None:
    frame = np.zeros(12 + 2 * 3 + 2, np.uint8)
    frame[:12] = range(12)
    frame[12], frame[15] = 3, 8
    goals, places = np.array([0x0102, -2, 0x0FFF], np.int32), np.array([2, 0], np.int64)
    state = crc16(bytes(range(12)))
    assert kernels.put_goals(frame, 12, goals, places, 2, state)
    assert frame.tobytes()[12:18] == bytes((3, 0xFF, 0x0F, 8, 0x02, 0x01))
    assert int.from_bytes(frame.tobytes()[18:], "little") == crc16(frame.tobytes()[:18])
    stuffed = np.array([0x00FD, 0, 0xFFFF], np.int32)
    frame[15] = 0xFD
    assert not kernels.put_goals(frame, 12, stuffed, places, 2, state)


@pytest.mark.parametrize("error", [RuntimeError("no locator available"), OSError(28, "No space left on device")])
def test_kernels_are_there_where_no_compiled_code_can_be_kept(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise error

    monkeypatch.setattr("numba.core.caching.FunctionCache.__init__", refuse)
    double = kernels._kernel(kernels._REAL)(lambda x: 2.0 * x)
    assert double(3.0) == 6.0 and not double._can_compile
