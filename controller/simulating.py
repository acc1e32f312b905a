"""Serving simulated hardware until interrupted, for ``omote simulate``."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from controller.errors import ConfigError
from controller.parameters import PARAMETERS
from controller.paths import find_config
from controller.robot import load_robot
from controller.signals import stop_flag
from controller.watching import Watch
from drivers.traffic import Decoder

if TYPE_CHECKING:
    from drivers.sim.serve import PtyServer


@dataclass(frozen=True)
class SimulatedId:
    """A servo to simulate: ``id`` on the bus and vendor ``model`` name."""

    id: int
    model: str


def serve_servos(
    servos: list[SimulatedId],
    baud: int,
    link: Path | None,
    wire: bool,
    faults: list[str],
    console: Console,
    control: Path | None = None,
    watch: bool = False,
) -> None:
    """Serve simulated servos; prints ``ready PATH`` and returns when interrupted.

    Parameters
    ----------
    servos : ids and models; the model decides the protocol.
    baud : rate the servos listen at.
    link : path that becomes a link to the pseudo-terminal.
    wire : bytes take the time they take at ``baud``.
    faults : faults to inject, see docs/simulated-buses.md.
    control : path of a socket that takes faults while it runs.
    watch : show the servos and the traffic while it runs.
    """
    from drivers.dynamixel.tables import load_table
    from drivers.sim import serve_dynamixel
    from drivers.traffic import Decoder1, Decoder2

    tables = {servo.id: load_table(servo.model) for servo in servos}
    decoder = (Decoder1 if any(table.protocol == 1 for table in tables.values()) else Decoder2)(tables)

    def ready(path: str) -> None:
        console.print(f"ready {link or path}", soft_wrap=True)

    with _watching(decoder if watch else None, console) as look:
        _until_stopped(
            lambda stop: serve_dynamixel(
                servos,
                baud=baud,
                link=link,
                wire=wire,
                faults=faults,
                on_ready=ready,
                commands=control,
                stop=stop,
                on_server=look,
            )
        )


@contextmanager
def _watching(decoder: Decoder | None, console: Console) -> Iterator[Callable[[PtyServer], None]]:
    """Gives what begins to watch a server; the view ends with the block. Without a decoder nobody watches."""
    over = threading.Event()
    threads: list[threading.Thread] = []

    def look(server: PtyServer) -> None:
        if decoder is None:
            return

        def rows() -> list[dict[str, Any]]:
            with server.chain.lock:
                return server.chain.describe(time.monotonic())

        watch = Watch(f"simulated bus on {server.port.path}", rows, decoder, console)
        server.tap = watch.tap
        threads.append(threading.Thread(target=watch.run, args=(lambda: not over.is_set(),)))
        threads[-1].start()

    try:
        yield look
    finally:
        over.set()
        for thread in threads:
            thread.join()


def serve_board(board: str, link: Path | None, faults: list[str], console: Console, watch: bool = False) -> None:
    """Serve a simulated servo board, ``maestro`` or ``ssc32``; prints ``ready PATH`` and returns when interrupted."""
    from drivers.sim import Maestro, Ssc32, serve
    from drivers.traffic import HexDecoder, TextDecoder

    decoder = HexDecoder() if board == "maestro" else TextDecoder()
    made = {"maestro": Maestro, "ssc32": Ssc32}[board](now_s=time.monotonic(), faults=faults)

    def ready(path: str) -> None:
        console.print(f"ready {link or path}", soft_wrap=True)

    with _watching(decoder if watch else None, console) as look:
        _until_stopped(lambda stop: serve(made, link=link, on_ready=ready, stop=stop, on_server=look))


def robot_servos(name: str, bus: str | None) -> tuple[list[SimulatedId], int]:
    """The servos on one bus of a robot file, and its baud rate; the first bus without a name.

    Raises
    ------
    ConfigError
        when the file is wrong or has no such bus.
    """
    robot = load_robot(find_config("robots", name), PARAMETERS)
    names = [entry.name for entry in robot.buses]
    if bus is not None and bus not in names:
        raise ConfigError(f"robot {robot.name} has no bus called {bus!r}", hint=f"its buses: {', '.join(names)}")
    chosen = robot.buses[names.index(bus) if bus else 0]
    return [SimulatedId(channel.id, channel.model) for channel in robot.on_bus(chosen.name)], chosen.baud


def serve_host(script: str, link: Path | None, console: Console) -> None:
    """Serve a simulated robot host; prints ``ready PATH``, returns when interrupted and says what it counted.

    Raises
    ------
    ConfigError
        when the script is unknown or wrong.
    """
    from controller.host import HostPort, RobotHost, load_script

    loaded = load_script(script, PARAMETERS)
    with HostPort(link) as port, stop_flag() as flag:
        console.print(f"ready {link or port.path}", soft_wrap=True)
        host = RobotHost(port, loaded, PARAMETERS)
        host.run(lambda: not flag.is_set())
        counts = host.report()
    console.print(f"{counts['sent']} lines sent, {counts['accepted']} accepted, {counts['refused']} refused")


def _until_stopped(serve: Callable[[int], None]) -> None:
    """Run ``serve(stop)`` until SIGINT or SIGTERM; the descriptor ``stop`` becomes readable then."""
    reading, writing = os.pipe()

    def note(_number: int, _frame: object) -> None:
        os.write(writing, b"x")

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        serve(reading)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(reading)
        os.close(writing)
