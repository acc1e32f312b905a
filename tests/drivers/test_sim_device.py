"""drivers.sim.device: one servo, instruction by instruction, with the time in the test's hand."""

from __future__ import annotations

import pytest

from drivers.dynamixel.packet import ALERT
from drivers.dynamixel.packet import ErrorNumber as E
from drivers.sim.device import CLEAR_MULTI_TURN, SimulatedServo
from drivers.sim.plant import Skin

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


def test_power_up():
    device = servo(position=1500.0)
    assert (device.id, device.baud, device.torque, device.secondary_id) == (1, 1_000_000, False, None)
    assert device.return_delay_s == pytest.approx(500e-6)
    assert (read(device, "Present Position", 0.0), read(device, "Goal Position", 0.0)) == (1500, 1500)
    assert read(device, "Goal PWM", 0.0) == 885
    assert read(device, "Goal Current", 0.0) == 1750
    assert read(device, "Present Input Voltage", 0.0) == 50
    assert read(device, "Present Temperature", 0.0) == 30


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
    write(device, "Goal Current", 175)  # a tenth of the stall torque
    assert read(device, "Present Position", 5.0) == 2048 + 100
    assert read(device, "Present Current", 5.0) == 175


def test_current_limit_holds_the_shaft_back():
    device = servo(skin=Skin(spring=1e-3, inertia=0.0, friction=0.0))
    write(device, "Current Limit", 350)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 4000)
    assert read(device, "Present Position", 5.0) == 2048 + 200
    other = servo(skin=Skin(spring=1e-3, inertia=0.0, friction=0.0))
    write(other, "Operating Mode", 5)
    write(other, "Torque Enable", 1)
    write(other, "Goal Current", 175)
    write(other, "Goal Position", 4000)
    assert read(other, "Present Position", 5.0) == 2048 + 100


def test_load_comes_from_spring_and_friction():
    device = servo(skin=Skin(spring=1e-4, inertia=0.0, friction=0.05))
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3048)
    assert read(device, "Present Current", 0.1) > 0.05 * 1750
    assert read(device, "Present Current", 9.0) == 175
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


def test_leaving_the_table_is_an_access_error_without_data():
    assert servo().read(220, 9, 0.0) == (E.ACCESS, b"")


def test_hardware_error_in_the_shutdown_mask_takes_torque_until_reboot():
    device = servo()
    write(device, "Torque Enable", 1)
    device.latch(0x20, 0.0)
    assert not device.torque
    assert device.read(132, 4, 0.0)[0] == ALERT
    assert len(device.read(132, 4, 0.0)[1]) == 4
    assert (read(device, "Torque Enable", 0.0), read(device, "Hardware Error Status", 0.0)) == (0, 0x20)
    assert write(device, "Torque Enable", 1) == ALERT  # silently refused
    assert not device.torque
    device.reboot(1.0)
    assert write(device, "Torque Enable", 1, 2.0) == 0
    assert device.torque


def test_hardware_error_outside_the_mask_only_alerts():
    device = servo("xm430-w350")
    write(device, "Torque Enable", 1)
    device.latch(0x01, 0.0)
    assert device.torque
    assert device.read(132, 4, 0.0)[0] == ALERT


def test_shut_down_servo_does_not_come_on_by_goal_update():
    device = servo()
    write(device, "Drive Mode", 8)
    device.latch(0x20, 0.0)
    write(device, "Goal Position", 2500)
    assert not device.torque


def test_voltage_dip_latches_after_the_voltage_came_back():
    device = servo()
    write(device, "Torque Enable", 1)
    device.plant.supply_v = 3.0
    device.look(1.0)
    device.plant.supply_v = 5.0
    device.look(2.0)
    assert (device.register("Hardware Error Status", 2.0), device.torque) == (0x01, False)
    assert device.register("Present Input Voltage", 2.0) == 50


def test_heat_latches_overheating():
    device = servo()
    device.plant.forced_c = 70.0
    device.look(1.0)
    assert device.alert == 0
    device.plant.forced_c = 71.0
    device.look(2.0)
    assert device.register("Hardware Error Status", 2.0) == 0x04


