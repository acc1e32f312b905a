"""``omote simulate``: hardware that is not there, at ports that any program can open."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from rich.console import Console

from controller.base.errors import ConfigError

if TYPE_CHECKING:
    from controller.tools.simulating import Serving

console = Console(highlight=False)


def register(app: typer.Typer) -> None:
    """Add this module's commands to ``app``."""
    simulators = typer.Typer(no_args_is_help=True, help="Stand in for hardware on a pseudo-terminal.")
    simulators.command("dynamixel")(simulate_dynamixel)
    simulators.command("feetech")(simulate_feetech)
    simulators.command("maestro")(simulate_maestro)
    simulators.command("ssc32")(simulate_ssc32)
    simulators.command("text")(simulate_text)
    simulators.command("omote")(simulate_omote)
    simulators.command("robot")(simulate_robot)
    simulators.command("host")(simulate_host)
    app.add_typer(simulators, name="simulate")


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


Ids = Annotated[str, typer.Option("--ids", help="Ids of the servos: 1-24 or 1,3,7-9.")]
Link = Annotated[Path | None, typer.Option("--link", help="Make this path a link to the pseudo-terminal.")]
Tcp = Annotated[
    str | None, typer.Option("--tcp", metavar="HOST:PORT", help="Listen here; clients open socket://HOST:PORT.")
]
Wire = Annotated[bool, typer.Option("--wire", help="Bytes take the time they take at the baud rate.")]
Latency = Annotated[
    float, typer.Option("--latency", min=0, max=1000, help="With --wire: latency timer of a USB adapter, in ms.")
]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", metavar="SPEC", help="Fault to inject, as mute:7 or drop:*:p=0.01; may be repeated."),
]
Look = Annotated[bool, typer.Option("--watch", help="Show the servos and the decoded traffic while it runs.")]
Control = Annotated[
    Path | None, typer.Option("--control", help="Socket that takes faults, and says how the servos are, while it runs.")
]
BoardBaud = Annotated[int, typer.Option("--baud", min=300, help="Baud rate of the board.")]


def _serving(
    link: Link = None,
    tcp: Tcp = None,
    wire: Wire = False,
    latency: Latency = 0.0,
    fault: Faults = None,
    control: Control = None,
    watch: Look = False,
) -> Serving:
    """Where and how to serve: a link to a pseudo-terminal, or a TCP address."""
    from controller.tools.simulating import Serving

    if link is not None and tcp is not None:
        raise ConfigError("--link and --tcp do not go together", hint="run it twice for two ports")
    if latency and not wire:
        raise ConfigError("--latency is part of the time on the wire", hint="add --wire")
    where = link if tcp is None else f"socket://{tcp}"
    return Serving(where, wire, latency / 1000.0, tuple(fault or ()), control, watch)


