"""Runs a calibration: reads the buses and single key presses on the terminal, and draws the screen."""

from __future__ import annotations

import itertools
import os
import re
import select
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.live import Live

from controller.base.config import load
from controller.base.errors import ConfigError, ControllerError
from controller.base.files import NEWER
from controller.base.signals import stop_flag
from controller.robot.buses import BusSettings
from controller.robot.calibration import SUFFIX, CalibrationFile, CapturedAngles, rest_deg, save_calibration
from controller.robot.channels import servo_specs
from controller.robot.settings import ChannelSettings, RobotSettings
from controller.tools.calibrate_screen import CalibrationScreen
from drivers import open_bus
from drivers.base.bus import Bus
from drivers.base.errors import DriverError

ARROWS = {"[A": "up", "[B": "down", "[C": "right", "[D": "left", "OA": "up", "OB": "down", "OC": "right", "OD": "left"}

PERIOD_S = 0.03
"""Time that each cycle waits for keys."""
STALE_S = 0.5
"""An older angle counts as unknown. It is long enough for a single missed read not to matter."""
MAX_SPEED_RAD_S = 0.5
"""Limit of the speed of every servo during a calibration."""

BusChannels = tuple[Bus, NDArray[np.intp]]
"""A bus, and the indices of its channels among those of the calibration."""


def run_calibration(
    robot: RobotSettings, channels: Sequence[ChannelSettings], name: str, target: Path, margin_deg: float,
    console: Console,
) -> bool:  # fmt: skip
    """Let a person capture the angles of ``channels``; return whether the file was written.

    The torque is off whenever it ends. Channels in an existing ``target`` that are not captured now are kept. If a
    signal or an error ends it, unsaved angles are written to a new file beside ``target``.

    Raises DriverError or ControllerError.
    """
    before = _known_channels(target, robot)
    with ExitStack() as stack:
        ended = stack.enter_context(stop_flag())
        read_keys = stack.enter_context(keyboard())
        used = [bus for bus in robot.buses if any(channel.bus == bus.name for channel in channels)]
        buses = [_open_bus(stack, bus, channels) for bus in used]
        screen = CalibrationScreen(channels, all(bus.measures for bus, _ in buses), margin_deg)
        written = False
        title = f"{robot.name}, calibration {name!r}"
        try:
            with Live(screen.picture(title), console=console, auto_refresh=False, screen=True) as live:
                while not (screen.done or ended.is_set()):
                    try:
                        _cycle(buses, screen)
                    except DriverError as error:  # the captured angles are kept, and s saves them
                        screen.fail(f"{error}; torque is switched off; trying again")
                    live.update(screen.picture(title), refresh=True)
                    for key in read_keys(PERIOD_S):
                        screen.handle_key(key)
                    if screen.saving:
                        written |= _save(screen, robot, name, target, before, written)
        finally:
            if not screen.done:
                _save_aside(screen, robot, name, target, before, console)
    return written


def _known_channels(target: Path, robot: RobotSettings) -> dict[str, CapturedAngles]:
    """Return the channels of an existing calibration; none if it is of another robot, or damaged.

    Raises ConfigError: a newer omote has written it, and replacing it would lose what this omote cannot read.
    """
    try:
        found = load(target, CalibrationFile) if target.exists() else None
    except ConfigError as error:
        if NEWER in str(error):
            raise ConfigError(str(error), hint=f"{error.hint}, or save under another name: --name NAME") from error
        found = None
    if found is None or found.robot != robot.name:
        return {}
    known = {channel.name for channel in robot.channels}
    return {name: angles for name, angles in found.channels.items() if name in known}


def _open_bus(stack: ExitStack, bus: BusSettings, channels: Sequence[ChannelSettings]) -> BusChannels:
    indices = [i for i, channel in enumerate(channels) if channel.bus == bus.name]
    on_bus = [channels[i] for i in indices]
    specs = servo_specs(on_bus, np.radians([rest_deg(channel) + channel.trim_deg for channel in on_bus]))
    slow = [replace(spec, max_speed_rad_s=min(spec.max_speed_rad_s, MAX_SPEED_RAD_S)) for spec in specs]
    return stack.enter_context(open_bus(bus.kind, slow, **bus.options())), np.array(indices, dtype=np.intp)


def _cycle(buses: Sequence[BusChannels], screen: CalibrationScreen) -> None:
    """Switch the torque on or off as the screen says, move servos that hold, and read all angles."""
    angles = np.full(len(screen.channels), np.nan)
    for bus, indices in buses:
        if not bus.is_open:
            bus.reconnect()
        if screen.holding != bus.running:
            bus.start() if screen.holding else bus.stop()
        if screen.holding:
            bus.write(np.radians(screen.target_deg[indices]))
        measured = bus.read()
        known = (measured.age_s < STALE_S) | (not bus.measures)
        angles[indices] = np.degrees(np.where(known, measured.position_rad, np.nan))
    screen.set_angles(angles)


