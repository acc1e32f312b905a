"""drivers.sim.servos.drive: what all motor controls share: units, stops, observation, causes of hardware errors."""

from __future__ import annotations

import math

import pytest

from drivers.sim.servos.drive import OVERLOAD_AFTER_S, Drive, speed_unit
from drivers.sim.servos.drive_word import WordDrive
from drivers.sim.servos.drive_x import XDrive
from drivers.sim.servos.motion import Motion, plan_speed
from drivers.sim.servos.plant import Plant, Skin
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import load_table

VOLTAGE, TEMPERATURE, OVERLOAD = 0x01, 0x04, 0x20
"""Bits of Hardware Error Status of X-series servos (e-Manual)."""


def drive(model: str = "xl330-m288", top_speed: float = 1000.0) -> Drive:
    table = load_table(model)
    registers = Registers(table)
    registers.reset(0, table.size)
    plant = Plant(0.0, 2000.0, top_speed, 5.0, Skin(spring=0.0, inertia=0.0, friction=0.0))
    return (XDrive if "Profile Velocity" in table else WordDrive)(registers, plant, 0.0)


@pytest.mark.parametrize(
    ("model", "rpm", "ticks"),
    [("xl330-m288", 0.2289, 4096), ("ax-12a", 0.111, 1024 * 360 / 300), ("mx1-28", 0.114, 4096)],
)
def test_one_step_of_speed_in_ticks(model: str, rpm: float, ticks: float):
    assert speed_unit(load_table(model)) == pytest.approx(rpm / 60 * ticks, rel=3e-3)


def test_registers_are_the_shaft_reversed_about_the_middle_then_offset():
    one = drive()
    one.side, one.mirror, one.offset = -1, 4095.0, 7
    assert (one.to_register(1000.4), one.to_shaft(3102)) == (3095 + 7, 1000.0)
    one.side, one.mirror = 1, 0.0
    assert (one.to_register(1000.4), one.to_shaft(1007)) == (1007, 1000.0)


def test_a_stop_is_at_once_and_coasting_takes_half_the_motors_acceleration():
    one = drive()
    one.plant.trajectory = plan_speed(0.0, Motion(2000.0, 900.0), 900.0, 1.0)
    one.stop(1.0)
    assert one.plant.motion(1.0) == one.plant.motion(9.0) == Motion(2900.0)
    one.plant.trajectory = plan_speed(0.0, Motion(2000.0, 900.0), 900.0, 1.0)
    one.coast(1.0)
    braking = 0.5 * 1000.0 / one.plant.RAMP_S
    assert one.plant.motion(1.0 + 0.01).velocity == pytest.approx(900.0 - braking * 0.01)
    assert one.plant.motion(9.0).position == pytest.approx(2900.0 + 900.0**2 / (2 * braking))


def test_what_is_observed_of_a_jammed_shaft_is_where_it_is_and_where_it_should_be():
    one = drive()
    one.plant.powered = True
    one.plant.trajectory = plan_speed(0.0, Motion(2000.0, 10.0), 10.0, 1.0)
    motion, commanded, load = one.observe(1.0)
    assert (motion, load) == (Motion(2010.0, 10.0), 0.0) and commanded == motion
    one.plant.jam(1.0, True)
    motion, commanded, load = one.observe(2.0)
    assert (motion, commanded.position) == (Motion(2010.0), 2020.0)
    assert load == pytest.approx(10.0 * one.plant.STIFFNESS)


def test_hardware_errors_begin_just_beyond_their_limits():
    one = drive()
    plant, registers = one.plant, one.registers
    registers.put("Min Voltage Limit", 45)
    registers.put("Max Voltage Limit", 55)
    for volts, bits in ((4.5, 0), (4.4, VOLTAGE), (5.5, 0), (5.6, VOLTAGE)):
        plant.supply_v = volts
        assert one.hardware_errors(0.0, 0.0) == bits
    plant.supply_v = 5.0
    assert one.hardware_errors(0.0, 1.0) == 0, "sags to 4.6 V"
    plant.supply_v = 4.7
    assert one.hardware_errors(0.0, -1.0) == VOLTAGE, "sags to 4.3 V"
    plant.supply_v = 5.0
    limit = registers.get("Temperature Limit")
    for celsius, bits in ((float(limit), 0), (limit + 0.1, TEMPERATURE)):
        plant.forced_c = celsius
        assert one.hardware_errors(0.0, 0.0) == bits


def test_an_overload_takes_full_torque_of_a_jammed_shaft_for_its_time():
    one = drive()
    assert one.hardware_errors(99.0, 1.0) == 0, "not jammed"
    one.plant.jam(10.0, True)
    assert one.hardware_errors(10.0 + OVERLOAD_AFTER_S, 1.0) == 0
    late = math.nextafter(10.0 + OVERLOAD_AFTER_S, math.inf)
    assert one.hardware_errors(late, 1.0) == one.hardware_errors(late, -1.0) == OVERLOAD
    assert one.hardware_errors(late, 0.99) == 0
    one.plant.supply_v, one.plant.forced_c = 1.0, 200.0
    assert one.hardware_errors(late, 1.0) == VOLTAGE | TEMPERATURE | OVERLOAD
