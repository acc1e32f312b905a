"""``omote ports``, ``scan``, ``set-id``, ``monitor`` and ``calibrate``: real buses and their servos."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress
from rich.table import Table

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from controller.cli.completion import models, names_of
from controller.cli.console import console, show_table

Port = Annotated[str, typer.Argument(help="Serial port; omote ports lists them.")]
Protocol = Annotated[
    int | None,
    typer.Option(min=1, max=2, help="2 (Dynamixel X, XL-320) or 1 (AX, MX, Feetech). Default: try both."),
]


def ports() -> None:
    """List the serial ports of this machine, and the command that fixes one that cannot be used.

    Example: omote ports
    """
    from drivers.port.ports import list_ports  # imported lazily: not needed for --help

    found = list_ports()
    if not found:
        console.print(
            "No serial port found. Plug the adapter in, or try: omote simulate dynamixel --link /tmp/head",
            soft_wrap=True,
        )
        return
    table = Table("port", "usb", "serial number", "description", "usable", "latency timer")
    for record in found:
        latency = "" if record.latency_s is None else f"{record.latency_s * 1000:g} ms"
        usable = "yes" if record.usable else "[red]no[/]"
        table.add_row(record.path, record.vid_pid, record.serial_number, record.description, usable, latency)
    show_table(table)
    for record in found:
        if record.hint:
            console.print(f"{record.device}: {record.hint}", soft_wrap=True)
        if record.lasting_hint:
            console.print(f"{record.device}, also after every restart: {record.lasting_hint}", soft_wrap=True)


def scan(
    port: Port,
    baud: Annotated[
        list[int] | None, typer.Option("--baud", help="Baud rate to try; may be repeated. Default: all.")
    ] = None,
    protocol: Annotated[
        list[int] | None,
        typer.Option("--protocol", min=1, max=2, help="2 (Dynamixel X, XL-320) or 1 (AX, MX, Feetech). Default: both."),
    ] = None,
) -> None:
    """Find the Dynamixel and Feetech servos on a port, at all baud rates and in both protocols; nothing moves.

    Example: omote scan /dev/ttyUSB0 --baud 1000000
    """
    from controller.tools.scan import STEPS, plan_scan, scan_port  # imported lazily: not needed for --help

    plan = plan_scan(baud, protocol or (2, 1))
    table = Table("baud", "prot.", "id", "model", "fw", "supply", "temp.", "error", "torque")
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(f"scanning {port}", total=len(plan) * STEPS)

        for found in scan_port(port, plan, lambda text, step: progress.update(task, description=text, completed=step)):
            table.add_row(*found.row)
    if table.row_count:
        show_table(table)
    else:
        console.print(
            f"No servo answered on {port}. Check its power, the wiring and the adapter's direction switch.",
            soft_wrap=True,
        )


def set_id(
    port: Port,
    old: Annotated[int, typer.Argument(min=0, max=252, help="Present id of the servo.")],
    new: Annotated[int, typer.Argument(min=0, max=252, help="New id of the servo.")],
    baud: Annotated[int, typer.Option(help="Baud rate of the servo; omote scan finds it.")] = 1_000_000,
    protocol: Protocol = None,
    release: Annotated[
        bool, typer.Option("--release", help="Disable its torque first; support the part that it holds.")
    ] = False,
) -> None:
    """Change the id of a servo. Checks that no other servo has the new id, and reads the change back.

    Example: omote set-id /dev/ttyUSB0 1 12
    """
    from drivers.tools.set_id import set_id as change  # imported lazily: not needed for --help

    info = change(port, baud, protocol, old, new, release=release)
    console.print(f"{info.model}: permanent id {old} -> {info.id}, written and read back on {port}", soft_wrap=True)


def monitor(
    port: Annotated[str, typer.Argument(help="Serial port; omote ports lists them. Omit it with --replay.")] = "",
    baud: Annotated[int, typer.Option(help="Baud rate of the bus; omote scan finds it.")] = 1_000_000,
    protocol: Protocol = None,
    listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing: for a second adapter on a bus that another program drives.")
    ] = False,
    model: Annotated[
        str, typer.Option(help="With --listen: model of the servos, which names the registers.", autocompletion=models)
    ] = "",
    rate: Annotated[float, typer.Option(min=0.1, max=200, help="Reads of the servos per second.")] = 10.0,
    seconds: Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")] = None,
    record: Annotated[
        Path | None, typer.Option("--record", help="Write the traffic to this file: .pcapng, else a text log.")
    ] = None,
    replay: Annotated[Path | None, typer.Option("--replay", help="Decode a recorded file instead of a port.")] = None,
) -> None:
    """Show the servos of a bus and its decoded packets, live; no torque is enabled and nothing moves.

    If the output is not a terminal, the packets are printed line by line.

    Example: omote monitor /dev/ttyUSB0 --baud 57600
    """
    # imported lazily: not needed for --help
    from controller.base.signals import stop_flag
    from controller.body.process import deadline
    from controller.tools.monitor import listen_to_bus, poll_servos, replay_traffic

    if bool(port) == (replay is not None):
        raise ConfigError("give either a port or --replay FILE", hint="omote ports lists the ports")
    if replay is not None:
        replay_traffic(replay, protocol, console, model)
        return
    in_time = deadline(seconds)
    with stop_flag() as flag:

        def keep_going() -> bool:
            return not flag.is_set() and in_time()

        if listen:
            listen_to_bus(port, baud, protocol, console, keep_going, model, record)
        else:
            poll_servos(port, baud, protocol, console, keep_going, rate, record)


def calibrate(
    robot: Annotated[
        str, typer.Argument(help="Robot: a name from configs/robots or a file.", autocompletion=names_of("robots"))
    ],
    name: Annotated[str, typer.Option("--name", "-n", help="Name of the calibration.")] = "default",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write. Default: beside the robot file.")
    ] = None,
    channel: Annotated[
        list[str] | None, typer.Option("--channel", "-c", help="Only this channel; may be repeated.")
    ] = None,
    margin: Annotated[
        float, typer.Option(min=0, max=20, help="Degrees by which the captured ends are moved inwards.")
    ] = 1.0,
    find_stops: Annotated[
        bool, typer.Option("--find-stops", help="Find the end stops by motor current, servo by servo; only reports.")
    ] = False,
    torque: Annotated[
        float, typer.Option(min=0.01, max=0.5, help="With --find-stops: fraction of the full torque to push with.")
    ] = 0.15,
    yes: Annotated[bool, typer.Option("--yes", help="With --find-stops: do not ask before servos move.")] = False,
    pairs: Annotated[
        Path | None,
        typer.Option("--pairs", help="Fit each channel's mix to this table of parameters and angles; nothing moves."),
    ] = None,
) -> None:
    """Capture the neutral and end positions of each servo of a robot, by hand or by keys, and save them by name.

    The torque is off until h is pressed: support what the servos hold. An existing file is only replaced after a
    question. With --find-stops each servo drives to both of its end stops, after a question.

    Example: omote calibrate head24 --name desk
    """
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS, did_you_mean
    from controller.robot.calibration import calibration_path
    from controller.robot.robot import load_robot
    from controller.tools.calibrate import run_calibration

    path = find_config("robots", robot)
    settings = load_robot(path, PARAMETERS)
    if pairs is not None:
        _fit_pairs(path, pairs, out or path)
        return
    known = [each.name for each in settings.channels]
    for word in channel or ():
        if word not in known:
            raise ConfigError(f"robot {settings.name} has no channel called {word!r}{did_you_mean(word, known)}")
    channels = [each for each in settings.channels if not channel or each.name in channel]
    if find_stops:
        from controller.cli import hardware  # imported lazily: not needed for --help

        hardware.find_stops(settings, channels, torque, margin, yes)
        return
    target = out or calibration_path(name, path)
    if run_calibration(settings, channels, name, target, margin, console):
        console.print(f"wrote {target}", soft_wrap=True)
        console.print(
            f'To use it, write in the robot file: calibration = "{name if out is None else target}"', soft_wrap=True
        )


def _fit_pairs(path: Path, pairs: Path, target: Path) -> None:
    """Fit the channels of the robot in ``path`` to pairs, write them to ``target`` and print how well they fit."""
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.robot.pairs.files import fit_channels, read_pairs, report_rows, write_robot
    from controller.robot.robot import load_robot, robot_parameters

    robot = load_robot(path, PARAMETERS)
    parameters = robot_parameters(robot, path, PARAMETERS)
    with console.status("fitting"):
        fitted = fit_channels(robot, read_pairs(pairs, robot, parameters))
        kept = write_robot(path, target, fitted, PARAMETERS) if any(not each.why_not for each in fitted) else None
    table = Table("channel", "moves", "error", "left out", "follows", "", title="degrees, rms", title_justify="left")
    for row in report_rows(fitted, parameters):
        table.add_row(*row)
    show_table(table)
    if all(each.why_not for each in fitted):
        raise ConfigError(f"{pairs}: determines no channel; nothing was written", hint="record faces that move them")
    if kept is not None:
        console.print(f"kept the old file as {kept}", soft_wrap=True)
    console.print(f"wrote {target}", soft_wrap=True)
