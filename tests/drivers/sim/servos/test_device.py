"""drivers.sim.servos.device: one servo, instruction by instruction, with the time in the test's hand."""

from __future__ import annotations

import pytest

from drivers.packets.packet import ErrorNumber as E
from drivers.sim.servos.device import CLEAR_MULTI_TURN, SimulatedServo
from drivers.sim.servos.plant import Skin

NO_LOAD = Skin(spring=0.0, inertia=0.0, friction=0.0)


def servo(model: str = "xl330-m288", **options) -> SimulatedServo:
    return SimulatedServo(1, model, **{"skin": NO_LOAD, **options})


def write(device: SimulatedServo, name: str, value: int, now_s: float = 0.0) -> int:
    item = device.table[name]
    return device.write(item.address, item.encode(value), now_s)


def read(device: SimulatedServo, name: str, now_s: float) -> int:
    item = device.table[name]
    error, data = device.read(item.address, item.size, now_s)
    assert error & 0x7F == 0
    return item.decode(data)


def test_a_goal_moves_the_shaft_only_under_torque():
    device = servo()
    write(device, "Goal Position", 3000)
    assert device.position_ticks(5.0) == 2048
    write(device, "Torque Enable", 1, 5.0)
    # Nothing rewrites the goal: the old one is carried out at once, at full speed (445 units of 0.2289 rpm).
    assert device.position_ticks(5.1) > 2300
    assert device.position_ticks(6.0) == 3000


def test_speed_is_bounded_by_the_motor():
    device = servo()
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 4095)
    top = 445 * 0.0239691227 / device.table.rad_per_tick
    fastest = max(device.position_ticks(0.01 * k + 0.01) - device.position_ticks(0.01 * k) for k in range(40))
    assert fastest == pytest.approx(top * 0.01, abs=1.5)
    assert max(read(device, "Present Velocity", 0.01 * k) for k in range(40)) == 445


def test_profile_velocity_and_acceleration_follow_the_formula():
    device = servo()
    write(device, "Torque Enable", 1)
    write(device, "Profile Acceleration", 10)
    write(device, "Profile Velocity", 100)
    write(device, "Goal Position", 4000)
    ramp = 0.064 * 100 / 10  # t1 = 64 V / A ms
    assert read(device, "Present Velocity", ramp / 2) == pytest.approx(50, abs=1)
    assert read(device, "Present Velocity", ramp + 0.1) == 100
    ticks_s = 100 * 0.0239691227 / device.table.rad_per_tick
    total = (4000 - 2048) / ticks_s + ramp
    assert (read(device, "Moving", total - 0.02), read(device, "Moving", total + 0.02)) == (1, 0)
    assert read(device, "Present Position", total + 0.02) == 4000


@pytest.mark.parametrize(("velocity", "acceleration", "profile"), [(0, 0, 0), (100, 0, 1), (400, 1, 2), (20, 50, 3)])
def test_moving_status(velocity: int, acceleration: int, profile: int):
    device = servo()
    assert read(device, "Moving Status", 0.0) == 1
    write(device, "Torque Enable", 1)
    write(device, "Profile Acceleration", acceleration)
    write(device, "Profile Velocity", velocity)
    write(device, "Goal Position", 3000)
    assert read(device, "Moving Status", 0.02) == 2 | profile << 4
    assert read(device, "Moving Status", 99.0) == 1


def test_time_based_profile_takes_its_time():
    device = servo()
    write(device, "Drive Mode", 4)
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 1000)  # ms
    write(device, "Profile Acceleration", 200)
    write(device, "Goal Position", 3048)
    assert read(device, "Present Position", 0.5) == 2548
    assert read(device, "Moving", 0.99) == 1
    assert (read(device, "Moving", 1.01), read(device, "Present Position", 1.01)) == (0, 3048)


def test_goals_of_other_modes_do_not_start_the_motion_anew():
    device = servo()
    write(device, "Drive Mode", 4)
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 1000)
    write(device, "Goal Position", 3048)
    for name in ("Goal Velocity", "Goal PWM", "Goal Current"):
        write(device, name, 5, 0.9)
    assert read(device, "Present Position", 1.01) == 3048


