"""A small process that lets servos go when the program that drives them is killed.

For servos without a bus watchdog, on POSIX systems. It sleeps beside the program and, when that ends without a word
(SIGKILL, a crash of the interpreter), opens the port and sends what switches the motors off. It helps against nothing
that takes the computer or the adapter away; and it stands back where another program has the port by then.

Run as ``python keeper.py`` it is that process; :class:`Keeper` starts it.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

LOOK_S = 0.25
"""How often it looks whether its parent is still there, should the pipe between them be held open by others."""
BUSY_S = 0.3
"""Time in which a dying program gives its port back; who holds it later is another one."""
REPEATS = 5
PAUSE_S = 0.02


class Keeper:
    """Starts the process and ends it.

    Parameters
    ----------
    path : device path of the port.
    baud : rate on the wire.
    frames : packets that switch the motors off; nobody answers them.
    """

    def __init__(self, path: str, baud: int, frames: Iterable[bytes]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-E", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # signals of a terminal are not for it
        )
        orders = {"path": path, "baud": baud, "frames": [frame.hex() for frame in frames], "parent": os.getpid()}
        self._say(json.dumps(orders | {"import": [_root(), *sys.path]}))

    @property
    def watching(self) -> bool:
        """Whether the process is there."""
        return self._process.poll() is None

    def dismiss(self) -> None:
        """End it: the motors are off, or somebody else's matter. May be called any number of times."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._say("bye")
            with suppress(OSError):
                self._process.stdin.close()
        try:
            self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _say(self, line: str) -> None:
        if self._process.stdin is not None:
            with suppress(OSError):  # it died; nothing is lost but the safety it gave
                self._process.stdin.write(line.encode() + b"\n")
                self._process.stdin.flush()


def _root() -> str:
    return str(Path(__file__).resolve().parents[2])


def watch(source: int) -> None:
    """Read orders from a descriptor, wait for its end, and carry them out unless there was a goodbye."""
    data = b""
    orders: dict[str, Any] = {}
    while True:
        ready, _, _ = select.select([source], [], [], LOOK_S)
        if ready:
            part = os.read(source, 65536)
            data += part
            if data.endswith(b"bye\n"):
                return
            if not orders and b"\n" in data:
                orders = json.loads(data.partition(b"\n")[0])
            if part:
                continue
        elif not orders or os.getppid() == orders["parent"]:
            continue
        if orders:
            sys.path[:] = orders["import"]
            let_go(orders["path"], orders["baud"], orders["frames"])
        return


def let_go(path: str, baud: int, frames: Iterable[str]) -> bool:
    """Send packets (hexadecimal) on a port, some times over. False where it cannot be had."""
    import time

    from drivers.base.errors import PortBusy, PortError
    from drivers.port.serialport import SerialPort

    port, deadline_s = SerialPort(path, baud), time.monotonic() + BUSY_S
    while not port.is_open:
        try:
            port.open()
        except PortBusy:
            if time.monotonic() > deadline_s:
                return False
            time.sleep(PAUSE_S)
        except PortError:
            return False
    with suppress(PortError):
        for _ in range(REPEATS):
            for frame in frames:
                port.write(bytes.fromhex(frame))
            time.sleep(PAUSE_S)
    port.close()
    return True


if __name__ == "__main__":
    watch(0)
