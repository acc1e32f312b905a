"""Dry run: computes what a stage would send to its servos, without opening a port or waiting for a clock.

Layers, motion limits, mixes and safety rules are those of a real run. Nothing is measured, so load rules do not act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.links.line.script import Script, load_script
from controller.links.line.show import Show
from controller.robot.anchors import AnchorSolver, load_anchors
from controller.robot.safety import GoalFilter
from controller.robot.settings import ChannelSettings, RobotSettings
from controller.stage.stage import Stage
from controller.takes.livelink import Take, TakePlayer
from controller.takes.reader import load_take, reader_of
from controller.takes.recording import SUFFIX, replay

Feed = Callable[[int], object]
"""Writes to the layers what is due at a time (ns)."""

_START_NS = 1_000_000_000
_MAX_S = 600.0
_EXPRESSION_S = 1.5
"""Time for each expression, and after the last step of a script."""


@dataclass
class Rehearsal:
    """What a dry run computed.

    rows : for each channel a summary as text. buses : for each bus, the angles (deg) of every cycle.
    seconds : computed time. length_s : length of the longest source.
    """

    rows: list[dict[str, str]] = field(default_factory=list)
    buses: list[dict[str, object]] = field(default_factory=list)
    seconds: float = 0.0
    length_s: float = 0.0


def dry_run(
    stage: Stage,
    take: Path | None,
    seconds: float | None,
    parameters: Parameters,
    voice: Take | None = None,
    *,
    alone: bool = False,
) -> Rehearsal:
    """Compute what each robot of a stage is sent while a take, or the stage's own sources, play.

    The stage's own sources are the scripts of its simulated hosts, its show, its take and its voice. If there are none,
    every named expression is shown in turn.

    Parameters
    ----------
    take : a take or a recording; it replaces the stage's own sources. voice : plays in addition.
    alone : with ``voice``, leave out the stage's own sources.
    seconds : time to compute. Default: the length of the longest source (one repetition of a loop), at most 10 minutes.

    With several robots, the rows have the robot's name before the bus's, because two robots may use one name of a bus.
    """
    if stage.heads:
        return _dry_run_heads(stage, take, seconds, parameters, voice, alone)
    found = Rehearsal()
    for robot in stage.robots:
        state = stage.state(parameters)
        state.live(stage.settings.liveliness, 0, stage.settings.manner)
        feed, length_s = _feed(stage, take, state, voice, alone)
        anchors = load_anchors(robot, stage.head, parameters)
        offline = OfflineRun(robot, state, feed, stage.settings.control_hz, anchors)
        found.length_s = length_s
        found.seconds = min(length_s, _MAX_S) if seconds is None else seconds
        offline.run(found.seconds)
        prefix = f"{robot.name}/" if len(stage.robots) > 1 else ""
        found.rows += [row | {"servo": prefix + row["servo"]} for row in offline.rows()]
        found.buses += offline.report()
    return found


def _dry_run_heads(
    stage: Stage, take: Path | None, seconds: float | None, parameters: Parameters, voice: Take | None, alone: bool
) -> Rehearsal:
    """Dry-run each head in turn; take and voice go to the first head. Rows and buses have the head's name."""
    found = Rehearsal()
    for i, head in enumerate(stage.heads):
        source = (take, voice) if i == 0 else (None, None)
        one = dry_run(head.stage, source[0], seconds, parameters, source[1], alone=alone and i == 0)
        found.rows += [row | {"servo": f"{head.name}/{row['servo']}"} for row in one.rows]
        found.buses += [{"head": head.name, **bus} for bus in one.buses]
        found.seconds, found.length_s = max(found.seconds, one.seconds), max(found.length_s, one.length_s)
    return found


