"""A stage without its ports: what every servo would be sent, with all rules and limits, in a time of its own.

The same parts as in a run stand between the commands and the wire: layers, limits of motion, mixes, safety rules and
limits of the servos. Only the clock is not waited for, and nothing is measured, so rules of load do not act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.robot.anchors import AnchorMap
from controller.robot.channels import build_table, limiter_of, play
from controller.robot.rules import RuleSettings
from controller.robot.safety import Guard
from controller.robot.settings import ChannelSettings, RobotSettings

Feed = Callable[[int], object]
"""Gives the layers what is due at a time (ns)."""

_FIRST_NS = 1_000_000_000


class Line:
    """What stands between the parameters and one bus.

    Parameters
    ----------
    channels : the channels on the bus. rules : what no servo does. period_s : the bus's period.
    anchors : solves the channels that pull at the skin.

    Attributes
    ----------
    table : the channels. sent : (n,) rad, what the bus was sent last. held : how often a limit of position held.
    """

    def __init__(
        self,
        channels: Sequence[ChannelSettings],
        parameters: Parameters,
        rules: RuleSettings,
        period_s: float,
        anchors: AnchorMap | None = None,
    ) -> None:
        own = [channel.name for channel in channels]
        self.table = build_table(channels, parameters, anchors.on(own) if anchors is not None else None)
        self.period_s = period_s
        self.guard = Guard(rules, self.table, *play(channels))
        self.limiter = limiter_of(self.table, period_s)
        self.sent = self.table.angles(parameters.neutral())[0]
        self.limiter.reset(self.sent)
        self.held = np.zeros(len(own), dtype=np.int64)

    def step(self, values: Floats) -> Floats:
        """One cycle towards the face ``values`` : (p,); (n,) rad that go to the bus."""
        wanted = self.table.angles(values)[0]
        self.held += (wanted <= self.table.low_rad) | (wanted >= self.table.high_rad)
        allowed = self.guard.apply(wanted, self.sent, self.limiter.rest(self.period_s), None, self.period_s)
        return self.limiter.step(self.period_s, allowed, self.sent)


class OfflineRun:
    """All of a robot in a time of its own.

    Parameters
    ----------
    robot : its channels, on any number of buses. state : the layers. feed : gives them what is due.
    control_hz : ticks of the layers per second. anchors : see :class:`Line`.

    Attributes
    ----------
    sent_rad : for each bus, what every cycle sent, (c, n) rad, once it has run.
    """

    def __init__(
        self,
        robot: RobotSettings,
        state: CommandState,
        feed: Feed,
        control_hz: float = 100.0,
        anchors: AnchorMap | None = None,
    ) -> None:
        self._robot, self._state, self._feed, self._dt = robot, state, feed, 1.0 / control_hz
        self.lines = {
            bus.name: Line(robot.on_bus(bus.name), state.parameters, robot.rules, 1.0 / bus.rate_hz, anchors)
            for bus in robot.buses
        }
        self.sent_rad: dict[str, Floats] = {}

    def run(self, seconds: float) -> None:
        """Play so much of it."""
        values, rows = self._state.parameters.neutral(), {name: [line.sent.copy()] for name, line in self.lines.items()}
        for tick in range(math.ceil(seconds / self._dt)):
            now_ns = _FIRST_NS + round(tick * self._dt * 1e9)
            self._feed(now_ns)
            self._state.tick(now_ns, self._dt, values)
            for name, line in self.lines.items():
                while len(rows[name]) * line.period_s <= (tick + 1) * self._dt:
                    rows[name].append(line.step(values).copy())
        self.sent_rad = {name: np.array(each) for name, each in rows.items()}

    def rows(self) -> Iterator[dict[str, str]]:
        """One row a channel, in file order: what it was sent, and what held it back."""
        for channel in self._robot.channels:
            line = self.lines[channel.bus]
            i = line.table.names.index(channel.name)
            sent = np.degrees(self.sent_rad[channel.bus][:, i])
            yield {
                "sent (deg)": f"{sent.min():.1f} to {sent.max():.1f}",
                "limits (deg)": f"{channel.limit_deg[0]:g} to {channel.limit_deg[1]:g}",
                "fastest (deg/s)": f"{np.abs(np.diff(sent)).max(initial=0.0) / line.period_s:.0f} of "
                f"{channel.max_speed_deg_s:g}",
                "held by": ", ".join(_held(line, i, channel.name)) or "nothing",
            }

    def report(self) -> list[dict[str, object]]:
        """What each bus would have been sent, a row a cycle (deg), and the rules that acted."""
        return [
            {
                "robot": self._robot.name,
                "bus": name,
                "period_s": line.period_s,
                "channels": list(line.table.names),
                "sent_deg": np.round(np.degrees(self.sent_rad[name]), 3).tolist(),
                "rules": line.guard.report(),
            }
            for name, line in self.lines.items()
        ]


def _held(line: Line, i: int, name: str) -> Iterator[str]:
    """What held a channel back: its limit, and the rules that name it."""
    if line.held[i]:
        yield f"limit {line.held[i] * line.period_s:.1f} s"
    for rule in line.guard.report():
        if name in str(rule["rule"]).split():
            yield f"{str(rule['rule']).split()[0]} {rule['seconds']:.1f} s"
