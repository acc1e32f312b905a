"""Safety rules and limits of motion between the angles of a face's channels and the goals sent to a bus.

The chain is smoothing -> dead band -> slack -> rules -> limiter of motion. Rules only narrow the range [low, high] of
positions that each servo may be sent; several rules combine by intersection, so their order does not matter. All of
them act on targets: the :class:`controller.motion.motion.MotionLimiter` after them limits speed and acceleration,
whatever a rule does. The rules follow those of the Hanson motor stack; docs/robots.md lists the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.robot.channels import ChannelTable, build_table
from controller.robot.filters import SlowStart, TargetFilter
from controller.robot.linkages.kind import LinkageSettings
from controller.robot.linkages.linked_channels import LinkedChannels
from controller.robot.rules import AllowedRange, HeatRules, RuleCounter, RuleInput
from controller.robot.settings import ChannelSettings, LoadRule, PreventRule, RuleSettings, TimingRule
from drivers.base.bus import BusState

if TYPE_CHECKING:
    from controller.robot.anchors import AnchorSolver  # imported lazily: it loads the head

_TOLERANCE_RAD = 1e-3


class _Thresholds:
    """Thresholds of k channels: index, sign of the side (+1: high), and angle (rad), each (k,)."""

    def __init__(self, table: ChannelTable, neutral: Floats, extremes: Sequence[tuple[str, str, float]]) -> None:
        self.at = np.array([table.names.index(name) for name, _, _ in extremes], dtype=np.intp)
        self.sign = np.array([1.0 if side == "high" else -1.0 for _, side, _ in extremes])
        self.neutral = neutral[self.at]
        self.limit = np.where(self.sign > 0, table.high_rad[self.at], table.low_rad[self.at])
        self.bound = self.angle_rad(np.array([extreme for _, _, extreme in extremes]))

    def angle_rad(self, relative: Floats) -> Floats:
        """(k,) rad of relative positions (k,): 0 is the neutral face, 1 the limit."""
        return self.neutral + relative * (self.limit - self.neutral)

    def past(self, angles: Floats) -> Flags:
        """(..., k) whether the channels' ``angles`` : (..., n) lie beyond their threshold."""
        return self.sign * (angles[..., self.at] - self.bound) > _TOLERANCE_RAD


class AntagonistRules:
    """Keeps antagonists from being past their extremes at the same time.

    It also compares the position at which a servo would come to rest, so that none overshoots while it brakes.
    """

    def __init__(self, rules: Sequence[PreventRule], table: ChannelTable, neutral: Floats) -> None:
        self._own = _Thresholds(table, neutral, [(r.channel, r.toward, r.extreme) for r in rules])
        self._other = _Thresholds(table, neutral, [(r.other, r.other_toward, r.other_extreme) for r in rules])
        self.counter = RuleCounter([f"prevent {r.channel} against {r.other}" for r in rules])

    def narrow(self, now: RuleInput, allowed: AllowedRange) -> None:
        """Narrow the allowed range for one cycle."""
        angles = np.array((now.target, now.position, now.rest))
        own, other = self._own.past(angles), self._other.past(angles)
        yields, waits = other[0] | other[1] | other[2], own[1] | own[2]
        for ends, where in ((self._own, yields), (self._other, waits)):
            allowed.narrow(ends.at, ends.sign, ends.bound, where)
        self.counter.count((yields & own[0]) | (waits & other[0]), now.dt)


class TimingRules:
    """Limits how long a servo may stay at an extreme.

    The time past the extreme is added up, and the time inside it is subtracted at the same rate, so that a target that
    leaves the extreme for a moment does not restart the count.
    """

    def __init__(self, rules: Sequence[TimingRule], table: ChannelTable, neutral: Floats) -> None:
        each = [(rule, name) for rule in rules for name in rule.channels]
        self._ends = _Thresholds(table, neutral, [(name, r.toward, r.extreme) for r, name in each])
        self._extreme = np.array([r.extreme for r, _ in each])
        self._hold = np.array([r.hold_s for r, _ in each])
        times = np.array([(r.fall_s, r.rest_s, r.recover_s) for r, _ in each]).reshape(-1, 3)
        self._until = np.cumsum(times, axis=1)
        self._fall, self._recover = times[:, 0], times[:, 2]
        self._spent, self._phase = np.zeros(len(each)), np.full(len(each), -1.0)  # s; a phase of -1 means not acting
        self._idle = True
        self.counter = RuleCounter([f"timing {name} toward {r.toward}" for r, name in each])

    def narrow(self, now: RuleInput, allowed: AllowedRange) -> None:
        """Narrow the allowed range for one cycle."""
        past = self._ends.past(now.position)
        if self._idle and not past.any():
            return
        waiting = self._phase < 0
        pace = np.where(past, now.dt, -now.dt)
        self._spent = np.where(waiting, np.maximum(self._spent + pace, 0.0), 0.0)
        self._phase = np.where(waiting, np.where(self._spent > self._hold, 0.0, -1.0), self._phase + now.dt)
        self._phase[self._phase >= self._until[:, 2]] = -1.0
        acting = self._phase >= 0
        self._idle = not (acting.any() or self._spent.any())
        allowed.narrow(self._ends.at, self._ends.sign, self._ends.angle_rad(self._level()), acting)
        self.counter.count(acting, now.dt)

    def _level(self) -> Floats:
        """(k,) relative limit: it falls from 1 to the extreme, stays there, and rises to 1 again."""
        fallen = np.clip(self._phase / self._fall, 0.0, 1.0)
        risen = np.clip((self._phase - self._until[:, 1]) / self._recover, 0.0, 1.0)
        level: Floats = 1.0 - (1.0 - self._extreme) * (fallen - risen)
        return level


