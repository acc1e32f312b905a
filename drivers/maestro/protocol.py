"""Encoding of commands to a Pololu Maestro: compact and Pololu protocol, error bits, CRC-7.

Source: Pololu Maestro User's Guide, sections 4.e and 5. Targets are in quarter microseconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntFlag

SET_TARGET, SET_SPEED, SET_ACCELERATION, SET_PWM = 0x84, 0x87, 0x89, 0x8A
GET_POSITION, GET_MOVING, SET_MULTIPLE, GET_ERRORS = 0x90, 0x93, 0x9F, 0xA1
GO_HOME, STOP_SCRIPT, RESTART_SCRIPT, RESTART_WITH_PARAMETER, SCRIPT_STATUS = 0xA2, 0xA4, 0xA7, 0xA8, 0xAE
POLOLU, MINI_SSC = 0xAA, 0xFF

QUARTER = 4
"""Number of steps of a target per microsecond."""
SPEED_US_S = 25.0
"""One step of speed: 0.25 us per 10 ms, in us/s."""
ACCELERATION_US_S2 = 312.5
"""One step of acceleration: 0.25 us per 10 ms per 80 ms, in us/s²."""
MAX_SPEED, MAX_ACCELERATION = 0x3FFF, 255


class MaestroError(IntFlag):
    """Bits of Get Errors."""

    SIGNAL = 1
    OVERRUN = 2
    BUFFER_FULL = 4
    CRC = 8
    PROTOCOL = 16
    TIMEOUT = 32
    SCRIPT_STACK = 64
    CALL_STACK = 128
    PROGRAM_COUNTER = 256


def error_names(bits: int) -> list[str]:
    """Names of errors, as ``["crc", "buffer full"]``."""
    return [str(error.name).lower().replace("_", " ") for error in MaestroError if bits & error]


def crc7(data: bytes) -> int:
    """CRC-7 of a message: polynomial 0x91, least significant bit first."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc ^ 0x91) >> 1 if crc & 1 else crc >> 1
    return crc


class Encoder:
    """Encodes commands as bytes.

    device : device number for the Pololu protocol; None: compact protocol, to any board.
    crc : end every command with its CRC-7.
    """

    def __init__(self, device: int | None = None, crc: bool = False) -> None:
        self._device, self._crc = device, crc

    def command(self, code: int, *data: int) -> bytes:
        """One command with its data bytes, each below 0x80."""
        head = (code,) if self._device is None else (POLOLU, self._device, code & 0x7F)
        message = bytes((*head, *data))
        return message + bytes((crc7(message),)) if self._crc else message

    def word(self, code: int, channel: int, value: int) -> bytes:
        """A command for a channel with a value of 14 bits."""
        return self.command(code, channel, value & 0x7F, value >> 7)

    def targets(self, first: int, values: Sequence[int]) -> bytes:
        """Encode Set Multiple Targets for consecutive channels, from ``first`` on."""
        data = [part for value in values for part in (value & 0x7F, value >> 7)]
        return self.command(SET_MULTIPLE, len(values), first, *data)
