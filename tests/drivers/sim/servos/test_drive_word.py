"""drivers.sim.servos.drive_word: goals and sensors of servos with 16-bit registers."""

from __future__ import annotations

import pytest

from drivers.sim.servos.drive_word import SENSED, FeetechDrive, WordDrive
from drivers.sim.servos.motion import Motion, Profile, hold, plan_speed
from drivers.sim.servos.plant import Plant, Skin
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import load_table


def drive(model: str, **registers: int) -> WordDrive:
    table = load_table(model)
    memory = Registers(table)
    memory.reset(0, table.size)
    for name, value in registers.items():
        memory.put(name.replace("_", " "), value)
    skin = Skin(spring=1e-4, rest=0.0, inertia=0.0, friction=0.0)
    plant = Plant(0.0, float(table.center), 1000.0, 7.0, skin)
    return (FeetechDrive if "Goal Velocity" in table else WordDrive)(memory, plant, 0.0)


@pytest.mark.parametrize("model", ["ax-12a", "mx1-28", "xl320", "sts3215", "scs0009"])
def test_sensing_touches_nothing_but_sensed_registers(model: str):
    one = drive(model)
    memory, table = one.registers.memory, one.registers.table
    memory[:] = b"\xa5" * len(memory)
    one.sense(1.0)
    sensed = {at for item in table.values() if item.name in SENSED for at in range(item.address, item.end)}
    assert {at for at in range(len(memory)) if memory[at] != 0xA5} <= sensed
    assert (one.first_sensed, one.last_sensed) == (min(sensed), max(sensed) + 1)


def test_sensing_quickly_is_sensing():
    one = drive("ax-12a")
    one.plant.trajectory = hold(0.0, 300.0)
    one.sense_quickly(1.0)
    assert one.registers.get("Present Position") == 300


@pytest.mark.parametrize(("model", "load"), [("ax-12a", 51), ("sts3215", 205)])
def test_load_is_a_share_of_the_stall_torque(model: str, load: int):
    one = drive(model)
    one.plant.powered = True
    one.sense(1.0)
    assert one.registers.get("Present Load") == load


def test_the_direction_of_an_xl320_is_left_in_its_register():
    one = drive("xl320")
    one.plant.powered = True
    one.plant.rest = 1512.0
    one.sense(1.0)
    assert one.registers.get("Present Load") == round(1023 * 0.1) | 1024


@pytest.mark.parametrize(("mode", "turns"), [(1, True), (2, False)])
def test_an_xl320_turns_endlessly_in_wheel_mode_alone(mode: int, turns: bool):
    one = drive("xl320", Control_Mode=mode, Goal_Position=700, Moving_Speed=200)
    one.plant.powered = True
    one.plan(0.0)
    assert (one.plant.trajectory.at(60.0).velocity != 0.0) == turns


def test_positions_outside_the_turn_are_cut():
    one = drive("ax-12a")
    for shaft, shown in ((-50.0, 0), (2000.0, 1023)):
        one.plant.trajectory = hold(0.0, shaft)
        one.sense(1.0)
        assert one.registers.get("Present Position") == shown


@pytest.mark.parametrize(("speed", "fastest"), [(0, 1000.0), (100, 100 * 0.0116228475 / 0.005113269293928698)])
def test_moving_speed_zero_is_the_top_speed(speed: int, fastest: float):
    one = drive("ax-12a", Goal_Position=900, Moving_Speed=speed)
    one.plan(0.0)
    assert one.plant.motion(0.2).velocity == pytest.approx(fastest)
    assert one.plant.trajectory.profile == Profile.RECTANGULAR


def test_an_acceleration_beyond_the_motors_is_the_motors():
    one = drive("sts3215", Goal_Position=3000, Acceleration=254)
    one.plan(0.0)
    assert one.plant.motion(0.01).acceleration == pytest.approx(254 * 100.0)
    one.plant.top_acceleration = 5000.0
    one.plan(0.0)
    assert one.plant.motion(0.01).acceleration == 5000.0


def test_goal_time_is_for_the_scs_series_only():
    for model, seconds in (("scs0009", 2.0), ("sts3215", None)):
        one = drive(model, Goal_Time=2000)
        one.registers.put("Goal Position", one.registers.table.center + 100)
        one.plan(0.0)
        assert (one.plant.trajectory.duration == pytest.approx(2.0)) is (seconds is not None)


def test_the_wheel_of_an_ax_turns_by_magnitude_and_direction():
    one = drive("ax-12a", CW_Angle_Limit=0, CCW_Angle_Limit=0, Moving_Speed=512)
    one.plan(0.0)
    assert one.plant.motion(9.0).velocity == pytest.approx(512 / 1023 * 1000.0)
    one.registers.put("Moving Speed", 512 | 1024)
    one.plan(9.0)
    assert one.plant.motion(20.0).velocity == pytest.approx(-512 / 1023 * 1000.0)
    one.registers.put("CCW Angle Limit", 1)
    one.registers.put("Goal Position", 1)
    one.plan(20.0)
    assert one.plant.trajectory.end == 1.0


