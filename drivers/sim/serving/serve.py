"""Serve a simulated bus on a port: an event loop that moves bytes, keeps wire time and takes commands."""

from __future__ import annotations

import logging
import os
import select
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from drivers.base.errors import PortError
from drivers.base.waking import WakeDelay
from drivers.sim.serving.control import Commands, ControlSocket, Lines
from drivers.sim.serving.make_port import make_port
from drivers.sim.serving.ports import Link
from drivers.sim.serving.timeline import Timeline
from drivers.sim.servos.simulators import ids_and_models
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Line, ReplyQueue
from drivers.sim.wire.simulator import make_line
from drivers.sim.wire.timing import WireTiming

log = logging.getLogger(__name__)

EARLY_S, SPARE_S = 80e-6, 10e-6
"""How long before bytes are due the server wakes at first, as the system wakes it late; soon as much as it has learned
from its waits, and some to spare."""

POLL_S = 800e-6
"""How long the server of a wire that takes time polls after a reply, for a client that writes again at once: the system
would wake it late. Where the client wrote later than that last time, it waits without polling."""
POLL_WORTH_S = 40e-6
"""It polls only where nine of ten waits end later than this."""
POLL_STEP_S = 100e-6
"""Sleep between polls: too short for the processor's idle states. Without it the server, where it has real-time
priority, would keep the system from carrying the bytes of its pseudo-terminal."""

Control = int | socket.socket
"""Where commands to the server come from: a descriptor, or (the only thing that Windows can wait for) a socket."""


class PortServer:
    """Moves bytes between a simulated far end and a port.

    Parameters
    ----------
    line : what is at the far end.
    link : where clients find it, see :data:`drivers.sim.serving.ports.Link`.
    baud : bit rate while no client has set one.
    wire : bytes take their time at the bit rate, with return delay and the USB latency timer `latency_s`.
    commands : path of a socket that takes commands (``drivers.sim.serving.control``), or None.
    timeline : commands by time, counted from when `run` begins, or None.
    on_line : called with each command line that arrives at the `control` of `run`; None: any byte there ends the
        loop, as its end always does.

    Attributes
    ----------
    port : what clients open, by its ``path``.
    tap : called with (sent by the client, bytes) for everything that passes, or None.
    """

    def __init__(
        self,
        line: Line,
        link: Link = None,
        *,
        baud: int = 1_000_000,
        wire: bool = False,
        latency_s: float = 0.0,
        commands: str | os.PathLike[str] | None = None,
        timeline: Timeline | None = None,
        on_line: Callable[[str], object] | None = None,
    ) -> None:
        self.line, self._timeline = line, timeline or Timeline(())
        self.tap: Callable[[bool, bytes], None] | None = None
        self._socket = ControlSocket(commands, Commands(line).handle) if commands else None
        try:
            self.port = make_port(link)
        except BaseException:
            self._close_socket()
            raise
        self._link = self.port.path if "://" in self.port.path else link
        self._wire = wire
        self._queue = ReplyQueue(line, baud, WireTiming(latency_s) if wire else None)
        self.on_line, self._lines = on_line, Lines()
        self._replied_s = 0.0
        self._prompt = False
        self._usual, self._least = WakeDelay(0.5, EARLY_S), WakeDelay(0.1, EARLY_S)
        line.on_unplug = self._unplug

    def run(self, control: Control) -> None:
        """Serve until `control` reaches its end (or gives any byte, without `on_line`)."""
        self._timeline.start(time.monotonic())
        self._do_due()  # what is due at once comes before the first byte
        try:
            while True:
                watched = [control, *(self._socket.descriptors if self._socket else ()), *self.port.descriptors]
                timeout_s, begun_s = self._timeout(), time.monotonic()
                ready, _, _ = select.select(watched, [], [], timeout_s)
                if timeout_s and not ready:
                    self._note_wake(time.monotonic() - begun_s - timeout_s)
                if control in ready and not self._command(control):
                    return
                if self._socket:
                    self._socket.serve(ready)
                if any(descriptor in ready for descriptor in self.port.descriptors):
                    self._receive()
                self._do_due()
        finally:
            self.close()

    def _note_wake(self, late_s: float) -> None:
        self._usual.note(late_s)
        self._least.note(late_s)

    def close(self) -> None:
        """Remove port, link and socket; harmless when done."""
        self.port.close()
        self._close_socket()

    def _close_socket(self) -> None:
        if self._socket:
            self._socket.close()

    def _command(self, control: Control) -> bool:
        """Carry out commands; False when the loop must end."""
        data = os.read(control, 65536) if isinstance(control, int) else control.recv(65536)
        if not data or self.on_line is None:
            return False
        for line in self._lines.feed(data):
            self.on_line(line)
        return True

    def _timeout(self) -> float | None:
        """Seconds until something is due; None = nothing is."""
        now_s, due_s = time.monotonic(), min(self._queue.due_s, self._timeline.due_s)
        if self._queue.replies:
            due_s = min(due_s, self._queue.replies[0][0] - self._usual.late_s - SPARE_S)
        if self._prompt and self._least.late_s > POLL_WORTH_S and now_s - self._replied_s < POLL_S:
            return min(POLL_STEP_S, max(due_s - now_s, 0.0))
        return None if due_s == float("inf") else max(due_s - now_s, 0.0)

    def _receive(self) -> None:
        data = self.port.read()
        if not data:
            return
        if self.tap is not None:
            self.tap(True, data)
        now_s = time.monotonic()
        if self._replied_s:  # the first since the last reply
            self._prompt = self._wire and now_s - self._replied_s < POLL_S
            self._replied_s = 0.0
        self.line.set_line_baud(self.port.baud())
        self._queue.receive(data, now_s)

    def _do_due(self) -> None:
        """Send replies, change faults and give up packets whose time has come."""
        now_s, replies = time.monotonic(), self._queue.replies
        early_s = self._usual.late_s + SPARE_S
        while replies and replies[0][0] - early_s <= now_s:
            while now_s < replies[0][0]:  # so little that the system would oversleep it
                now_s = time.monotonic()
            data = replies.popleft()[1]
            if self.port.is_open:
                self.port.write(data)
                if self.tap is not None:
                    self.tap(False, data)
            self._replied_s = now_s
        self._queue.advance(now_s)
        self._timeline.advance(now_s, self._carry_out)

    def _carry_out(self, command: str) -> None:
        """A command of the timeline; one that cannot be carried out is logged."""
        answer = Commands(self.line).handle(command)
        if answer.startswith("error"):
            log.warning("timeline: %s: %s", command, answer.removeprefix("error "))

    def _unplug(self, fault: Fault, begins: bool) -> None:
        """Close the port and drop all pending bytes, or open it again, perhaps under another name."""
        if begins:
            self.port.close()
            self._queue.clear()
        elif not self.port.is_open:
            self._open_again(fault.alias)

    def _open_again(self, alias: str | None) -> None:
        """Open the port, under its old name where the other one cannot be had."""
        for link in (alias, self._link) if alias else (self._link,):
            try:
                self.port.open(link)
                return
            except PortError as error:
                log.warning("the port does not come back: %s", error)


