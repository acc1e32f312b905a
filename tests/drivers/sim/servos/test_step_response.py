"""Steps of every family of servos against the profile formulas and units of its maker's manual, written out here.

Dynamixel: e-Manual, "Profile Velocity(112)" and "Moving Speed (32)". Feetech: STS memory table, addresses 41 and 46.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.base.bus import ServoSpec
from drivers.sim.serving.virtual import VirtualBus
from drivers.sim.servos.device import SimulatedServo

TURN_S = 0.03
"""Time in which a simulated motor reaches its no-load speed without a profile."""
RPM = 2 * math.pi / 60


def path(total: float, distance: float, ramp: float, at: float) -> float:
    """Position on a way of equal ramps that takes `total` seconds, `at` seconds after its start."""
    at = min(max(at, 0.0), total)
    speed = distance / (total - ramp)
    rise, fall = min(at, ramp), max(at - (total - ramp), 0.0)
    level = at - rise - fall
    return speed * ((rise**2 / 2 + fall * ramp - fall**2 / 2) / ramp + level) if ramp else speed * at


def step(model: str, distance: int, **registers: int) -> SimulatedServo:
    """A servo that turns by `distance` ticks from 0 s on."""
    servo = SimulatedServo(1, model)
    for name, value in registers.items():
        servo.force(name.replace("_", " "), value, 0.0)
    servo.force("Torque Enable", 1, 0.0)
    servo.force("Goal Position", servo.goal + distance, 0.0)
    return servo


def check(servo: SimulatedServo, distance: int, total: float, ramp: float) -> None:
    start = servo.position_ticks(0.0)
    for at in np.linspace(0.0, 1.2 * total, 50):  # the units of Dynamixel give 63.97 and 64.03 where the formula has 64
        error = 1.5 + 0.002 * abs(distance)
        assert servo.position_ticks(at) - start == pytest.approx(path(total, distance, ramp, at), abs=error), at
    assert not servo.register("Moving", 1.01 * total)


@pytest.mark.parametrize("model", ["xl330-m288", "xm430-w350", "xh540-v150", "mx-64", "xl430-w250"])
@pytest.mark.parametrize(("velocity", "acceleration", "distance"), [(60, 10, 1000), (40, 40, -900), (100, 2, 700)])
def test_velocity_based_profile_of_dynamixel(model: str, velocity: int, acceleration: int, distance: int):
    servo = step(model, distance, Profile_Velocity=velocity, Profile_Acceleration=acceleration)
    way = abs(distance)
    ramp, level = 0.064 * velocity / acceleration, 0.064 * way / velocity  # t1 = 64 V/A, t2 = 64 D/V in ms
    if ramp > level:  # a triangle
        ramp = level = 0.064 * math.sqrt(way / acceleration)
    check(servo, distance, ramp + level, ramp)


@pytest.mark.parametrize(
    ("model", "gain", "weight", "ticks"),
    [
        ("xl330-m288", 400, 0.1, 28.3),
        ("xl330-m288", 800, 0.1, 14.2),
        ("xm540-w270", 800, -0.25, -35.4),
        ("mx-64", 850, 0.2, 26.7),
    ],
)
def test_a_weight_leaves_the_error_that_the_position_gain_needs(model: str, gain: int, weight: float, ticks: float):
    """e-Manual, Position PID Gain: KPP is P gain / 128, steps of PWM for one of error; 885 are all of the torque."""
    servo = step(model, 300, Position_P_Gain=gain)
    servo.change_fault("weight", weight, True, 1.0)
    assert ticks == pytest.approx(weight * 885 / (gain / 128), abs=0.1)
    assert servo.goal - servo.position_ticks(3.0) == pytest.approx(ticks, abs=0.5)
    stall = 885 if "Current Limit" not in servo.table else servo.drive.full_current
    assert servo.register("Present Current", 3.0) == pytest.approx(
        weight * stall + 0.012 * stall, abs=0.001 * stall + 1
    )
    servo.force("Position I Gain", 10, 3.0)
    assert servo.position_ticks(4.0) == servo.goal
    servo.force("Position I Gain", 0, 4.0)
    servo.change_fault("weight", None, False, 4.0)
    assert servo.position_ticks(5.0) == servo.goal


def test_a_weight_does_not_move_a_limp_shaft_or_one_beyond_its_stop():
    servo = step("xl330-m288", 300)
    servo.change_fault("weight", 0.5, True, 2.0)
    servo.change_fault("stops", (2300.0, 2400.0), True, 2.0)
    assert servo.position_ticks(3.0) == 2300
    servo.force("Torque Enable", 0, 3.0)
    assert servo.position_ticks(4.0) == pytest.approx(servo.position_ticks(9.0))


@pytest.mark.parametrize(("total_ms", "ramp_ms"), [(1000, 200), (1000, 500), (600, 0), (800, 700)])
def test_time_based_profile_of_dynamixel(total_ms: int, ramp_ms: int):
    servo = step("xl330-m288", 600, Drive_Mode=4, Profile_Velocity=total_ms, Profile_Acceleration=ramp_ms)
    check(servo, 600, total_ms / 1000, min(ramp_ms, total_ms / 2) / 1000)


@pytest.mark.parametrize(
    ("model", "speed", "rpm", "ticks"),
    [
        ("ax-12a", 100, 0.111, 360 / 0.29),
        ("xl320", 100, 0.111, 360 / 0.29),
        ("mx1-28", 100, 0.114, 4096),
        ("mx1-106", 60, 0.114, 4096),
    ],
)
def test_moving_speed_of_ax_mx_and_xl320(model: str, speed: int, rpm: float, ticks: float):
    distance = round(0.25 * ticks)
    servo = step(model, distance, Moving_Speed=speed)
    seconds = distance / ticks / (speed * rpm / 60)
    middle = servo.position_ticks(seconds / 2) - servo.position_ticks(0.0)
    assert middle == pytest.approx(distance / 2, rel=0.03)
    assert servo.register("Moving", 0.95 * seconds) == 1
    assert servo.register("Moving", 1.05 * seconds + TURN_S) == 0


@pytest.mark.parametrize(("velocity", "acceleration", "distance"), [(1000, 20, 1500), (800, 100, -900), (3000, 5, 400)])
def test_velocity_and_acceleration_of_feetech_sts(velocity: int, acceleration: int, distance: int):
    """Steps/s, and units of 100 steps/s²."""
    ramp, level = velocity / (100 * acceleration), abs(distance) / velocity
    if ramp > level:
        ramp = level = math.sqrt(abs(distance) / (100 * acceleration))
    servo = step("sts3215", distance, Goal_Velocity=velocity, Acceleration=acceleration)
    check(servo, distance, ramp + level, ramp)


def test_goal_time_of_feetech_scs_is_the_time_of_the_move():
    servo = step("scs0009", 200, Goal_Time=700)
    check(servo, 200, 0.7, 0.0)


# ---------------------------------------------------------------- drivers: limits in rad/s arrive as such

TICKS = {"xl330-m288": 4096, "mx-64": 4096, "ph54-200-s500": 1003846,
         "sts3215": 4096, "xl320": 360 / 0.29, "ax-12a": 360 / 0.29, "mx1-28": 4096,
         "scs0009": 1024 * 360 / 300}  # fmt: skip
"""Steps of a turn."""
FAMILY = {"sts3215": "feetech", "scs0009": "feetech"}
STEP = {"xl330-m288": 0.229 * RPM, "mx-64": 0.229 * RPM, "ph54-200-s500": 0.01 * RPM,
        "xl320": 0.111 * RPM, "ax-12a": 0.111 * RPM, "mx1-28": 0.114 * RPM}  # fmt: skip
"""One step of the speed register, rad/s; Feetech's is one step of position in a second."""


