"""State of every servo of a bus, its goal and its measurements, for display."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from controller.robot.busloop import BusLoop
from drivers.base.bus import BusState


def servo_states(loop: BusLoop) -> list[dict[str, Any]]:
    """Return a record for each servo: names, limits and goal (degrees), measurements (None if unknown), and its error.

    May be called from any thread; ``age_s`` is the age of a position.
    """
    state, goals = loop.measured(), np.degrees(loop.goals_rad)
    return [
        {
            "bus": loop.settings.name, "id": spec.id, "name": spec.name, "model": spec.model,
            "low_deg": round(math.degrees(spec.min_rad), 1), "high_deg": round(math.degrees(spec.max_rad), 1),
            "wanted_deg": round(float(goals[i]), 2), **_reported(state, i),
        }
        for i, spec in enumerate(loop.bus.servos)
    ]  # fmt: skip


def _reported(state: BusState | None, i: int) -> dict[str, Any]:
    if state is None:
        return {"error": "not read yet"}
    return {
        "measured_deg": _number(math.degrees(state.position_rad[i]), 2), "age_s": _number(state.age_s[i], 2),
        "temperature_c": _number(state.temperature_c[i], 0), "voltage_v": _number(state.voltage_v[i], 1),
        "current_a": _number(state.current_a[i], 3), "torque": bool(state.torque[i]), "error": _fault(state, i),
    }  # fmt: skip


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def _fault(state: BusState, i: int) -> str:
    """Describe the error of a servo in a few words; empty if it has none."""
    if state.silent[i]:
        return "does not answer"
    if state.hardware_error[i]:
        return f"hardware error 0x{int(state.hardware_error[i]):02x}"
    return "alert" if state.error[i] & 0x80 else ""