def _served(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options of :func:`_serving` for its first parameter, ``how``."""
    own, shared = _options(command)[1:], _options(_serving)

    def run(**given: Any) -> None:
        how = _serving(**{option.name: given.pop(option.name) for option in shared})
        command(how, **given)

    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__annotations__ = {}
    run.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    return run


def _options(command: Callable[..., Any]) -> list[inspect.Parameter]:
    """A function's parameters, their annotations as objects; that of ``how`` is no option."""
    hints = get_type_hints(command, localns={"Serving": object}, include_extras=True)
    return [p.replace(annotation=hints[p.name]) for p in inspect.signature(command).parameters.values()]


@_served
def simulate_dynamixel(
    how: Serving,
    ids: Ids = "1-24",
    model: Annotated[str, typer.Option(help="Model of the servos.")] = "xl330-m288",
    baud: Annotated[int, typer.Option(help="Baud rate the servos listen at.")] = 1_000_000,
) -> None:
    """Serve simulated Dynamixel servos until interrupted; prints `ready PATH`. AX and MX models speak Protocol 1.0.

    Example: omote simulate dynamixel --ids 1-24 --model xl330-m288 --link /tmp/head
    """
    from controller.tools.simulating import SimulatedId, serve_servos

    servos = [SimulatedId(i, model) for i in parse_ids(ids)]
    serve_servos(servos, baud, how, console)


@_served
def simulate_feetech(
    how: Serving,
    ids: Ids = "1-6",
    model: Annotated[str, typer.Option(help="Model of the servos.")] = "sts3215",
    baud: Annotated[int, typer.Option(help="Baud rate the servos listen at.")] = 1_000_000,
) -> None:
    """Serve simulated Feetech STS or SCS servos until interrupted; prints `ready PATH`.

    Example: omote simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    """
    from controller.tools.simulating import SimulatedId, serve_servos

    servos = [SimulatedId(i, model) for i in parse_ids(ids)]
    serve_servos(servos, baud, how, console)


@_served
def simulate_maestro(
    how: Serving,
    channels: Annotated[int, typer.Option(help="6 (Micro Maestro), 12, 18 or 24.")] = 24,
    device: Annotated[int, typer.Option(min=0, max=127, help="Device number, for the Pololu protocol.")] = 12,
    crc: Annotated[bool, typer.Option("--crc", help="Commands end with a CRC-7.")] = False,
    baud: BoardBaud = 115_200,
) -> None:
    """Serve a simulated Pololu Maestro until interrupted; prints `ready PATH`.

    Example: omote simulate maestro --link /tmp/maestro
    """
    from controller.tools.simulating import serve_board
    from drivers.sim import Maestro
    from drivers.sim.serving.families import MAESTRO_SIZES

    if channels not in MAESTRO_SIZES:
        raise ConfigError(f"--channels {channels}: no Maestro has so many", hint="6, 12, 18 or 24")
    board = Maestro(channels, time.monotonic(), device=device, crc=crc)
    serve_board(board, baud, how, console)


@_served
def simulate_ssc32(
    how: Serving,
    baud: BoardBaud = 115_200,
) -> None:
    """Serve a simulated Lynxmotion SSC-32 until interrupted; prints `ready PATH`.

    Example: omote simulate ssc32 --link /tmp/ssc32
    """
    from controller.tools.simulating import serve_board
    from drivers.sim import Ssc32

    serve_board(Ssc32(now_s=time.monotonic()), baud, how, console)


@_served
def simulate_text(
    how: Serving,
    template: Annotated[
        str, typer.Option("--template", help=r"One servo's move, as in a robot file; \n and \r end a line.")
    ] = r"#{ch}P{us}\r",
    off: Annotated[str, typer.Option(help="What switches one servo off.")] = r"#{ch}P0\r",
    query: Annotated[str, typer.Option(help="What asks for one servo.")] = "",
    answer: Annotated[str, typer.Option(help="What comes back; it goes with --query.")] = "",
    begin: Annotated[str, typer.Option(help="What stands before the moves of one line.")] = "",
    separator: Annotated[str, typer.Option(help="What stands between them.")] = "",
    end: Annotated[str, typer.Option(help="What stands behind them.")] = "",
    ids: Ids = "1-16",
    baud: BoardBaud = 115_200,
) -> None:
    """Serve a simulated board that reads lines of a template, until interrupted; prints `ready PATH`.

    Example: omote simulate text --template 'S{ch},{us}\\n' --off 'D{ch}\\n' --link /tmp/board
    """
    from controller.tools.simulating import serve_board
    from drivers.sim.boards.textboard import TextBoard

    texts = {"template": template, "off": off, "query": query, "answer": answer}
    texts |= {"begin": begin, "separator": separator, "end": end}
    texts = {name: text.replace(r"\r", "\r").replace(r"\n", "\n") for name, text in texts.items()}
    numbers = parse_ids(ids)
    board = TextBoard(texts=texts, names=[f"servo{i}" for i in numbers], ids=numbers, now_s=time.monotonic())
    serve_board(board, baud, how, console)


@_served
def simulate_omote(
    how: Serving,
    names: Annotated[str, typer.Option(help="What the head takes, with commas; all parameters without it.")] = "",
    baud: BoardBaud = 115_200,
) -> None:
    """Serve a simulated head that takes the omote line protocol, until interrupted; prints `ready PATH`.

    Example: omote simulate omote --names jawOpen,headYaw --link /tmp/head
    """
    from controller.base.parameters import PARAMETERS
    from controller.tools.simulating import serve_board
    from drivers.sim.boards.linehead import LineHead

    known = [name.strip() for name in names.split(",") if name.strip()] or [*PARAMETERS.names]
    serve_board(LineHead(known, time.monotonic()), baud, how, console)


@_served
def simulate_robot(
    how: Serving,
    robot: Annotated[str, typer.Argument(help="Robot: a name from configs/robots or a file.")],
    bus: Annotated[str | None, typer.Option("--bus", help="Name of the bus; the first without it.")] = None,
) -> None:
    """Serve the simulated servos or board of a robot file, until interrupted; prints `ready PATH`.

    Example: omote simulate robot head24 --link /tmp/head
    """
    from controller.tools.simulating import serve_robot

    serve_robot(robot, bus, how, console)


def simulate_host(
    script: Annotated[str, typer.Argument(help="Script: a name from configs/scripts.")] = "tour",
    link: Link = None,
) -> None:
    """Serve a simulated robot host that writes omote line protocol, until interrupted; prints `ready PATH`.

    Example: omote simulate host tour --link /tmp/robot
    """
    from controller.tools.simulating import serve_host

    serve_host(script, link, console)
