"""Compiled inner loops of a bus cycle. Importing this imports numba, so do it only where a bus is driven.

Between the last byte of a reply and the first byte of the next goal the wire is idle: what is done there is done
here, in one call each, because after every wait for the wire the interpreter starts cold.

The types stand with each kernel so that it is compiled on import, before a port is opened: compiled at its first call,
on a new machine, it would hold up a bus under torque for longer than the servos' watchdog waits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import int64, njit, types

from drivers.dynamixel.packet import crc16

CRC_TABLE = np.array([crc16(bytes((byte,))) for byte in range(256)], np.uint16)
"""CRC-16 of each single byte, (256,)."""

_BYTES = types.Array(types.uint8, 1, "C", readonly=True)
_HEADS = types.Array(types.uint8, 2, "C", readonly=True)
_STATES, _STEPS, _REALS = types.int64[::1], types.int32[::1], types.float64[::1]
_REAL = types.float64


def _kernel(*parameters: Any) -> Any:
    return njit([parameters], cache=True, nogil=True)


@_kernel(_BYTES, int64, int64, int64)
def crc_span(data, begin, end, state):  # type: ignore[no-untyped-def]
    """CRC-16 of ``data[begin:end]`` (uint8), continuing from `state`."""
    for at in range(begin, end):
        state = ((state << 8) & 0xFFFF) ^ CRC_TABLE[(state >> 8) ^ data[at]]
    return state


@_kernel(_BYTES, int64, _HEADS, _STATES, int64)
def check_replies(data, begin, heads, states, size):  # type: ignore[no-untyped-def]
    """Whether status packets lie side by side from `begin` on, each of `size` bytes, with right heads and CRCs.

    Parameters
    ----------
    data : (m,) uint8.
    heads : (k, 8) uint8, what each packet begins with.
    states : (k,) int64, the CRC of each head.
    """
    for k in range(heads.shape[0]):
        start = begin + k * size
        for at in range(heads.shape[1]):
            if data[start + at] != heads[k, at]:
                return False
        end = start + size - 2
        if crc_span(data, start + heads.shape[1], end, states[k]) != data[end] | data[end + 1] << 8:
            return False
    return True


@_kernel(_BYTES, int64, _BYTES, int64, int64)
def check_joint(data, begin, ids, size, state):  # type: ignore[no-untyped-def]
    """CRC behind the parts of a joint reply from `begin` on, each of `size` bytes; -1 where one is damaged.

    Parameters
    ----------
    data : (m,) uint8.
    ids : (k,) uint8, the second byte of each part.
    state : CRC of what comes before.
    """
    for k in range(ids.shape[0]):
        start = begin + k * size
        end = start + size - 2
        state = crc_span(data, start, end, state)
        if data[start + 1] != ids[k] or state != data[end] | data[end + 1] << 8:
            return -1
        state = crc_span(data, end, end + 2, state)
    return state


@_kernel(*[_REALS] * 4)
def clip_targets(wanted, low, high, target):  # type: ignore[no-untyped-def]
    """Finite targets, inside their limits, into `target`; all (n,) float64. Returns how many were not, of each."""
    refused = clipped = 0
    for i in range(wanted.shape[0]):
        if np.isfinite(wanted[i]):
            target[i] = min(max(wanted[i], low[i]), high[i])
            clipped += target[i] != wanted[i]
        else:
            refused += 1
    return refused, clipped


@_kernel(_REALS, _REALS, _REAL, _REAL, _REALS, _REALS)
def spend_travel(target, speed, elapsed_s, burst_s, saved, last):  # type: ignore[no-untyped-def]
    """Move `last` towards `target` as far as saved-up travel allows; all (n,) float64. Returns how many fell short."""
    short = 0
    for i in range(target.shape[0]):
        saved[i] = min(saved[i] + elapsed_s * speed[i], burst_s * speed[i])
        move = min(max(target[i] - last[i], -saved[i]), saved[i])
        saved[i] -= abs(move)
        last[i] += move
        short += abs(last[i] - target[i]) > 1e-9
    return short


@_kernel(*[_REALS] * 5, *[_STEPS] * 5, _REALS)
def to_steps(angle_rad, sign, zero_rad, center, rad_per_tick, low, high, lowest, highest, goals, sent):  # type: ignore[no-untyped-def]
    """Angles to the nearest steps within limits, into `goals` (n,) int32, and back into `sent` (n,) float64.

    A goal that lies outside ``low`` to ``high`` may only go nearer; nothing leaves ``lowest`` to ``highest``.
    """
    for i in range(angle_rad.shape[0]):
        step = np.rint(center[i] + (zero_rad[i] + sign[i] * angle_rad[i]) / rad_per_tick[i])
        step = max(step, max(min(low[i], goals[i]), lowest[i]))
        step = min(step, min(max(high[i], goals[i]), highest[i]))
        goals[i] = int(step)
        sent[i] = sign[i] * ((step - center[i]) * rad_per_tick[i] - zero_rad[i])


@_kernel(*[_REALS] * 4, _REAL, *[_REALS] * 4, types.float64[:, ::1])
def to_si(ticks, speed, current, seen_s, now_s, sign, zero_rad, center, rad_per_tick, out):  # type: ignore[no-untyped-def]
    """Angle, speed, current and age of n servos into the rows of `out`, (4, n) float64."""
    for i in range(ticks.shape[0]):
        out[0, i] = sign[i] * ((ticks[i] - center[i]) * rad_per_tick[i] - zero_rad[i])
        out[1, i] = sign[i] * speed[i]
        out[2, i] = sign[i] * current[i]
        out[3, i] = now_s - seen_s[i]
