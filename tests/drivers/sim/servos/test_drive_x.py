"""drivers.sim.servos.drive and drive_x: angles to registers and back, and sensing in part or in whole."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.servos.drive import Drive, Sensing
from drivers.sim.servos.drive_word import WordDrive
from drivers.sim.servos.drive_x import XDrive
from drivers.sim.servos.motion import hold
from drivers.sim.servos.plant import Plant, Skin
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import load_table


def drive(model: str = "xl330-m288", **registers: int) -> Drive:
    table = load_table(model)
    memory = Registers(table)
    memory.reset(0, table.size)
    for name, value in registers.items():
        memory.put(name.replace("_", " "), value)
    kind = XDrive if "Profile Velocity" in table else WordDrive
    return kind(memory, Plant(0.0, 2000.0, 7000.0, 5.0, Skin()), 0.0)


@given(st.integers(-100_000, 100_000), st.sampled_from([0, 1]), st.integers(-1024, 1024))
def test_goal_and_present_agree_whatever_the_drive_mode_and_offset(ticks: int, mode: int, offset: int):
    one = drive(Drive_Mode=mode, Homing_Offset=offset)
    assert one.to_register(one.to_shaft(ticks)) == ticks


@pytest.mark.parametrize("model", ["xl330-m288", "xm430-w350", "xl430-w250", "mx-28", "xm540-w270"])
def test_sensing_the_motion_alone_gives_the_same_registers(model: str):
    one = drive(model, Drive_Mode=1)
    one.plant.powered = True
    one.registers.put("Goal Position", 3000)
    one.plan(0.0)
    one.sense(0.05)
    whole = bytes(one.registers.memory[one.motion_at : one.motion_end])
    one.registers.memory[one.motion_at : one.motion_end] = bytes(10)
    one.plant.forced_c = 41.0
    one.sense_quickly(0.05)
    assert one.registers.memory[one.motion_at : one.motion_end] == whole
    assert whole != bytes(10)
    assert (one.motion_at, one.motion_end) == (126, 136)
    assert one.registers.get("Present Temperature") == 41
    celsius = one.registers.table["Present Temperature"].address
    wanted = {(126, celsius): Sensing.QUICK, (125, 126): Sensing.ALL, (64, 116): Sensing.NOTHING}
    assert {addresses: one.sensing(addresses) for addresses in wanted} == wanted


@pytest.mark.parametrize("model", ["xl330-m288", "xl320"])
def test_sensing_touches_nothing_but_sensed_registers(model: str):
    one = drive(model)
    memory = one.registers.memory
    table = load_table(model)
    sensed = {
        address
        for item in table.values()
        if not item.writable and item.name.startswith(("Present", "Moving", "Realtime", "Velocity T", "Position T"))
        for address in range(item.address, item.end)
    }
    memory[:] = b"\xa5" * len(memory)
    one.sense(1.0)
    assert {at for at in range(len(memory)) if memory[at] != 0xA5} <= sensed
    assert one.first_sensed == min(sensed)
    assert one.last_sensed == max(sensed) + 1


def test_a_lowered_velocity_limit_counts():
    one = drive(Velocity_Limit=100)
    one.registers.put("Goal Position", 4000)
    one.plan(0.0)
    assert one.plant.motion(0.5).velocity == pytest.approx(100 * one.ticks_s)


def test_a_timed_move_too_quick_for_the_motor_goes_at_its_top_speed():
    one = drive(Drive_Mode=4, Profile_Velocity=50)
    one.registers.put("Goal Position", 4000)
    one.plan(0.0)
    speeds = [one.plant.motion(0.01 * k).velocity for k in range(60)]
    assert max(speeds) == pytest.approx(one.top_speed)
    assert one.plant.motion(9.0).position == 4000.0


def test_pwm_is_given_only_by_a_powered_motor():
    one = drive()
    one.registers.put("Goal Position", 3000)
    one.plan(0.0)
    one.sense(0.05)
    assert one.registers.get("Present PWM") == 0
    one.plant.powered = True
    one.sense(0.05)
    assert one.registers.get("Present PWM") > 600


@pytest.mark.parametrize(("mode", "goals"), [
    (0, ("Goal Current",)), (1, ("Goal Velocity",)), (3, ("Goal Position",)), (4, ("Goal Position",)),
    (5, ("Goal Position", "Goal Current")), (16, ("Goal PWM",)),
])  # fmt: skip
def test_the_goals_of_each_mode(mode: int, goals: tuple[str, ...]):
    assert drive(Operating_Mode=mode).goals == goals


def test_a_current_reaches_as_far_as_the_spring_lets_it():
    one = drive(Current_Limit=735)
    assert one.reach == pytest.approx(0.5 / 4e-5)
    one.registers.put("Goal Position", 1_000_000)
    one.plan(0.0)
    assert one.plant.trajectory.end == pytest.approx(2000.0 + 0.5 / 4e-5)
    one.registers.put("Goal Position", -1_000_000)
    one.plan(0.0)
    assert one.plant.trajectory.end == pytest.approx(2000.0 - 0.5 / 4e-5)


def test_a_profile_is_bounded_by_the_motor():
    one = drive(Profile_Velocity=32767, Profile_Acceleration=32767, Goal_Position=60_000, Operating_Mode=4)
    one.plan(0.0)
    assert one.plant.motion(0.001).acceleration == pytest.approx(one.plant.top_acceleration)
    assert one.plant.motion(1.0).velocity == pytest.approx(one.top_speed)
    slow = drive(Profile_Velocity=10, Profile_Acceleration=1, Goal_Position=60_000, Operating_Mode=4)
    slow.plan(0.0)
    assert slow.plant.motion(0.001).acceleration == pytest.approx(slow.ticks_s2)
    assert slow.plant.motion(60.0).velocity == pytest.approx(10 * slow.ticks_s)


def test_pwm_is_a_share_of_the_top_speed():
    one = drive(Operating_Mode=16, Goal_PWM=442, Drive_Mode=1)
    one.plan(0.0)
    assert one.plant.motion(9.0).velocity == pytest.approx(-442 / 885 * one.top_speed)


def test_sensed_registers_one_by_one():
    one = drive(Drive_Mode=1, Operating_Mode=1, Goal_Velocity=100)
    one.plant.powered = True
    one.plan(0.0)
    one.plant.supply_v, one.plant.forced_c = 5.04, 41.6
    one.sense(2.0)
    get = one.registers.get
    motion = one.plant.motion(2.0)
    load = one.plant.load(motion, motion)
    assert get("Realtime Tick") == 2000
    assert (get("Moving"), get("Present Velocity"), get("Velocity Trajectory")) == (1, 100, 100)
    assert get("Present Position") == get("Position Trajectory") == round(4095 - motion.position)
    assert get("Present Current") == -round(1470 * load)
    assert get("Present PWM") == -round(885 * (0.8 * motion.velocity / one.plant.top_speed + 0.2 * load))
    assert (get("Present Input Voltage"), get("Present Temperature")) == (50, 42)
    assert get("Moving Status") == 1, "a velocity that is reached is no profile any more"


def test_a_stuck_shaft_is_a_following_error_from_ten_ticks_on():
    for behind, shown in ((9.9, 1), (10.0, 8)):
        one = drive()
        one.plant.powered = True
        one.plant.jam(0.0, True)
        one.plant.trajectory = hold(0.0, 2000.0 + behind)
        one.sense(1.0)
        assert one.registers.get("Moving Status") == shown


def test_temperatures_beyond_the_register_are_cut():
    one = drive()
    for celsius, shown in ((-5.0, 0), (300.0, 255)):
        one.plant.forced_c = celsius
        one.sense(1.0)
        assert one.registers.get("Present Temperature") == shown & 0xFF


def test_a_timed_move_with_ramps_is_judged_by_its_fastest_part():
    one = drive(Drive_Mode=4, Profile_Velocity=100, Profile_Acceleration=50)
    one.registers.put("Goal Position", 4000)
    one.plan(0.0)
    assert one.plant.trajectory.duration > 0.1
    assert max(one.plant.motion(0.01 * k).velocity for k in range(60)) == pytest.approx(one.top_speed)
    one.registers.put("Goal Position", 4050)
    one.plan(9.0)
    assert one.plant.trajectory.duration == pytest.approx(0.1)


def test_the_homing_offset_is_in_both_positions():
    one = drive(Homing_Offset=100)
    one.sense(0.0)
    assert one.registers.get("Present Position") == one.registers.get("Position Trajectory") == 2100
