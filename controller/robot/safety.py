"""Safety before the bus: what stands between the angles a face asks for and the limiter of motion.

The chain is dead band -> slack -> rules. Rules only narrow the window [low, high] in which each servo may be told to
be; several rules join by intersection, so their order does not matter. All of it acts on targets: the
:class:`controller.motion.motion.MotionLimiter` behind keeps speed and acceleration, whatever a rule does. After the
rules of the Hanson motor stack, without its defects; see docs/robots.md for what differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Flags, Floats, Indices
from controller.robot.channels import ChannelTable
from controller.robot.rules import LoadRule, PreventRule, RuleSettings, TimingRule
from drivers.base.bus import BusState

_NEAR_RAD = 1e-3


@dataclass
class Moment:
    """What rules look at: angles, and what was measured.

    Attributes
    ----------
    angles : (3, n) rad: where the servos are asked to be, where they were last told to be, and where they would come
        to rest if they braked from the next step on. state : the newest measurement. dt : s.
    """

    angles: Floats
    state: BusState | None
    dt: float

    @property
    def position(self) -> Floats:
        """(n,) rad, where the servos were last told to be."""
        angles: Floats = self.angles[1]
        return angles


@dataclass
class Window:
    """Where each servo may be told to be; (n,) rad. ``narrow`` only ever makes it smaller."""

    low: Floats
    high: Floats

    def narrow(self, at: Indices, sign: Floats, bound: Floats, where: Flags) -> None:
        """Keep servos ``at`` : (k,) on the near side of ``bound`` : (k,), seen along ``sign`` : (k,) +1 or -1."""
        if not where.any():
            return
        up, down = where & (sign > 0), where & (sign < 0)
        np.minimum.at(self.high, at[up], bound[up])
        np.maximum.at(self.low, at[down], bound[down])


@dataclass
class Tally:
    """How often each rule acted: ``times`` it began to, and for how many seconds, (k,)."""

    labels: list[str]
    times: NDArray[np.int64] = field(init=False)
    seconds: Floats = field(init=False)
    acting: Flags = field(init=False)

    def __post_init__(self) -> None:
        k = len(self.labels)
        self.times, self.seconds, self.acting = np.zeros(k, np.int64), np.zeros(k), np.zeros(k, bool)

    def note(self, acting: Flags, dt: float) -> None:
        """Count what acts now."""
        if not (acting.any() or self.acting.any()):
            return
        self.times += acting & ~self.acting
        self.seconds += acting * dt
        np.copyto(self.acting, acting)

    def report(self) -> list[dict[str, object]]:
        """The rules that acted, with their counts."""
        return [
            {"rule": label, "times": int(times), "seconds": round(float(seconds), 3)}
            for label, times, seconds in zip(self.labels, self.times, self.seconds, strict=True)
            if times
        ]


class _Ends:
    """Indices, signs and thresholds (k,) of relative positions of channels."""

    def __init__(self, table: ChannelTable, neutral: Floats, ends: Sequence[tuple[str, str, float]]) -> None:
        self.at = np.array([table.names.index(name) for name, _, _ in ends], dtype=np.intp)
        self.sign = np.array([1.0 if side == "high" else -1.0 for _, side, _ in ends])
        self.neutral = neutral[self.at]
        self.limit = np.where(self.sign > 0, table.high_rad[self.at], table.low_rad[self.at])
        self.bound = self.at_share(np.array([extreme for _, _, extreme in ends]))

    def at_share(self, share: Floats) -> Floats:
        """(k,) rad of relative positions."""
        return self.neutral + share * (self.limit - self.neutral)

    def keep(self, window: Window, where: Flags) -> None:
        """Keep the channels of ``where`` : (k,) on the near side of their threshold."""
        window.narrow(self.at, self.sign, self.bound, where)

    def past(self, angles: Floats) -> Flags:
        """(..., k) whether the channels' ``angles`` : (..., n) lie beyond their threshold."""
        return self.sign * (angles[..., self.at] - self.bound) > _NEAR_RAD


class Prevent:
    """Keeps antagonists from being past their extremes at the same time.

    Decides by where a servo would come to rest, so that neither overshoots while it brakes.
    """

    def __init__(self, rules: Sequence[PreventRule], table: ChannelTable, neutral: Floats) -> None:
        self._own = _Ends(table, neutral, [(r.channel, r.toward, r.extreme) for r in rules])
        self._other = _Ends(table, neutral, [(r.other, r.other_toward, r.other_extreme) for r in rules])
        self.tally = Tally([f"prevent {r.channel} against {r.other}" for r in rules])

    def narrow(self, now: Moment, window: Window) -> None:
        """See :class:`Guard`."""
        own, other = self._own.past(now.angles), self._other.past(now.angles)
        yields, waits = other[0] | other[1] | other[2], own[1] | own[2]
        self._own.keep(window, yields)
        self._other.keep(window, waits)
        self.tally.note((yields & own[0]) | (waits & other[0]), now.dt)