class LoadRules:
    """Lets a servo that meets resistance give way, from its measured position, against the direction of its push.

    Only currents measured in this cycle count; the rule never limits a servo that does not measure its current.
    """

    def __init__(self, rules: Sequence[LoadRule], table: ChannelTable) -> None:
        each = [(rule, name) for rule in rules for name in rule.channels]
        self._at = np.array([table.names.index(name) for _, name in each], dtype=np.intp)
        numbers = np.array([(r.current_a, r.after_s, r.rest_s) for r, _ in each]).reshape(-1, 3)
        self._current, self._after, self._rest = numbers.T
        angles = np.array([(r.most_deg, r.fall_deg_s, r.rise_deg_s) for r, _ in each]).reshape(-1, 3)
        self._max_give, self._fall, self._rise = np.radians(angles).T
        self._low, self._high = table.low_rad[self._at], table.high_rad[self._at]
        self._over, self._calm, self._push, self._from, self._given = np.zeros((5, len(each)))
        self.counter = RuleCounter([f"load {name}" for _, name in each])

    def narrow(self, now: RuleInput, allowed: AllowedRange) -> None:
        """Narrow the allowed range for one cycle."""
        if now.state is not None:
            self._measure(now, now.state)
        acting = self._push != 0.0
        allowed.narrow(self._at, self._push, self._from - self._push * self._given, acting)
        self.counter.count(acting, now.dt)

    def _measure(self, now: RuleInput, state: BusState) -> None:
        current, position = np.abs(state.current_a[self._at]), state.position_rad[self._at]
        known = state.fresh[self._at] & np.isfinite(current) & np.isfinite(position)
        over = known & (current > self._current)
        self._over = np.where(over, self._over + now.dt, np.where(known, 0.0, self._over))
        begins = over & (self._over > self._after) & (self._push == 0.0)
        push = np.where(now.position[self._at] < position, -1.0, 1.0)
        self._push = np.where(begins, push, self._push)
        self._from = np.where(begins, np.clip(position, self._low, self._high), self._from)
        self._given[begins] = 0.0
        self._give_way(over, known, now.dt)

    def _give_way(self, over: Flags, known: Flags, dt: float) -> None:
        self._calm = np.where(over, 0.0, self._calm + dt * known)
        falling, rising = over & (self._push != 0.0), self._calm > self._rest
        self._given = np.where(falling, np.minimum(self._given + self._fall * dt, self._max_give), self._given)
        self._given = np.where(rising, self._given - self._rise * dt, self._given)
        limit = np.where(self._push > 0, self._high - self._from, self._from - self._low)
        self._push[rising & (-self._given >= limit)] = 0.0


class DeadBandAndSlack:
    """Applies the dead band and compensates the slack of each channel.

    A target that moves by less than the dead band is ignored. Slack is the play of a gear or string: half of it is
    added while the target rises and subtracted while it falls, so that the far end reaches the target.
    """

    def __init__(self, dead_band_rad: Floats, slack_rad: Floats) -> None:
        self._dead, self._half = dead_band_rad, 0.5 * slack_rad
        self._turn = np.maximum(0.1 * slack_rad, _TOLERANCE_RAD)
        self._held, self._peak = np.full(len(slack_rad), np.nan), np.zeros(len(slack_rad))
        self._direction = np.zeros(len(slack_rad))

    def apply(self, target: Floats) -> Floats:
        """(n,) rad: the angles to send for ``target`` : (n,) rad."""
        moved = ~(np.abs(target - self._held) <= self._dead)
        self._held[moved] = target[moved]
        # the direction reverses when the target has come back from its furthest point by self._turn
        advance = (self._held - self._peak) * np.where(self._direction == 0.0, 1.0, self._direction)
        reversed_ = (advance < -self._turn) | ((self._direction == 0.0) & (advance > self._turn))
        self._direction = np.where(reversed_, np.sign(self._held - self._peak), self._direction)
        self._peak = np.where(reversed_ | (advance > 0.0), self._held, self._peak)
        return self._held + self._direction * self._half