@pytest.mark.parametrize(
    ("mode", "name", "value", "velocity"),
    [(1, "Goal Velocity", -100, -100 * 50 / 50), (2, "Goal Time", 250, 250.0), (2, "Goal Time", -2000, -1000.0)],
)
def test_speed_and_pwm_modes_of_feetech(mode: int, name: str, value: int, velocity: float):
    one = drive("sts3215", Operating_Mode=mode)
    one.registers.put(name, value)
    one.plan(0.0)
    expected = velocity if mode == 2 else -100 * one.ticks_s
    assert one.plant.motion(9.0).velocity == pytest.approx(expected)


def test_step_mode_adds_to_where_the_last_step_ends():
    one = drive("sts3215", Operating_Mode=3, Goal_Position=100)
    centre = one.plant.motion(0.0).position
    one.plan(0.0)
    one.plan(0.01)
    assert one.plant.trajectory.end == centre + 200.0


def test_goal_velocity_and_acceleration_of_feetech():
    one = drive("sts3215", Goal_Position=3000, Goal_Velocity=200, Acceleration=10)
    one.plan(0.0)
    assert one.plant.motion(0.05).acceleration == pytest.approx(1000.0)
    assert one.plant.motion(0.5).velocity == pytest.approx(200 * one.ticks_s)
    one.registers.put("Goal Velocity", 0)
    one.plan(0.0)
    assert max(one.plant.motion(0.01 * k).velocity for k in range(200)) > 200 * one.ticks_s


def test_homing_offset_and_turns_of_an_sts():
    one = drive("sts3215", Homing_Offset=100)
    one.plant.trajectory = hold(0.0, 2148.0)
    one.sense(0.0)
    assert one.registers.get("Present Position") == 2048
    one.plant.trajectory = hold(0.0, 9000.0)
    one.sense(0.0)
    assert one.registers.get("Present Position") == 4095
    one.registers.put("Phase", 0x10)
    one.sense(0.0)
    assert one.registers.get("Present Position") == 8900


def test_sensed_registers_of_an_ax():
    one = drive("ax-12a")
    one.plant.powered = True
    one.plant.trajectory = plan_speed(0.0, Motion(100.0, -200.0), -200.0, 1.0)
    one.plant.supply_v, one.plant.forced_c = 11.0, 36.6
    one.sense(0.25)
    get = one.registers.get
    assert (get("Present Position"), get("Moving")) == (50, 1)
    assert get("Present Speed") == -round(200 / one.ticks_s)
    assert (get("Present Voltage"), get("Present Temperature")) == (110, 37)
    one.plant.powered = False
    one.sense(0.25)
    assert get("Moving") == 0


@pytest.mark.parametrize(("now_s", "tick"), [(0.0, 0), (0.25, 250), (32.767, 32767), (32.7685, 0), (40.0, 7232)])
def test_the_tick_of_an_mx_counts_milliseconds_in_fifteen_bits(now_s: float, tick: int):
    one = drive("mx1-28")
    one.sense(now_s)
    assert one.registers.get("Realtime Tick") == tick


def test_speeds_are_in_the_unit_of_the_models_register():
    one = drive("sts3215", Operating_Mode=1, Goal_Velocity=100)
    one.ticks_s = 3.0
    one.plan(0.0)
    assert one.plant.motion(9.0).velocity == pytest.approx(300.0)
    one.registers.put("Goal Velocity", 400)
    one.plan(9.0)
    assert one.plant.motion(20.0).velocity == pytest.approx(1000.0), "no faster than the motor"
    one.registers.put("Operating Mode", 0)
    one.registers.put("Goal Velocity", -100)
    one.registers.put("Goal Position", 4000)
    one.plan(20.0)
    assert max(abs(one.plant.motion(20.0 + 0.01 * k).velocity) for k in range(50, 800)) == pytest.approx(300.0)


@pytest.mark.parametrize(
    ("volts", "celsius", "shown"),
    [(30.0, 300.0, (255, 255)), (-1.0, -5.0, (0, 0)), (25.45, 254.6, (254, 255)), (0.1, 1.2, (1, 1))],
)
def test_voltage_and_temperature_stay_in_their_byte(volts: float, celsius: float, shown: tuple[int, int]):
    one = drive("ax-12a")
    one.plant.supply_v, one.plant.forced_c = volts, celsius
    one.sense(1.0)
    assert (one.registers.get("Present Voltage"), one.registers.get("Present Temperature")) == shown


@pytest.mark.parametrize("model", ["sts3215", "scs0009"])
def test_maximum_velocity_limit_is_in_units_of_50_steps_a_second(model: str):
    one = drive(model, Goal_Position=900, Maximum_Velocity_Limit=4, Goal_Velocity=900)
    one.plan(0.0)
    assert abs(one.plant.motion(0.5).velocity) == pytest.approx(200.0)


def test_maximum_acceleration_bounds_the_acceleration_of_an_sts():
    for own, most, steps in ((0, 20, 2000), (50, 20, 2000), (10, 20, 1000), (10, 0, 1000)):
        one = drive("sts3215", Goal_Position=3000, Acceleration=own, Maximum_Acceleration=most)
        one.plan(0.0)
        assert one.plant.motion(0.01).acceleration == pytest.approx(steps)
