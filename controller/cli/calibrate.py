"""``omote calibrate``."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from controller.cli.console import console

if TYPE_CHECKING:
    from controller.robot.settings import ChannelSettings, RobotSettings  # start-up: --help does without it


def register(app: typer.Typer) -> None:
    """Add this module's command to ``app``."""
    app.command()(calibrate)


def calibrate(
    robot: Annotated[str, typer.Argument(help="Robot: a name from configs/robots or a file.")],
    name: Annotated[str, typer.Option("--name", "-n", help="Name of the calibration.")] = "default",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; beside the robot file without it.")
    ] = None,
    channel: Annotated[
        list[str] | None, typer.Option("--channel", "-c", help="Only this channel; may be repeated.")
    ] = None,
    margin: Annotated[float, typer.Option(min=0, max=20, help="Degrees kept away from the captured ends.")] = 1.0,
) -> None:
    """Capture where each servo of a head has its neutral and its ends, by hand or by keys, and save it by name.

    The motors are off until h is pressed: support what they hold. A file that exists is only replaced after a question.

    Example: omote calibrate head24 --name desk
    """
    from controller.base.parameters import PARAMETERS  # start-up: --help does without it
    from controller.robot.calibration import calibration_path  # start-up: --help does without it
    from controller.robot.robot import load_robot  # start-up: --help does without it
    from controller.tools.calibrate import run_calibration  # start-up: --help does without it

    path = find_config("robots", robot)
    settings = load_robot(path, PARAMETERS)
    channels = _chosen(settings, channel)
    target = out or calibration_path(name, path)
    with ExitStack() as stack:
        written = run_calibration(stack, settings, channels, name, target, margin, console)
    if written:
        console.print(f"wrote {target}", soft_wrap=True)
        console.print(
            f'The robot file takes it with: calibration = "{name if out is None else target}"', soft_wrap=True
        )


def _chosen(robot: RobotSettings, names: list[str] | None) -> Sequence[ChannelSettings]:
    from controller.base.parameters import did_you_mean  # start-up: --help does without it

    known = [channel.name for channel in robot.channels]
    for name in names or ():
        if name not in known:
            raise ConfigError(f"robot {robot.name} has no channel called {name!r}{did_you_mean(name, known)}")
    return [channel for channel in robot.channels if not names or channel.name in names]