class Guard:
    """Dead band, slack and all safety rules for the channels of one bus."""

    def __init__(self, rules: RuleSettings, table: ChannelTable) -> None:
        neutral = table.neutral_rad
        rules = rules.within(table.names)
        self._heat = HeatRules(rules.heat, table, neutral) if rules.heat else None
        self._table = table
        self._slack = DeadBandAndSlack(table.dead_band_rad, table.slack_rad)
        every = (
            AntagonistRules(rules.prevent, table, neutral),
            TimingRules(rules.timing, table, neutral),
            LoadRules(rules.load, table),
            *((self._heat,) if self._heat is not None else ()),
        )
        self._rules = [rule for rule in every if rule.counter.labels]

    def apply(self, target: Floats, position: Floats, rest: Floats, state: BusState | None, dt: float) -> Floats:
        """Return the angles (n,) rad that the servos may be sent, inside the limits and every rule.

        Parameters
        ----------
        target : (n,) rad, the angles of the face. position : (n,) rad, the last goals.
        rest : (n,) rad, where they would come to rest; from
            :meth:`controller.motion.motion.MotionLimiter.stopping_position`.
        state : the newest measurement. dt : s.
        """
        low, high = self._table.low_rad, self._table.high_rad
        finite = np.where(np.isfinite(target), target, position)  # a servo whose target is not finite stays
        wanted = np.clip(self._slack.apply(np.clip(finite, low, high)), low, high)
        allowed = AllowedRange(low.copy(), high.copy())
        now = RuleInput(wanted, position, rest, state, dt)
        for rule in self._rules:
            rule.narrow(now, allowed)
        return np.maximum(np.minimum(wanted, allowed.high), np.minimum(allowed.low, allowed.high))

    @property
    def speed_fraction(self) -> Floats | float:
        """Fraction of its top speed that each channel may use now, by its temperature: (n,), or 1 for all."""
        return 1.0 if self._heat is None else self._heat.speed_fraction

    def report(self) -> list[dict[str, object]]:
        """Return a record for each rule that acted: its label, how often, for how long (s)."""
        return [row for rule in self._rules for row in rule.counter.report()]


class GoalFilter:
    """Turns the angles wanted of one bus's channels into goals: safety rules first, then limits of motion.

    channels, period_s, linkages : of the bus. rules, anchors : of the robot.
    """

    def __init__(self, channels: Sequence[ChannelSettings], parameters: Parameters, rules: RuleSettings,
                 period_s: float, anchors: AnchorSolver | None = None,
                 linkages: Sequence[LinkageSettings] = ()) -> None:  # fmt: skip
        names = [channel.name for channel in channels]
        self.table = build_table(
            channels, parameters, None if anchors is None else anchors.for_channels(names), linkages
        )
        self.guard = Guard(rules, self.table)
        self.period_s = period_s
        self._filter, self._slow_start = TargetFilter(channels), SlowStart(channels)
        self._limiter = self.table.limiter(period_s)
        self.sent = np.zeros(len(names))  # rad, the last goals
        self.restart(self.table.neutral_rad)

    def out_of_reach(self) -> dict[str, int]:
        """Linkages whose inputs became unreachable, by name, and how often."""
        linked = [bound for bound in self.table.bound if isinstance(bound, LinkedChannels)]
        return {each.name: each.times for each in linked if each.times}

    def restart(self, position_rad: Floats) -> None:
        """Continue from positions (n,) rad at rest, as far as the limits of position allow."""
        np.clip(position_rad, self.table.low_rad, self.table.high_rad, out=self.sent)
        self._limiter.reset(self.sent)
        self._begin(np.ones(len(self.sent), dtype=bool))

    def _begin(self, where: Flags) -> None:
        self._filter.restart(where)
        self._slow_start.restart(where)

    def restart_some(self, where: Flags, position_rad: Floats) -> None:
        """Restart the channels ``where`` : (n,) as ``restart`` does; where a position is NaN, from the last goal."""
        start = np.where(np.isfinite(position_rad), position_rad, self.sent)
        self._limiter.reset_some(where, start)
        self.sent[where] = np.clip(start, self.table.low_rad, self.table.high_rad)[where]
        self._begin(where)

    def step(self, wanted: Floats, state: BusState | None = None, dt: float | None = None) -> Floats:
        """Compute the goals of one cycle towards angles ``wanted`` (n,) rad, given the newest measurement.

        dt : duration of the cycle, s; by default the bus's own. Returns goals (n,) rad, the same array each time.
        """
        dt = self.period_s if dt is None else dt
        smooth = self._filter.apply(wanted, dt)
        allowed = self.guard.apply(smooth, self.sent, self._limiter.stopping_position(dt), state, dt)
        self._limiter.set_speed_fraction(np.minimum(self._slow_start.step(dt), self.guard.speed_fraction))
        return self._limiter.step(dt, allowed, self.sent)
