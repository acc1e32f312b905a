"""Assertions about a record of servos. Each raises AssertionError, which says which servo, when, and what.

Times in messages are seconds since the record began, positions are Present Position in ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from drivers.sim.servos.device import SimulatedServo
from drivers.testing.motions import Dash, dashes, paths, place_at
from drivers.testing.records import ServoRecord, Write

Limits = tuple[float, float] | Mapping[int, tuple[float, float]] | None
"""Lowest and highest position (ticks) of all servos or by id; None: the limit registers of each."""

SHOWN = 5
"""Faults that a message lists; it counts the others."""
SOON_S = 0.1
"""A motion so soon after torque came on is because of it."""
GOAL = "Goal Position"


def fail(title: str, faults: list[str]) -> None:
    """Raise an AssertionError with what was found; nothing where nothing was."""
    __tracebackhide__ = True
    if faults:
        more = [f"and {len(faults) - SHOWN} more"] if len(faults) > SHOWN else []
        raise AssertionError("\n  ".join([title, *faults[:SHOWN], *more]))


def beyond_limits(record: ServoRecord, limits: Limits, end_s: float) -> list[str]:
    """Goals that were beyond limits, also those that the servo refused, and shafts that moved beyond them.

    Where a shaft was outside before, its goals may lead it back.
    """
    faults: list[str] = []
    for k, servo in enumerate(record.servos):
        low, high = _limits_of(servo, limits)
        own = [write for write in record.writes if write.id == servo.id]
        faults += _goals_out(record, k, own, low, high)
        if limits is None:
            faults += [
                f"{name(servo)} refused {_said(write)}: {write.refused}"
                for write in own
                if write.refused.startswith("data") and write.register != GOAL
            ]
        faults += _ways_out(record, k, low, high, end_s)
    return faults


def _goals_out(record: ServoRecord, k: int, writes: Sequence[Write], low: float, high: float) -> Iterator[str]:
    servo = record.servos[k]
    for write in writes:
        if write.register != GOAL or write.value is None or low <= write.value <= high:
            continue
        here = servo.drive.to_register(place_at(record.pieces[k], record.start_s + write.time_s))
        if write.refused or not min(low, here) - 1 <= write.value <= max(high, here) + 1:
            note = f", which it refused ({write.refused})" if write.refused else ""
            yield f"{name(servo)} got {_said(write)}{note}; its limits are {low:g} to {high:g}"


def _limits_of(servo: SimulatedServo, limits: Limits) -> tuple[float, float]:
    if isinstance(limits, Mapping):
        return limits.get(servo.id, (-math.inf, math.inf))
    if limits is not None:
        return limits
    item = servo.table[GOAL]
    if not item.lower or not item.upper or servo.registers.extended:
        return -math.inf, math.inf
    return servo.registers.get(item.lower), servo.registers.get(item.upper)


def _ways_out(record: ServoRecord, k: int, low: float, high: float, end_s: float) -> Iterator[str]:
    """Motions under power that go further outside than they began."""
    servo = record.servos[k]
    for piece, samples in paths(record.pieces[k], end_s):
        begin = samples[0]
        far = max(samples, key=lambda sample: abs(sample.position - begin.position))
        begun, place = (servo.drive.to_register(sample.position) for sample in (begin, far))
        if piece.powered and not min(low, begun) - 1 <= place <= max(high, begun) + 1:
            wall = high if place > high else low
            yield f"{name(servo)} moved to {place} at {far.time_s - record.start_s:.3f} s, beyond {wall:g}"


def still_on(record: ServoRecord) -> list[str]:
    """Servos whose torque is on."""
    faults = []
    for k, servo in enumerate(record.servos):
        if servo.torque:
            since_s = _on_since(record, k, math.inf)
            faults.append(f"{name(servo)} still has its torque on, since {since_s:.3f} s; nothing switched it off")
    return faults


def _on_since(record: ServoRecord, k: int, before_s: float) -> float:
    """When the torque of a servo last came on, no later than a time; seconds since the record began."""
    since_s, on = record.start_s, False
    for piece in record.pieces[k]:
        if piece.start_s > before_s:
            break
        if piece.powered and not on:
            since_s = piece.start_s
        on = piece.powered
    return since_s - record.start_s


def jumps(record: ServoRecord, deg: float, deg_s: float, end_s: float) -> list[str]:
    """Ways of more than ``deg`` that a powered shaft went faster than ``deg_s``."""
    faults = []
    for k, servo in enumerate(record.servos):
        tick_deg = math.degrees(servo.table.rad_per_tick)
        found = dashes(record.pieces[k], end_s, deg_s / tick_deg)
        faults += [_jump(record, k, dash, tick_deg) for dash in found if dash.way * tick_deg > deg]
    return faults


def _jump(record: ServoRecord, k: int, dash: Dash, tick_deg: float) -> str:
    servo, start_s = record.servos[k], record.start_s
    first, last = (servo.drive.to_register(sample.position) for sample in (dash.first, dash.last))
    took_s, at_s = dash.last.time_s - dash.first.time_s, dash.first.time_s - start_s
    on_s, goal = _on_since(record, k, dash.first.time_s), _last_goal(record, servo, at_s)
    cause = f"; its last goal was {_said(goal)}" if goal else ""
    soon = f", and its torque had come on at {on_s:.3f} s" if at_s - on_s < SOON_S else ""
    advice = "move in small steps from its Present Position, or set its Profile Velocity"
    if soon and (goal is None or goal.time_s < on_s):
        advice = "write its Present Position to its Goal Position before torque comes on"
    return (
        f"{name(servo)} went {dash.way * tick_deg:.1f} degrees in {took_s:.3f} s, at up to "
        f"{dash.top_speed * tick_deg:.0f} degrees/s, from {first} to {last} at {at_s:.3f} s{cause}{soon}: {advice}"
    )


def _last_goal(record: ServoRecord, servo: SimulatedServo, before_s: float) -> Write | None:
    """The last goal of a servo up to a time since the record began."""
    goals = (w for w in reversed(record.writes) if w.id == servo.id and w.register == GOAL and not w.refused)
    return next((write for write in goals if write.time_s <= before_s + 1e-3), None)


def name(servo: SimulatedServo) -> str:
    """A servo in messages."""
    return f"servo {servo.id} ({servo.table.model})"


def _said(write: Write) -> str:
    return f"{write.register} = {write.value:g} at {write.time_s:.3f} s"
