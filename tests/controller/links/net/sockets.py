"""Free ports of loopback, and waiting for what another thread does."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A port on which nobody listens."""
    with socket.socket(socket.AF_INET, kind) as made:
        made.bind(("127.0.0.1", 0))
        port: int = made.getsockname()[1]
        return port


def wait_for(done: Callable[[], object], what: str = "it", limit_s: float = 60.0) -> None:
    """Wait until something is true."""
    end_s = time.monotonic() + limit_s
    while not done():
        assert time.monotonic() < end_s, f"{what} did not happen"
        time.sleep(0.005)
