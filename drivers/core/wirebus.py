"""Base class of all drivers on one port: loss of the port and reconnecting, target limits, and a safe stop.

A family implements hooks that open its port and start, drive, read and switch off its servos.
"""

from __future__ import annotations

import copy
import logging
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from drivers.base.bus import Bus, BusReport, BusState, Floats, ServoSpec, frozen
from drivers.base.errors import BusError, DriverError, PortLost
from drivers.core.limits import TargetLimits

log = logging.getLogger(__name__)

E = TypeVar("E", bound=DriverError)


class WireBus(Bus):
    """A bus on one port; see :class:`~drivers.base.bus.Bus`. Its hooks are abstract methods; `clock` is monotonic."""

    def __init__(self, servos: Iterable[ServoSpec], *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(servos)
        self._clock = clock
        self._report = BusReport()
        self._limits = TargetLimits(self.servos, self._report)
        self._running = False
        self._lost = False

    @property
    @abstractmethod
    def path(self) -> str:
        """Device path in use."""

    @abstractmethod
    def _use_path(self, path: str) -> None:
        """Set the device path for the next opening."""

    @abstractmethod
    def _open_link(self) -> None:
        """Open the port; raises PortMissing, PortBusy or PortPermission."""

    @abstractmethod
    def _close_link(self) -> None:
        """Close the port; never raises."""

    @abstractmethod
    def _bring_up(self) -> Floats:
        """Check every servo, switch it on at its present position, and return these (n,) rad; see :meth:`Bus.start`."""

    @abstractmethod
    def _send(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) rad that passed the limits; returns them rounded to the servos' steps, (n,) rad."""

    @abstractmethod
    def _ask(self) -> BusState:
        """Read one cycle's measurements."""

    @abstractmethod
    def _switch_off(self) -> None:
        """Switch every reachable servo off, each by itself; raises NoReply for those not confirmed."""

    def _settle(self, now_s: float) -> None:
        """Maintain the servos before a cycle, as after tripped watchdogs; does nothing by default."""

    @property
    def running(self) -> bool:
        return self._running

    def open(self) -> None:
        self._open_link()
        self._lost = False

    def reconnect(self) -> None:
        """Open the port again and, if the bus was running, start from the servos' present positions.

        When that fails the bus stays lost and sends no goals; call again later.
        """
        self._close_link()
        self.open()
        if not self._running:
            return
        try:
            self._start()
        except BaseException:
            self._lost = True
            self._close_link()
            raise

    def _release(self) -> None:
        self._close_link()

    @contextmanager
    def _losing(self) -> Iterator[None]:
        """Context that closes the port and counts the loss when it disappears."""
        self._raise_if_lost()
        try:
            yield
        except PortLost:
            self._note_loss()
            raise

    def _raise_if_lost(self) -> None:
        if self._lost:
            raise self._error(PortLost, f"port {self.path} is lost", "plug it in again and call reconnect()")
        if not self.is_open:
            raise self._error(PortLost, f"port {self.path} is not open", "call open()")

    def _error(self, kind: type[E], message: str, hint: str = "", indices: Iterable[int] | None = None) -> E:
        """An error of this port that concerns some servos, by default all."""
        ids = self.ids if indices is None else tuple(self.ids[index] for index in indices)
        return kind(message, hint=hint, port=self.path, servo_ids=ids)

    def _note_loss(self) -> None:
        self._lost = True
        self._close_link()
        self._report.count("port_lost")
        log.error("port %s went away", self.path)

    def start(self) -> None:
        if not self._running:
            self._start()

    def _start(self) -> None:
        with self._losing():
            self._limits.reset(self._bring_up(), self._clock())
            self._running = True

    def stop(self) -> None:
        if not self._running:
            return
        self._running = False
        if self._lost:  # the adapter may be back
            try:
                self.reconnect()
            except DriverError as error:
                message = f"servos not confirmed off, for their port is gone: {error}"
                raise self._error(PortLost, message, "switch the servos' power off") from error
        with self._losing():
            self._switch_off()

    def write(self, angle_rad: ArrayLike) -> Floats:
        """As :meth:`drivers.base.bus.Bus.write`; raises ValueError for not n angles, BusError when not started."""
        wanted = np.asarray(angle_rad, dtype=np.float64)
        if wanted.shape != (len(self.servos),):
            raise ValueError(f"angle_rad: shape {wanted.shape}, expected {(len(self.servos),)}")
        if not self._running:
            raise BusError(f"the bus on {self.path} is not started", hint="call start()", port=self.path)
        self._raise_if_lost()  # not _losing(): between a reply and the next goals the wire waits for every line here
        try:
            now = self._clock()
            self._settle(now)
            sent = self._send(self._limits.apply(wanted, now))
        except PortLost:
            self._note_loss()
            raise
        self._report.writes += 1
        return frozen(sent)

    def read(self) -> BusState:
        self._raise_if_lost()
        try:
            self._settle(self._clock())
            state = self._ask()
        except PortLost:
            self._note_loss()
            raise
        self._report.cycles += 1
        return state

    def report(self) -> BusReport:
        return copy.deepcopy(self._report)
