"""drivers.sim.servos.plant: load, heat, supply and a stuck shaft."""

from __future__ import annotations

import math

import pytest

from drivers.sim.servos.motion import Motion, plan_move, plan_speed
from drivers.sim.servos.plant import NO_STOPS, Plant, Skin
from drivers.sim.servos.state import ServoState
from drivers.tables.tables import load_table

AT_REST = Motion(2048.0, 0.0, 0.0)


def plant(**skin: float) -> Plant:
    made = Plant(0.0, 2048.0, 1000.0, 5.0, Skin(**{"spring": 0.0, "inertia": 0.0, "friction": 0.0, **skin}))
    made.powered = True
    return made


@pytest.mark.parametrize(
    ("skin", "motion", "load"),
    [
        ({"spring": 1e-4}, Motion(3048.0, 0.0, 0.0), 0.1),
        ({"spring": 1e-4}, Motion(1048.0, 0.0, 0.0), -0.1),
        ({"spring": 1e-4, "rest": 3048.0}, AT_REST, -0.1),
        ({"friction": 0.05}, Motion(2048.0, -3.0, 0.0), -0.05),
        ({"friction": 0.05}, AT_REST, 0.0),
        ({"inertia": 1e-5}, Motion(2048.0, 0.0, 2e4), 0.2),
        ({"spring": 1.0}, Motion(3048.0, 0.0, 0.0), 1.0),
    ],
)
def test_load(skin: dict[str, float], motion: Motion, load: float):
    assert plant(**skin).load(motion, motion) == pytest.approx(load)


def test_a_limp_motor_gives_no_torque():
    limp = plant(spring=1.0)
    limp.powered = False
    assert limp.load(Motion(0.0, 5.0, 0.0), AT_REST) == 0.0


def test_the_supply_sags_under_load():
    assert plant().voltage(0.0) == 5.0
    assert plant().voltage(-1.0) == 4.6


def test_heat_follows_the_square_of_the_load_with_a_lag():
    motor = plant()
    motor.heat(200.0, 0.5)
    assert motor.temperature_c == pytest.approx(30 + 15 * (1 - math.exp(-1)))
    motor.heat(50.0, 1.0)  # time does not run back
    assert motor.temperature_c == pytest.approx(30 + 15 * (1 - math.exp(-1)))
    motor.heat(400.0, 0.5)
    assert motor.temperature_c == pytest.approx(30 + 15 * (1 - math.exp(-2)))
    motor.heat(1e6, 0.0)
    assert motor.temperature_c == pytest.approx(30.0)


def test_a_temperature_from_outside_wins():
    hot = plant()
    hot.forced_c = 80.0
    hot.heat(10.0, 1.0)
    assert hot.temperature_c == 80.0


def test_a_jammed_shaft_stays_pushes_and_goes_on_from_where_it_is():
    stuck = plant()
    stuck.trajectory = plan_speed(0.0, AT_REST, 100.0, 1e6)
    stuck.jam(1.0, True)
    held = stuck.motion(1.0)
    assert held.position == pytest.approx(2148.0, abs=0.1)
    assert stuck.motion(5.0) == held
    assert stuck.load(stuck.motion(1.1), stuck.trajectory.at(1.1)) == pytest.approx(0.2, abs=0.01)
    stuck.jam(6.0, True)
    assert stuck.jammed_since == 1.0
    stuck.jam(7.0, False)
    assert stuck.motion(9.0) == held
    stuck.jam(9.0, False)
    assert stuck.jammed_since is None


def test_placing_moves_even_a_jammed_shaft():
    limp = plant()
    limp.jam(0.0, True)
    limp.place(1.0, 100.0)
    assert limp.motion(2.0).position == 100.0


def test_the_skin_by_default_pulls_back_and_rubs():
    motor = Plant(0.0, 2048.0, 1000.0, 5.0, Skin())
    motor.powered = True
    still = Motion(3048.0)
    assert motor.load(still, still) == pytest.approx(0.04)
    moving = Motion(2048.0, 5.0, 1e4)
    assert motor.load(moving, moving) == pytest.approx(0.012 + 0.02)
    assert motor.load(Motion(-1e6), AT_REST) == -1.0


def test_the_motor_takes_thirty_milliseconds_to_its_top_speed():
    assert plant().top_acceleration == pytest.approx(1000.0 / 0.03)


def test_a_shaft_that_is_placed_stays_there_and_starts_cold():
    motor = plant()
    motor.place(1.0, 100.0)
    assert (motor.motion(5.0), motor.jammed_at, motor.temperature_c) == (Motion(100.0), None, 30.0)


def test_heat_is_counted_from_power_up():
    motor = Plant(1000.0, 0.0, 1000.0, 5.0, Skin())
    motor.heat(1000.0, 1.0)
    assert motor.temperature_c == 30.0
    motor.heat(1200.0, 1.0)
    assert motor.temperature_c == pytest.approx(30 + 60 * (1 - math.exp(-1)))