def test_a_jammed_shaft_draws_full_current_and_overloads():
    device = servo()
    write(device, "Torque Enable", 1)
    device.plant.jam(0.0, True)
    write(device, "Goal Position", 3000)
    assert read(device, "Present Position", 0.5) == 2048
    assert read(device, "Present Current", 0.5) == 1750
    assert read(device, "Moving Status", 0.5) & 8
    device.look(0.9)
    assert device.torque
    device.look(1.2)
    assert (device.register("Hardware Error Status", 1.2), device.torque) == (0x20, False)


def test_full_load_heats_the_motor():
    device = servo(skin=Skin(spring=1e-3, rest=1548.0, inertia=0.0, friction=0.0))
    write(device, "Torque Enable", 1)
    for k in range(100):
        device.look(k * 10.0)
    assert device.register("Present Temperature", 1000.0) == pytest.approx(30 + 60 * 0.25, abs=1)


def test_watchdog_trips_stops_and_locks_the_goals():
    device = servo()
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 50)
    write(device, "Goal Position", 4000)
    device.watch(0.1)
    assert read(device, "Bus Watchdog", 0.1) == 5
    device.watch(0.3)
    assert read(device, "Bus Watchdog", 0.3) == 0xFF
    stopped = device.position_ticks(0.3)
    assert stopped == pytest.approx(2048 + 0.1 * 50 * 15.63, abs=3)
    assert device.position_ticks(9.0) == stopped
    assert write(device, "Goal Position", 3000, 9.0) == E.DATA_RANGE
    assert write(device, "Goal Velocity", 1, 9.0) == E.DATA_RANGE
    assert device.torque
    device.heard.at_s = 9.0
    assert write(device, "Bus Watchdog", 0, 9.0) == 0
    assert write(device, "Goal Position", 3000, 9.0) == 0
    assert device.position_ticks(20.0) == 3000


def test_watchdog_rests_without_torque():
    device = servo()
    write(device, "Bus Watchdog", 1)
    device.watch(10.0)
    assert read(device, "Bus Watchdog", 10.0) == 1


@pytest.mark.parametrize(
    ("model", "mode", "stops"), [("xl330-m288", 0, False), ("xl330-m288", 1, True), ("xm430-w350", 0, True)]
)
def test_small_servos_keep_turning_in_current_mode(model: str, mode: int, stops: bool):
    device = servo(model)
    write(device, "Operating Mode", mode)
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    write(device, "Goal Current" if mode == 0 else "Goal Velocity", 40)
    device.watch(1.0)
    assert read(device, "Bus Watchdog", 1.0) == 0xFF
    assert (device.position_ticks(1.0) == device.position_ticks(2.0)) is stops


def test_watchdog_may_be_ignored():
    device = servo()
    device.watchdog_ignored = True
    write(device, "Bus Watchdog", 1)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3000)
    device.watch(5.0)
    assert (read(device, "Bus Watchdog", 5.0), device.position_ticks(5.0)) == (0xFF, 3000)


def test_a_hand_moves_only_a_limp_servo():
    device = servo()
    device.place(1000, 0.0)
    assert device.position_ticks(1.0) == 1000
    assert device.goal == 2048
    write(device, "Torque Enable", 1, 1.0)
    with pytest.raises(ValueError, match="servo 1 holds its shaft"):
        device.place(500, 1.0)


def test_realtime_tick_counts_milliseconds_and_wraps():
    device = servo(now_s=10.0)
    assert read(device, "Realtime Tick", 11.5) == 1500
    assert read(device, "Realtime Tick", 10.0 + 32.768 + 0.0105) == 10


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


def test_wrong_baud_and_unknown_rates():
    assert servo(baud=57_600).baud == 57_600
    device = servo(baud=123_456)
    assert device.baud == 57_600  # the register's initial value
    device.force_baud(2_000_000)
    assert device.baud == 2_000_000
