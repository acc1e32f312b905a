"""drivers.sim.servos.drive_y: where Y-series servos keep what their motor does, and the codes of their errors."""

from __future__ import annotations

import math

import pytest

from drivers.sim.servos.drive import OVERLOAD_AFTER_S
from drivers.sim.servos.drive_y import YDrive
from drivers.sim.servos.motion import Profile
from drivers.sim.servos.plant import Plant, Skin
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import load_table

MODEL = "ym070-210-r051"
TABLE = load_table(MODEL)
TURN = 524_288
FREE = Skin(spring=0.0, inertia=0.0, friction=0.0)


def drive(**registers: int) -> YDrive:
    """A drive at 0 s whose shaft, without a load, stands at 0 with its motor on."""
    memory = Registers(TABLE)
    memory.reset(0, TABLE.size)
    for name, value in registers.items():
        memory.put(name.replace("_", " "), value)
    one = YDrive(memory, Plant(0.0, 0.0, 400_000.0, 24.0, FREE), 0.0)
    one.plant.powered = True
    return one


def sensed(one: YDrive, now_s: float) -> dict[str, int]:
    """What it senses at a time, by register."""
    one.sense(now_s)
    return {name: one.registers.get(name) for name in (
        "Moving Status", "Realtime Tick", "Present PWM", "Present Current", "Present Velocity", "Present Position",
        "Velocity Trajectory", "Position Trajectory", "Present Input Voltage", "Present Inverter Temperature",
        "Present Motor Temperature",
    )}  # fmt: skip


def test_what_is_sensed_lies_where_the_manual_has_it() -> None:
    """Moving Status to Present Motor Temperature, side by side; Realtime Tick in ms."""
    one = drive()
    last = TABLE["Present Motor Temperature"]
    assert (one.first_sensed, one.last_sensed) == (TABLE["Moving Status"].address, last.address + last.size)
    found = sensed(one, 1.5)
    assert found["Realtime Tick"] == 1500 and found["Present Position"] == 0
    assert found["Present Input Voltage"] == 2400  # 0.01 V, where its limits are 0.1 V
    assert found["Present Motor Temperature"] == found["Present Inverter Temperature"] == 30


