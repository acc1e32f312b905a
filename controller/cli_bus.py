"""``omote ports``, ``scan`` and ``simulate``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from controller.errors import ConfigError

console = Console(highlight=False)


def register(app: typer.Typer) -> None:
    """Add this module's commands to ``app``."""
    app.command()(ports)
    app.command()(scan)
    app.command("set-id")(set_id)
    app.command()(monitor)
    simulators = typer.Typer(no_args_is_help=True, help="Stand in for hardware on a pseudo-terminal.")
    simulators.command("dynamixel")(simulate_dynamixel)
    simulators.command("feetech")(simulate_feetech)
    simulators.command("maestro")(simulate_maestro)
    simulators.command("ssc32")(simulate_ssc32)
    simulators.command("robot")(simulate_robot)
    simulators.command("host")(simulate_host)
    app.add_typer(simulators, name="simulate")


def ports() -> None:
    """List the serial ports of this machine, and what to type where one cannot be used.

    Example: omote ports
    """
    from drivers.ports import list_ports

    found = list_ports()
    if not found:
        console.print("No serial port found. Plug the adapter in, or try: omote simulate dynamixel --link /tmp/head")
        return
    table = Table("port", "usb", "serial number", "description", "usable", "latency timer")
    for record in found:
        latency = "" if record.latency_s is None else f"{record.latency_s * 1000:g} ms"
        usable = "yes" if record.usable else "[red]no[/]"
        table.add_row(record.path, record.vid_pid, record.serial_number, record.description, usable, latency)
    console.print(table)
    for record in found:
        if record.hint:
            console.print(f"{record.device}: {record.hint}", soft_wrap=True)


def scan(
    port: Annotated[str, typer.Argument(help="Serial port; omote ports lists them.")],
    baud: Annotated[
        list[int] | None, typer.Option("--baud", help="Baud rate to try; may be repeated. All without it.")
    ] = None,
    protocol: Annotated[
        list[int] | None,
        typer.Option("--protocol", min=1, max=2, help="2 (Dynamixel X, XL-320) or 1 (AX, MX, Feetech). Both without."),
    ] = None,
) -> None:
    """Look for Dynamixel and Feetech servos on a port, at all rates and in both protocols; nothing moves.

    Example: omote scan /dev/ttyUSB0 --baud 1000000
    """
    from rich.progress import Progress

    from controller.scanning import STEPS, plan_scan, scan_port

    plan = plan_scan(baud, protocol or (2, 1))
    table = Table("baud", "prot.", "id", "model", "fw", "supply", "temp.", "error", "torque")
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(f"scanning {port}", total=len(plan) * STEPS)

        def tell(text: str, step: int) -> None:
            progress.update(task, description=text, completed=step)

        for found in scan_port(port, plan, tell):
            table.add_row(*found.row)
    if table.row_count:
        console.print(table)
    else:
        console.print(f"No servo answered on {port}. Check its power, the wiring and the adapter's direction switch.")


def set_id(
    port: Annotated[str, typer.Argument(help="Serial port; omote ports lists them.")],
    old: Annotated[int, typer.Argument(min=0, max=252, help="Id that the servo has.")],
    new: Annotated[int, typer.Argument(min=0, max=252, help="Id that it shall have.")],
    baud: Annotated[int, typer.Option(help="Baud rate it listens at; omote scan finds it.")] = 1_000_000,
    protocol: Annotated[
        int, typer.Option(min=1, max=2, help="2 for Dynamixel X and XL-320, 1 for AX, MX and Feetech.")
    ] = 2,
    release: Annotated[
        bool, typer.Option("--release", help="Switch its motor off first; support what it holds.")
    ] = False,
) -> None:
    """Give a servo another id. It is checked that nobody else has it, and that the change was kept.

    Example: omote set-id /dev/ttyUSB0 1 12
    """
    from drivers.rename import set_id as change

    info = change(port, baud, protocol, old, new, release=release)
    console.print(f"{info.model}: permanent id {old} -> {info.id}, written and read back on {port}")


def monitor(
    port: Annotated[str, typer.Argument(help="Serial port; omote ports lists them.")],
    baud: Annotated[int, typer.Option(help="Baud rate of the bus; omote scan finds it.")] = 1_000_000,
    protocol: Annotated[
        int, typer.Option(min=1, max=2, help="2 for Dynamixel X and XL-320, 1 for AX, MX and Feetech.")
    ] = 2,
    listen: Annotated[
        bool, typer.Option("--listen", help="Only listen: for a second adapter on a wire that another program drives.")
    ] = False,
    model: Annotated[str, typer.Option(help="With --listen: the servos' model, so that registers have names.")] = "",
    rate: Annotated[float, typer.Option(min=0.1, max=200, help="How often the servos are asked, per second.")] = 10.0,
    seconds: Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")] = None,
) -> None:
    """Show the servos of a bus and the decoded packets that pass, live; nothing is switched on or moved.

    Where the output is no terminal, the packets are printed line by line.

    Example: omote monitor /dev/ttyUSB0 --baud 57600
    """
    from controller.monitoring import ask
    from controller.monitoring import listen as only_listen
    from controller.run import Deadline
    from controller.signals import stop_flag

    deadline = Deadline(seconds)
    with stop_flag() as flag:

        def going() -> bool:
            return not flag.is_set() and deadline()

        if listen:
            only_listen(port, baud, protocol, console, going, model)
        else:
            ask(port, baud, protocol, console, going, rate)


