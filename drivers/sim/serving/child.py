"""The child process of ``SimulatedBus(process=True)``: settings (a JSON line), then commands, on standard input.

It answers ``ready PATH`` (or ``error WHY``) on standard output and ends when standard input does, so it cannot
outlive its parent however that one ends.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from typing import Any

from drivers.base.errors import DriverError
from drivers.base.priority import request_realtime
from drivers.sim.serving.control import Commands
from drivers.sim.serving.farend import make_line
from drivers.sim.serving.serve import Control, PortServer


def build(settings: dict[str, Any]) -> PortServer:
    """The server that the settings describe."""
    now_s = time.monotonic()
    line = make_line(
        settings["family"],
        settings["servos"],
        now_s,
        baud=settings["baud"],
        seed=settings["seed"],
        options=settings["options"],
    )
    server = PortServer(
        line,
        settings["link"],
        baud=settings["baud"],
        wire=settings["wire"],
        latency_s=settings["latency_s"],
        on_line=Commands(line).handle,
    )
    try:
        line.faults.add(settings["faults"], now_s)
    except DriverError:
        server.close()
        raise
    return server


def main() -> int:
    """Serve until standard input ends. Signals to the whole group are the parent's business."""
    for ending in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, ending):
            signal.signal(getattr(signal, ending), signal.SIG_IGN)
    request_realtime()  # a real servo is not kept waiting by a program that draws
    first = _first_line(sys.stdin.fileno())
    if not first:
        return 0
    try:
        server = build(json.loads(first))
    except DriverError as error:
        _say(f"error {error}")
        return 1
    _say(f"ready {server.port.path}")
    server.run(_standard_input())
    return 0


def _standard_input() -> Control:
    """Standard input as something that can be waited for; only sockets can on Windows."""
    if os.name != "nt":
        return sys.stdin.fileno()
    ours, theirs = socket.socketpair()

    def forward() -> None:
        with theirs:
            while data := os.read(sys.stdin.fileno(), 4096):
                theirs.sendall(data)

    threading.Thread(target=forward, daemon=True).start()
    return ours


def _first_line(descriptor: int) -> bytes:
    """One line, byte by byte, so that nothing behind it is taken away from the server's loop."""
    line = b""
    while not line.endswith(b"\n"):
        byte = os.read(descriptor, 1)
        if not byte:
            return b""
        line += byte
    return line


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
