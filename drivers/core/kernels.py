"""Compiled inner loops of a bus cycle: decoding replies, CRC-16, target limits, and goals in encoder steps.

The wire is idle between the last byte of a reply and the first byte of the next goal, so each stage there is one call.
Importing this module imports numba; do so only where a bus is driven. Every kernel declares its types, so that it is
compiled on import, before a port is opened: compiled at its first call it would delay a bus under torque beyond the
servos' watchdog. No kernel releases the interpreter's lock: each takes a few microseconds, less than
it takes to get the lock back where other buses are driven in the same process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import int64, njit, types

from drivers.packets.packet import crc16
from drivers.tables.tables import MAGNITUDE_BIT, TRIPPED

CRC_TABLE = np.array([crc16(bytes((byte,))) for byte in range(256)], np.uint16)
"""CRC-16 of each single byte, (256,)."""

_BYTES = types.Array(types.uint8, 1, "C", readonly=True)
_FRAME, _OCTETS = types.uint8[::1], types.uint8[:, ::1]
_HEADS = types.Array(types.uint8, 2, "C", readonly=True)
_STATES, _STEPS, _REALS = types.int64[::1], types.int32[::1], types.float64[::1]
_PLACES, _SPANS, _FIELDS = types.int64[::1], types.int64[:, ::1], types.int64[:, :, ::1]
_BOUNDS, _TABLE = types.int32[:, ::1], types.float64[:, ::1]
_REAL, _FLAG = types.float64, types.boolean

UNSIGNED, TWOS_COMPLEMENT, SIGN_MAGNITUDE = range(3)
"""Encodings of a register's sign; the last has one bit for the direction (XL-320)."""
FIELDS = ("position", "velocity", "current", "temperature", "hardware", "torque", "watchdog")
TEMPERATURE, HARDWARE, TORQUE, WATCHDOG = range(3, 7)
"""Registers that `take_replies` reads, in its order, and the indices of those that are not motion."""


def _kernel(*parameters: Any) -> Callable[[Callable[..., Any]], Any]:
    def compiled(function: Callable[..., Any]) -> Any:
        try:
            return njit([parameters], cache=True)(function)
        except (RuntimeError, OSError):  # numba finds no folder to keep compiled code in, or a full disk
            return njit([parameters])(function)

    return compiled


@_kernel(_BYTES, int64, int64, int64)
def crc_span(data, begin, end, state):  # type: ignore[no-untyped-def]
    """CRC-16 of ``data[begin:end]`` (uint8), continuing from `state`."""
    for at in range(begin, end):
        state = ((state << 8) & 0xFFFF) ^ CRC_TABLE[(state >> 8) ^ data[at]]
    return state


@_kernel(_BYTES, int64, int64)
def has_header(data, begin, end):  # type: ignore[no-untyped-def]
    """Whether ``data[begin:end]`` (uint8) holds FF FF FD, which Protocol 2.0 stuffs with another FD."""
    for at in range(begin, end - 2):  # noqa: SIM110  numba compiles no any()
        if data[at] == 0xFF and data[at + 1] == 0xFF and data[at + 2] == 0xFD:
            return True
    return False


@_kernel(_BYTES, _SPANS, _HEADS, _STATES)
def check_replies(data, spans, heads, states):  # type: ignore[no-untyped-def]
    """Whether `data` holds k valid status packets, one of each servo: heads and CRCs match, nothing is stuffed.

    data : (m,) uint8, not shorter than the replies.
    spans : (k, 3) int64: a servo's id, index of its error byte, end of its reply.
    heads : (k, 8) uint8, first bytes of each packet.
    states : (k,) int64, the CRC of each head.
    """
    for k in range(spans.shape[0]):
        begin, end = spans[k, 1], spans[k, 2] - 2
        for at in range(8):
            if data[begin - 8 + at] != heads[k, at]:
                return False
        if crc_span(data, begin, end, states[k]) != data[end] | data[end + 1] << 8 or has_header(data, begin, end):
            return False
    return True