def test_velocity_pwm_and_current_modes():
    device = servo()
    write(device, "Operating Mode", 1)
    write(device, "Torque Enable", 1)
    write(device, "Goal Velocity", -100)
    assert read(device, "Present Velocity", 1.0) == -100
    assert read(device, "Present Position", 3.0) < -1000
    write(device, "Torque Enable", 0, 3.0)
    assert read(device, "Present Velocity", 4.0) == 0
    write(device, "Operating Mode", 16, 4.0)
    assert 0 <= read(device, "Present Position", 4.0) < 4096
    assert read(device, "Goal PWM", 4.0) == 0
    write(device, "Torque Enable", 1, 4.0)
    write(device, "Goal PWM", 442, 4.0)
    assert read(device, "Present Velocity", 5.0) == pytest.approx(222, abs=2)
    write(device, "Torque Enable", 0, 6.0)
    write(device, "Operating Mode", 0, 7.0)
    assert read(device, "Goal Current", 7.0) == 0


def test_current_mode_finds_the_balance_with_the_skin():
    device = servo(skin=Skin(spring=1e-3, inertia=0.0, friction=0.0))
    write(device, "Operating Mode", 0)
    write(device, "Torque Enable", 1)
    write(device, "Goal Current", 147)  # a tenth of the 1.47 A at stall (e-Manual, XL330-M288)
    assert read(device, "Present Position", 5.0) == 2048 + 100
    assert read(device, "Present Current", 5.0) == 147


def test_current_limit_holds_the_shaft_back():
    device = servo(skin=Skin(spring=1e-3, inertia=0.0, friction=0.0))
    write(device, "Current Limit", 294)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 4000)
    assert read(device, "Present Position", 5.0) == 2048 + 200
    other = servo(skin=Skin(spring=1e-3, inertia=0.0, friction=0.0))
    write(other, "Operating Mode", 5)
    write(other, "Torque Enable", 1)
    write(other, "Goal Current", 147)
    write(other, "Goal Position", 4000)
    assert read(other, "Present Position", 5.0) == 2048 + 100


def test_load_comes_from_spring_and_friction():
    device = servo(skin=Skin(spring=1e-4, inertia=0.0, friction=0.05))
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3048)
    assert read(device, "Present Current", 0.1) > 0.05 * 1470
    assert read(device, "Present Current", 9.0) == 147
    write(device, "Torque Enable", 0, 9.0)
    assert read(device, "Present Current", 9.0) == 0


def test_reverse_mode_mirrors_goal_present_velocity_and_current():
    device = servo(position=1000.0, skin=Skin(spring=1e-4, inertia=0.0, friction=0.0))
    write(device, "Drive Mode", 1)
    assert read(device, "Present Position", 0.0) == 3095
    write(device, "Goal Position", 3095)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3500)
    assert read(device, "Present Velocity", 0.05) > 0
    assert read(device, "Present Position", 9.0) == 3500
    assert read(device, "Present Current", 9.0) > 0
    assert device.plant.motion(9.0).position == 595


@pytest.mark.parametrize(("mode", "offset", "shown"), [(3, 1024, 3072), (3, 1025, 2048), (4, 1025, 3073)])
def test_homing_offset_counts_only_up_to_a_quarter_turn_in_position_mode(mode, offset, shown):
    device = servo()
    write(device, "Operating Mode", mode)
    write(device, "Homing Offset", offset)
    assert read(device, "Present Position", 1.0) == shown


def test_torque_on_by_goal_update():
    device = servo()
    write(device, "Drive Mode", 8)
    write(device, "Goal Position", 2500)
    assert device.torque
    assert read(device, "Torque Enable", 0.0) == 1
    assert read(device, "Present Position", 9.0) == 2500
    old = servo(firmware=45)
    write(old, "Drive Mode", 8)
    write(old, "Goal Position", 2500)
    assert not old.torque


