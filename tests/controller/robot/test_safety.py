"""Safety rules before the bus, alone and against hostile targets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.channels import ChannelTable, build_table
from controller.robot.robot import load_robot
from controller.robot.rules import AllowedRange, RuleCounter, RuleInput
from controller.robot.safety import DeadBandAndSlack, Guard, TimingRules
from controller.robot.settings import ChannelSettings, LoadRule, PreventRule, RuleSettings, TimingRule
from drivers.base.bus import BusState

DT = 0.02
JAW = TimingRule(channels=["a"], toward="high", extreme=0.6, hold_s=1.0, fall_s=1.0, rest_s=3.0, recover_s=1.0)
LOAD = LoadRule(channels=["a"], current_a=0.5, after_s=0.2, most_deg=12.0, fall_deg_s=30.0, rest_s=0.5, rise_deg_s=20.0)
PAIR = PreventRule(channel="a", toward="high", extreme=0.5, other="b", other_toward="low", other_extreme=0.4)


def table_of(*names: str, limits: tuple[float, float] = (-40.0, 50.0)) -> ChannelTable:
    return build_table(
        [
            ChannelSettings.model_validate(
                {
                    "name": name,
                    "bus": "b",
                    "id": i,
                    "model": "xl330-m288",
                    "mix": {"jawOpen": 1.0},
                    "map": {"at": [0, 1], "deg": [0, 50]},
                    "limit_deg": limits,
                    "max_speed_deg_s": 400,
                    "max_accel_deg_s2": 4000,
                }
            )
            for i, name in enumerate(names)
        ],
        P,
    )


def measured(position_rad: np.ndarray, current_a: np.ndarray, fresh: bool = True) -> BusState:
    n = len(position_rad)
    flags, bytes_, floats = np.full(n, fresh), np.zeros(n, np.uint8), np.zeros(n)
    return BusState(0.0, position_rad, floats, current_a, flags, floats, bytes_, ~flags, floats, floats, bytes_, flags)


class Line:
    """Guard and limiter as a bus has them; degrees in and out."""

    def __init__(self, rules: RuleSettings, table: ChannelTable) -> None:
        self.guard, self.limiter = Guard(rules, table), table.limiter(DT)
        self.sent = np.zeros(len(table.names))

    def step(self, *target_deg: float, state: BusState | None = None) -> np.ndarray:
        allowed = self.guard.apply(np.radians(target_deg), self.sent, self.limiter.stopping_position(DT), state, DT)
        return np.degrees(self.limiter.step(DT, allowed, self.sent))

    def run(self, seconds: float, *target_deg: float) -> np.ndarray:
        return np.array([self.step(*target_deg).copy() for _ in range(round(seconds / DT))])


def test_a_jaw_held_open_falls_to_its_extreme_rests_and_may_open_again() -> None:
    way = Line(RuleSettings(timing=[JAW]), table_of("a")).run(12.0, 50.0)[:, 0]
    at = lambda seconds: way[round(seconds / DT)]  # noqa: E731
    assert at(0.9) == pytest.approx(50.0)
    assert at(3.0) == pytest.approx(30.0, abs=0.1)
    assert at(5.0) == pytest.approx(30.0, abs=0.1)
    assert at(6.6) == pytest.approx(50.0, abs=0.5)
    assert at(9.5) == pytest.approx(30.0, abs=0.1)  # and so on, for as long as it is asked for


@pytest.mark.parametrize(
    ("extreme", "seconds", "share"),
    [
        (0.6, 1.0, 1.0),
        (0.6, 1.5, 0.8),  # half of the fall, which takes one second
        (0.6, 2.0, 0.6),
        (0.6, 4.0, 0.6),
        (0.6, 5.0, 0.7),  # a quarter of the way back, which takes four seconds
        (0.6, 7.0, 0.9),
        (0.6, 8.1, 1.0),
        (0.0, 1.5, 0.5),
    ],
)
def test_a_limit_falls_rests_and_comes_back_each_in_its_own_time(extreme: float, seconds: float, share: float) -> None:
    given = JAW.model_dump() | {"extreme": extreme, "rest_s": 2.0, "recover_s": 4.0}
    table = table_of("a")
    rule, high = TimingRules([TimingRule(**given)], table, table.neutral_rad), table.high_rad
    for _ in range(round(seconds / DT) + 1):
        allowed = AllowedRange(table.low_rad.copy(), high.copy())
        rule.narrow(RuleInput(high, high, high, None, DT), allowed)
    assert allowed.high[0] / high[0] == pytest.approx(share, abs=0.03 / (1.0 if seconds < 2.0 else 4.0))
    assert allowed.low[0] == table.low_rad[0]


def test_leaving_before_the_time_keeps_the_whole_travel_and_flicker_does_not() -> None:
    line = Line(RuleSettings(timing=[JAW]), table_of("a"))
    for _ in range(10):
        line.run(0.5, 50.0)
        line.run(0.6, 0.0)
    assert line.guard.report() == []
    for _ in range(20):
        line.run(0.5, 50.0)
        line.step(0.0)
    assert line.guard.report()[0]["rule"] == "timing a toward high"


def test_the_other_side_of_a_timed_servo_is_free() -> None:
    line = Line(RuleSettings(timing=[JAW]), table_of("a"))
    assert line.run(4.0, -40.0)[-1, 0] == pytest.approx(-40.0)
    assert line.guard.report() == []


def test_antagonists_are_never_past_their_extremes_together() -> None:
    line = Line(RuleSettings(prevent=[PAIR]), table_of("a", "b"))
    rng = np.random.default_rng(3)
    way = []
    for _ in range(600):
        target = rng.uniform(-60, 60, 2) if rng.random() < 0.5 else np.array([50.0, -40.0])
        way += [line.step(*target) for _ in range(int(rng.integers(1, 12)))]
    a, b = np.array(way).T
    assert np.minimum(a - 25.0, -16.0 - b).max() <= 0.06  # degrees: what counts as past
    assert a.max() > 40.0 and b.min() < -35.0  # either of them has its whole travel when the other is away


def test_the_favoured_antagonist_gets_its_way() -> None:
    line = Line(RuleSettings(prevent=[PAIR]), table_of("a", "b"))
    line.run(1.0, 50.0, 0.0)
    a, b = line.run(1.0, 50.0, -40.0)[-1]
    assert (a, b) == (pytest.approx(25.0, abs=1e-3), pytest.approx(-40.0))
    assert line.guard.report() == [{"rule": "prevent a against b", "times": 1, "seconds": 1.0}]


def test_an_overloaded_servo_gives_way_from_where_it_stands_and_comes_back() -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    line.run(1.0, 40.0)
    stuck = measured(np.radians([20.0]), np.array([0.9]))
    held = [float(line.step(40.0, state=stuck)[0]) for _ in range(100)]
    assert held[5] == pytest.approx(40.0)
    assert held[-1] == pytest.approx(8.0, abs=0.1)  # 12 degrees back from where it is stuck, not from the target
    free = measured(np.radians([8.0]), np.array([0.1]))
    after = [float(line.step(40.0, state=free)[0]) for _ in range(200)]
    assert after[20] == pytest.approx(8.0, abs=0.1)  # rests first
    assert after[-1] == pytest.approx(40.0, abs=0.1)
    assert line.guard.report()[0]["times"] == 1


def test_a_servo_that_is_overloaded_again_gives_way_from_there() -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    line.run(1.0, 40.0)
    for stuck_deg in (20.0, 30.0):
        stuck, free = (measured(np.radians([stuck_deg]), np.array([current])) for current in (0.9, 0.1))
        held = [float(line.step(40.0, state=stuck)[0]) for _ in range(100)]
        assert held[-1] == pytest.approx(stuck_deg - 12.0, abs=0.1)
        assert min(held) > stuck_deg - 12.1
        began = next(i for i, deg in enumerate(held) if deg < 39.9)
        assert max(held[began + 8 : began + 10]) > stuck_deg - 9.0  # it gives way slowly, from where it stands
        for _ in range(200):
            line.step(40.0, state=free)
    assert line.guard.report()[0]["times"] == 2


def test_a_current_at_the_limit_is_none_too_many() -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    line.run(1.0, 40.0)
    for _ in range(100):
        line.step(40.0, state=measured(np.radians([20.0]), np.array([0.5])))
    assert line.guard.report() == []


def test_a_servo_pushed_down_gives_way_upwards() -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    line.run(1.0, -30.0)
    stuck = measured(np.radians([-10.0]), np.array([-0.9]))
    for _ in range(100):
        line.step(-30.0, state=stuck)
    assert np.degrees(line.sent[0]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("state", [measured(np.zeros(1), np.array([np.nan])), measured(np.zeros(1), np.ones(1), False)])
def test_a_current_that_was_not_measured_says_nothing(state: BusState) -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    for _ in range(200):
        line.step(40.0, state=state)
    assert np.degrees(line.sent[0]) == pytest.approx(40.0)


def test_slack_is_taken_up_on_both_ways() -> None:
    play_deg = 4.0
    far = {True: 0.0, False: 0.0}
    worst = {True: 0.0, False: 0.0}
    for compensated in (True, False):
        slack = np.radians([play_deg if compensated else 0.0])
        line = Line(RuleSettings(), replace(table_of("a"), slack_rad=slack))
        for i in range(2000):
            wanted = 20.0 * np.sin(i * DT)
            (near,) = line.step(wanted)
            far[compensated] = min(max(far[compensated], near - play_deg / 2), near + play_deg / 2)
            if i > 200 and abs(np.cos(i * DT)) > 0.5:  # away from the turning points
                worst[compensated] = max(worst[compensated], abs(far[compensated] - wanted))
    assert worst[True] < 0.5 * worst[False]


def test_a_dead_band_keeps_small_changes_away() -> None:
    line = Line(RuleSettings(), replace(table_of("a"), dead_band_rad=np.radians([1.0])))
    line.run(1.0, 10.0)
    assert line.run(1.0, 10.9)[-1, 0] == pytest.approx(10.0)
    assert line.run(1.0, 11.1)[-1, 0] == pytest.approx(11.1)


@pytest.mark.slow
def test_no_hostile_target_gets_past_a_limit_of_the_shipped_head() -> None:
    robot = load_robot(find_config("robots", "head24"), P)
    table = build_table(robot.channels, P)
    guard, limiter = Guard(robot.rules, table), table.limiter(DT)
    rng = np.random.default_rng(0)
    values = P.neutral()
    way = np.zeros((3002, 24))  # two rows at rest first
    for step in range(2, len(way)):
        if rng.random() < 0.3:  # seldom enough that rules come to act
            values = rng.uniform(-3, 3, len(P)) if rng.random() < 0.5 else np.ones(len(P))
        way[step] = way[step - 1]
        sent = way[step]
        target = table.angles(values)[0]
        target[rng.random(24) < 0.05] = rng.choice([np.nan, np.inf, -np.inf, 1e300])
        current = np.where(np.sin(step / 40) > 0, 1.4, rng.choice([0.0, np.nan], 24))
        state = measured(sent + rng.normal(0, 0.2, 24), current, bool(rng.random() < 0.9))
        limiter.step(DT, guard.apply(target, sent, limiter.stopping_position(DT), state, DT), sent)
    speed = np.diff(way, axis=0) / DT
    assert np.all((table.low_rad <= way) & (way <= table.high_rad))
    assert np.all(np.abs(speed) <= table.max_speed_rad_s * (1 + 1e-9))
    assert np.all(np.abs(np.diff(speed, axis=0)) / DT <= table.max_accel_rad_s2 * (1 + 1e-6))
    assert len(guard.report()) >= 8


def test_rules_are_counted_when_they_begin_and_timed_while_they_act() -> None:
    counter = RuleCounter(["a", "b", "c"])
    for a, b in ((1, 0), (1, 1), (0, 1), (1, 1), (1, 0)):
        counter.count(np.array([a, b, 0], bool), 0.10006)
    assert counter.report() == [
        {"rule": "a", "times": 2, "seconds": 0.4},  # rounded to milliseconds
        {"rule": "b", "times": 1, "seconds": 0.3},
    ]
    counter = RuleCounter(["a"])
    counter.count(np.array([True]), 1.2345678)
    assert counter.report()[0]["seconds"] == 1.235


def test_a_range_only_becomes_smaller_at_the_side_of_its_sign() -> None:
    allowed = AllowedRange(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    at, where = np.array([0, 0, 1]), np.array([True, True, False])
    allowed.narrow(at, np.array([1.0, -1.0, 1.0]), np.array([0.5, -0.25, 0.0]), where)
    assert (allowed.low.tolist(), allowed.high.tolist()) == ([-0.25, -1.0], [0.5, 1.0])
    allowed.narrow(at[:2], np.array([1.0, -1.0]), np.array([0.75, -0.5]), where[:2])
    assert (allowed.low.tolist(), allowed.high.tolist()) == ([-0.25, -1.0], [0.5, 1.0])
    allowed.narrow(at[:1], np.zeros(1), np.zeros(1), where[:1])
    assert (allowed.low.tolist(), allowed.high.tolist()) == ([-0.25, -1.0], [0.5, 1.0])


def test_half_the_slack_is_added_on_the_way_up_and_taken_away_on_the_way_down() -> None:
    filter_ = DeadBandAndSlack(np.array([0.0]), np.array([0.5]))

    def sent(*targets: float) -> list[float]:
        return [float(filter_.apply(np.array([target]))[0]) for target in targets]

    assert sent(0.0, 0.04, 0.0) == [0.0, 0.04, 0.0]  # not yet a direction: less than a tenth of the slack
    assert sent(0.125, 1.0) == [0.375, 1.25]
    assert sent(0.96, 1.0) == pytest.approx([1.21, 1.25])  # came back by less than that
    assert sent(0.9375, 0.5) == [0.6875, 0.25]
    assert sent(0.54, 0.5625) == pytest.approx([0.29, 0.8125])
    other = DeadBandAndSlack(np.array([0.25]), np.array([0.0]))
    assert [float(other.apply(np.array([t]))[0]) for t in (1.0, 1.25, 0.75, 1.2501, 1.1)] == [
        1.0, 1.0, 1.0, 1.2501, 1.2501
    ]  # fmt: skip


def test_a_servo_that_gave_way_comes_back_at_its_pace_after_a_rest() -> None:
    line = Line(RuleSettings(load=[LOAD]), table_of("a"))
    line.run(1.0, 30.0)
    stuck, free = (measured(np.radians([10.0]), np.array([current])) for current in (0.9, 0.1))
    for _ in range(100):
        line.step(30.0, state=stuck)
    assert np.degrees(line.sent[0]) == pytest.approx(-2.0, abs=0.1)  # 12 degrees from where it was stuck
    path = []
    for _ in range(150):
        line.step(30.0, state=free)
        path.append(float(np.degrees(line.sent[0])))
    waits = next(i for i, angle in enumerate(path) if angle > -1.95) * DT
    assert waits == pytest.approx(LOAD.rest_s, abs=4 * DT)
    rising = [angle for angle in path if 0.0 < angle < 25.0]
    assert np.diff(rising) / DT == pytest.approx(np.full(len(rising) - 1, LOAD.rise_deg_s), rel=0.01)
    assert path[-1] == pytest.approx(30.0, abs=0.1)
    for _ in range(100):
        line.step(30.0, state=free)
    (row,) = line.guard.report()
    # while it is stuck, from after_s on; the rest; and until the limit has passed the end of the servo's range
    acted_s = (2.0 - LOAD.after_s) + LOAD.rest_s + (12.0 + 50.0 - 10.0) / LOAD.rise_deg_s
    assert row["times"] == 1 and row["seconds"] == pytest.approx(acted_s, abs=4 * DT)
    for _ in range(20):
        line.step(30.0, state=stuck)
    assert line.guard.report()[0]["times"] == 2
    short = Line(RuleSettings(load=[LOAD]), table_of("a"))
    short.run(1.0, 30.0)
    for i in range(200):  # over for less than after_s at a time
        short.step(30.0, state=stuck if i % 8 else free)
    assert np.degrees(short.sent[0]) == pytest.approx(30.0)
