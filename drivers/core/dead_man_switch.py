"""Dead man's switch: a small child process that switches servos off when the program that drives them is killed.

For servos without a bus watchdog, on POSIX systems. When the program ends without dismissing it (SIGKILL, a crash of
the interpreter), it opens the port and sends packets that switch the motors off, unless another program has the port
by then. It does not help when the computer or the adapter fails.

:class:`DeadManSwitch` starts it, as ``python -m drivers.core.dead_man_switch PARENT``. The process reads its orders (a
JSON line) from standard input, carries them out once on a pseudo-terminal, so that nothing has to be imported later,
and answers ``ready`` or ``failed WHY`` on standard output. Then it waits for the end of its input or its parent.
"""

from __future__ import annotations

import json
import os
import select
import selectors
import signal
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from drivers.base.children import command, environment

if TYPE_CHECKING:
    import subprocess

READY_S = 15.0
"""Time limit for the process to get ready; it takes a tenth of a second, more on a busy computer."""
CHECK_INTERVAL_S = 0.25
"""Interval of checking the parent process, in case another process holds the pipe open."""
PORT_WAIT_S = 0.3
"""Time in which a dying program closes its port; if the port is still busy then, another program uses it."""
REPEATS = 5
PAUSE_S = 0.02
_END_S = 2.0
_MODULE = "drivers.core.dead_man_switch"  # not __name__, which is __main__ in the process itself


