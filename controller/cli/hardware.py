"""``omote preflight``, ``service`` and ``calibrate --find-stops``: a head before it acts, and with its computer."""

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
    by: Annotated[float, typer.Option(min=1, max=15, help="Degrees that each servo moves to either side.")] = 3.0,
    load: Annotated[
        float, typer.Option(min=0.05, max=0.9, help="Share of its stall torque at which a servo stops.")
    ] = 0.4,
    operator: Annotated[str, typer.Option(help="Who stands for the report; asked for on a terminal.")] = "",
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask, not for the direction either.")] = False,
) -> None:
    """Check a head against its file: each servo is looked at, then moves a little by itself, all others off.

    Reported are model, supply, limits, direction, range, load and delays. It asks before anything moves. Ctrl-C, load
    or an error stops the servo that moves and switches it off.

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
    _ask_first(
        f"{_count(len(channels), 'servo')} of {settings.name}, one after the other: {by:g} degrees to either side.", yes
    )
    found = new_preflight(settings, path)
    try:
        run_preflight(
            settings,
            channels,
            found,
            robot_parameters(settings, path, PARAMETERS),
            _say_seen if not yes else lambda each, text: None,
            Options(by, load),
            lambda name: console.print(f"[dim]{name}[/]", soft_wrap=True),
        )
    finally:  # also what was found until an error or Ctrl-C
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
        raise ControllerError(f"{settings.name}: {'; '.join(parts)}", hint="mend that and run omote preflight again")
    console.print(f"{settings.name} is as its file says.")


def look_for_stops(
    robot: RobotSettings, channels: Sequence[ChannelSettings], torque: float, margin_deg: float, yes: bool
) -> None:
    """``omote calibrate --find-stops``; raises ControllerError where something does not fit."""
    from controller.hardware.stops import find_robot_stops, stops_table  # imported lazily: not needed for --help

    servos = f"{_count(len(channels), 'servo')} of {robot.name}"
    what = f"{servos}, one after the other: looking for end stops with {100 * torque:.0f} % of the torque."
    _ask_first(what, yes)
    found = find_robot_stops(
        robot, channels, torque=torque, progress=lambda text: console.print(f"[dim]{text}[/]", soft_wrap=True)
    )
    show_table(stops_table(found, channels, margin_deg))
    if faulty := [row.channel for row in found if row.faults]:
        raise ControllerError(
            f"{robot.name}: not as the file says: {', '.join(faulty)}",
            hint='set limit_deg to what stands under "with margin", or look at the servo',
        )


def service(
    what: Annotated[
        str, typer.Argument(help="Robot or stage: a name from configs or a file.", autocompletion=names_of("stages"))
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the files.")],
    user: Annotated[str, typer.Option(help="User that the service runs as.")] = "omote",
    name: Annotated[str, typer.Option(help="Name of the service; default: that of the stage or robot.")] = "",
) -> None:
    """Write udev rules and a systemd unit with which a head starts with its computer, and the commands to install them.

    The rules give every adapter a name that stays, a short latency timer and a group; the unit runs the stage without a
    picture, watches it and stops its servos safely. Nothing is installed.

    Example: omote service my-stage.toml -o service
    """
    from controller.hardware.service import write_service  # imported lazily: not needed for --help

    written, commands = write_service(what, out, user, name)
    for path in written:
        console.print(f"wrote {path}", soft_wrap=True)
    console.print("To install it:", soft_wrap=True)
    for line in commands:
        console.print(f"  {line}", soft_wrap=True, markup=False)


def _robot(robot: str, names: Sequence[str] | None) -> tuple[Path, RobotSettings, list[ChannelSettings]]:
    """The file, the settings and the channels that were asked for; raises ConfigError."""
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


def _ask_first(what: str, yes: bool) -> None:
    """Ask before anything moves; raises ControllerError where there is nobody to ask, or the answer is no."""
    if yes:
        return
    if not _is_asked():
        raise ControllerError("servos would move, and there is no terminal to ask first", hint="add --yes to move them")
    console.print(f"{what} Keep hands away, and a hand at the power switch.", soft_wrap=True)
    if not typer.confirm("Go on?"):
        raise ControllerError("nothing was moved")


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def _is_asked() -> bool:
    """Whether there is somebody to ask."""
    return sys.stdin.isatty()


def _say_seen(channel: ChannelSettings, text: str) -> bool | None:
    """Ask whoever watches; None where they did not see it."""
    question = f"{channel.name}: did that part, and no other, move {text}? (y/n, s: not seen)"
    answer = str(typer.prompt(question, default="s"))[:1].lower()
    return {"y": True, "n": False}.get(answer)
