"""controller.robot.servo_states: one record a servo, and None for what nobody knows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.robot.servo_states import servo_states
from drivers.base.bus import BusState, ServoSpec


def unknown(count: int) -> BusState:
    numbers = (np.full(count, np.nan) for _ in range(6))
    flags = (np.zeros(count, bool) for _ in range(3))
    codes = (np.zeros(count, np.uint8) for _ in range(2))
    position, velocity, current, age, voltage, temperature = numbers
    fresh, silent, torque = flags
    error, hardware = codes
    return BusState(0.0, position, velocity, current, fresh, age, error, silent, voltage, temperature, hardware, torque)


def loop(state: BusState | None) -> Any:
    servos = [
        ServoSpec(1, "jaw", "xl330-m288", -0.5, 1.0, 5.0, 50.0),
        ServoSpec(7, "brow", "xl330-m288", -1.0, 1.0, 5.0, 50.0),
    ]
    bus = SimpleNamespace(servos=servos)
    settings = SimpleNamespace(name="head")
    return SimpleNamespace(measured=lambda: state, goals_rad=np.array([0.25, np.nan]), settings=settings, bus=bus)


def test_before_anything_was_read_limits_and_goals_are_known() -> None:
    first, second = servo_states(loop(None))
    assert (first["bus"], first["id"], first["name"], first["model"]) == ("head", 1, "jaw", "xl330-m288")
    assert (first["low_deg"], first["high_deg"]) == pytest.approx((-28.6, 57.3), abs=0.05)
    assert first["wanted_deg"] == pytest.approx(np.degrees(0.25), abs=0.01) and first["error"] == "not read yet"
    assert "measured_deg" not in second


def test_what_a_servo_reports_and_what_is_wrong_with_it() -> None:
    state = unknown(2)
    state.position_rad[:], state.age_s[:] = (0.5, np.nan), (0.012, np.inf)
    state.temperature_c[0], state.torque[0], state.silent[:] = 41.0, True, (False, True)
    first, second = servo_states(loop(state))
    assert first["measured_deg"] == pytest.approx(np.degrees(0.5), abs=0.01)
    assert (first["temperature_c"], first["torque"], first["age_s"], first["error"]) == (41.0, True, 0.01, "")
    assert (second["measured_deg"], second["age_s"], second["error"]) == (None, None, "does not answer")
    state.silent[1], state.hardware_error[1] = False, 0x20
    assert servo_states(loop(state))[1]["error"] == "hardware error 0x20"
    state.hardware_error[1], state.error[1] = 0, 0x80
    assert servo_states(loop(state))[1]["error"] == "alert"
