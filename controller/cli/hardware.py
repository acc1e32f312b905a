"""Commands that check robot hardware, find end stops, and generate files that start a robot at boot.

They are ``omote preflight``, ``omote calibrate --find-stops`` and ``omote service``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from controller.base.errors import ConfigError, ControllerError
from controller.base.paths import find_config
from controller.cli.completion import names_of
from controller.cli.console import console, show_table

if TYPE_CHECKING:
    from controller.robot.settings import ChannelSettings, RobotSettings

Robot = Annotated[
    str, typer.Argument(help="Robot: a name from configs/robots or a file.", autocompletion=names_of("robots"))
]


def preflight(
    robot: Robot,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Report to write: .toml or .json.")] = None,
    channel: Annotated[
        list[str] | None, typer.Option("--channel", "-c", help="Only this channel; may be repeated.")
    ] = None,
    amplitude_deg: Annotated[
        float, typer.Option("--by", min=1, max=15, help="Degrees that each servo moves to either side.")
    ] = 3.0,
    load: Annotated[
        float, typer.Option(min=0.05, max=0.9, help="Fraction of its stall torque at which a servo is stopped.")
    ] = 0.4,
    operator: Annotated[
        str, typer.Option(help="Name of the person who signs the report. If omitted, a terminal is asked for it.")
    ] = "",
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask nothing: neither before servos move nor which way they moved.")
    ] = False,
) -> None:
    """Check the servos of a robot against its file: read each one, then move it a little while all others are off.

    The report has model, supply voltage, limits, direction, range, load and delays. A question comes before anything
    moves. Ctrl-C, a load above --load or an error stops the moving servo and disables its torque.

    Example: omote preflight my-robot.toml -o preflight.toml
    """
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.hardware.preflight import Options, new_preflight, run_preflight
    from controller.hardware.preflight_report import check_report_path, preflight_table, write_preflight
    from controller.robot.robot import robot_parameters

    if out is not None:
        check_report_path(out)
    path, settings, channels = _robot(robot, channel)
    plan = f"{amplitude_deg:g} degrees to either side"
    _confirm_motion(f"{_count(len(channels), 'servo')} of {settings.name}, one after the other: {plan}.", yes)
    found = new_preflight(settings, path)
    try:
        run_preflight(
            settings,
            channels,
            found,
            robot_parameters(settings, path, PARAMETERS),
            _ask_direction_seen if not yes else lambda each, text: None,
            Options(amplitude_deg, load),
            lambda name: console.print(f"[dim]{name}[/]", soft_wrap=True),
        )
    finally:  # an error or Ctrl-C does not lose what was found before it
        if found.channels:
            show_table(preflight_table(found))
            for fault in found.faults:
                console.print(fault, style="red", markup=False, soft_wrap=True)
            if out is not None:
                write_preflight(found, out)
    found.signed_by = operator or ("" if yes else typer.prompt("Signed by (name, or empty)", default=""))
    if out is not None:
        write_preflight(found, out)
        console.print(f"wrote {out}" + ("" if found.signed_by else ", which nobody has signed"), soft_wrap=True)
    if not found.passed:
        skipped = [row.name for row in found.channels if row.skipped]
        parts = [_count(len(found.faults), "fault")] if found.faults else []
        parts += [f"not moved: {', '.join(skipped)}"] if skipped else []
        raise ControllerError(f"{settings.name}: {'; '.join(parts)}", hint="fix that and run omote preflight again")
    console.print(f"{settings.name} is as its file says.")


def find_stops(
    robot: RobotSettings, channels: Sequence[ChannelSettings], torque: float, margin_deg: float, yes: bool
) -> None:
    """Run ``omote calibrate --find-stops``: find and print the end stops of channels, one after the other.

    torque : fraction of a servo's full torque that pushes against a stop. yes : do not ask before servos move.

    Raises ControllerError: nobody agreed, or a servo does not fit the robot file.
    """
    from controller.hardware.stops import find_robot_stops, stops_table  # imported lazily: not needed for --help

    servos = f"{_count(len(channels), 'servo')} of {robot.name}"
    _confirm_motion(f"{servos}, one after the other: finding end stops with {100 * torque:.0f} % of the torque.", yes)
    found = find_robot_stops(
        robot, channels, torque=torque, progress=lambda text: console.print(f"[dim]{text}[/]", soft_wrap=True)
    )
    show_table(stops_table(found, channels, margin_deg))
    if faulty := [row.channel for row in found if row.faults]:
        raise ControllerError(
            f"{robot.name}: not as the file says: {', '.join(faulty)}",
            hint='set limit_deg to the values in the column "with margin", or check the servo',
        )


def service(
    stage: Annotated[
        str,
        typer.Argument(
            help="Stage file or robot file: a name from configs or a path.", autocompletion=names_of("stages")
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the files.")],
    user: Annotated[str, typer.Option(help="User that the service runs as.")] = "omote",
    name: Annotated[str, typer.Option(help="Name of the service. Default: the name of the stage or robot.")] = "",
) -> None:
    """Write the udev rules and the systemd unit that start a robot at boot, and print how to install them.

    The rules give every adapter a permanent name, a short latency timer and a group. The unit runs the stage headless
    with a watchdog and stops its servos safely. Nothing is installed.

    Example: omote service my-stage.toml -o service
    """
    from controller.hardware.service import write_service  # imported lazily: not needed for --help

    written, commands = write_service(stage, out, user, name)
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)
    console.print("To install it:", soft_wrap=True)
    for line in commands:
        console.print(f"  {line}", soft_wrap=True, markup=False)


def _robot(robot: str, names: Sequence[str] | None) -> tuple[Path, RobotSettings, list[ChannelSettings]]:
    """Return the robot's file, its settings and the named channels (all if ``names`` is empty); raises ConfigError."""
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS, did_you_mean
    from controller.robot.robot import load_robot

    path = find_config("robots", robot)
    settings = load_robot(path, PARAMETERS)
    known = [each.name for each in settings.channels]
    for word in names or ():
        if word not in known:
            raise ConfigError(f"robot {settings.name} has no channel called {word!r}{did_you_mean(word, known)}")
    return path, settings, [each for each in settings.channels if not names or each.name in names]


def _confirm_motion(plan: str, yes: bool) -> None:
    """Ask before servos move, unless ``yes``; raises ControllerError: there is no terminal, or the answer is no."""
    if yes:
        return
    if not _is_interactive():
        raise ControllerError("servos would move, and there is no terminal to ask first", hint="add --yes to move them")
    console.print(f"{plan} Keep hands clear of the robot and be ready to switch off the power.", soft_wrap=True)
    if not typer.confirm("Go on?"):
        raise ControllerError("nothing was moved")


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def _is_interactive() -> bool:
    """Whether standard input is a terminal, so that somebody can answer."""
    return sys.stdin.isatty()


def _ask_direction_seen(channel: ChannelSettings, text: str) -> bool | None:
    """Ask the operator whether the right part moved as ``text`` says; return None if they did not see it."""
    question = f"{channel.name}: did that part, and no other, move {text}? (y/n, s: not seen)"
    answer = str(typer.prompt(question, default="s"))[:1].lower()
    return {"y": True, "n": False}.get(answer)
