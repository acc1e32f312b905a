"""drivers.sim.servos.state: what a servo does by itself: errors, watchdog, heat, and what tools may do to it."""

from __future__ import annotations

import math

import pytest

from drivers.packets.packet import ALERT
from drivers.packets.packet import ErrorNumber as E
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.motion import Motion, plan_speed
from drivers.sim.servos.plant import Skin
from drivers.sim.servos.state import same_rate

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
    device.update(1.0)
    device.plant.supply_v = 5.0
    device.update(2.0)
    assert (device.register("Hardware Error Status", 2.0), device.torque) == (0x01, False)
    assert device.register("Present Input Voltage", 2.0) == 50


def test_heat_latches_overheating():
    device = servo()
    device.plant.forced_c = 70.0
    device.update(1.0)
    assert device.alert == 0
    device.plant.forced_c = 71.0
    device.update(2.0)
    assert device.register("Hardware Error Status", 2.0) == 0x04


def test_a_jammed_shaft_draws_full_current_and_overloads():
    device = servo()
    write(device, "Torque Enable", 1)
    device.plant.jam(0.0, True)
    write(device, "Goal Position", 3000)
    assert read(device, "Present Position", 0.5) == 2048
    assert read(device, "Present Current", 0.5) == 1470
    assert read(device, "Moving Status", 0.5) & 8
    device.update(0.9)
    assert device.torque
    device.update(1.2)
    assert (device.register("Hardware Error Status", 1.2), device.torque) == (0x20, False)


def test_full_load_heats_the_motor():
    device = servo(skin=Skin(spring=1e-3, rest=1548.0, inertia=0.0, friction=0.0))
    write(device, "Torque Enable", 1)
    for k in range(100):
        device.update(k * 10.0)
    assert device.register("Present Temperature", 1000.0) == pytest.approx(30 + 60 * 0.25, abs=1)


def test_watchdog_trips_stops_and_locks_the_goals():
    device = servo()
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    write(device, "Profile Velocity", 50)
    write(device, "Goal Position", 4000)
    device.check_watchdog(0.1)
    assert read(device, "Bus Watchdog", 0.1) == 5
    device.check_watchdog(0.3)
    assert read(device, "Bus Watchdog", 0.3) == 0xFF
    stopped = device.position_ticks(0.3)
    assert stopped == pytest.approx(2048 + 0.1 * 50 * 15.63, abs=3)
    assert device.position_ticks(9.0) == stopped
    assert write(device, "Goal Position", 3000, 9.0) == E.DATA_RANGE
    assert write(device, "Goal Velocity", 1, 9.0) == E.DATA_RANGE
    assert device.torque
    device.last_instruction.at_s = 9.0
    assert write(device, "Bus Watchdog", 0, 9.0) == 0
    assert write(device, "Goal Position", 3000, 9.0) == 0
    assert device.position_ticks(20.0) == 3000


def test_watchdog_rests_without_torque():
    device = servo()
    write(device, "Bus Watchdog", 1)
    device.check_watchdog(10.0)
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
    device.check_watchdog(1.0)
    assert read(device, "Bus Watchdog", 1.0) == 0xFF
    assert (device.position_ticks(1.0) == device.position_ticks(2.0)) is stops


def test_watchdog_may_be_ignored():
    device = servo()
    device.watchdog_ignored = True
    write(device, "Bus Watchdog", 1)
    write(device, "Torque Enable", 1)
    write(device, "Goal Position", 3000)
    device.check_watchdog(5.0)
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


def test_wrong_baud_and_unknown_rates():
    assert servo(baud=57_600).baud == 57_600
    device = servo(baud=123_456)
    assert device.baud == 57_600  # the register's initial value
    device.force_baud(2_000_000)
    assert device.baud == 2_000_000


@pytest.mark.parametrize(
    ("ours", "theirs", "same"), [(97, 100, True), (103, 100, True), (96.9, 100, False), (103.1, 100, False)]
)
def test_rates_may_differ_by_three_percent(ours: float, theirs: float, same: bool):
    assert same_rate(ours, theirs) is same


