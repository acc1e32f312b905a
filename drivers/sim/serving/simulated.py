"""A simulated bus behind a port as one object, served from a thread or from a child process."""

from __future__ import annotations

import json
import os
import shlex
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any, Self

from drivers.base.children import command, environment
from drivers.base.errors import DriverError, PortError
from drivers.sim.serving.ports import Link
from drivers.sim.serving.serve import PortServer, make_server
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.simulators import ids_and_models
from drivers.sim.wire.faults import parse_fault
from drivers.sim.wire.line import Line

MAX_START_S = 20.0
"""A child process that is not ready after this time is killed."""
ERROR = "error "
"""Prefix of the answer to a command that failed."""
_CHILD = "drivers.sim.serving.child"


class ServoView:
    """One servo of a running bus for use from another thread: always up to date, never in the middle of a packet."""

    def __init__(self, chain: Chain, device_id: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._chain, self._servo, self._clock = chain, chain.servo(device_id), clock

    @property
    def position_ticks(self) -> int:
        """Present Position."""
        with self._chain.lock:
            return self._servo.position_ticks(self._clock())

    @property
    def goal(self) -> int:
        """Goal Position."""
        with self._chain.lock:
            return self._servo.goal

    @property
    def torque(self) -> bool:
        """Whether the motor is on."""
        with self._chain.lock:
            self._servo.update(self._clock())
            return self._servo.torque

    @property
    def eeprom_writes(self) -> dict[str, int]:
        """Writes to permanent registers so far, by name."""
        with self._chain.lock:
            return dict(self._servo.eeprom_writes)

    def register(self, name: str) -> int:
        """Value of a register; KeyError where the model has none of that name."""
        with self._chain.lock:
            return self._servo.register(name, self._clock())

    def put(self, name: str, value: int) -> None:
        """Set a register whatever its access, as another program could have left it."""
        with self._chain.lock:
            self._servo.force(name, value, self._clock())

    def place(self, position: float) -> None:
        """Move the shaft as by hand, ticks; ValueError while its torque is on."""
        with self._chain.lock:
            self._servo.place(position, self._clock())

    def latch(self, bits: int) -> None:
        """Latch hardware errors."""
        with self._chain.lock:
            self._servo.latch(bits, self._clock())


class SimulatedBus:
    """A simulated bus of any family behind a port; a context manager.

    servos : ids, or specs with ``id`` and ``model``.
    link : where clients find it: a path that shall point at a pseudo-terminal, ``socket://HOST:PORT`` (port 0 takes a
        free one), or ``memory://NAME`` for programs in this process.
    faults : specs, see ``drivers.sim.wire.faults``.
    model : of the servos given as bare ids.
    baud : bit rate of the servos.
    wire, latency_s : bytes take their time.
    process : serve from a child process (which ends with this one, however this one ends) instead of a thread.
    seed : of random faults.
    family, options : see :func:`drivers.sim.wire.simulator.make_line`.
    line : a far end that is made already, instead of servos; thread mode only.

    Attributes
    ----------
    tap : thread mode only: called with (sent by the client, bytes) for everything that passes.

    Raises DriverError: on entering: unknown model, unreadable fault, no terminal, or the child does not start.
    """

    def __init__(
        self,
        servos: Iterable[Any],
        link: Link = None,
        faults: Iterable[str] = (),
        *,
        model: str | int = "xl330-m288",
        baud: int = 1_000_000,
        wire: bool = False,
        latency_s: float = 0.0,
        process: bool = False,
        seed: int = 0,
        family: str = "dynamixel",
        options: Mapping[str, Any] = {},
        line: Line | None = None,
    ) -> None:
        self.baud, self._made = baud, line
        self._settings = {
            "servos": ids_and_models(servos, model),
            "link": None if link is None else os.fspath(link),
            "baud": baud,
            "faults": list(faults),
            "seed": seed,
            "wire": wire,
            "latency_s": latency_s,
            "family": family,
            "options": dict(options),
        }
        self._process = process
        self._path = ""
        self._child: subprocess.Popen[bytes] | None = None
        self._server: PortServer | None = None
        self._thread: threading.Thread | None = None
        self._stop: socket.socket | None = None
        self._done, self._answer = threading.Event(), ""

    @property
    def path(self) -> str:
        """What a client opens; after an unplug and replug the new name (thread mode)."""
        return self._server.port.path if self._server and self._server.port.is_open else self._path

    @property
    def line(self) -> Line:
        """What is at the far end (thread mode only)."""
        if self._server is None:
            raise RuntimeError("the servos can be looked at only while the bus runs in a thread of this process")
        return self._server.line

    @property
    def chain(self) -> Chain:
        """The servos themselves (thread mode only; TypeError where it is a board)."""
        if not isinstance(self.line, Chain):
            raise TypeError("a board has no servos to look at; see line")
        return self.line

    @property
    def tap(self) -> Callable[[bool, bytes], None] | None:
        return self._server.tap if self._server else None

    @tap.setter
    def tap(self, tap: Callable[[bool, bytes], None] | None) -> None:
        if self._server is None:
            raise RuntimeError("the traffic can be seen only while the bus runs in a thread of this process")
        self._server.tap = tap

    def servo(self, device_id: int) -> ServoView:
        """One servo (thread mode only); KeyError where none has the id."""
        return ServoView(self.chain, device_id)

    def fault(self, *specs: str) -> None:
        """Set faults now.

        Raises DriverError: a spec cannot be read, or this bus has no such fault; then none is set.
        """
        for spec in specs:
            parse_fault(spec)
        answer = self._send(shlex.join(("fault", *specs)))
        if answer.startswith(ERROR):
            message, _, hint = answer.removeprefix(ERROR).partition("; ")
            raise DriverError(message, hint=hint)

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind; None: all."""
        self._send(f"clear {kind or ''}")

    def sync(self) -> None:
        """Return when what clients wrote before has been carried out (thread mode only).

        The server looks for commands and bytes at once, and carries out the commands first. It may have looked before
        the bytes came when it finds the first command; with the second one it finds them, too; the third comes after
        they were carried out.
        """
        for _ in range(3):
            self._send("faults")

    def __enter__(self) -> Self:
        if self._process:
            self._start_child()
        else:
            self._start_thread()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the port and end the service; harmless when it has ended."""
        child, self._child = self._child, None
        if child:
            _end_child(child)
        if self._stop is not None:
            self._stop.close()
        if self._thread is not None:
            self._thread.join()
        self._thread = self._server = self._stop = None

    def _start_thread(self) -> None:
        server = make_server(self._settings, self._made)
        handle = server.on_line

        def carry_out(line: str) -> None:
            if handle is not None:
                self._answer = str(handle(line))
            self._done.set()

        server.on_line = carry_out
        self._server, self._path = server, server.port.path
        reading, self._stop = socket.socketpair()
        self._thread = threading.Thread(target=_serve, args=(server, reading), name="simulated-bus", daemon=True)
        self._thread.start()

    @property
    def processor_s(self) -> float | None:
        """Processor time that its child process has used, s; None where there is none, or the system does not tell."""
        if self._child is None:
            return None
        try:
            with open(f"/proc/{self._child.pid}/stat", encoding="ascii", errors="replace") as file:
                fields = file.read().rpartition(")")[2].split()
        except OSError:  # it has ended, or the system has no such file
            return None
        return (int(fields[11]) + int(fields[12])) / float(os.sysconf("SC_CLK_TCK"))

    def _start_child(self) -> None:
        child = self._child = subprocess.Popen(
            command(_CHILD, json.dumps(self._settings)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment(_CHILD),
        )
        words = _next_line(child).partition(" ")
        if words[0] != "ready":
            self.close()
            raise PortError(f"the simulated bus did not start: {words[2] or 'its process ended'}")
        self._path = words[2]

    def _send(self, command: str) -> str:
        """Carry out a command; returns its answer. Raises PortError: the bus has ended."""
        line, answer = command.encode() + b"\n", ""
        with suppress(OSError):  # it has ended: there is no answer
            if self._child and self._child.stdin:
                self._child.stdin.write(line)
                self._child.stdin.flush()
                answer = _next_line(self._child)
            elif self._stop is not None:
                self._done.clear()
                self._stop.sendall(line)
                answer = self._answer if self._done.wait(MAX_START_S) else ""
            else:
                return ""
        if not answer:
            raise PortError(f"the simulated bus on {self._path} has ended", hint="start it again", port=self._path)
        return answer


def _serve(server: PortServer, reading: socket.socket) -> None:
    with reading:
        server.run(reading)


def _next_line(child: subprocess.Popen[bytes]) -> str:
    """Read the child's next line; empty where the child has ended. A child that takes too long is killed."""
    timer = threading.Timer(MAX_START_S, child.kill)
    timer.start()
    try:
        return (child.stdout.readline() if child.stdout else b"").decode().strip()
    finally:
        timer.cancel()


def _end_child(child: subprocess.Popen[bytes]) -> None:
    """End the child by the end of its standard input, or kill it."""
    if child.stdin:
        with suppress(OSError):  # it has ended already
            child.stdin.close()
    try:
        child.wait(timeout=2.0)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
    if child.stdout:
        child.stdout.close()