def make_server(settings: Mapping[str, Any], line: Line | None = None) -> PortServer:
    """The server of a simulated far end, from the settings of a :class:`~drivers.sim.serving.simulated.SimulatedBus`.

    line : the far end, where it is made already.

    Raises DriverError: unknown family or model, unreadable fault, or the port cannot be made.
    """
    now_s, baud = time.monotonic(), settings["baud"]
    line = line or make_line(
        settings["family"], settings["servos"], now_s, baud=baud, seed=settings["seed"], options=settings["options"]
    )
    wire, latency_s, handle = settings["wire"], settings["latency_s"], Commands(line).handle
    server = PortServer(line, settings["link"], baud=baud, wire=wire, latency_s=latency_s, on_line=handle)
    try:
        line.faults.add(settings["faults"], now_s)
    except BaseException:
        server.close()
        raise
    return server


def serve_dynamixel(
    ids: Iterable[object],
    model: str | int = "xl330-m288",
    baud: int = 1_000_000,
    link: Link = None,
    wire: bool = False,
    faults: Iterable[str | Fault] = (),
    on_ready: Callable[[str], None] = lambda path: None,
    *,
    latency_s: float = 0.0,
    commands: str | os.PathLike[str] | None = None,
    stop: Control | None = None,
    seed: int = 0,
    on_server: Callable[[PortServer], None] = lambda server: None,
) -> None:
    """Serve a simulated bus of Dynamixel or Feetech servos until it is interrupted. Prints nothing.

    ids : servo ids, or specs with ``id`` and ``model``.
    model : of the servos given as bare ids, for example ``"xm430-w350"``, ``"ax-12a"``, ``"sts3215"``; it decides
        the protocol.
    baud : bit rate of the servos.
    link, wire, latency_s, commands : see :class:`PortServer`. faults : specs, see ``drivers.sim.wire.faults``.
    on_ready : called with the path to open as soon as clients may come.
    stop : descriptor or socket; the end of it (or any byte) ends the service. None: until KeyboardInterrupt.
    seed : of random faults.
    on_server : called with the server before it serves, for access to servos and traffic.

    Raises DriverError: unknown model, unreadable fault, or the terminal or link cannot be made.
    """
    now_s = time.monotonic()
    line = make_line("dynamixel", ids_and_models(ids, model), now_s, baud=baud, seed=seed)
    line.faults.add(faults, now_s)
    port: dict[str, Any] = {"baud": baud, "wire": wire, "latency_s": latency_s}
    serve(line, link, on_ready, commands=commands, stop=stop, on_server=on_server, **port)


def serve(
    line: Line,
    link: Link = None,
    on_ready: Callable[[str], None] = lambda path: None,
    *,
    baud: int = 1_000_000,
    wire: bool = False,
    latency_s: float = 0.0,
    commands: str | os.PathLike[str] | None = None,
    timeline: Timeline | None = None,
    stop: Control | None = None,
    on_server: Callable[[PortServer], None] = lambda server: None,
) -> None:
    """Serve any simulated bus, for example ``Maestro()`` or ``Ssc32()``; parameters as for `serve_dynamixel`.

    Raises DriverError: the terminal, link or socket cannot be made.
    """
    server = PortServer(line, link, baud=baud, wire=wire, latency_s=latency_s, commands=commands, timeline=timeline)
    reading, writing = os.pipe()
    try:
        on_server(server)
        on_ready(server.port.path)
        server.run(reading if stop is None else stop)
    finally:
        server.close()
        os.close(reading)
        os.close(writing)
