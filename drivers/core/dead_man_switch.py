"""A small process that lets servos go when the program that drives them is killed.

For servos without a bus watchdog, on POSIX systems. It sleeps beside the program and, when that ends without a word
(SIGKILL, a crash of the interpreter), opens the port and sends what switches the motors off. It helps against nothing
that takes the computer or the adapter away; and it stands back where another program has the port by then.

:class:`DeadManSwitch` starts it, as ``python -m drivers.core.dead_man_switch PARENT``. It reads its orders (a JSON
line) from standard input, carries them out once on a pseudo-terminal of its own, so that nothing has to be imported
when it matters, and answers ``ready``, or ``failed WHY``, on standard output. Then it waits for the end of its input or
of its parent.
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
"""A process that does not stand ready after this time is given up; it takes a tenth of a second, more on a busy one."""
LOOK_S = 0.25
"""How often it looks whether its parent is still there, should the pipe between them be held open by others."""
BUSY_S = 0.3
"""Time in which a dying program gives its port back; who holds it later is another one."""
REPEATS = 5
PAUSE_S = 0.02
_END_S = 2.0
_MODULE = "drivers.core.dead_man_switch"  # not __name__, which is __main__ in the process itself


class DeadManSwitch:
    """Starts the process, waits until it stands ready, and ends it.

    Parameters
    ----------
    path : device path of the port.
    baud : rate on the wire.
    frames : packets that switch the motors off; nobody answers them.
    ready_s : how long to wait for it.

    Raises
    ------
    DriverError : it does not stand ready: nobody would let the servos go.
    """

    def __init__(self, path: str, baud: int, frames: Iterable[bytes], *, ready_s: float = READY_S) -> None:
        try:
            self._process = _start()
        except OSError as error:
            raise _unready(path, f"{sys.executable or 'Python'} does not start: {error.strerror}") from error
        try:
            self._say(json.dumps({"path": _anywhere(path), "baud": baud, "frames": [frame.hex() for frame in frames]}))
            why = self._why_not_ready(ready_s)
        except BaseException:
            self._kill()
            raise
        if why:
            self._kill()
            raise _unready(path, why)
        _close(self._process.stdout)

    @property
    def watching(self) -> bool:
        """Whether the process is there."""
        return self._process.poll() is None

    def dismiss(self) -> None:
        """End it: the motors are off, or somebody else's matter. May be called any number of times."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            self._say("bye")
            _close(self._process.stdin)
        import subprocess  # start-up: the process itself does without

        try:
            self._process.wait(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._kill()

    def _why_not_ready(self, ready_s: float) -> str:
        """Wait for its answer; empty when it stands ready."""
        said = _line(self._process.stdout, time.monotonic() + ready_s)
        word, _, why = (said or "").partition(" ")
        if word == "ready":
            return ""
        if said is None:
            return f"its process did not say that it stands ready within {ready_s:g} s"
        return why or f"its process ended with status {self._process.wait()}, see its message above"

    def _say(self, line: str) -> None:
        if self._process.stdin is not None:
            with suppress(OSError):  # it died, which is told by who looks at it
                self._process.stdin.write(line.encode() + b"\n")
                self._process.stdin.flush()

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()
        _close(self._process.stdin)
        _close(self._process.stdout)


def _start() -> subprocess.Popen[bytes]:
    """The process; what it has to say beside its answer goes where the program's own errors go."""
    import subprocess  # the process itself does without

    return subprocess.Popen(
        command(_MODULE, str(os.getpid()), bare=True),
        env=environment(_MODULE, bare=True),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd="/",  # whoever takes the current folder away, or its disk, is not kept from it
        start_new_session=True,  # signals of a terminal are not for it
    )


def _anywhere(path: str) -> str:
    """A path that means the same from every folder."""
    return path if "://" in path else os.path.abspath(path)


def _unready(path: str, why: str) -> Exception:
    from drivers.base.errors import DriverError  # start-up: the process itself loads it when it is ready

    return DriverError(
        f"no process waits to switch the servos on {path} off if this program is killed: {why}",
        hint="the servos are driven without one; mend that and start again, or set watchdog_ms = 0 if it is meant",
        port=path,
    )


def _line(pipe: Any, deadline_s: float) -> str | None:
    """One line; less where it ends before, None where the time is over first."""
    data = b""
    while not data.endswith(b"\n"):
        if not _readable(pipe, deadline_s):
            return None
        part = os.read(pipe.fileno(), 1)
        if not part:
            break
        data += part
    return data.decode(errors="replace").strip()


def _readable(pipe: Any, deadline_s: float) -> bool:
    """Whether there is something to read by then, in a program with any number of open files."""
    with selectors.DefaultSelector() as waiting:
        waiting.register(pipe, selectors.EVENT_READ)
        return bool(waiting.select(max(deadline_s - time.monotonic(), 0.0)))


def _close(pipe: Any) -> None:
    if pipe is not None:
        with suppress(OSError):
            pipe.close()


# ---------------------------------------------------------------------- the process itself


def keep(source: int, answer: int, parent: int) -> bool:
    """Take orders, say that all is ready, and let the servos go when the parent ends without a goodbye.

    Parameters
    ----------
    source, answer : descriptors of orders and of what is answered.
    parent : process id of the program that is watched over.

    Returns
    -------
    bool : False where the orders cannot be carried out.
    """
    orders = _orders(source)
    if orders is None:
        return True
    try:
        dry_run(**orders)
    except Exception as error:  # noqa: BLE001  whatever it is, the program must hear it
        _tell(answer, f"failed {type(error).__name__}: {error}")
        return False
    _tell(answer, "ready")
    if _left_alone(source, parent):
        gone = let_go(**orders)
        done = "were told to let go" if gone else "were left as they are: its port cannot be had"
        _tell(2, f"the program that drove servos on {orders['path']} was killed; they {done}")
    return True


def _orders(source: int) -> dict[str, Any] | None:
    """The first line; None where there is none."""
    data = b""
    while not data.endswith(b"\n"):
        part = os.read(source, 1)  # nothing behind it is taken away
        if not part:
            return None
        data += part
    orders: dict[str, Any] = json.loads(data)
    return orders


def _left_alone(source: int, parent: int) -> bool:
    """Wait for the end of a descriptor, or of the parent; False where a goodbye came first."""
    data = b""
    while True:
        ready, _, _ = select.select([source], [], [], LOOK_S)
        if ready:
            part = os.read(source, 4096)
            data += part
            if data.endswith(b"bye\n") or not part:
                return bool(not part)
        elif os.getppid() != parent:
            return True


def dry_run(path: str, baud: int, frames: Iterable[str]) -> None:
    """Let go on a pseudo-terminal of our own: all that it takes is loaded then, and known to work.

    Raises
    ------
    Exception : whatever would be in the way.
    """
    scheme, has_scheme, _ = path.partition("://")
    if has_scheme:
        _load_scheme(scheme)
    try:
        far, near = os.openpty()
    except OSError:  # a system without them: loading is what can be done
        from drivers.port.serialport import SerialPort  # start-up: see let_go

        SerialPort(path, baud)
        return
    try:
        if not let_go(os.ttyname(near), baud, frames, repeats=1) and sys.platform == "linux":
            raise RuntimeError("cannot open a pseudo-terminal")  # other systems may refuse its rate
    finally:
        os.close(near)
        os.close(far)


def _load_scheme(scheme: str) -> None:
    """What pyserial and the system load only when a port in the network is opened."""
    from importlib import import_module  # start-up: few ports are in the network

    "localhost".encode("idna")
    if scheme != "socket":
        import_module(f"serial.urlhandler.protocol_{scheme}")


def let_go(path: str, baud: int, frames: Iterable[str], repeats: int = REPEATS) -> bool:
    """Send packets (hexadecimal) on a port, some times over. False where it cannot be had."""
    # start-up: the process says that it is there before it loads this
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
        for _ in range(repeats):
            for frame in frames:
                port.write(bytes.fromhex(frame))
            time.sleep(PAUSE_S)
    port.close()
    return True


def _tell(descriptor: int, line: str) -> None:
    """Write a line where somebody may listen; who is gone, or does not read, is not waited for."""
    with suppress(OSError, ValueError):
        if select.select([], [descriptor], [], 0.0)[1]:
            os.write(descriptor, (" ".join(line.split()) + "\n").encode(errors="replace"))


def main() -> int:
    """Be the process. It ends with its parent, not by what a whole group of processes is told."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    return 0 if keep(0, 1, int(sys.argv[1])) else 1


if __name__ == "__main__":
    sys.exit(main())