@_kernel(_BYTES, _SPANS, _HEADS, _STATES)
def check_joint(data, spans, heads, states):  # type: ignore[no-untyped-def]
    """As `check_replies` for a fast sync read, where each CRC covers all bytes before it; one head, one state."""
    for at in range(8):
        if data[at] != heads[0, at]:
            return False
    state = states[0]
    for k in range(spans.shape[0]):
        begin, end = spans[k, 1], spans[k, 2] - 2
        state = crc_span(data, begin, end, state)
        if data[begin + 1] != spans[k, 0] or state != data[end] | data[end + 1] << 8:
            return False
        state = crc_span(data, end, end + 2, state)
    return True


@_kernel(_BYTES, int64, _STATES)
def register(data, begin, field):  # type: ignore[no-untyped-def]
    """Decode a little-endian register; `field` (3,) int64: offset from `begin`, bytes (0: not read), sign encoding."""
    value, size = 0, field[1]
    for i in range(size):
        value |= int64(data[begin + field[0] + i]) << (8 * i)
    if field[2] == SIGN_MAGNITUDE:
        magnitude = value & (MAGNITUDE_BIT - 1)
        return -magnitude if value & MAGNITUDE_BIT else magnitude
    if field[2] == TWOS_COMPLEMENT and size and value >> (8 * size - 1):
        return value - (1 << (8 * size))
    return value


@_kernel(_BYTES, int64, int64, _SPANS, _TABLE, _OCTETS, _TABLE)
def is_ordinary(data, begin, i, fields, scales, octets, known):  # type: ignore[no-untyped-def]
    """Whether the reply with its error byte at `begin` changes nothing of servo `i` but its motion.

    A servo whose indirect addresses were reset reads 0 throughout, which is a change. Parameters as in `take_replies`.
    """
    if data[begin] != octets[0, i]:
        return False
    some, read = 0, 0
    for row in range(TEMPERATURE, WATCHDOG + 1):
        value = register(data, begin, fields[row])
        some, read = some | value, read | fields[row, 1]
        if not fields[row, 1]:
            continue
        if row == TEMPERATURE and value * scales[2, i] != known[5, i]:
            return False
        if (row == HARDWARE and value != octets[1, i]) or (row == TORQUE and (value != 0) != (octets[2, i] != 0)):
            return False
        if row == WATCHDOG and value == TRIPPED:
            return False
    return some != 0 or read == 0


@_kernel(_TABLE, _TABLE, _REAL, _TABLE)
def to_si(known, axes, now_s, out):  # type: ignore[no-untyped-def]
    """Write angle, speed, current and age of n servos to the rows of `out` (4, n); parameters as in `take_replies`."""
    for i in range(known.shape[1]):
        out[0, i] = axes[0, i] * ((known[0, i] - axes[2, i]) * axes[3, i] - axes[1, i])
        out[1, i] = axes[0, i] * known[1, i]
        out[2, i] = axes[0, i] * known[2, i]
        out[3, i] = now_s - known[3, i]


@_kernel(_BYTES, _FLAG, _SPANS, _HEADS, _STATES, _PLACES, _FIELDS, _TABLE, _TABLE, _REAL, _OCTETS, _TABLE, _TABLE)
def take_replies(data, joint, spans, heads, states, places, fields, scales, axes, now_s, octets, known, out):  # type: ignore[no-untyped-def]
    """Decode the replies of one cycle where all are valid and only motion changed; else return False, all unchanged.

    data, spans, heads, states : see `check_replies` and, with `joint`, `check_joint`.
    places : (k,) int64, index of each servo in the arrays of the bus.
    fields : (k, 7, 3) int64, see `register`: the rows named by `FIELDS`, their offsets from the error byte.
    scales : (3, n), steps of velocity, current and temperature in SI units.
    axes : (4, n), see `to_steps`.
    now_s : time of the replies.
    octets : (4, n) uint8: error byte, hardware error, torque, freshness.
    known : (6, n): position (steps), velocity, current, time, supply, temperature.
    out : (4, n), see `to_si`.
    """
    if not (check_joint(data, spans, heads, states) if joint else check_replies(data, spans, heads, states)):
        return False
    for k in range(places.shape[0]):
        if not is_ordinary(data, spans[k, 1], places[k], fields[k], scales, octets, known):
            return False
    for k in range(places.shape[0]):
        i, begin = places[k], spans[k, 1]
        known[0, i] = register(data, begin, fields[k, 0])
        for row in range(1, TEMPERATURE):
            if fields[k, row, 1]:
                known[row, i] = register(data, begin, fields[k, row]) * scales[row - 1, i]
        known[3, i] = now_s
        octets[3, i] = 1
    to_si(known, axes, now_s, out)
    return True