def test_a_move_is_sensed_with_its_trajectory() -> None:
    one = drive(Goal_Position=TURN // 4, Profile_Velocity=1000)
    one.plan(0.0)
    half_s = 0.5 * one.plant.trajectory.duration
    found = sensed(one, half_s)
    assert found["Present Position"] == pytest.approx(TURN / 8, rel=0.02)
    assert found["Position Trajectory"] == found["Present Position"]
    speed = one.plant.trajectory.at(half_s).velocity
    assert found["Velocity Trajectory"] == round(speed)  # 1 pulse/s, where Present Velocity is 0.01 rev/min
    assert found["Present Velocity"] == round(speed / one.ticks_s) > 0
    arrived = sensed(one, one.plant.trajectory.duration + 1.0)
    assert arrived["Present Position"] == TURN // 4 and arrived["Present Velocity"] == 0


@pytest.mark.parametrize(
    ("velocity", "acceleration", "profile"),
    [(0, 0, Profile.STEP), (1000, 0, Profile.RECTANGULAR), (1000, 50, Profile.TRAPEZOIDAL)],
)
def test_the_status_of_a_motion_has_its_bits(velocity: int, acceleration: int, profile: int) -> None:
    """Arrived, running, moving, following error, profile and inside the position limits, from bit 0 on."""
    one = drive(Goal_Position=TURN // 2, Profile_Velocity=velocity, Profile_Acceleration=acceleration)
    one.plan(0.0)
    status = sensed(one, 0.5 * one.plant.trajectory.duration)["Moving Status"]
    assert status & 0b1 == 0 and status >> 1 & 1 and status >> 2 & 1
    assert status >> 3 & 1 == 0  # the shaft follows without a load
    assert status >> 4 & 0b11 == profile
    status = sensed(one, one.plant.trajectory.duration + 1.0)["Moving Status"]
    assert status & 0b1111 == 0b0001 and status >> 4 & 0b11 == 0


def test_a_shaft_that_is_stuck_far_from_its_trajectory_is_a_following_error() -> None:
    """From 10 steps of an X-series servo on, which are 128 of a Y-series one each."""
    for off, error in ((10 * 128 - 1, 0), (10 * 128 + 1, 1)):
        one = drive()
        one.plant.jammed_at, one.plant.jammed_since = float(off), 0.0
        status = sensed(one, 0.5)["Moving Status"]
        assert status >> 3 & 1 == error and status & 1 == 1 - error


def test_a_position_beyond_the_limits_is_said() -> None:
    for position, inside in ((1000, 1), (1001, 0), (-2000, 1), (-2001, 0)):
        one = drive(Max_Position_Limit=1000, Min_Position_Limit=-2000)
        one.plant.jammed_at = float(position)
        assert sensed(one, 0.1)["Moving Status"] >> 6 & 1 == inside


def test_a_profile_of_times_counts_in_steps_of_its_own() -> None:
    """One step of Profile Time is 0.2 ms here, 1 ms of X-series servos."""
    assert YDrive.time_s == 2e-4
    one = drive(Drive_Mode=4, Goal_Position=1000, Profile_Time=5000, Profile_Acceleration_Time=1000)
    assert one.timed
    one.plan(0.0)
    assert one.plant.trajectory.duration == pytest.approx(1.0)
    one = drive(Goal_Position=1000, Profile_Time=5000, Profile_Velocity=0)
    one.plan(0.0)
    assert one.plant.trajectory.duration < 0.5  # times count only in that mode


def test_a_load_gives_way_to_nothing_that_the_manual_says() -> None:
    assert drive(Position_I_Gain=0).give() == 0.0


def errors(one: YDrive, load: float = 0.0, now_s: float = 5.0) -> int:
    return one.hardware_errors(now_s, load)


def test_errors_are_codes_of_the_first_cause() -> None:
    codes = TABLE.error_codes
    assert errors(drive()) == 0
    one = drive(Max_Voltage_Limit=200)
    assert errors(one) == codes["over_voltage"]
    one = drive(Min_Voltage_Limit=241)
    assert errors(one) == codes["voltage"]
    one.plant.forced_c = 200.0
    assert errors(one) == codes["voltage"]  # of two, the first
    one = drive(Motor_Temperature_Limit=60)
    for celsius, code in ((60.0, 0), (61.0, codes["temperature"])):
        one.plant.forced_c = celsius
        assert errors(one) == code
    assert len(set(codes.values())) == len(codes) and 0 not in codes.values()


def test_a_motor_that_gives_all_it_can_for_long_is_overloaded() -> None:
    for blocked in ("jammed_since", "pressed_since"):
        one = drive(Min_Voltage_Limit=0)
        assert errors(one, 1.0, 5.0) == 0  # it turns
        setattr(one.plant, blocked, 4.0)
        assert errors(one, -1.0, 4.0 + OVERLOAD_AFTER_S) == 0
        assert errors(one, -1.0, 4.0 + OVERLOAD_AFTER_S + 1e-6) == TABLE.error_codes["overload"]
        assert errors(one, 0.99, 9.0) == 0


def test_a_servo_that_is_reversed_says_where_its_trajectory_leads_in_its_own_direction() -> None:
    one = drive(Drive_Mode=1, Goal_Position=TURN // 4, Profile_Velocity=1000)
    one.plan(0.0)
    found = sensed(one, 0.5 * one.plant.trajectory.duration)
    assert one.plant.trajectory.end == pytest.approx(-TURN // 4, abs=1)
    assert found["Present Velocity"] > 0 and found["Velocity Trajectory"] > 0 and found["Present Position"] > 0
    assert math.isclose(found["Position Trajectory"], found["Present Position"], abs_tol=1)