class DeadManSwitch:
    """Starts the process, waits until it is ready (else raises DriverError), and ends it.

    path, baud : device path and rate of the port.
    frames : packets that switch the motors off and have no answer.
    ready_s : time limit for the process to get ready.
    """

    def __init__(self, path: str, baud: int, frames: Iterable[bytes], *, ready_s: float = READY_S) -> None:
        try:
            self._process = _start()
        except OSError as error:
            raise _not_ready(path, f"{sys.executable or 'Python'} does not start: {error.strerror}") from error
        try:
            anywhere = path if "://" in path else os.path.abspath(path)
            self._send(json.dumps({"path": anywhere, "baud": baud, "frames": [frame.hex() for frame in frames]}))
            why = self._why_not_ready(ready_s)
            if why:
                raise _not_ready(path, why)
        except BaseException:
            self._kill()
            raise
        _close(self._process.stdout)

    @property
    def watching(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def dismiss(self) -> None:
        """End the process without switching anything off; may be called any number of times."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._send("bye")
            _close(self._process.stdin)
        import subprocess  # imported lazily: the child process does not need it

        try:
            self._process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._kill()

    def _why_not_ready(self, ready_s: float) -> str:
        """Wait for the answer of the process; return why it is not ready, empty when it is."""
        pipe, deadline_s = self._process.stdout, time.monotonic() + ready_s
        answer = None if pipe is None else _read_line(pipe.fileno(), deadline_s)
        if answer is None:
            return f"its process was not ready within {ready_s:g} s"
        word, _, why = answer.decode(errors="replace").strip().partition(" ")
        if word == "ready":
            return ""
        return why or f"its process ended with status {self._process.wait()}, see its message above"

    def _send(self, line: str) -> None:
        if self._process.stdin is not None:
            with suppress(OSError):  # where the process has ended, its answer or `watching` shows it
                self._process.stdin.write(line.encode() + b"\n")
                self._process.stdin.flush()

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()
        _close(self._process.stdin)
        _close(self._process.stdout)


def _start() -> subprocess.Popen[bytes]:
    """Start the process; its standard error is the program's own."""
    import subprocess  # imported lazily: the child process does not need it

    return subprocess.Popen(
        command(_MODULE, str(os.getpid()), bare=True),
        env=environment(_MODULE, bare=True),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd="/",  # so that it does not keep the current folder or its disk in use
        start_new_session=True,  # signals of a terminal do not reach it
    )


def _not_ready(path: str, why: str) -> Exception:
    from drivers.base.errors import DriverError  # imported lazily: the child process must be ready early

    return DriverError(
        f"no process waits to switch the servos on {path} off if this program is killed: {why}",
        hint="the servos are driven without one; fix that and start again, or set watchdog_ms = 0 if that is intended",
        port=path,
    )


def _close(pipe: Any) -> None:
    if pipe is not None:
        with suppress(OSError):
            pipe.close()


def _read_line(descriptor: int, deadline_s: float | None = None) -> bytes | None:
    """One line, incomplete where the input ends before; None where the time is over first."""
    data = b""
    with selectors.DefaultSelector() as selector:  # unlike select() for any number of open files
        selector.register(descriptor, selectors.EVENT_READ)
        while not data.endswith(b"\n"):
            if not selector.select(None if deadline_s is None else max(deadline_s - time.monotonic(), 0.0)):
                return None
            part = os.read(descriptor, 1)  # by byte, so that nothing behind the line is taken
            if not part:
                break
            data += part
    return data


# ---------------------------------------------------------------------- the process itself


def watch(source: int, answer: int, parent: int) -> bool:
    """Take orders, get ready, and switch the servos off when the parent ends without dismissing this process.

    Orders and answer have file descriptors, the parent a process id. False where the orders cannot be carried out.
    """
    line = _read_line(source) or b""
    if not line.endswith(b"\n"):
        return True
    orders = json.loads(line)
    try:
        dry_run(**orders)
    except Exception as error:  # noqa: BLE001  whatever it is, the program must report it
        _print(answer, f"failed {type(error).__name__}: {error}")
        return False
    _print(answer, "ready")
    if _parent_died(source, parent):
        done = "were switched off" if switch_off(**orders) else "were not switched off: its port cannot be opened"
        _print(2, f"the program that drove servos on {orders['path']} was killed; they {done}")
    return True


def _parent_died(source: int, parent: int) -> bool:
    """Wait for the end of a descriptor or of the parent; return False where the parent sent ``bye`` first."""
    data = b""
    while True:
        ready, _, _ = select.select([source], [], [], CHECK_INTERVAL_S)
        if ready:
            part = os.read(source, 4096)
            data += part
            if data.endswith(b"bye\n") or not part:
                return not part
        elif os.getppid() != parent:
            return True


def dry_run(path: str, baud: int, frames: Iterable[str]) -> None:
    """Switch off on a pseudo-terminal, which loads and tries all code that is needed; raises whatever goes wrong."""
    scheme, has_scheme, _ = path.partition("://")
    if has_scheme:
        _load_scheme(scheme)
    try:
        far, near = os.openpty()
    except OSError:  # a system without them: loading is all that can be done
        from drivers.port.serialport import SerialPort  # imported lazily: see switch_off

        SerialPort(path, baud)
        return
    try:
        if not switch_off(os.ttyname(near), baud, frames, repeats=1) and sys.platform == "linux":
            raise RuntimeError("cannot open a pseudo-terminal")  # other systems may refuse its rate
    finally:
        os.close(near)
        os.close(far)


def _load_scheme(scheme: str) -> None:
    """Import what pyserial and the system import only when a network port is opened."""
    from importlib import import_module  # imported lazily: only for network ports

    "localhost".encode("idna")
    if scheme != "socket":
        import_module(f"serial.urlhandler.protocol_{scheme}")


def switch_off(path: str, baud: int, frames: Iterable[str], repeats: int = REPEATS) -> bool:
    """Send packets (hexadecimal) on a port several times; False where the port cannot be opened."""
    # imported lazily: the parent waits until these are loaded
    from drivers.base.errors import PortBusy, PortError
    from drivers.port.serialport import SerialPort

    port, deadline_s = SerialPort(path, baud), time.monotonic() + PORT_WAIT_S
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
        for _ in range(repeats):
            for frame in frames:
                port.write(bytes.fromhex(frame))
            time.sleep(PAUSE_S)
    port.close()
    return True


def _print(descriptor: int, line: str) -> None:
    """Write a line without waiting for the reader, which may have ended."""
    with suppress(OSError, ValueError):
        if select.select([], [descriptor], [], 0.0)[1]:
            os.write(descriptor, (" ".join(line.split()) + "\n").encode(errors="replace"))


def main() -> int:
    """Run the process; signals to the whole process group do not end it, the end of its parent does."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    return 0 if watch(0, 1, int(sys.argv[1])) else 1


if __name__ == "__main__":
    sys.exit(main())
