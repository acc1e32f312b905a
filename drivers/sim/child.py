"""The child process of ``SimulatedBus(process=True)``: settings (a JSON line), then commands, on standard input.

It answers ``ready PATH`` (or ``error WHY``) on standard output and ends when standard input does, so it cannot
outlive its parent however that one ends.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from typing import Any

from drivers.errors import DriverError
from drivers.priority import take_priority
from drivers.sim.control import Commands
from drivers.sim.device import SimulatedServo
from drivers.sim.serve import PtyServer, make_chain


def build(settings: dict[str, Any]) -> PtyServer:
    """The server that the settings describe."""
    now_s = time.monotonic()
    servos = [
        SimulatedServo(device_id, model, now_s=now_s, baud=settings["baud"]) for device_id, model in settings["servos"]
    ]
    chain = make_chain(servos, now_s, settings["seed"])
    server = PtyServer(
        chain,
        settings["link"],
        baud=settings["baud"],
        wire=settings["wire"],
        latency_s=settings["latency_s"],
        on_line=Commands(chain).obey,
    )
    try:
        chain.faults.add(settings["faults"], now_s)
    except DriverError:
        server.close()
        raise
    return server


def main() -> int:
    """Serve until standard input ends. Signals to the whole group are the parent's business."""
    for ending in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, ending):
            signal.signal(getattr(signal, ending), signal.SIG_IGN)
    take_priority()  # a real servo is not kept waiting by a program that draws
    first = _first_line(sys.stdin.fileno())
    if not first:
        return 0
    try:
        server = build(json.loads(first))
    except DriverError as error:
        _say(f"error {error}")
        return 1
    _say(f"ready {server.port.path}")
    server.run(sys.stdin.fileno())
    return 0


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
