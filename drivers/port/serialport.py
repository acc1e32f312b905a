"""A serial port that is opened exclusively, read without spinning, and fails with one error tree.

pyserial raises four different exceptions when a device is unplugged, one of which (termios.error) is not even
an OSError; here each of them becomes :class:`~drivers.base.errors.PortLost`. Deadlines are on the monotonic clock.
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
_WRITE_LIMIT_S = 0.5

HOST_MARGIN_S = 0.010
"""Time a busy host may need to notice a reply, beyond the wire and the adapter."""
UNKNOWN_LATENCY_S = 0.002
PSEUDO_MARGIN_S = 0.05
"""Behind a pseudo-terminal or a socket sits a program, which competes for the processor with everything else."""


_tap: ContextVar[Callable[[bool, bytes], None] | None] = ContextVar("tap", default=None)


@contextmanager
def tapped(tap: Callable[[bool, bytes], None]) -> Iterator[None]:
    """Ports that are made in this context give ``tap`` (sent, bytes) for all that passes, however deep in a driver."""
    token = _tap.set(tap)
    try:
        yield
    finally:
        _tap.reset(token)


class SerialPort:
    """One serial device, held by this process alone while it is open.

    Parameters
    ----------
    path : device path; prefer ``/dev/serial/by-id/...``, which stays the same after a replug. Or
        ``socket://HOST:PORT``, ``memory://NAME`` (a bus simulated in this process), or another URL of pyserial.
    baud : any rate the device takes.

    Attributes
    ----------
    tap : called with (sent, bytes) for everything that passes, or None.
    clock, sleep : the time of this port's deadlines, and the way to let it pass.
    """

    clock: Callable[[], float] = staticmethod(time.monotonic)
    sleep: Callable[[float], object] = staticmethod(time.sleep)

    def __init__(self, path: str | os.PathLike[str], baud: int = 1_000_000) -> None:
        self.path = os.fspath(path)
        self.baud = int(baud)
        self.low_latency = False
        self.tap: Callable[[bool, bytes], None] | None = _tap.get()
        self._end: Endpoint | None = None

    @property
    def is_open(self) -> bool:
        """True while the device is held."""
        return self._end is not None

    @property
    def serial(self) -> Any:
        """The pyserial object (or socket) underneath, for code that insists on one; None while closed."""
        return None if self._end is None else self._end.device

    def open(self) -> None:
        """Take the device for this process, ask for low latency, and throw away what lies in its input.

        Raises
        ------
        PortMissing : no such device.
        PortBusy : another program holds it.
        PortPermission : this user may not open it.
        PortError : the device does not take the baud rate.
        """
        self.close()
        try:
            end = open_endpoint(self.path, self.baud)
        except UNPLUGGED as error:
            raise self._opening_error(error) from error
        except ValueError as error:
            message = f"port {self.path} does not take {self.baud} baud: {error}"
            raise PortError(message, hint="set a baud rate the adapter has", port=self.path) from error
        self._end = end
        self.low_latency = end.low_latency
        try:
            self.drain()
        except PortLost:
            self.close()
            raise

    def close(self) -> None:
        """Give the device back; never raises, may be called any number of times."""
        end, self._end = self._end, None
        if end is not None:
            with suppress(*UNPLUGGED):
                end.close()

    def write(self, data: bytes) -> None:
        """Hand all bytes to the system.

        Raises
        ------
        PortLost : the device went away, or took nothing for half a second.
        """
        deadline = 0.0
        if self.tap is not None:
            self.tap(True, data)
        view = memoryview(data)
        while view:
            try:
                view = view[self._opened().put(view) :]
                continue
            except BlockingIOError:
                deadline = deadline or time.monotonic() + _WRITE_LIMIT_S
            except (*UNPLUGGED, ValueError) as error:
                raise self._lost(error) from error
            if time.monotonic() > deadline:
                raise self._lost("it takes no bytes")
            self._wait(deadline, writing=True)

    def put(self, data: bytes) -> int:
        """Hand over what there is room for now, without waiting; returns how many bytes that was.

        Raises
        ------
        PortLost : the device went away.
        """
        try:
            sent = self._opened().put(memoryview(data))
        except BlockingIOError:
            return 0
        except (*UNPLUGGED, ValueError) as error:
            raise self._lost(error) from error
        if self.tap is not None:
            self.tap(True, data[:sent])
        return sent

    def read(self, deadline_s: float) -> bytes:
        """What has arrived, waiting for the first byte until a deadline.

        Parameters
        ----------
        deadline_s : time of ``time.monotonic()``. One in the past only takes what is there already, so that
            bytes which came while this process was stalled still count.

        Returns
        -------
        bytes : empty when nothing came.

        Raises
        ------
        PortLost : the device went away.
        """
        self._wait(deadline_s)
        try:
            return self._take()
        except BlockingIOError:
            return b""

    def drain(self, quiet_s: float = 0.0, limit_s: float = 0.2) -> int:
        """Throw away input until nothing came for ``quiet_s`` seconds, at most ``limit_s``.

        Returns
        -------
        int : bytes thrown away.
        """
        count, end = 0, time.monotonic() + limit_s
        while True:
            try:
                count += len(self._take() if quiet_s == 0.0 else self._awaited(quiet_s, end))
            except BlockingIOError:
                return count
            if time.monotonic() > end:
                return count

    def _awaited(self, quiet_s: float, end_s: float) -> bytes:
        self._wait(min(time.monotonic() + quiet_s, end_s))
        return self._take()

    def _take(self) -> bytes:
        try:
            data = self._opened().take()
        except BlockingIOError:
            raise
        except (*UNPLUGGED, ValueError) as error:
            raise self._lost(error) from error
        if self.tap is not None:
            self.tap(False, data)
        return data

    def _wait(self, deadline_s: float, writing: bool = False) -> None:
        try:
            self._opened().wait(max(0.0, deadline_s - time.monotonic()), writing)
        except (*UNPLUGGED, ValueError) as error:
            raise self._lost(error) from error

    def _opened(self) -> Endpoint:
        if self._end is None:
            raise OSError(errno.EBADF, "it is not open")
        return self._end

    def _lost(self, why: object) -> PortLost:
        reason = why.strerror if isinstance(why, OSError) and why.strerror else why
        return PortLost(
            f"port {self.path} went away: {reason}",
            hint="plug it in again and reconnect; `omote ports` shows what is there",
            port=self.path,
        )

    def _opening_error(self, error: BaseException) -> PortError:
        code = getattr(error, "errno", None)
        if code in _BUSY:
            message = f"port {self.path} is held by another program"
            return PortBusy(message, hint=f"close it; `fuser -v {self.path}` names it", port=self.path)
        if code in _DENIED:
            return PortPermission(
                f"no permission to open port {self.path}",
                hint="sudo usermod -a -G dialout $USER, then log out and in again",
                port=self.path,
            )
        if "://" in self.path:
            return PortMissing(
                f"no port {self.path}: {getattr(error, 'strerror', None) or error}",
                hint="start what serves it first, for example: omote simulate dynamixel --tcp HOST:PORT",
                port=self.path,
            )
        if code in _MISSING or not Path(self.path).exists():
            message = f"no port {self.path}"
            return PortMissing(message, hint="`omote ports` lists what is plugged in", port=self.path)
        return PortError(f"cannot open port {self.path}: {error}", hint="try `omote ports`", port=self.path)


def as_serial_port(port: str | os.PathLike[str] | SerialPort, baud: int) -> SerialPort:
    """The port of a path or URL; one that is a port already stays what it is."""
    return SerialPort(port, baud) if isinstance(port, str | os.PathLike) else port


def latency_s(path: str | os.PathLike[str], sys_root: str | os.PathLike[str] = "/sys") -> float | None:
    """Latency timer of the USB adapter behind a device path, in seconds; None where the system knows none.

    Linux keeps it in ``/sys/bus/usb-serial/devices/<name>/latency_timer`` (milliseconds).
    """
    name = Path(path).resolve().name
    try:
        text = (Path(sys_root) / "bus/usb-serial/devices" / name / "latency_timer").read_text()
        return int(text) / 1000.0
    except (OSError, ValueError):
        return None


def reply_margin_s(path: str | os.PathLike[str]) -> float:
    """Longest wait for a reply beyond its time on the wire, for what a device path leads to, in seconds."""
    if str(Path(path).resolve()).startswith("/dev/pts/") or "://" in str(path):
        return PSEUDO_MARGIN_S
    latency = latency_s(path)
    return 2 * (UNKNOWN_LATENCY_S if latency is None else latency) + HOST_MARGIN_S
