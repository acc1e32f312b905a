"""Commands to a running simulated bus: one line each, over a socket or a pipe.

================================  =====================================================================
``fault SPEC [SPEC ...]``         sets faults (``drivers.sim.wire.faults``)
``clear [KIND]``                  ends the faults of a kind, or all
``faults``                        answers with the faults that are set
``servos``                        answers with a JSON list of the servos' (or channels') state
``place ID TICKS``                moves a limp shaft by hand
================================  =====================================================================

A word with spaces stands in quotes, as in a shell. Every line is answered by one line: ``ok``, ``ok VALUE`` or
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

    They run in the server's own loop, so a port is never pulled away while somebody waits on it.

    Parameters
    ----------
    line : the bus.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self._words: dict[str, Callable[[list[str], float], str]] = {
            "fault": self._fault,
            "clear": self._clear,
            "faults": self._faults,
            "servos": self._servos,
            "place": self._place,
        }

    def handle(self, line: str) -> str:
        """Carry out one line; returns its answer and never raises on what the line says."""
        try:
            word, *rest = shlex.split(line) or [""]
        except ValueError as error:
            return f"error {line!r}: {error}"
        command = self._words.get(word)
        if command is None:
            return f"error there is no command {word!r} (there are {', '.join(self._words)})"
        try:
            with self._line.lock:
                return f"ok {command(rest, time.monotonic())}".rstrip()
        except DriverError as error:
            return f"error {error}; {error.hint}"
        except (KeyError, ValueError, IndexError) as error:
            return f"error {line!r}: {error.args[0] if error.args else error}"

    def _fault(self, specs: list[str], now_s: float) -> str:
        self._line.faults.add(specs, now_s)
        return ""

    def _clear(self, kinds: list[str], now_s: float) -> str:
        self._line.faults.clear(kinds[0] if kinds else None, now_s)
        return ""

    def _faults(self, words: list[str], now_s: float) -> str:
        specs = (fault.spec for fault in self._line.faults.active)
        return " ".join(shlex.quote(spec) if " " in spec else spec for spec in specs)

    def _servos(self, words: list[str], now_s: float) -> str:
        return json.dumps(self._line.describe(now_s))

    def _place(self, words: list[str], now_s: float) -> str:
        device_id, ticks = (int(word) for word in words)
        self._line.place(device_id, ticks, now_s)
        return ""


class Lines:
    """Cuts a byte stream into lines; one that is far too long is thrown away."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[str]:
        """The lines that are complete now, without their ends; empty ones are left out."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self._rest = b""
        return [line.decode(errors="replace").strip() for line in lines if line.strip()]


class ControlSocket:
    """A Unix socket that takes commands from any number of clients, without ever waiting for one.

    Parameters
    ----------
    path : where it listens; a socket that nobody serves any more is replaced.
    handle : answers one line.

    Raises
    ------
    PortBusy : somebody else listens there, or it is a file.
    PortError : it cannot be made.
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
        """Take what has come at the descriptors that are ready."""
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
    """Take away a socket whose server is gone."""
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