def test_eeprom_is_locked_under_torque():
    device = servo()
    write(device, "Torque Enable", 1)
    assert write(device, "ID", 9) == E.ACCESS
    assert device.id == 1
    write(device, "Torque Enable", 0)
    assert write(device, "ID", 9) == 0
    assert device.id == 9
    assert device.eeprom_writes == {"ID": 1}


def test_registered_write_waits_for_action():
    device = servo()
    assert device.action(0.0) == E.INSTRUCTION
    assert device.reg_write(116, b"\xff\xff\x00\x00") == E.DATA_LIMIT
    assert read(device, "Registered Instruction", 0.0) == 0
    assert device.reg_write(65, b"\x01") == 0
    assert (read(device, "Registered Instruction", 0.0), read(device, "LED", 0.0)) == (1, 0)
    assert device.action(0.0) == 0
    assert (read(device, "Registered Instruction", 0.0), read(device, "LED", 0.0)) == (0, 1)
    assert device.action(0.0) == E.INSTRUCTION


def test_reboot_forgets_ram_keeps_eeprom_and_is_deaf_for_a_while():
    device = servo()
    write(device, "Homing Offset", 5)
    write(device, "Profile Velocity", 50)
    write(device, "Bus Watchdog", 10)
    write(device, "Torque Enable", 1)
    device.reboot(1.0)
    assert not device.torque
    assert device.deaf_until == 1.25
    assert read(device, "Homing Offset", 2.0) == 5
    assert read(device, "Profile Velocity", 2.0) == 0
    assert read(device, "Bus Watchdog", 2.0) == 0
    assert write(device, "ID", 3, 2.0) == 0


def test_startup_configuration_switches_torque_on():
    device = servo()
    write(device, "Startup Configuration", 1)
    device.reboot(0.0)
    assert device.torque
    assert read(device, "Torque Enable", 1.0) == 1
    assert write(device, "ID", 3, 1.0) == E.ACCESS


@pytest.mark.parametrize(("option", "device_id", "baud"), [(0xFF, 1, 57_600), (1, 9, 57_600), (2, 9, 2_000_000)])
def test_factory_reset(option: int, device_id: int, baud: int):
    device = servo()
    changes = []
    device.on_change = lambda: changes.append(1)
    for name, value in (("ID", 9), ("Baud Rate", 4), ("Homing Offset", 7), ("Drive Mode", 1)):
        write(device, name, value)
    assert device.factory_reset(option, 0.0) == 0
    assert (device.id, device.baud) == (device_id, baud)
    assert read(device, "Homing Offset", 1.0) == 0
    assert read(device, "Present Position", 1.0) == 2048
    assert len(changes) == 3


def test_factory_reset_of_an_unknown_kind_is_refused():
    device = servo()
    write(device, "Homing Offset", 7)
    assert device.factory_reset(3, 0.0) == E.DATA_RANGE
    assert read(device, "Homing Offset", 0.0) == 7


def test_clear_brings_the_position_back_into_one_turn_at_rest_only():
    device = servo()
    write(device, "Operating Mode", 4)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 9000)
    assert device.clear(CLEAR_MULTI_TURN, 0.1) == E.RESULT_FAIL
    assert device.clear(b"\x01\x00\x00\x00\x00", 60.0) == E.DATA_RANGE
    assert read(device, "Present Position", 60.0) == 9000
    assert device.clear(CLEAR_MULTI_TURN, 60.0) == 0
    assert read(device, "Present Position", 60.0) == 9000 % 4096
    assert read(device, "Present Position", 70.0) == 9000 % 4096


@pytest.mark.parametrize(("mode", "then"), [(3, 4066), (4, -30)])
def test_switched_on_in_position_mode_a_turned_servo_counts_within_one_turn(mode: int, then: int):
    """e-Manual, Present Position (132)."""
    device = servo()
    write(device, "Operating Mode", mode)
    device.place(-30, 1.0)
    assert read(device, "Present Position", 1.0) == -30, "limp, it counts on"
    write(device, "Goal Position", 100, 1.0)
    write(device, "Torque Enable", 1, 1.0)
    assert read(device, "Present Position", 1.0) == then
    assert device.goal == 100