def test_health_is_checked_ten_times_a_second():
    device = servo()
    device.update(1.0)
    device.plant.forced_c = 99.0
    device.update(1.09)
    assert device.alert == 0
    device.update(1.1)
    assert device.alert == ALERT
    assert device.hardware_error == 0x04


@pytest.mark.parametrize(
    ("period", "now_s", "tripped"),
    [(5, 0.1, False), (5, 0.101, True), (127, 2.54, False), (127, 2.55, True), (128, 99.0, False), (0, 99.0, False)],
)
def test_the_watchdog_counts_twenty_milliseconds_a_step_up_to_127(period: int, now_s: float, tripped: bool):
    device = servo()
    write(device, "Torque Enable", 1)
    device.registers.put("Bus Watchdog", period)
    device.check_watchdog(now_s)
    assert device.registers.goals_locked is tripped
    assert device.registers.get("Bus Watchdog") == (0xFF if tripped else period)


def test_a_tripped_watchdog_does_not_stop_the_shaft_again():
    device = servo()
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    device.check_watchdog(1.0)
    device.plant.trajectory = plan_speed(1.0, Motion(2048.0, 100.0), 100.0, 1.0)
    device.check_watchdog(2.0)
    assert device.plant.motion(3.0).velocity == 100.0


@pytest.mark.parametrize(
    ("model", "mode", "keeps"), [("xc330-m288", 0, True), ("xc330-m288", 1, False), ("xc430-w150", 1, False)]
)
def test_which_models_keep_turning_when_the_watchdog_trips(model: str, mode: int, keeps: bool):
    device = servo(model)
    write(device, "Operating Mode", mode)
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    write(device, "Goal Velocity" if mode else "Goal Current", 40)
    device.check_watchdog(1.0)
    assert (device.plant.motion(2.0).velocity != 0.0) is keeps


def test_status_levels_of_both_makers():
    assert [servo(model).status_level for model in ("xl330-m288", "sts3215")] == [2, 2]
    feetech = servo("sts3215")
    feetech.registers.put("Response Level", 0)
    assert (feetech.status_level, feetech.is_feetech, servo().is_feetech) == (1, True, False)


def test_errors_of_a_servo_without_an_error_register_are_latched_too():
    device = servo("ax-12a")
    assert "Hardware Error Status" not in device.table
    write(device, "Torque Enable", 1)
    device.latch(0x01, 0.0)
    assert (device.hardware_error, device.alert, device.torque) == (0x01, ALERT, True), "outside the mask"
    device.latch(0x20, 0.0)
    assert (device.hardware_error, device.torque) == (0x21, False)
    device.reboot(1.0)
    assert (device.hardware_error, device.alert) == (0, 0)


def test_a_second_error_leaves_a_servo_shut_down_as_it_is():
    device = servo()
    device.latch(0x20, 0.0)
    device.plant.trajectory = plan_speed(0.0, Motion(2048.0, 100.0), 100.0, 1.0)
    device.latch(0x04, 1.0)
    assert device.hardware_error == 0x24
    assert device.plant.motion(2.0).velocity == 100.0, "coasts no second time"


def test_a_forced_alert_is_no_hardware_error():
    device = servo()
    for begins in (True, False):
        device.change_fault("alert", 0, begins, 0.0)
        assert (device.alert, device.hardware_error) == (ALERT if begins else 0, 0)


def test_faults_begin_and_end():
    device = servo()
    device.change_fault("hw", 0x08, False, 0.0)
    assert device.hardware_error == 0
    device.change_fault("hw", 0x08, True, 0.0)
    assert device.hardware_error == 0x08
    device.change_fault("volts", 4.8, True, 0.0)
    assert device.register("Present Input Voltage", 0.0) == 48
    device.change_fault("volts", 4.8, False, 0.0)
    assert device.register("Present Input Voltage", 0.0) == 50
    device.change_fault("temp", 44.0, True, 0.0)
    assert device.register("Present Temperature", 0.0) == 44
    device.change_fault("temp", 44.0, False, 0.0)
    assert device.register("Present Temperature", 0.0) == 30
    for begins in (True, False):
        device.change_fault("watchdog-ignored", 0, begins, 0.0)
        device.change_fault("eeprom-busy", 0.5, begins, 0.0)
        assert (device.watchdog_ignored, device.eeprom_busy_s) == (begins, 0.5 * begins)
    device.change_fault("stall", 0, True, 3.0)
    assert device.plant.jammed_since == 3.0
    device.change_fault("stall", 0, False, 3.0)
    assert device.plant.jammed_since is None