def _save(
    screen: CalibrationScreen, robot: RobotSettings, name: str, target: Path, before: Mapping[str, CapturedAngles],
    written: bool,
) -> bool:  # fmt: skip
    """Write the file, or ask first if it exists and this run has not ``written`` it; return whether it was written now.

    before : the channels that the file had when the run began.
    """
    captured = screen.captured()
    kept = len(before.keys() - captured.keys())
    if target.exists() and not written and not screen.may_replace:
        screen.ask(f"replace {target}{f' and keep {kept} other channels in it' if kept else ''}? (y/n)")
        return False
    try:
        save_calibration(target, name, robot.name, {**before, **captured})
    except ControllerError as error:  # the captured angles are kept, and s saves them once there is room
        screen.not_saved(f"not saved: {error}")
        return False
    wrong = screen.in_wrong_order()
    left_out = [each.name for each in screen.channels if each.name not in captured and each.name not in wrong]
    text = f"saved {len(captured)} channels"
    text += f"; not complete: {', '.join(left_out)}" if left_out else ""
    screen.saved(text + (f"; neutral is not between lowest and highest: {', '.join(wrong)}" if wrong else ""))
    return True


def _save_aside(
    screen: CalibrationScreen, robot: RobotSettings, name: str, target: Path, before: Mapping[str, CapturedAngles],
    console: Console,
) -> None:  # fmt: skip
    """Write angles that were captured and not saved, if any, to a new file beside ``target``, and print its path."""
    captured = screen.captured()
    if not screen.changed or not captured:
        return
    stem = target.name.removesuffix(SUFFIX if target.name.endswith(SUFFIX) else target.suffix)
    paths = (target.with_name(f"{stem}.unsaved{number or ''}{SUFFIX}") for number in itertools.count())
    free = next(path for path in paths if not path.exists())
    try:
        save_calibration(free, name, robot.name, {**before, **captured})
        text = f"ended before it was saved: the captured angles of {len(captured)} channels are in {free}"
    except ControllerError as error:
        text = f"ended before it was saved: {error}"
    with suppress(OSError):  # the terminal is gone
        console.print(text, soft_wrap=True, markup=False)


@contextmanager
def keyboard(descriptor: int | None = None) -> Iterator[Callable[[float], list[str]]]:
    """Yield a function that returns the keys pressed within a time (s).

    Keys are characters, ``up``, ``down``, ``left`` and ``right``.

    ``descriptor`` : of a terminal; None means standard input. The terminal's settings are restored at the end.

    Raises ControllerError: it is not a terminal.
    """
    fd = (sys.stdin.fileno() if sys.stdin is not None else -1) if descriptor is None else descriptor
    if not os.isatty(fd):
        raise ControllerError("keys can only be read from a terminal", hint="start omote in a terminal window")
    if sys.platform == "win32":
        yield _windows_keys
        return
    import termios  # not on Windows
    import tty  # not on Windows

    before = termios.tcgetattr(fd)
    tty.setcbreak(fd)
    try:
        yield partial(_terminal_keys, fd)
    finally:
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(fd, termios.TCSADRAIN, before)


def _terminal_keys(fd: int, wait_s: float) -> list[str]:
    end, data = time.monotonic() + wait_s, b""
    while select.select([fd], [], [], max(0.0, end - time.monotonic()))[0]:
        try:
            piece = os.read(fd, 64)
        except OSError:
            piece = b""
        if not piece:
            raise ControllerError("the terminal was closed", hint="start it again in another one")
        data += piece
    return split_keys(data.decode("utf-8", "ignore"))


def split_keys(text: str) -> list[str]:
    """Split the input of a terminal into keys; escape sequences of other keys are omitted."""
    keys = [ARROWS.get(key[1:], "") if key[0] == "\x1b" else key for key in re.findall("\x1b.{0,2}|.", text, re.DOTALL)]
    return [key for key in keys if key]


def _windows_keys(wait_s: float) -> list[str]:  # pragma: no cover
    import msvcrt  # Windows only

    names = {"H": "up", "P": "down", "M": "right", "K": "left"}
    end, keys = time.monotonic() + wait_s, []
    while time.monotonic() < end:
        if not msvcrt.kbhit():  # type: ignore[attr-defined]
            time.sleep(0.01)
            continue
        key = msvcrt.getwch()  # type: ignore[attr-defined]
        keys.append(names.get(msvcrt.getwch(), "") if key in ("\x00", "\xe0") else key)  # type: ignore[attr-defined]
    return [key for key in keys if key]
