"""What a stage would send to its servos, without opening a port."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from controller.base.parameters import Parameters
from controller.layers.commands import CommandState
from controller.links.line.script import Script, load_script
from controller.links.line.show import Show
from controller.robot.anchors import AnchorMap, load_anchors
from controller.robot.channels import build_table
from controller.robot.settings import ChannelSettings, RobotSettings
from controller.stage.offline import Feed, OfflineRun
from controller.stage.stage import Stage
from controller.takes.livelink import TakePlayer
from controller.takes.reader import load_take, reader_of
from controller.takes.recording import SUFFIX, replay

_LONGEST_S = 30.0
_EACH_S = 1.5


def dry_run(
    stage: Stage, take: Path | None, seconds: float | None, parameters: Parameters
) -> tuple[list[dict[str, str]], list[dict[str, object]]]:
    """Play a stage's take, its simulated hosts' scripts or else every named expression to each of its robots.

    Returns
    -------
    A row a channel, and for each bus every angle of every cycle (deg).
    """
    rows: list[dict[str, str]] = []
    report: list[dict[str, object]] = []
    for robot in stage.robots:
        state = stage.state(parameters)
        state.live(stage.settings.liveliness, 0)
        feed, length_s = _feed(stage, take, state)
        rehearsal = OfflineRun(robot, state, feed, stage.settings.control_hz, _anchors(stage, robot, parameters))
        rehearsal.run(min(length_s, _LONGEST_S) if seconds is None else seconds)
        rows += [fixed | sent for fixed, sent in zip(plan_rows(robot, parameters), rehearsal.rows(), strict=True)]
        report += rehearsal.report()
    return rows, report


def _anchors(stage: Stage, robot: RobotSettings, parameters: Parameters) -> AnchorMap | None:
    if all(channel.anchor is None for channel in robot.channels):
        return None

    return load_anchors(robot, stage.head, parameters)


def _feed(stage: Stage, take: Path | None, state: CommandState) -> tuple[Feed, float]:
    """What gives the layers what is due, and for how long it does (s)."""
    if take is not None:
        return _of_take(stage, take, state)
    names = [script for link in stage.settings.links if (script := link.simulated) is not None]
    names += [stage.settings.show] if stage.settings.show is not None else []
    scripts = [load_script(name, state.parameters, stage.vocabulary, beside=stage.path) for name in names] or [
        _every(state)
    ]
    shows = [Show(script, state) for script in scripts]
    for show in shows:
        show.playing = True
    return _all([show.tick for show in shows]), max(script.loop_s or _last_s(script) for script in scripts)


def _of_take(stage: Stage, take: Path, state: CommandState) -> tuple[Feed, float]:
    if take.suffix == SUFFIX:
        return _of_recording(stage, take, state)
    loaded = load_take(take, state.parameters)
    return TakePlayer(loaded, state, reader_of(take).layer).tick, loaded.duration_s


def _of_recording(stage: Stage, path: Path, state: CommandState) -> tuple[Feed, float]:
    """The recorded face in the highest layer, which is what a replay shows but for the time it takes to get there."""
    ticks = [(now_ns, values.copy()) for now_ns, values in replay(path, state.parameters, make=stage.state)]
    times = np.array([now_ns for now_ns, _ in ticks], dtype=np.int64)
    every, first = np.ones(len(state.parameters), dtype=bool), [0]

    def feed(now_ns: int) -> None:
        first[0] = first[0] or now_ns
        at = int(np.searchsorted(times - times[0], now_ns - first[0], side="right")) - 1
        state.write_layer("manual", ticks[at][1], every, now_ns)

    return feed, float(times[-1] - times[0]) * 1e-9 if len(times) else 0.0


def _every(state: CommandState) -> Script:
    """Each named expression in turn."""
    names = [*state.vocabulary.names, "neutral"]
    return Script(tuple((i * _EACH_S, f"EXPR {name}") for i, name in enumerate(names)))


def _last_s(script: Script) -> float:
    return script.steps[-1][0] + _EACH_S if script.steps else _EACH_S


def _all(feeds: list[Callable[[int], object]]) -> Feed:
    def feed(now_ns: int) -> None:
        for each in feeds:
            each(now_ns)

    return feed


def plan_rows(robot: RobotSettings, parameters: Parameters) -> Iterator[dict[str, str]]:
    """One row a channel: servo, mix, and the angle of the neutral face."""
    table = build_table(robot.channels, parameters)
    neutral, _ = table.angles(parameters.neutral())
    for channel, angle in zip(robot.channels, neutral, strict=True):
        yield {
            "channel": channel.name,
            "servo": f"{channel.bus} id {channel.id}, {channel.model}",
            "mix": _mix(channel),
            "neutral (deg)": f"{np.degrees(angle):.1f}",
        }


def _mix(channel: ChannelSettings) -> str:
    if channel.anchor is not None:
        point = channel.anchor.point
        return "pulls at " + (point if isinstance(point, str) else ", ".join(f"{x:g}" for x in point))
    words = " ".join(term.words(name) for name, term in channel.mix.items()).removeprefix("+")
    return words if channel.join == "sum" else f"{channel.join} of {words}"
