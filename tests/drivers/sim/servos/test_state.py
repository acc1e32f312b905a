"""drivers.sim.servos.state: what a servo does by itself: errors, watchdog, heat, and what tools may do to it."""

from __future__ import annotations

import pytest

from drivers.packets.packet import ALERT
from drivers.packets.packet import ErrorNumber as E
from drivers.sim.servos.device import SimulatedServo
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
    assert read(device, "Present Current", 0.5) == 1750
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
