"""drivers.sim.servos.drive and drive_x: angles to registers and back, and sensing in part or in whole."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.servos.drive import Drive
from drivers.sim.servos.drive_word import WordDrive
from drivers.sim.servos.drive_x import XDrive
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
    one.sense_motion(0.05)
    assert one.registers.memory[one.motion_at : one.motion_end] == whole
    assert whole != bytes(10)
    assert (one.motion_at, one.motion_end) == (126, 136)


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