class Timing:
    """Lets no servo stay at an extreme.

    The time past the extreme adds up, and runs back at the same pace on the near side of it: a target that flickers
    out for a moment does not begin anew.
    """

    def __init__(self, rules: Sequence[TimingRule], table: ChannelTable, neutral: Floats) -> None:
        each = [(rule, name) for rule in rules for name in rule.channels]
        self._ends = _Ends(table, neutral, [(name, r.toward, r.extreme) for r, name in each])
        self._extreme = np.array([r.extreme for r, _ in each])
        self._hold = np.array([r.hold_s for r, _ in each])
        times = np.array([(r.fall_s, r.rest_s, r.recover_s) for r, _ in each]).reshape(-1, 3)
        self._until = np.cumsum(times, axis=1)
        self._fall, self._recover = times[:, 0], times[:, 2]
        self._spent, self._phase = np.zeros(len(each)), np.full(len(each), -1.0)
        self._rests = True
        self.tally = Tally([f"timing {name} toward {r.toward}" for r, name in each])

    def narrow(self, now: Moment, window: Window) -> None:
        """See :class:`Guard`."""
        if self._rests and not self._ends.past(now.position).any():
            return
        idle = self._phase < 0
        pace = np.where(self._ends.past(now.position), now.dt, -now.dt)
        self._spent = np.where(idle, np.maximum(self._spent + pace, 0.0), 0.0)
        self._phase = np.where(idle, np.where(self._spent > self._hold, 0.0, -1.0), self._phase + now.dt)
        self._phase[self._phase >= self._until[:, 2]] = -1.0
        acting = self._phase >= 0
        self._rests = not (acting.any() or self._spent.any() or self.tally.acting.any())
        if acting.any():
            window.narrow(self._ends.at, self._ends.sign, self._ends.at_share(self._level()), acting)
        self.tally.note(acting, now.dt)

    def _level(self) -> Floats:
        """(k,) relative limit: 1 falls to the extreme, stays, and rises to 1 again."""
        fallen = np.clip(self._phase / self._fall, 0.0, 1.0)
        risen = np.clip((self._phase - self._until[:, 1]) / self._recover, 0.0, 1.0)
        level: Floats = 1.0 - (1.0 - self._extreme) * (fallen - risen)
        return level


class Load:
    """Lets a servo that meets resistance give way, from where it stands, against the way it pushes.

    Only fresh, measured currents count; a servo that does not measure its current is never held by this rule.
    """

    def __init__(self, rules: Sequence[LoadRule], table: ChannelTable) -> None:
        each = [(rule, name) for rule in rules for name in rule.channels]
        self._at = np.array([table.names.index(name) for _, name in each], dtype=np.intp)
        numbers = np.array([(r.current_a, r.after_s, r.rest_s) for r, _ in each]).reshape(-1, 3)
        self._current, self._after, self._rest = numbers.T
        angles = np.array([(r.most_deg, r.fall_deg_s, r.rise_deg_s) for r, _ in each]).reshape(-1, 3)
        self._most, self._fall, self._rise = np.radians(angles).T
        self._low, self._high = table.low_rad[self._at], table.high_rad[self._at]
        k = len(each)
        self._over, self._calm = np.zeros(k), np.zeros(k)
        self._push, self._from, self._given = np.zeros(k), np.zeros(k), np.zeros(k)
        self.tally = Tally([f"load {name}" for _, name in each])

    def narrow(self, now: Moment, window: Window) -> None:
        """See :class:`Guard`."""
        if now.state is not None:
            self._measure(now, now.state)
        acting = self._push != 0.0
        if not (acting.any() or self.tally.acting.any()):
            return
        window.narrow(self._at, self._push, self._from - self._push * self._given, acting)
        self.tally.note(acting, now.dt)

    def _measure(self, now: Moment, state: BusState) -> None:
        current, position = np.abs(state.current_a[self._at]), state.position_rad[self._at]
        told = state.fresh[self._at] & np.isfinite(current) & np.isfinite(position)
        over = told & (current > self._current)
        self._over = np.where(over, self._over + now.dt, np.where(told, 0.0, self._over))
        begins = over & (self._over > self._after) & (self._push == 0.0)
        push = np.where(now.position[self._at] < position, -1.0, 1.0)
        self._push = np.where(begins, push, self._push)
        self._from = np.where(begins, np.clip(position, self._low, self._high), self._from)
        self._given[begins] = 0.0
        self._give_way(over, told, now.dt)

    def _give_way(self, over: Flags, told: Flags, dt: float) -> None:
        self._calm = np.where(over, 0.0, self._calm + dt * told)
        falling, rising = over & (self._push != 0.0), self._calm > self._rest
        self._given = np.where(falling, np.minimum(self._given + self._fall * dt, self._most), self._given)
        self._given = np.where(rising, self._given - self._rise * dt, self._given)
        limit = np.where(self._push > 0, self._high - self._from, self._from - self._low)
        self._push[rising & (-self._given >= limit)] = 0.0