def test_leaving_the_table_is_an_access_error_without_data():
    assert servo().read(220, 9, 0.0) == (E.ACCESS, b"")


def test_eeprom_busy_makes_it_deaf():
    device = servo()
    device.eeprom_busy_s = 0.02
    write(device, "LED", 1, 5.0)
    assert device.deaf_until == 0.0
    write(device, "Homing Offset", 1, 5.0)
    assert device.deaf_until == 5.02


def test_xl320():
    device = servo("xl320")
    assert (read(device, "Present Position", 0.0), read(device, "Goal Position", 0.0)) == (512, 512)
    assert read(device, "Present Voltage", 0.0) == 74
    write(device, "Moving Speed", 200)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 300)
    assert read(device, "Present Speed", 0.3) == 200 | 1024
    assert (read(device, "Present Position", 5.0), read(device, "Present Speed", 5.0)) == (300, 0)
    assert write(device, "CW Angle Limit", 1) == E.ACCESS
    assert write(device, "Goal Position", 1024) == E.DATA_RANGE
    device.latch(0x01, 5.0)
    assert (device.torque, read(device, "Torque Limit", 5.0)) == (False, 0)


def test_xl320_wheel_mode():
    device = servo("xl320")
    write(device, "Control Mode", 1)
    write(device, "Torque Enable", 1)
    write(device, "Moving Speed", 512 | 1024)
    assert device.plant.motion(1.0).velocity == pytest.approx(-512 / 1023 * device.plant.top_speed)


def test_load_register_of_models_without_current():
    device = servo("xl430-w250", skin=Skin(spring=1e-4, inertia=0.0, friction=0.0))
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3048)
    assert read(device, "Present Load", 9.0) == 100


def test_the_ramps_of_a_time_based_profile_take_profile_acceleration_in_milliseconds():
    device = servo()
    write(device, "Drive Mode", 4)
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 1000)
    write(device, "Profile Acceleration", 200)
    write(device, "Goal Position", 3048)
    cruise = 1000 / 0.8
    assert device.plant.motion(0.1).velocity == pytest.approx(cruise / 2)
    assert device.plant.motion(0.5).velocity == pytest.approx(cruise)


@pytest.mark.parametrize(("goal_current", "sign"), [(147, 1), (-147, -1)])
def test_without_a_spring_current_turns_the_shaft_for_ever(goal_current: int, sign: int):
    device = servo()
    write(device, "Operating Mode", 0)
    write(device, "Torque Enable", 1)
    write(device, "Goal Current", goal_current)
    assert device.plant.motion(5.0).velocity == pytest.approx(sign * 0.1 * device.drive.top_speed)


def test_velocity_is_bounded_by_its_limit_and_reversed_by_the_drive_mode():
    device = servo()
    write(device, "Drive Mode", 1)
    write(device, "Velocity Limit", 100)
    write(device, "Operating Mode", 1)
    write(device, "Torque Enable", 1)
    write(device, "Goal Velocity", 100)
    assert read(device, "Present Velocity", 5.0) == 100
    assert device.plant.motion(5.0).velocity < 0
    device.registers.put("Goal Velocity", 300)
    device.drive.plan(5.0)
    assert read(device, "Present Velocity", 9.0) == 100


def test_profile_acceleration_ramps_the_velocity_mode():
    device = servo()
    write(device, "Operating Mode", 1)
    write(device, "Torque Enable", 1)
    write(device, "Profile Acceleration", 10)
    write(device, "Goal Velocity", 100)
    ramp_s = 0.064 * 100 / 10
    assert read(device, "Present Velocity", ramp_s / 2) == pytest.approx(50, abs=1)
    assert read(device, "Present Velocity", ramp_s + 0.01) == 100


