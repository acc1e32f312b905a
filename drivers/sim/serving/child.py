"""Child process that serves a ``SimulatedBus(process=True)``: settings as a JSON argument, commands on standard input.

It writes ``ready PATH`` (or ``error WHY``) to standard output and ends when standard input does, so it cannot
outlive its parent however that one ends.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading

from drivers.base.errors import DriverError
from drivers.base.priority import request_realtime, shorten_thread_switches
from drivers.sim.serving.serve import Control, make_server


def main() -> int:
    """Serve until standard input ends. Signals to the whole process group are ignored; the parent handles them."""
    for ending in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, ending):
            signal.signal(getattr(signal, ending), signal.SIG_IGN)
    request_realtime()  # servos answer in time while another program draws
    shorten_thread_switches()
    try:
        server = make_server(json.loads(sys.argv[1]))
    except DriverError as error:
        _print(f"error {error}")
        return 1
    _print(f"ready {server.port.path}")
    handle = server.on_line
    if handle is not None:
        server.on_line = lambda line: _print(str(handle(line)))
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


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
