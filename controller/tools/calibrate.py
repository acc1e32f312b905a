"""Running a calibration: the buses, the keyboard and the screen together."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.live import Live

from controller.base.signals import stop_flag
from controller.robot.buses import BusSettings
from controller.robot.calibration import rest_deg, save_calibration
from controller.robot.channels import servo_specs
from controller.robot.settings import ChannelSettings, RobotSettings
from controller.tools.calibrate_screen import CalibrationScreen
from controller.tools.keys import Keyboard
from drivers import open_bus
from drivers.base.bus import Bus

PERIOD_S = 0.03
STALE_S = 0.5
"""An older angle counts as unknown; a single read that was missed does not matter."""
SLOW_RAD_S = 0.5
"""Nothing moves faster than this while it is calibrated."""


@dataclass
class _Wire:
    """One bus and which of the channels (k,) are on it."""

    bus: Bus
    indices: NDArray[np.intp]


def run_calibration(
    stack: ExitStack,
    robot: RobotSettings,
    channels: Sequence[ChannelSettings],
    name: str,
    target: Path,
    margin_deg: float,
    console: Console,
) -> bool:
    """Let a person capture ``channels``; motors are off whenever it ends, however it ends.

    Returns
    -------
    bool : whether the calibration was written.

    Raises
    ------
    DriverError, ControllerError
    """
    ended = stack.enter_context(stop_flag())
    keyboard = stack.enter_context(Keyboard())
    wires = [_opened(stack, robot, bus, channels) for bus in robot.buses if any(c.bus == bus.name for c in channels)]
    state = CalibrationScreen(channels, all(wire.bus.measures for wire in wires), margin_deg)
    written = False
    title = f"{robot.name}, calibration {name!r}"
    with Live(state.picture(title), console=console, auto_refresh=False, screen=True) as live:
        while not (state.done or ended.is_set()):
            _cycle(wires, state)
            live.update(state.picture(title), refresh=True)
            for key in keyboard.keys(PERIOD_S):
                state.press(key)
            if state.saving:
                written |= _save(state, robot, name, target, written)
    return written


def _opened(stack: ExitStack, robot: RobotSettings, bus: BusSettings, channels: Sequence[ChannelSettings]) -> _Wire:
    indices = [i for i, channel in enumerate(channels) if channel.bus == bus.name]
    own = [channels[i] for i in indices]
    specs = servo_specs(own, np.radians([rest_deg(channel) + channel.trim_deg for channel in own]))
    slow = [replace(spec, max_speed_rad_s=min(spec.max_speed_rad_s, SLOW_RAD_S)) for spec in specs]
    opened = open_bus(bus.kind, slow, **bus.options())
    stack.enter_context(opened)
    return _Wire(opened, np.array(indices, dtype=np.intp))


def _cycle(wires: Sequence[_Wire], state: CalibrationScreen) -> None:
    """Switch as the keys said, move what holds, and read where everything is."""
    angles = np.full(len(state.channels), np.nan)
    for wire in wires:
        if state.holding != wire.bus.running:
            wire.bus.start() if state.holding else wire.bus.stop()
        if state.holding:
            wire.bus.write(np.radians(state.target_deg[wire.indices]))
        measured = wire.bus.read()
        known = (measured.age_s < STALE_S) | (not wire.bus.measures)
        angles[wire.indices] = np.degrees(np.where(known, measured.position_rad, np.nan))
    state.see(angles)


def _save(state: CalibrationScreen, robot: RobotSettings, name: str, target: Path, own: bool) -> bool:
    """Write the file, or ask first where one is in the way that this run did not write."""
    if target.exists() and not own and not state.may_replace:
        state.ask(f"replace {target}? (y/n)")
        return False
    captured = state.captured()
    save_calibration(target, name, robot.name, captured)
    left_out = [channel.name for channel in state.channels if channel.name not in captured]
    state.changed = False
    state.saved(f"saved {len(captured)} channels" + (f"; not complete: {', '.join(left_out)}" if left_out else ""))
    return True
