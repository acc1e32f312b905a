"""Runs a calibration: reads the buses and the keyboard, and shows the screen."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
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
from controller.tools.keys import keyboard
from drivers import open_bus
from drivers.base.bus import Bus

PERIOD_S = 0.03
STALE_S = 0.5
"""An older angle counts as unknown; a single read that was missed does not matter."""
SLOW_RAD_S = 0.5
"""Nothing moves faster than this while it is calibrated."""

BusChannels = tuple[Bus, NDArray[np.intp]]
"""A bus and the indices of its channels."""


def run_calibration(
    robot: RobotSettings, channels: Sequence[ChannelSettings], name: str, target: Path, margin_deg: float,
    console: Console,
) -> bool:  # fmt: skip
    """Let a person capture ``channels``; the motors are off whenever it ends. Returns whether the file was written.

    Raises DriverError or ControllerError.
    """
    with ExitStack() as stack:
        ended = stack.enter_context(stop_flag())
        read_keys = stack.enter_context(keyboard())
        used = [bus for bus in robot.buses if any(channel.bus == bus.name for channel in channels)]
        buses = [_open_bus(stack, bus, channels) for bus in used]
        screen = CalibrationScreen(channels, all(bus.measures for bus, _ in buses), margin_deg)
        written = False
        title = f"{robot.name}, calibration {name!r}"
        with Live(screen.picture(title), console=console, auto_refresh=False, screen=True) as live:
            while not (screen.done or ended.is_set()):
                _cycle(buses, screen)
                live.update(screen.picture(title), refresh=True)
                for key in read_keys(PERIOD_S):
                    screen.handle_key(key)
                if screen.saving:
                    written |= _save(screen, robot, name, target, written)
    return written


def _open_bus(stack: ExitStack, bus: BusSettings, channels: Sequence[ChannelSettings]) -> BusChannels:
    indices = [i for i, channel in enumerate(channels) if channel.bus == bus.name]
    own = [channels[i] for i in indices]
    specs = servo_specs(own, np.radians([rest_deg(channel) + channel.trim_deg for channel in own]))
    slow = [replace(spec, max_speed_rad_s=min(spec.max_speed_rad_s, SLOW_RAD_S)) for spec in specs]
    return stack.enter_context(open_bus(bus.kind, slow, **bus.options())), np.array(indices, dtype=np.intp)


def _cycle(buses: Sequence[BusChannels], screen: CalibrationScreen) -> None:
    """Switch the motors as the keys ask, move those that hold, and read where everything is."""
    angles = np.full(len(screen.channels), np.nan)
    for bus, indices in buses:
        if screen.holding != bus.running:
            bus.start() if screen.holding else bus.stop()
        if screen.holding:
            bus.write(np.radians(screen.target_deg[indices]))
        measured = bus.read()
        known = (measured.age_s < STALE_S) | (not bus.measures)
        angles[indices] = np.degrees(np.where(known, measured.position_rad, np.nan))
    screen.set_angles(angles)


def _save(screen: CalibrationScreen, robot: RobotSettings, name: str, target: Path, own: bool) -> bool:
    """Write the file, or ask first if it exists and this run did not write it."""
    if target.exists() and not own and not screen.may_replace:
        screen.ask(f"replace {target}? (y/n)")
        return False
    captured = screen.captured()
    save_calibration(target, name, robot.name, captured)
    left_out = [channel.name for channel in screen.channels if channel.name not in captured]
    screen.saved(f"saved {len(captured)} channels" + (f"; not complete: {', '.join(left_out)}" if left_out else ""))
    return True