class OfflineRun:
    """Runs a robot from the layers to the goals of its servos, faster than real time.

    robot : its channels, on any number of buses. state : the layers. feed : writes to them what is due.
    control_hz : ticks of the layers per second. anchors : solver of the robot's anchored channels.
    """

    def __init__(
        self,
        robot: RobotSettings,
        state: CommandState,
        feed: Feed,
        control_hz: float = 100.0,
        anchors: AnchorSolver | None = None,
    ) -> None:
        self._robot, self._state, self._feed, self._dt = robot, state, feed, 1.0 / control_hz
        self._buses = {
            bus.name: GoalFilter(
                robot.on_bus(bus.name),
                state.parameters,
                robot.rules,
                1.0 / bus.rate_hz,
                anchors,
                robot.linkages_on(bus.name),
            )
            for bus in robot.buses
        }
        self._neutral = {name: bus.sent.copy() for name, bus in self._buses.items()}
        self._limited = {name: np.zeros(len(bus.sent), dtype=np.int64) for name, bus in self._buses.items()}
        self.sent_rad: dict[str, Floats] = {}  # by bus: the goals (c, n) of every cycle

    def run(self, seconds: float) -> None:
        """Compute this many seconds."""
        values, rows = self._state.parameters.neutral(), {name: [rest] for name, rest in self._neutral.items()}
        for tick in range(math.ceil(seconds / self._dt)):
            now_ns = _START_NS + round(tick * self._dt * 1e9)
            self._feed(now_ns)
            self._state.tick(now_ns, self._dt, values)
            for name, bus in self._buses.items():
                while len(rows[name]) * bus.period_s <= (tick + 1) * self._dt:
                    wanted = bus.table.curves(bus.table.mixed(values))
                    self._limited[name] += bus.table.beyond(wanted)
                    rows[name].append(bus.step(np.clip(wanted, bus.table.low_rad, bus.table.high_rad)).copy())
        self.sent_rad = {name: np.array(each) for name, each in rows.items()}

    def rows(self) -> Iterator[dict[str, str]]:
        """Yield one row for each channel, in file order: servo, mix, neutral angle, sent range, and what limited it."""
        for channel in self._robot.channels:
            bus = self._buses[channel.bus]
            i = bus.table.names.index(channel.name)
            sent = np.degrees(self.sent_rad[channel.bus][:, i])
            fastest = np.abs(np.diff(sent)).max(initial=0.0) / bus.period_s
            yield {
                "channel": channel.name,
                "servo": f"{channel.bus} id {channel.id}, {channel.model}",
                "mix": _mix(channel),
                "neutral (deg)": f"{np.degrees(self._neutral[channel.bus][i]):.1f}",
                "sent (deg)": f"{sent.min():.1f} to {sent.max():.1f}",
                "limits (deg)": f"{channel.limit_deg[0]:g} to {channel.limit_deg[1]:g}",
                "fastest (deg/s)": f"{fastest:.0f} of {channel.max_speed_deg_s:g}",
                "held by": ", ".join(self._held_by(channel, i)) or "nothing",
            }

    def _held_by(self, channel: ChannelSettings, i: int) -> Iterator[str]:
        """Yield what limited a channel: its position limit, and the rules that name it, each with a time (s)."""
        bus = self._buses[channel.bus]
        if limited := self._limited[channel.bus][i]:
            yield f"limit {limited * bus.period_s:.1f} s"
        for rule in bus.guard.report():
            kind, *words = str(rule["rule"]).split()
            if channel.name in words:
                yield f"{kind} {rule['seconds']:.1f} s"

    def report(self) -> list[dict[str, object]]:
        """Return what each bus would have been sent, a row for each cycle (deg), and the rules that acted."""
        return [
            {
                "robot": self._robot.name,
                "bus": name,
                "period_s": bus.period_s,
                "channels": list(bus.table.names),
                "sent_deg": np.round(np.degrees(self.sent_rad[name]), 3).tolist(),
                "rules": bus.guard.report(),
            }
            for name, bus in self._buses.items()
        ]


def _mix(channel: ChannelSettings) -> str:
    if channel.anchor is not None:
        point = channel.anchor.point
        return "pulls at " + (point if isinstance(point, str) else ", ".join(f"{x:g}" for x in point))
    terms = " ".join(term.describe(name) for name, term in channel.mix.items()).removeprefix("+")
    return terms if channel.join == "sum" else f"{channel.join} of {terms}"


def _feed(stage: Stage, take: Path | None, state: CommandState, voice: Take | None, alone: bool) -> tuple[Feed, float]:
    """Return a function that writes to the layers what is due, and the length (s) of its longest source."""
    if take is not None and take.suffix == SUFFIX:
        return _recording_feed(stage, take, state)
    feeds: list[tuple[Feed, float]] = []
    settings = stage.settings
    if take is None and not alone:
        feeds = [_script_feed(script, state) for script in _scripts(stage, state)]
        take = None if settings.take is None else stage.file(settings.take)
        if voice is None and settings.voice is not None and settings.voice_hz is None:
            voice = load_take(stage.file(settings.voice), state.parameters)
    if take is not None:
        feeds.append(_take_feed(load_take(take, state.parameters), state, reader_of(take).layer))
    if voice is not None:
        feeds.append(_take_feed(voice, state, "speech"))
    if not feeds:  # no source: show each named expression in turn
        expressions = [*state.vocabulary.names, "neutral"]
        script = Script(tuple((i * _EXPRESSION_S, f"EXPR {name}") for i, name in enumerate(expressions)))
        feeds = [_script_feed(script, state)]

    def feed(now_ns: int) -> None:
        for each, _ in feeds:
            each(now_ns)

    return feed, max(length_s for _, length_s in feeds)


def _scripts(stage: Stage, state: CommandState) -> list[Script]:
    """Load the scripts of a stage's simulated hosts, and its show."""
    names = [script for link in stage.settings.links if (script := link.simulated) is not None]
    names += [stage.settings.show] if stage.settings.show is not None else []
    return [load_script(name, state.parameters, stage.vocabulary, beside=stage.path) for name in names]


def _script_feed(script: Script, state: CommandState) -> tuple[Feed, float]:
    show = Show(script, state)
    show.playing = True
    return show.tick, script.loop_s or (script.steps[-1][0] if script.steps else 0.0) + _EXPRESSION_S


def _take_feed(take: Take, state: CommandState, layer: str) -> tuple[Feed, float]:
    return TakePlayer(take, state, layer).tick, take.duration_s


def _recording_feed(stage: Stage, path: Path, state: CommandState) -> tuple[Feed, float]:
    """Return a feed that writes the recorded face to the highest layer; only the motion to the first face is added."""
    ticks = [(now_ns, values.copy()) for now_ns, values in replay(path, state.parameters, make=stage.state)]
    times = np.array([now_ns for now_ns, _ in ticks], dtype=np.int64)
    every, first = np.ones(len(state.parameters), dtype=bool), [0]

    def feed(now_ns: int) -> None:
        if not ticks:
            return
        first[0] = first[0] or now_ns
        index = int(np.searchsorted(times - times[0], now_ns - first[0], side="right")) - 1
        state.write_layer("manual", ticks[index][1], every, now_ns)

    return feed, float(times[-1] - times[0]) * 1e-9 if len(times) else 0.0
