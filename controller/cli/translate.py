"""``omote translate``: forwards faces from one program to another in another format."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape


def translate(
    source: Annotated[str, typer.Argument(metavar="IN", help="KIND:ADDRESS to receive from, or the path of a take.")],
    target: Annotated[str, typer.Argument(metavar="OUT", help="KIND:ADDRESS to send to.")],
    seconds: Annotated[float | None, typer.Option("--seconds", "-s", min=0.1, help="Stop after this long.")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="Swap left and right.")] = False,
    connect: Annotated[
        bool, typer.Option("--connect", help="Connect to the address of IN (TCP) instead of listening there.")
    ] = False,
    baud: Annotated[int, typer.Option(help="Baud rate of serial ports.", min=300)] = 115_200,
    open_to_network: Annotated[
        bool, typer.Option("--open-to-network", help="Let IN listen at an address that other machines reach.")
    ] = False,
    token: Annotated[
        str | None,
        typer.Option(
            "--token", envvar="OMOTE_TOKEN", help="Token that IN demands and OUT sends first, as a shared password."
        ),
    ] = None,
    vocabulary: Annotated[
        list[str] | None, typer.Option("--vocabulary", help="File with parameters of your own; may be repeated.")
    ] = None,
) -> None:
    """Receive faces in one format and send them in another, without a stage, a picture or servos.

    An address is HOST:PORT, udp:HOST:PORT, tcp:HOST:PORT, a serial port, or - for standard input or output. If it is
    omitted, it is the usual port of the kind on this machine. `omote plugins` lists the kinds.

    Example: omote translate livelink:127.0.0.1:11111 vmc:127.0.0.1:39539
    """
    # imported lazily: not needed for --help
    from controller.base.parameters import PARAMETERS
    from controller.base.paths import find_config
    from controller.tools.translate import Options
    from controller.tools.translate import translate as run

    console = Console(stderr=True, highlight=False, emoji=False, soft_wrap=True)  # messages may go to standard output
    options = Options(mirror, connect, baud, open_to_network, token, seconds)
    parameters = PARAMETERS.with_files(find_config("vocabularies", name) for name in vocabulary or ())
    counts = run(source, target, parameters, options, lambda text: console.print(escape(f"{text}; Ctrl-C ends")))
    console.print(escape(str(counts)))