def test_a_goal_switches_torque_on_only_with_its_bit_and_without_shutdown():
    device = servo()
    write(device, "Goal Position", 2500)
    assert not device.torque
    write(device, "Drive Mode", 8)
    for name in ("Goal PWM", "Goal Current", "Goal Velocity", "Goal Position"):
        write(device, "Torque Enable", 0)
        write(device, name, 1)
        assert device.torque, name


def test_permanent_writes_are_counted_and_keep_the_servo_deaf_for_the_longest():
    device = servo()
    device.eeprom_busy_s = 0.5
    write(device, "Homing Offset", 1, 1.0)
    write(device, "Homing Offset", 2, 1.1)
    write(device, "LED", 1, 1.2)
    assert (device.eeprom_writes, device.deaf_until) == ({"Homing Offset": 2}, 1.6)
    device.eeprom_busy_s = 0.0
    write(device, "Homing Offset", 3, 1.3)
    assert device.deaf_until == 1.6


def test_torque_that_is_on_is_not_switched_on_again():
    device = servo()
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 1)
    write(device, "Goal Position", 3000)
    before = device.plant.trajectory
    write(device, "Torque Enable", 1, 0.5)
    assert device.plant.trajectory is before


def test_sensors_are_read_again_after_a_write_at_the_same_moment():
    device = servo()
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3000)
    write(device, "Profile Velocity", 1)
    assert read(device, "Moving Status", 0.1) & 2
    write(device, "Torque Enable", 0, 0.1)
    assert not read(device, "Moving Status", 0.1) & 2


def test_an_old_servo_gets_its_torque_back_with_its_limit_without_a_reboot():
    device = servo("ax-12a")
    write(device, "Torque Enable", 1)
    device.latch(0x20, 0.0)
    assert (device.torque, read(device, "Torque Limit", 0.0)) == (False, 0)
    item = device.table["Torque Enable"]
    device.write(item.address, b"\1", 1.0)
    assert (device.torque, device.hardware_error, device.shut_down) == (True, 0, False)
    assert device.registers.get("Torque Limit") == device.table["Torque Limit"].initial


def test_any_bytes_of_the_table_may_be_read_and_none_behind_it():
    device = servo()
    size = device.table.size
    error, data = device.read(0, size, 1.0)
    assert (error, len(data)) == (0, size)
    assert device.read(size - 1, 1, 1.0)[0] == 0
    assert device.read(size, 1, 1.0) == (E.ACCESS, b"")
    assert device.read(0, 0, 1.0) == (E.ACCESS, b"")
    tick = device.table["Realtime Tick"].address
    assert device.read(tick, 2, 2.0)[1] == (2000).to_bytes(2, "little")
    assert device.read(tick - 1, 2, 3.0)[1][1:] == (3000 & 0xFF).to_bytes(1, "little")
    assert device.read(146, 1, 4.0)[1] == b"\x1e"


def test_a_factory_reset_restores_every_permanent_register():
    device = servo()
    permanent = [item for item in device.table.values() if item.address < device.table.eeprom_end]
    for item in permanent:
        device.registers.put(item.name, item.initial ^ 0x55)
    assert device.factory_reset(0xFF, 0.0) == 0
    assert [device.registers.get(item.name) for item in permanent] == [item.initial for item in permanent]


def test_what_a_read_senses_follows_pointers_that_are_set_later() -> None:
    """The same slots show the LED first, which nothing senses, and then the position."""
    device = servo(position=1000)
    first = device.table.indirect[0]
    for slot, target in enumerate((65,) * 4):
        device.write(first[0] + 2 * slot, target.to_bytes(2, "little"), 0.0)
    assert device.read(first[1], 4, 0.1)[1] == bytes(4)
    for slot, target in enumerate(range(132, 136)):
        device.write(first[0] + 2 * slot, target.to_bytes(2, "little"), 0.2)
    device.place(1234, 0.3)
    assert int.from_bytes(device.read(first[1], 4, 0.4)[1], "little") == 1234