def parse_ids(text: str) -> list[int]:
    """``1-3,7`` as [1, 2, 3, 7].

    Raises
    ------
    ConfigError
        naming the part that is no id or range of ids.
    """
    ids: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdigit() or (dash and not last.isdigit()):
            raise ConfigError(f"--ids {text}: {part.strip()!r} is no id", hint="for example --ids 1,3,7-9")
        ids += range(int(first), int(last or first) + 1)
    wrong = [i for i in ids if i > 252]
    if wrong or not ids or len(set(ids)) != len(ids):
        raise ConfigError(f"--ids {text}: ids go from 0 to 252, each once", hint="for example --ids 1-24")
    return ids


Link = Annotated[Path | None, typer.Option("--link", help="Make this path a link to the pseudo-terminal.")]
Tcp = Annotated[
    str | None, typer.Option("--tcp", metavar="HOST:PORT", help="Listen here; clients open socket://HOST:PORT.")
]
Wire = Annotated[bool, typer.Option("--wire", help="Bytes take the time they take at the baud rate.")]
Faults = Annotated[
    list[str] | None, typer.Option("--fault", metavar="SPEC", help="Fault to inject, for example mute:7; repeatable.")
]

Look = Annotated[bool, typer.Option("--watch", help="Show the servos and the decoded traffic while it runs.")]
Control = Annotated[Path | None, typer.Option("--control", help="Socket that takes faults while it runs.")]


def _where(link: Path | None, tcp: str | None) -> Path | str | None:
    """Where to serve: a link to a pseudo-terminal, or a TCP address."""
    if link is not None and tcp is not None:
        raise ConfigError("--link and --tcp do not go together", hint="run it twice for two ports")
    return link if tcp is None else f"socket://{tcp}"


def simulate_dynamixel(
    ids: Annotated[str, typer.Option("--ids", help="Ids of the servos: 1-24 or 1,3,7-9.")] = "1-24",
    model: Annotated[str, typer.Option(help="Model of the servos.")] = "xl330-m288",
    baud: Annotated[int, typer.Option(help="Baud rate the servos listen at.")] = 1_000_000,
    link: Link = None,
    tcp: Tcp = None,
    wire: Wire = False,
    fault: Faults = None,
    control: Control = None,
    watch: Look = False,
) -> None:
    """Serve simulated Dynamixel servos until interrupted; prints `ready PATH`. AX and MX models speak Protocol 1.0.

    Example: omote simulate dynamixel --ids 1-24 --model xl330-m288 --link /tmp/head
    """
    from controller.simulating import SimulatedId, serve_servos

    servos = [SimulatedId(i, model) for i in parse_ids(ids)]
    serve_servos(servos, baud, _where(link, tcp), wire, fault or [], console, control, watch)


def simulate_feetech(
    ids: Annotated[str, typer.Option("--ids", help="Ids of the servos: 1-24 or 1,3,7-9.")] = "1-6",
    model: Annotated[str, typer.Option(help="Model of the servos.")] = "sts3215",
    baud: Annotated[int, typer.Option(help="Baud rate the servos listen at.")] = 1_000_000,
    link: Link = None,
    tcp: Tcp = None,
    wire: Wire = False,
    fault: Faults = None,
    control: Control = None,
    watch: Look = False,
) -> None:
    """Serve simulated Feetech STS or SCS servos until interrupted; prints `ready PATH`.

    Example: omote simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    """
    from controller.simulating import SimulatedId, serve_servos

    servos = [SimulatedId(i, model) for i in parse_ids(ids)]
    serve_servos(servos, baud, _where(link, tcp), wire, fault or [], console, control, watch)


def simulate_maestro(link: Link = None, tcp: Tcp = None, fault: Faults = None, watch: Look = False) -> None:
    """Serve a simulated Pololu Maestro until interrupted; prints `ready PATH`.

    Example: omote simulate maestro --link /tmp/maestro
    """
    from controller.simulating import serve_board
    from drivers.sim import Maestro

    serve_board(Maestro(now_s=time.monotonic()), 115_200, _where(link, tcp), False, fault or [], console, watch)


def simulate_ssc32(link: Link = None, tcp: Tcp = None, fault: Faults = None, watch: Look = False) -> None:
    """Serve a simulated Lynxmotion SSC-32 until interrupted; prints `ready PATH`.

    Example: omote simulate ssc32 --link /tmp/ssc32
    """
    from controller.simulating import serve_board
    from drivers.sim import Ssc32

    serve_board(Ssc32(now_s=time.monotonic()), 115_200, _where(link, tcp), False, fault or [], console, watch)


def simulate_robot(
    robot: Annotated[str, typer.Argument(help="Robot: a name from configs/robots or a file.")],
    bus: Annotated[str | None, typer.Option("--bus", help="Name of the bus; the first without it.")] = None,
    link: Link = None,
    tcp: Tcp = None,
    wire: Wire = False,
    fault: Faults = None,
    watch: Look = False,
) -> None:
    """Serve the simulated servos or board of a robot file, until interrupted; prints `ready PATH`.

    Example: omote simulate robot head24 --link /tmp/head
    """
    from controller.simulating import serve_robot

    serve_robot(robot, bus, _where(link, tcp), wire, fault or [], console, watch)


def simulate_host(
    script: Annotated[str, typer.Argument(help="Script: a name from configs/scripts.")] = "tour",
    link: Link = None,
) -> None:
    """Serve a simulated robot host that writes omote line protocol, until interrupted; prints `ready PATH`.

    Example: omote simulate host tour --link /tmp/robot
    """
    from controller.simulating import serve_host

    serve_host(script, link, console)