def test_a_stop_holds_the_shaft_and_lets_the_motor_push_as_hard_as_it_may():
    motor = plant()
    motor.set_stops(0.0, (2000.0, 2100.0))
    motor.trajectory = plan_move(0.0, Motion(2048.0), 2200.0, 1000.0, 1e5)
    assert motor.motion(5.0) == Motion(2100.0)
    assert motor.pressed_since == 5.0
    goal = Motion(2200.0)
    assert motor.load(motor.motion(6.0), goal) == 1.0
    motor.torque_limit = 0.15
    assert motor.load(motor.motion(6.0), goal) == 0.15
    motor.trajectory = plan_move(7.0, motor.motion(7.0), 2050.0, 1000.0, 1e5)
    assert motor.motion(9.0).position == 2050.0
    assert motor.pressed_since is None


def test_a_shaft_is_put_between_its_stops():
    motor = plant()
    motor.place(0.0, 2500.0)
    motor.set_stops(1.0, (2000.0, 2100.0))
    assert motor.motion(1.0).position == 2100.0
    motor.place(2.0, 0.0)
    assert motor.motion(2.0).position == 2000.0
    motor.set_stops(3.0, NO_STOPS)
    motor.place(3.0, 0.0)
    assert motor.motion(3.0).position == 0.0


PLAY = 4.0


def geared(**skin: float) -> Plant:
    made = Plant(0.0, 2048.0, 1000.0, 5.0, Skin(**{"spring": 0.0, "inertia": 0.0, "friction": 0.02, **skin}), PLAY)
    made.powered = True
    return made


def moved(plant: Plant, now_s: float, goal: float) -> None:
    plant.trajectory = plan_move(now_s, plant.motion(now_s), goal, plant.top_speed, plant.top_acceleration)


def test_a_shaft_that_turns_waits_until_the_motor_has_run_through_the_play():
    """From rest through 4 steps at the motor's greatest acceleration: sqrt(2 x 4 / 33333) = 15.5 ms; half at first."""
    geared_plant = geared()
    moved(geared_plant, 0.0, 2148.0)
    assert geared_plant.motion(0.0109).position == 2048.0
    assert geared_plant.motion(0.012).position > 2048.0
    assert geared_plant.motion(1.0) == Motion(2148.0)
    moved(geared_plant, 1.0, 2248.0)
    assert geared_plant.motion(1.005).position > 2148.0, "on the same flank it follows at once"
    moved(geared_plant, 2.0, 2048.0)
    assert geared_plant.motion(2.0154).position == geared_plant.motion(2.0).position
    assert geared_plant.motion(2.017).position < 2248.0
    assert geared_plant.motion(2.2).position == pytest.approx(geared_plant.trajectory.at(2.2).position, abs=0.1)
    assert geared_plant.motion(3.0) == Motion(2048.0)


def test_the_shaft_never_jumps_in_its_play_however_often_it_gets_goals():
    geared_plant, last, now_s = geared(), 2048.0, 0.0
    for k in range(4000):
        now_s = 0.001 * k
        position = geared_plant.motion(now_s).position
        assert abs(position - last) < 3.0, now_s  # 1000 steps/s, and what it makes up for
        last = position
        if k % 7 == 0:
            moved(geared_plant, now_s, 2048.0 + 50.0 * math.sin(9.0 * now_s))
    assert abs(last - (2048.0 + 50.0 * math.sin(9.0 * now_s))) < 30.0


@pytest.mark.parametrize("load", [{"spring": 1e-3, "rest": 1900.0}, {"weight": 0.1}])
def test_a_load_holds_the_gear_at_one_flank(load: dict[str, float]):
    geared_plant = geared(**{name: value for name, value in load.items() if name != "weight"})
    geared_plant.weight = load.get("weight", 0.0)
    moved(geared_plant, 0.0, 2148.0)
    assert geared_plant.motion(0.002).position > 2048.0
    moved(geared_plant, 1.0, 2048.0)
    assert geared_plant.motion(1.002).position < 2148.0


def test_the_play_of_a_model_is_that_of_its_specification():
    """e-Manual: 15 arcmin (XM430), 20 (MX-64), none stated (XL330), P-series less than 6, but they count at the motor;
    Feetech: at most 0.5 degrees (STS3215, STS3250).
    """
    arcmin = 4096 / 360 / 60
    plays = {"xm430-w350": 15 * arcmin, "xd540-t270": 15 * arcmin, "xw430-t333": 15 * arcmin, "mx-64": 20 * arcmin,
        "xl330-m288": 0.0, "ph54-100-s500": 0.0, "sts3215": 30 * arcmin, "scs0009": 0.0}  # fmt: skip
    for model, play in plays.items():
        assert load_table(model).play_ticks == pytest.approx(play), model
        assert ServoState(1, model).plant.play == pytest.approx(play), model
    assert load_table("ph54-100-s500").motor.play_arcmin == 6.0
