"""drivers.sim.boards.maestro_guide: numbers of the Pololu Maestro User's Guide, and its checksum by another method."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.boards import maestro_guide as guide
from drivers.sim.boards.maestro_guide import MaestroError, crc7


def by_bytes(message: bytes) -> int:
    """The checksum byte by byte, as the C code of section 5.d does it."""
    crc = 0
    for byte in message:
        crc ^= byte
        for _ in range(8):
            crc = (crc ^ 0x91) >> 1 if crc & 1 else crc >> 1
    return crc


def test_the_checksum_of_the_guide_s_example() -> None:
    assert crc7(bytes((0x83, 0x01))) == 0x17


@given(st.binary(max_size=12))
def test_checksums_are_those_of_the_guide_s_program(message: bytes) -> None:
    found = crc7(message)
    assert found == by_bytes(message) and 0 <= found < 128


@given(st.binary(min_size=1, max_size=6), st.data())
def test_any_wrong_bit_changes_the_checksum(message: bytes, data: st.DataObject) -> None:
    at, bit = data.draw(st.integers(0, len(message) - 1)), data.draw(st.integers(0, 7))
    wrong = bytes(byte ^ (1 << bit if k == at else 0) for k, byte in enumerate(message))
    assert crc7(wrong) != crc7(message)


def test_commands_have_the_bytes_of_the_guide() -> None:
    assert (guide.SET_TARGET, guide.SET_SPEED, guide.SET_ACCELERATION, guide.SET_PWM) == (0x84, 0x87, 0x89, 0x8A)
    assert (guide.GET_POSITION, guide.GET_MOVING, guide.SET_MULTIPLE) == (0x90, 0x93, 0x9F)
    assert (guide.GET_ERRORS, guide.GO_HOME) == (0xA1, 0xA2)
    assert (guide.STOP_SCRIPT, guide.RESTART_SCRIPT, guide.RESTART_WITH_PARAMETER, guide.SCRIPT_STATUS) == (
        0xA4, 0xA7, 0xA8, 0xAE,
    )  # fmt: skip
    assert (guide.POLOLU, guide.MINI_SSC) == (0xAA, 0xFF)


def test_units_are_quarter_microseconds_in_the_times_of_the_guide() -> None:
    """5.e: a speed of 1 is 0.25 us per 10 ms, and an acceleration of 1 is 0.25 us per 10 ms per 80 ms."""
    assert guide.TARGET_US == 0.25
    assert guide.SPEED_UNIT == 1 / 0.010
    assert guide.ACCELERATION_UNIT == 1 / 0.010 / 0.080
    # 5.e, Set Speed: at a speed of 140, a servo needs 100 ms from 1000 us to 1350 us
    assert 140 * guide.SPEED_UNIT * 0.100 * guide.TARGET_US == 350.0
    assert (guide.NEUTRAL_US - guide.RANGE_US, guide.NEUTRAL_US + guide.RANGE_US) == (1023.75, 1976.25)


def test_errors_are_bits_from_the_lowest_on_in_the_order_of_the_guide() -> None:
    order = ("SIGNAL", "OVERRUN", "BUFFER_FULL", "CRC", "PROTOCOL", "TIMEOUT", "SCRIPT_STACK", "CALL_STACK",
             "PROGRAM_COUNTER")  # fmt: skip
    assert [MaestroError[each].value for each in order] == [1 << bit for bit in range(9)]
    assert len(MaestroError) == len(order)
