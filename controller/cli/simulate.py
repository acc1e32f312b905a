"""``omote simulate``: serves simulated hardware at ports that any program can open."""

from __future__ import annotations

import difflib
import inspect
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperGroup

from controller.base.errors import ConfigError
from controller.cli.completion import models, names_of
from controller.cli.console import console
from drivers.base.errors import PluginError
from drivers.base.options import REQUIRED, Entry, entries

if TYPE_CHECKING:
    from controller.tools.simulate import Serving  # imported lazily: not needed for --help

log = logging.getLogger(__name__)


class _Simulators(TyperGroup):
    """The commands of this module, and one for each bus family (kind of servo or board) that has a simulator."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands; a family that cannot be loaded is logged and omitted."""
        # imported lazily: most commands need no families
        from drivers.core.registry import FAMILIES
        from drivers.sim.wire.simulator import simulator_of

        kinds = []
        for family in FAMILIES.all():
            if family.simulator:
                try:
                    simulator_of(family.kind)
                    kinds.append(family.kind)
                except PluginError as error:
                    log.warning("%s", error)
        return [*kinds, *super().list_commands(ctx)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command called ``cmd_name``, or None."""
        from drivers.core.registry import kinds  # imported lazily: most commands need no families

        if cmd_name in self.commands or cmd_name not in kinds():
            return self.commands.get(cmd_name)
        app = typer.Typer(add_completion=False)
        app.command(cmd_name)(_simulate_family(cmd_name))
        return typer.main.get_command(app)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the arguments name; an unknown one is refused with the most similar name."""
        from drivers.core.registry import kinds  # imported lazily: most commands need no families

        known = [*kinds(), *self.commands]
        close = difflib.get_close_matches(args[0], known, n=1) if args and args[0] not in known else []
        if close:
            ctx.fail(f"No such command {args[0]!r}. Did you mean {close[0]!r}?")
        return super().resolve_command(ctx, args)


def make_app() -> typer.Typer:
    """Return the group of all commands of ``omote simulate``."""
    simulators = typer.Typer(cls=_Simulators, no_args_is_help=True, help="Simulate hardware on a pseudo-terminal.")
    simulators.command("robot")(simulate_robot)
    simulators.command("host")(simulate_host)
    simulators.command("record")(simulate_record)
    return simulators


Link = Annotated[Path | None, typer.Option("--link", help="Make this path a link to the pseudo-terminal.")]
Tcp = Annotated[
    str | None, typer.Option("--tcp", metavar="HOST:PORT", help="Listen here; clients open socket://HOST:PORT.")
]
Rfc2217 = Annotated[
    str | None,
    typer.Option("--rfc2217", metavar="HOST:PORT", help="Listen here; clients open rfc2217://HOST:PORT."),
]
Script = Annotated[Path | None, typer.Option("--script", help="File with a timeline of faults.")]
Record = Annotated[
    Path | None, typer.Option("--record", help="Write the traffic to this file: .pcapng, else a text log.")
]
Wire = Annotated[bool, typer.Option("--wire", help="Delay bytes by their transmission time at the baud rate.")]
Latency = Annotated[
    float, typer.Option("--latency", min=0, max=1000, help="With --wire: latency timer of a USB adapter (ms).")
]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", metavar="SPEC", help="Fault to inject, as mute:7 or drop:*:p=0.01; may be repeated."),
]
Watch = Annotated[bool, typer.Option("--watch", help="Show the servos and the decoded traffic while it runs.")]
Control = Annotated[
    Path | None,
    typer.Option("--control", help="Unix socket to create, which accepts faults and reports the servos while it runs."),
]


def _serving(
    link: Link = None,
    tcp: Tcp = None,
    rfc2217: Rfc2217 = None,
    wire: Wire = False,
    latency: Latency = 0.0,
    fault: Faults = None,
    control: Control = None,
    watch: Watch = False,
    script: Script = None,
    record: Record = None,
) -> Serving:
    """Return where and how to serve. Raises ConfigError: options exclude each other."""
    from controller.tools.simulate import Serving  # imported lazily: not needed for --help

    endpoints = {"--link": link, "--tcp": tcp, "--rfc2217": rfc2217}
    if len(given := [name for name, endpoint in endpoints.items() if endpoint is not None]) > 1:
        raise ConfigError(f"{' and '.join(given)} exclude each other", hint="run it twice for two ports")
    if latency and not wire:
        raise ConfigError("--latency is part of the time on the wire", hint="add --wire")
    where = f"socket://{tcp}" if tcp else f"rfc2217://{rfc2217}" if rfc2217 else link
    return Serving(where, wire, latency / 1000.0, tuple(fault or ()), control, watch, script, record)


