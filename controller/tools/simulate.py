"""Serves simulated servos, boards and robot hosts until interrupted, for ``omote simulate``."""

from __future__ import annotations

import signal
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.base.signals import stop_flag, was_interrupted
from controller.links.line.host import RobotHost
from controller.links.line.hostport import HostPort
from controller.links.line.script import load_script
from controller.robot.buses import SIMULATION, BusSettings
from controller.robot.channels import servo_specs
from controller.robot.fault_script import load_fault_script
from controller.robot.robot import load_robot
from controller.robot.settings import ChannelSettings
from controller.tools.monitor import BusView
from controller.tools.traffic_files import Tap, TrafficWriter, combine_taps, decoder_of, read_traffic
from drivers import open_bus
from drivers.core.traffic import Decoder
from drivers.core.trafficlog import Wire
from drivers.sim.serving.replay import Replay
from drivers.sim.serving.serve import PortServer, serve
from drivers.sim.servos.chain import Chain
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Setting, make_line, simulator_of


@dataclass(frozen=True)
class Serving:
    """Options of a server.

    link : path of a symbolic link to the pseudo-terminal, or ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT`` to
        listen at instead.
    wire : delay bytes by their transmission time at the baud rate. latency_s : latency timer of a USB adapter, added.
    faults : faults to inject, see docs/simulated-buses.md. control : path of a socket that takes faults while it runs.
    watch : show the servos and the traffic while it runs.
    script : timeline of faults. record : file for the traffic.
    """

    link: Path | str | None = None
    wire: bool = False
    latency_s: float = 0.0
    faults: tuple[str, ...] = ()
    control: Path | None = None
    watch: bool = False
    script: Path | None = None
    record: Path | None = None


def serve_alone(kind: str, options: Any, how: Serving, console: Console) -> None:
    """Serve the simulator of a family with its ``options``; prints ``ready PATH`` and returns when interrupted.

    Raises DriverError for options that do not fit, or a port that cannot be made.
    """
    simulator = simulator_of(kind)
    setting = Setting(now_s=time.monotonic(), baud=options.baud, names=PARAMETERS.names)
    line = simulator.alone(options, setting)
    _serve(line, wire_of(line, kind, options.baud), how, console, simulator.decoder(line))


def wire_of(line: Line, family: str, baud: int) -> Wire:
    """Return the description of a simulated bus for the header of a traffic record."""
    return Wire(family, baud, {servo.id: servo.table.model for servo in line.servos} if isinstance(line, Chain) else {})


def serve_record(path: Path, how: Serving, console: Console) -> None:
    """Serve a recorded bus; prints ``ready PATH``, and its counts when it is interrupted.

    Raises ConfigError or DriverError: the record cannot be read, or contains no request with an answer.
    """
    record = read_traffic(path)
    line = Replay(record)
    _serve(line, record.wire, how, console, decoder_of(record))
    console.print(f"{line.requests} requests, {line.unknown} of them not in the record", soft_wrap=True)


def _serve(line: Line, wire: Wire, how: Serving, console: Console, decoder: Decoder) -> None:
    def attach_taps(server: PortServer) -> None:
        taps: list[Tap] = [stack.enter_context(TrafficWriter(how.record, wire)).tap] if how.record else []
        server.tap = combine_taps(*taps, *([start_view(server)] if how.watch else []))

    def start_view(server: PortServer) -> Tap:
        def rows() -> list[dict[str, Any]]:
            with server.line.lock:
                return server.line.describe(time.monotonic())

        view = BusView(f"simulated bus on {server.port.path}", rows, decoder, console)
        over = threading.Event()
        thread = threading.Thread(target=view.run, args=(lambda: not over.is_set(),))
        stack.callback(thread.join)
        stack.callback(over.set)
        thread.start()
        return view.tap

    timeline = load_fault_script(how.script) if how.script else None
    line.faults.add(how.faults, time.monotonic())
    with ExitStack() as stack, _stop_socket() as stop:
        serve(
            line,
            how.link,
            lambda path: console.print(f"ready {path}", soft_wrap=True),
            baud=wire.baud,
            wire=how.wire,
            latency_s=how.latency_s,
            commands=how.control,
            timeline=timeline,
            stop=stop,
            on_server=attach_taps,
        )


@contextmanager
def _stop_socket() -> Iterator[socket.socket]:
    """Yield a socket that becomes readable on SIGINT or SIGTERM.

    The interpreter writes to it at the moment of the signal. A handler in Python would run only after the call that
    waits for the socket, and that call would wait forever if the signal came just before it.
    """
    reading, writing = socket.socketpair()
    writing.setblocking(False)
    before = {number: signal.signal(number, lambda *_: None) for number in (signal.SIGINT, signal.SIGTERM)}
    wakeup = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
    if was_interrupted(before[signal.SIGINT]):
        writing.send(b"\0")
    try:
        yield reading
    finally:
        signal.set_wakeup_fd(wakeup)
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)  # None: not set from Python
        reading.close()
        writing.close()


def robot_bus(name: str, bus: str | None) -> tuple[BusSettings, list[ChannelSettings]]:
    """Return the bus called ``bus`` of a robot file, or the first if it is None, and the channels on it.

    Raises ConfigError: the file is wrong or has no such bus.
    """
    robot = load_robot(find_config("robots", name), PARAMETERS)
    names = [entry.name for entry in robot.buses]
    if bus is not None and bus not in names:
        raise ConfigError(f"robot {robot.name} has no bus called {bus!r}", hint=f"its buses: {', '.join(names)}")
    chosen = robot.buses[names.index(bus) if bus else 0]
    return chosen, robot.on_bus(chosen.name)


def serve_robot(name: str, bus: str | None, how: Serving, console: Console) -> None:
    """Serve simulated servos for a bus of a robot file (:func:`robot_bus`), with the settings its driver expects."""
    chosen, channels = robot_bus(name, bus)
    simulator = simulator_of(chosen.family)  # first, since its error is clearer where the family is not installed
    line = far_end(chosen, channels)
    _serve(line, wire_of(line, chosen.family, chosen.baud), how, console, simulator.decoder(line))


def far_end(bus: BusSettings, channels: Sequence[ChannelSettings]) -> Line:
    """Return the simulated servos or board of a robot's bus, with the settings its driver expects.

    Raises DriverError.
    """
    options = {key: value for key, value in bus.options().items() if key not in SIMULATION}
    driver = open_bus(bus.family, servo_specs(channels), **{"port": "", **options})
    servos = [(channel.id, channel.model) for channel in channels]
    return make_line(bus.family, servos, time.monotonic(), baud=bus.baud, options=driver.far_end())


def serve_host(script: str, link: Path | None, console: Console) -> None:
    """Serve a simulated robot host; prints ``ready PATH``, and its counts when it is interrupted.

    Raises ConfigError: the script is unknown or wrong.
    """
    loaded = load_script(script, PARAMETERS)
    with HostPort(link) as port, stop_flag() as flag:
        console.print(f"ready {link or port.path}", soft_wrap=True)
        host = RobotHost(port, loaded, PARAMETERS)
        host.run(lambda: not flag.is_set())
        counts = host.report()
    console.print(
        f"{counts['sent']} lines sent, {counts['accepted']} accepted, {counts['refused']} refused", soft_wrap=True
    )