def test_a_rate_that_the_model_lacks_counts_as_its_lowest():
    device = servo()
    device.force_baud(12_345)
    assert device.baud == min(device.table.baud)
    device.force_baud(12_345, otherwise=1_000_000)
    assert device.baud == 1_000_000
    device.force_baud(1_020_000)
    assert device.baud == 1_000_000, "within 3 %"


def test_a_secondary_id_goes_up_to_252():
    device = servo()
    for value, expected in ((5, 5), (252, 252), (253, None), (255, None)):
        device.registers.put("Secondary(Shadow) ID", value)
        assert device.secondary_id == expected
    assert servo("ax-12a").secondary_id is None


@pytest.mark.parametrize(("mode", "pwm", "current"), [(3, 885, 1750), (16, 0, 1750), (0, 885, 0)])
def test_goals_after_power_up_are_the_limits_but_zero_in_their_own_mode(mode: int, pwm: int, current: int):
    device = servo()
    write(device, "Operating Mode", mode)
    write(device, "Goal Velocity", 7)
    device.reboot(1.0)
    assert [read(device, name, 2.0) for name in ("Goal PWM", "Goal Current", "Goal Velocity")] == [pwm, current, 0]


@pytest.mark.parametrize(("position", "wrapped"), [(0.0, 0), (4095.0, 4095), (4096.0, 0), (-1.0, 4095), (9000.0, 808)])
def test_a_change_of_mode_wraps_the_position_into_one_turn(position: float, wrapped: int):
    device = servo(position=position)
    write(device, "Operating Mode", 3)
    assert (device.position_ticks(0.0), device.goal) == (wrapped, wrapped)


@pytest.mark.parametrize(("mode", "extended"), [(3, False), (4, True), (5, True), (1, False)])
def test_goals_beyond_a_turn_are_allowed_in_their_modes_also_after_a_reboot(mode: int, extended: bool):
    device = servo()
    write(device, "Operating Mode", mode)
    assert device.registers.extended is extended
    device.registers.extended = not extended
    device.reboot(1.0)
    assert device.registers.extended is extended


def test_a_reboot_ends_a_shutdown_a_tripped_watchdog_and_a_registered_write():
    device = servo()
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    device.check_watchdog(1.0)
    device.reg_write(65, b"\x01")
    device.latch(0x20, 1.0)
    device.reboot(2.0)
    assert (device.registers.goals_locked, device.shut_down, device.hardware_error) == (False, False, 0)
    assert device.action(3.0) == E.INSTRUCTION
    assert read(device, "Realtime Tick", 2.5) == 500


def test_a_hand_moves_the_shaft_in_the_middle_of_a_moment():
    device = servo()
    assert read(device, "Present Position", 1.0) == 2048
    device.place(1000.4, 1.0)
    assert read(device, "Present Position", 1.0) == 1000


@pytest.mark.parametrize(
    ("model", "rpm"), [("xl330-m288", 445 * 0.229), ("ax-12a", 59.0), ("sts3215", 3073 * 60 / 4096)]
)
def test_the_no_load_speed(model: str, rpm: float):
    device = servo(model)
    turns_s = device.plant.top_speed * device.table.rad_per_tick / (2 * math.pi)
    assert turns_s * 60 == pytest.approx(rpm, rel=0.15)


def test_a_look_at_a_servo_trips_its_watchdog():
    device = servo()
    write(device, "Bus Watchdog", 5)
    write(device, "Torque Enable", 1)
    device.update(1.0)
    assert device.registers.goals_locked


def test_the_last_errors_of_a_servo_with_codes_are_listed_with_the_newest_first():
    device = servo("ym070-210-r051")
    codes = device.table.error_codes
    for now_s, cause in enumerate(("voltage", "temperature", "temperature", "overload")):
        device.latch(codes[cause], float(now_s))
    listed = [read(device, f"Error Code History {k}", 9.0) for k in range(1, 5)]
    assert listed == [codes["overload"], codes["temperature"], codes["voltage"], 0]