def _add_serving(command: Callable[..., None], own: list[inspect.Parameter] | None = None) -> Callable[..., None]:
    """Return a command that has the options of :func:`_serving` instead of its first parameter, ``how``.

    own : the other options; by default, the other parameters of ``command``.
    """
    own, shared = _options(command)[1:] if own is None else own, _options(_serving)

    def run(**given: Any) -> None:
        how = _serving(**{option.name: given.pop(option.name) for option in shared})
        command(how, **given)

    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__annotations__ = {}
    run.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
    return run


def _options(command: Callable[..., Any]) -> list[inspect.Parameter]:
    """Return a function's parameters, with annotations that are objects and not text."""
    hints = get_type_hints(command, localns={"Serving": object}, include_extras=True)
    return [p.replace(annotation=hints[p.name]) for p in inspect.signature(command).parameters.values()]


def _simulate_family(kind: str) -> Callable[..., None]:
    """Return the command that serves the simulator of a family."""
    from controller.base.schema import from_command_line  # imported lazily: not needed for --help
    from controller.tools.simulate import serve_alone
    from drivers.core.registry import FAMILIES
    from drivers.sim.wire.simulator import simulator_of

    simulator = simulator_of(kind)

    def command(how: Serving, **given: Any) -> None:
        serve_alone(kind, from_command_line(simulator.options, given), how, console)

    command.__doc__ = simulator.help
    defaults = {"baud": FAMILIES.get(kind).baud}
    return _add_serving(command, [_parameter(entry, defaults.get(entry.name)) for entry in entries(simulator.options)])


def _parameter(entry: Entry, default: Any) -> inspect.Parameter:
    """Return an option of a simulator as an option of the command; ``default``, unless None or 0, replaces its own."""
    limits, name = entry.option, entry.name.replace("_", "-")
    flag = f"--{name}/--no-{name}" if entry.default is True else f"--{name}"
    complete = models if entry.name == "model" else None
    shown = typer.Option(flag, min=limits.at_least, max=limits.at_most, help=limits.help, autocompletion=complete)
    kind, empty = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.empty
    default = default or (empty if entry.default is REQUIRED else entry.default)
    return inspect.Parameter(entry.name, kind, default=default, annotation=Annotated[entry.type, shown])


@_add_serving
def simulate_robot(
    how: Serving,
    robot: Annotated[
        str, typer.Argument(help="Robot: a name from configs/robots or a file.", autocompletion=names_of("robots"))
    ],
    bus: Annotated[
        str | None, typer.Option("--bus", help="Name of the bus. Default: the first one of the file.")
    ] = None,
) -> None:
    """Serve the simulated servos or board of a robot file, until interrupted; prints `ready PATH`.

    Example: omote simulate robot head24 --link /tmp/head
    """
    from controller.tools.simulate import serve_robot  # imported lazily: not needed for --help

    serve_robot(robot, bus, how, console)


@_add_serving
def simulate_record(
    how: Serving,
    file: Annotated[Path, typer.Argument(help="Record of traffic, from --record of this command or of omote monitor.")],
) -> None:
    """Serve a recorded bus: each request gets the answers of the record; prints `ready PATH`, and counts at the end.

    Example: omote simulate record desk.log --link /tmp/head
    """
    from controller.tools.simulate import serve_record  # imported lazily: not needed for --help

    serve_record(file, how, console)


def simulate_host(
    script: Annotated[
        str, typer.Argument(help="Script: a name from configs/scripts.", autocompletion=names_of("scripts"))
    ] = "tour",
    link: Link = None,
) -> None:
    """Serve a simulated robot host that sends the commands of a script (omote line protocol), until interrupted.

    It prints `ready PATH` first.

    Example: omote simulate host tour --link /tmp/robot
    """
    from controller.tools.simulate import serve_host  # imported lazily: not needed for --help

    serve_host(script, link, console)