class Takeup:
    """Dead band and slack of each channel.

    A target that moves by less than the dead band is not followed. Slack is the play of a gear or string: half of it
    is added while the target rises and taken away while it falls, so that the far end goes where it should.

    Parameters
    ----------
    dead_rad, slack_rad : (n,), 0 for none.
    """

    def __init__(self, dead_rad: Floats, slack_rad: Floats) -> None:
        self._dead, self._half = dead_rad, 0.5 * slack_rad
        self._turn = np.maximum(0.1 * slack_rad, _NEAR_RAD)
        self._held, self._peak = np.full(len(dead_rad), np.nan), np.zeros(len(dead_rad))
        self._way = np.zeros(len(dead_rad))

    def apply(self, target: Floats) -> Floats:
        """(n,) rad: what to ask of the servos for ``target`` : (n,) rad."""
        moved = ~(np.abs(target - self._held) <= self._dead)
        self._held[moved] = target[moved]
        # the way it goes turns when the target comes back from its furthest point
        came = (self._held - self._peak) * np.where(self._way == 0.0, 1.0, self._way)
        turned = (came < -self._turn) | ((self._way == 0.0) & (came > self._turn))
        self._way = np.where(turned, np.sign(self._held - self._peak), self._way)
        self._peak = np.where(turned | (came > 0.0), self._held, self._peak)
        return self._held + self._way * self._half


class Guard:
    """All of it for the channels of one bus.

    Parameters
    ----------
    rules : the rules. table : the channels. dead_rad, slack_rad : (n,) per channel; none without.
    """

    def __init__(
        self,
        rules: RuleSettings,
        table: ChannelTable,
        dead_rad: Floats | None = None,
        slack_rad: Floats | None = None,
    ) -> None:
        none = np.zeros(len(table.names))
        neutral, _ = table.angles(np.zeros(table.mix.shape[1]))
        rules = rules.within(table.names)
        self._table = table
        self._takeup = Takeup(none if dead_rad is None else dead_rad, none if slack_rad is None else slack_rad)
        every = (Prevent(rules.prevent, table, neutral), Timing(rules.timing, table, neutral), Load(rules.load, table))
        self._rules = [rule for rule in every if rule.tally.labels]
        self._window = Window(table.low_rad.copy(), table.high_rad.copy())

    def apply(self, target: Floats, position: Floats, stop: Floats, state: BusState | None, dt: float) -> Floats:
        """What the servos may be asked for.

        Parameters
        ----------
        target : (n,) rad, what the face asks for. position : (n,) rad, where the servos were last told to be.
        stop : (n,) rad, where they would come to rest; see :meth:`controller.motion.motion.MotionLimiter.rest`.
        state : the newest measurement. dt : s.

        Returns
        -------
        (n,) rad, inside the limits and every rule.
        """
        table, window = self._table, self._window
        sound = np.where(np.isfinite(target), target, position)  # what is no number asks to stay
        wanted = self._takeup.apply(np.minimum(np.maximum(sound, table.low_rad), table.high_rad))
        wanted = np.minimum(np.maximum(wanted, table.low_rad), table.high_rad)
        np.copyto(window.low, table.low_rad)
        np.copyto(window.high, table.high_rad)
        now = Moment(np.array((wanted, position, stop)), state, dt)
        for rule in self._rules:
            rule.narrow(now, window)
        return np.maximum(np.minimum(wanted, window.high), np.minimum(window.low, window.high))

    def report(self) -> list[dict[str, object]]:
        """The rules that acted: which, how often, for how long (s)."""
        return [row for rule in self._rules for row in rule.tally.report()]