@pytest.mark.parametrize("model", TICKS)
def test_a_driver_moves_a_servo_at_the_speed_that_it_was_told(model: str):
    """Fastest speed in a long step: at most one register step above the limit, and not below."""
    ticks, limit, cycle_s = TICKS[model], 1.7, 0.01
    wire = VirtualBus([ServoSpec(1, "one", model, -1.2, 1.2, limit, 40.0)], FAMILY.get(model, "dynamixel"))
    shaft = [0.0]
    with wire.bus() as bus:
        bus.start()
        for _ in range(100):
            bus.write([1.0])
            wire.clock.sleep(cycle_s)
            shaft.append(wire.servo(1).position_ticks)
    turned = np.array(shaft[1:]) * 2 * math.pi / ticks
    assert abs(turned[-1] - turned[0]) == pytest.approx(1.0, abs=0.05)
    speed = abs(turned[40] - turned[20]) / (20 * cycle_s)
    assert limit * 0.97 <= speed <= limit * 1.03 + STEP.get(model, 2 * math.pi / ticks)


@pytest.mark.parametrize("model", ["xl330-m288", "mx-64", "ph54-200-s500", "sts3215"])
def test_a_driver_lets_a_servo_accelerate_as_it_was_told(model: str):
    """A step that is all ramp: half the way takes sqrt(way / acceleration)."""
    ticks, acceleration = TICKS[model], 8.0
    wire = VirtualBus([ServoSpec(1, "one", model, -1.2, 1.2, 30.0, acceleration)], FAMILY.get(model, "dynamixel"))
    with wire.bus() as bus:
        bus.start()
        bus.write([0.0])
        wire.clock.sleep(0.05)
        start, begun = wire.servo(1).position_ticks, wire.clock()
        half = math.sqrt(0.4 / acceleration)
        while wire.clock() - begun < half:
            bus.write([0.4])
            wire.clock.sleep(0.001)
        turned = abs(wire.servo(1).position_ticks - start) * 2 * math.pi / ticks
    assert turned == pytest.approx(0.2, rel=0.1)


def test_the_current_of_an_sts_is_in_units_of_6_5_ma():
    wire = VirtualBus([ServoSpec(1, "one", "sts3215", -1.2, 1.2, 3.0, 30.0)], "feetech")
    with wire.bus() as bus:
        bus.start()
        for _ in range(300):
            bus.write([1.0])
            wire.clock.sleep(0.01)
        (current,), register = bus.read().current_a, wire.servo(1).register("Present Current")
    assert abs(register) > 10
    assert current == pytest.approx(0.0065 * register, rel=0.05)