@_kernel(_FRAME, int64, _STEPS, _PLACES, int64, int64)
def put_goals(frame, at, goals, places, size, state):  # type: ignore[no-untyped-def]
    """Write goals and CRC into a sync write packet; False where they hold FF FF FD and must be stuffed.

    frame : (m,) uint8, the packet.
    at : index of its rows: an id and `size` bytes each.
    goals : (n,) int32 of the bus. places : (k,) int64, indices of the goals in the packet.
    state : CRC of the bytes before the rows.
    """
    for k in range(places.shape[0]):
        value, row = int64(goals[places[k]]), at + k * (1 + size) + 1
        for i in range(size):
            frame[row + i] = (value >> (8 * i)) & 0xFF
    end = at + places.shape[0] * (1 + size)
    if has_header(frame, at, end):
        return False
    crc = crc_span(frame, at, end, state)
    frame[end], frame[end + 1] = crc & 0xFF, crc >> 8
    return True


@_kernel(*[_REALS] * 4, _REAL, _REAL, *[_REALS] * 3)
def limit_targets(wanted, low, high, speed, elapsed_s, burst_s, target, budget, last):  # type: ignore[no-untyped-def]
    """Clip finite targets into `target`, and move `last` towards it as far as the travel budget allows; (n,) float64.

    The budget grows by `elapsed_s` at top speed up to `burst_s` of it. Returns how many targets were not finite, were
    clipped, and were not reached.
    """
    refused = clipped = short = 0
    for i in range(wanted.shape[0]):
        if np.isfinite(wanted[i]):
            target[i] = min(max(wanted[i], low[i]), high[i])
            clipped += target[i] != wanted[i]
        else:
            refused += 1
        budget[i] = min(budget[i] + elapsed_s * speed[i], burst_s * speed[i])
        move = min(max(target[i] - last[i], -budget[i]), budget[i])
        budget[i] -= abs(move)
        last[i] += move
        short += abs(last[i] - target[i]) > 1e-9
    return refused, clipped, short


@_kernel(_REALS, _TABLE, _BOUNDS, _STEPS, _REALS)
def to_steps(angle_rad, axes, bounds, goals, sent):  # type: ignore[no-untyped-def]
    """Round angles to steps within limits in `goals` (n,) int32, and convert these back to `sent` (n,) float64.

    A goal outside low to high may only move towards them; none leaves lowest to highest.

    axes : (4, n): sign, zero_rad, center, rad_per_tick.
    bounds : (4, n) int32: low, high, lowest, highest.
    """
    for i in range(angle_rad.shape[0]):
        sign, zero_rad, center, rad_per_tick = axes[0, i], axes[1, i], axes[2, i], axes[3, i]
        step = np.rint(center + (zero_rad + sign * angle_rad[i]) / rad_per_tick)
        step = max(step, max(min(bounds[0, i], goals[i]), bounds[2, i]))
        step = min(step, min(max(bounds[1, i], goals[i]), bounds[3, i]))
        goals[i] = int(step)
        sent[i] = sign * ((step - center) * rad_per_tick - zero_rad)
