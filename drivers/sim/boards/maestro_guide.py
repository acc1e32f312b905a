"""Numbers of a simulated Maestro, from the Pololu Maestro User's Guide (document 0J40) and from no driver.

Sections: 5.c (Pololu protocol, Mini SSC), 5.d (cyclic redundancy check), 5.e (commands of targets, speeds and
positions), 5.f (commands of scripts), 4.e (errors).
"""

from __future__ import annotations

from enum import IntFlag

# Section 5.e
SET_TARGET, SET_SPEED, SET_ACCELERATION, SET_PWM = 0x84, 0x87, 0x89, 0x8A
GET_POSITION, GET_MOVING, SET_MULTIPLE = 0x90, 0x93, 0x9F
GET_ERRORS, GO_HOME = 0xA1, 0xA2
# Section 5.f
STOP_SCRIPT, RESTART_SCRIPT, RESTART_WITH_PARAMETER, SCRIPT_STATUS = 0xA4, 0xA7, 0xA8, 0xAE
# Section 5.c
POLOLU, MINI_SSC = 0xAA, 0xFF

TARGET_US = 0.25
"""One step of a target or position, us (5.e, Set Target: quarter microseconds)."""
SPEED_UNIT = 100.0
"""One step of speed in targets per second (5.e, Set Speed: 0.25 us per 10 ms)."""
ACCELERATION_UNIT = 1250.0
"""One step of acceleration in targets per second² (5.e, Set Acceleration: 0.25 us per 10 ms per 80 ms)."""
NEUTRAL_US, RANGE_US = 1500.0, 476.25
"""Pulse of Mini SSC's target 127, and how far those of 0 and 254 are from it, with factory settings."""


class MaestroError(IntFlag):
    """Bits of Get Errors (4.e)."""

    SIGNAL = 1
    OVERRUN = 2
    BUFFER_FULL = 4
    CRC = 8
    PROTOCOL = 16
    TIMEOUT = 32
    SCRIPT_STACK = 64
    CALL_STACK = 128
    PROGRAM_COUNTER = 256


def crc7(message: bytes) -> int:
    """Remainder of the message, least significant bit first, by the polynomial 0x91 (5.d)."""
    bits = [byte >> k & 1 for byte in message for k in range(8)] + [0] * 7
    for start in range(len(bits) - 7):
        if bits[start]:
            for k in range(8):
                bits[start + k] ^= 0x91 >> k & 1
    return sum(bit << k for k, bit in enumerate(bits[-7:]))
