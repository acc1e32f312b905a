"""A serial port that is opened exclusively, reads and writes with deadlines, and raises errors of one tree.

pyserial raises four different exceptions when a device is unplugged, one of which (termios.error) is not even an
OSError; here each becomes :class:`~drivers.base.errors.PortLost`. Deadlines are on the monotonic clock.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from drivers.base.errors import PortBusy, PortError, PortLost, PortMissing, PortPermission
from drivers.port.endpoints import UNPLUGGED, Endpoint, open_endpoint

_MISSING = {errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR, errno.EIO, errno.ECONNREFUSED, errno.EHOSTUNREACH}
_DENIED = {errno.EACCES, errno.EPERM}
_BUSY = {errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK}
_MAX_WRITE_S = 0.5

HOST_MARGIN_S = 0.010
"""Time that a busy host may need to notice a reply, beyond the delays of wire and adapter."""
UNKNOWN_LATENCY_S = 0.002
PSEUDO_MARGIN_S = 0.05
"""The same for a pseudo-terminal or a socket, whose far end is a program that competes for the processor."""

_tap: ContextVar[Callable[[bool, bytes], None] | None] = ContextVar("tap", default=None)


@contextmanager
def tapped(tap: Callable[[bool, bytes], None]) -> Iterator[None]:
    """Ports created in this context call ``tap(sent, data)`` for all bytes that they send and receive."""
    token = _tap.set(tap)
    try:
        yield
    finally:
        _tap.reset(token)


class SerialPort:
    """One serial device, opened exclusively.

    Parameters
    ----------
    path : device path; prefer ``/dev/serial/by-id/...``, which stays the same after a replug. Or
        ``socket://HOST:PORT``, ``memory://NAME`` (a bus simulated in this process), or another URL of pyserial.
    baud : any rate the device takes.

    Attributes
    ----------
    tap : called with (sent, bytes) for everything that passes, or None.
    clock, sleep : the clock of this port's deadlines, and the function that waits on it; seconds.
    """

    clock: Callable[[], float] = staticmethod(time.monotonic)
    sleep: Callable[[float], object] = staticmethod(time.sleep)

    def __init__(self, path: str | os.PathLike[str], baud: int = 1_000_000) -> None:
        self.path = os.fspath(path)
        self.baud = int(baud)
        self.tap: Callable[[bool, bytes], None] | None = _tap.get()
        self._end: Endpoint | None = None

    @property
    def is_open(self) -> bool:
        """True while the device is open."""
        return self._end is not None

    @property
    def serial(self) -> Any:
        """The pyserial object (or socket) underneath; None while closed."""
        return None if self._end is None else self._end.device

    def open(self) -> None:
        """Open the device exclusively, request low latency, and discard its input.

        Raises PortMissing, PortBusy, PortPermission: see :mod:`drivers.base.errors`. PortError: the device does not
        take the baud rate.
        """
        self.close()
        try:
            self._end = open_endpoint(self.path, self.baud)
        except UNPLUGGED as error:
            raise self._opening_error(error) from error
        except ValueError as error:
            message = f"port {self.path} does not take {self.baud} baud: {error}"
            raise PortError(message, hint="set a baud rate the adapter has", port=self.path) from error
        try:
            self.drain()
        except PortLost:
            self.close()
            raise

    def close(self) -> None:
        """Close the device; never raises, may be called any number of times."""
        end, self._end = self._end, None
        if end is not None:
            with suppress(*UNPLUGGED):
                end.close()

    def write(self, data: bytes) -> None:
        """Write all bytes; raises PortLost where the device went away, or took nothing for half a second."""
        deadline = 0.0
        if self.tap is not None:
            self.tap(True, data)
        view = memoryview(data)
        while view:
            try:
                view = view[self._call_endpoint("put", view) :]
                continue
            except BlockingIOError:
                deadline = deadline or time.monotonic() + _MAX_WRITE_S
            if time.monotonic() > deadline:
                raise self._lost("it takes no bytes")
            self._wait(deadline, writing=True)

    def put(self, data: bytes) -> int:
        """Write as many bytes as there is room for, without waiting; return their number. Raises PortLost."""
        try:
            sent: int = self._call_endpoint("put", memoryview(data))
        except BlockingIOError:
            return 0
        if self.tap is not None:
            self.tap(True, data[:sent])
        return sent

    def read(self, deadline_s: float) -> bytes:
        """Return the bytes that have arrived, empty for none; wait for the first until a deadline. Raises PortLost.

        With a deadline in the past it returns bytes that are there already, so that bytes that came while this process
        was stalled are not lost.
        """
        return self.read_now() if self._wait(deadline_s) else b""

    def read_now(self) -> bytes:
        """Return the bytes that have arrived, empty for none, without a poll before the read. Raises PortLost."""
        try:
            return self._take()
        except BlockingIOError:
            return b""

    def drain(self, quiet_s: float = 0.0, limit_s: float = 0.2) -> int:
        """Discard input until nothing came for ``quiet_s``, at most for ``limit_s``; returns these bytes."""
        count, end = 0, time.monotonic() + limit_s
        while True:
            try:
                if quiet_s:
                    self._wait(min(time.monotonic() + quiet_s, end))
                count += len(self._take())
            except BlockingIOError:
                return count
            if time.monotonic() > end:
                return count

    def _take(self) -> bytes:
        data: bytes = self._call_endpoint("take")
        if self.tap is not None:
            self.tap(False, data)
        return data

    def _wait(self, deadline_s: float, writing: bool = False) -> bool:
        return bool(self._call_endpoint("wait", max(0.0, deadline_s - time.monotonic()), writing))

    def _call_endpoint(self, method: str, *arguments: Any) -> Any:
        """Call a method of the open endpoint; BlockingIOError passes, every other error becomes PortLost."""
        end = self._end
        try:
            if end is None:
                raise OSError(errno.EBADF, "it is not open")
            return getattr(end, method)(*arguments)
        except BlockingIOError:
            raise
        except (*UNPLUGGED, ValueError) as error:
            raise self._lost(error) from error

    def _lost(self, why: object) -> PortLost:
        reason = why.strerror if isinstance(why, OSError) and why.strerror else why
        return PortLost(
            f"port {self.path} went away: {reason}",
            hint="plug it in again and reconnect; `omote ports` shows what is there",
            port=self.path,
        )

    def _opening_error(self, error: BaseException) -> PortError:
        code = getattr(error, "errno", None)
        kind: type[PortError] = PortError
        message, hint = f"cannot open port {self.path}: {error}", "try `omote ports`"
        if code in _BUSY:
            kind, message = PortBusy, f"port {self.path} is held by another program"
            hint = f"close it; `fuser -v {self.path}` names it"
        elif code in _DENIED:
            kind, message = PortPermission, f"no permission to open port {self.path}"
            hint = "sudo usermod -a -G dialout $USER, then log out and in again"
        elif "://" in self.path:
            kind, message = PortMissing, f"no port {self.path}: {getattr(error, 'strerror', None) or error}"
            option = "--rfc2217" if self.path.startswith("rfc2217") else "--tcp"
            hint = f"start what serves it first, for example: omote simulate dynamixel {option} HOST:PORT"
        elif code in _MISSING or not Path(self.path).exists():
            kind, message, hint = PortMissing, f"no port {self.path}", "`omote ports` lists what is plugged in"
        return kind(message, hint=hint, port=self.path)


def as_serial_port(port: str | os.PathLike[str] | SerialPort, baud: int) -> SerialPort:
    """Create a port for a path or URL; a port is returned unchanged."""
    return SerialPort(port, baud) if isinstance(port, str | os.PathLike) else port


def latency_s(path: str | os.PathLike[str], sys_root: str | os.PathLike[str] = "/sys") -> float | None:
    """Latency timer of the USB adapter behind a device path, in seconds; None where there is none.

    Linux has it in ``/sys/bus/usb-serial/devices/<name>/latency_timer`` (milliseconds).
    """
    name = Path(path).resolve().name
    try:
        text = (Path(sys_root) / "bus/usb-serial/devices" / name / "latency_timer").read_text()
        return int(text) / 1000.0
    except (OSError, ValueError):
        return None


def reply_margin_s(path: str | os.PathLike[str]) -> float:
    """Longest wait (s) for a reply beyond its time on the wire, by the kind of device that a path leads to."""
    if str(Path(path).resolve()).startswith("/dev/pts/") or "://" in str(path):
        return PSEUDO_MARGIN_S
    latency = latency_s(path)
    return 2 * (UNKNOWN_LATENCY_S if latency is None else latency) + HOST_MARGIN_S
