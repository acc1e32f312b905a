"""Control a running simulated bus by command lines over a Unix socket or a pipe: faults, state, positions.

================================  =====================================================================
``fault SPEC [SPEC ...]``         sets faults (``drivers.sim.wire.faults``)
``clear [KIND]``                  ends the faults of a kind, or all
``faults``                        answers with the faults that are set
``servos``                        answers with a JSON list of the states of servos (or channels)
``place ID TICKS``                moves a shaft as by hand, with torque off
================================  =====================================================================

A word with spaces is put in quotes, as in a shell. Every line is answered by one line: ``ok``, ``ok VALUE`` or
``error WHY``.
"""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import socket
import stat
import time
from collections.abc import Callable
from pathlib import Path

from drivers.base.errors import DriverError, PortBusy, PortError
from drivers.sim.wire.line import Line

MAX_LINE = 4096


class Commands:
    """Carries out command lines.

    They run in the server's own loop, so a port is never pulled away while it is waited for.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self._commands: dict[str, Callable[[list[str], float], str | None]] = {
            "fault": lambda specs, now_s: line.faults.add(specs, now_s),
            "clear": lambda kinds, now_s: line.faults.clear(kinds[0] if kinds else None, now_s),
            "faults": lambda words, now_s: " ".join(_quoted(fault.spec) for fault in line.faults.active),
            "servos": lambda words, now_s: json.dumps(line.describe(now_s)),
            "place": self._place,
        }

    def handle(self, line: str) -> str:
        """Carry out one line; returns its answer, also where the line is wrong."""
        try:
            word, *rest = shlex.split(line) or [""]
        except ValueError as error:
            return f"error {line!r}: {error}"
        command = self._commands.get(word)
        if command is None:
            return f"error there is no command {word!r} (there are {', '.join(self._commands)})"
        try:
            with self._line.lock:
                return f"ok {command(rest, time.monotonic()) or ''}".rstrip()
        except DriverError as error:
            return f"error {error}; {error.hint}"
        except (KeyError, ValueError, IndexError, OverflowError) as error:
            return f"error {line!r}: {error.args[0] if error.args else error}"

    def _place(self, words: list[str], now_s: float) -> None:
        device_id, ticks = (int(word) for word in words)
        self._line.place(device_id, ticks, now_s)


def _quoted(spec: str) -> str:
    return shlex.quote(spec) if " " in spec else spec


class Lines:
    """Cuts a byte stream into lines; one longer than `MAX_LINE` is thrown away."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines that are complete now, without their ends; empty ones are left out."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest = b""
        return [line.decode(errors="replace").strip() for line in lines if line.strip()]


class ControlSocket:
    """A Unix socket that takes commands from any number of clients and never blocks.

    path : where it listens; a socket without a server is replaced.
    handle : answers one line.

    Raises PortBusy: another program listens there, or it is a file. PortError: it cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str], handle: Callable[[str], str]) -> None:
        self.path, self._handle = Path(path), handle
        self._clients: dict[int, tuple[socket.socket, Lines]] = {}
        _remove_dead(self.path)
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._listener.bind(str(self.path))
            self._listener.listen()
        except OSError as error:
            self._listener.close()
            raise PortError(
                f"cannot make the control socket {self.path}: {error}", hint=f"mkdir -p {self.path.parent}"
            ) from error
        self._listener.setblocking(False)

    @property
    def descriptors(self) -> list[int]:
        """What to wait on."""
        return [self._listener.fileno(), *self._clients]

    def serve(self, ready: list[int]) -> None:
        """Accept clients and carry out lines at the descriptors that are ready."""
        for descriptor in ready:
            if descriptor == self._listener.fileno():
                with contextlib.suppress(BlockingIOError):
                    client, _ = self._listener.accept()
                    client.setblocking(False)
                    self._clients[client.fileno()] = (client, Lines())
            elif descriptor in self._clients:
                self._take(descriptor)

    def close(self) -> None:
        """Stop listening; harmless when closed."""
        for client, _ in self._clients.values():
            client.close()
        self._clients.clear()
        if self._listener.fileno() >= 0:
            self._listener.close()
            self.path.unlink(missing_ok=True)

    def _take(self, descriptor: int) -> None:
        client, lines = self._clients[descriptor]
        try:
            data = client.recv(MAX_LINE)
            for line in lines.feed(data):
                client.send(self._handle(line).encode() + b"\n")
        except OSError:
            data = b""
        if not data:
            client.close()
            del self._clients[descriptor]


def _remove_dead(path: Path) -> None:
    """Remove a socket whose server has ended; raises PortBusy for any other file."""
    if not path.exists():
        return
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise PortBusy(f"cannot make the control socket {path}: there is a file", hint="choose another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            path.unlink(missing_ok=True)
            return
    raise PortBusy(f"another program serves the control socket {path}", hint="choose another path")
