"""What drivers of every family share on one wire: its loss and return, limits before every goal, and a sure stop.

A family says in a handful of hooks how its link is opened and its servos are started, asked and switched off.
"""

from __future__ import annotations

import copy
import logging
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from drivers.base.bus import Bus, BusReport, BusState, Floats, ServoSpec, frozen
from drivers.base.errors import BusError, DriverError, PortLost
from drivers.core.limits import TargetLimits

log = logging.getLogger(__name__)


class WireBus(Bus):
    """A bus on one port. See :class:`~drivers.base.bus.Bus` for the contract; the hooks are the abstract methods below.

    Parameters
    ----------
    servos : the servos in the order of all arrays.
    clock : monotonic seconds.
    """

    def __init__(self, servos: Iterable[ServoSpec], *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(servos)
        self._clock = clock
        self._report = BusReport()
        self._limits = TargetLimits(self.servos, self._report)
        self._running = False
        self._lost = False

    # ------------------------------------------------------------------ hooks

    @property
    @abstractmethod
    def path(self) -> str:
        """Device path in use."""

    @abstractmethod
    def _use_path(self, path: str) -> None:
        """Another device path, from the next opening on."""

    @abstractmethod
    def _open_link(self) -> None:
        """Take the port; raises PortMissing, PortBusy or PortPermission."""

    @abstractmethod
    def _close_link(self) -> None:
        """Give the port back; never raises."""

    @abstractmethod
    def _bring_up(self) -> Floats:
        """Check every servo, switch it on where it stands, and return where (n,) rad; see :meth:`Bus.start`."""

    @abstractmethod
    def _send(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) that passed the limits; returns what they became in the servos' steps, (n,) rad."""

    @abstractmethod
    def _ask(self) -> BusState:
        """Ask for one cycle's measurements."""

    @abstractmethod
    def _switch_off(self) -> None:
        """Torque off for every reachable servo, each by itself; raises NoReply for those not confirmed."""

    def _settle(self, now_s: float) -> None:
        """Look after the servos before a cycle, such as watchdogs that tripped; nothing by default."""

    # ------------------------------------------------------------------ the port

    @property
    def running(self) -> bool:
        """True between ``start`` and ``stop``."""
        return self._running

    def open(self) -> None:
        """Take the port; see :meth:`drivers.base.bus.Bus.open`."""
        self._open_link()
        self._lost = False

    def reconnect(self) -> None:
        """Take the port again and, if the bus was running, start from where the servos are now.

        When that fails the bus counts as lost still, so that no goal goes out; call again later.
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
        """Close the port and count once when it goes away."""
        self._raise_if_lost()
        try:
            yield
        except PortLost:
            self._note_loss()
            raise

    def _raise_if_lost(self) -> None:
        if self._lost or not self.is_open:
            raise PortLost(
                f"port {self.path} is {'lost' if self._lost else 'not open'}",
                hint="plug it in again and call reconnect()" if self._lost else "call open()",
                port=self.path,
                servo_ids=self.ids,
            )

    def _note_loss(self) -> None:
        self._lost = True
        self._close_link()
        self._report.count("port_lost")
        log.error("port %s went away", self.path)

    # ------------------------------------------------------------------ starting and stopping

    def start(self) -> None:
        """Check every servo and switch it on where it stands; see :meth:`drivers.base.bus.Bus.start`."""
        if not self._running:
            self._start()

    def _start(self) -> None:
        with self._losing():
            self._limits.reset(self._bring_up(), self._clock())
            self._running = True

    def stop(self) -> None:
        """Torque off for every reachable servo; see :meth:`drivers.base.bus.Bus.stop`."""
        if not self._running:
            return
        self._running = False
        if self._lost:  # the adapter may be back
            self._reconnect_to_stop()
        with self._losing():
            self._switch_off()

    def _reconnect_to_stop(self) -> None:
        """Take the port again; without it nothing can be said of the servos, and that is what a user must hear."""
        try:
            self.reconnect()
        except DriverError as error:
            raise PortLost(
                f"servos not confirmed off, for their port is gone: {error}",
                hint="switch the servos' power off",
                port=self.path,
                servo_ids=self.ids,
            ) from error

    # ------------------------------------------------------------------ every cycle

    def write(self, angle_rad: ArrayLike) -> Floats:
        """Send the goals that limits allow; see :meth:`drivers.base.bus.Bus.write`.

        Raises
        ------
        ValueError : not n angles.
        BusError : the bus was not started.
        """
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
        """Ask for this cycle's measurements; see :meth:`drivers.base.bus.Bus.read`."""
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
        """A copy of the counters."""
        return copy.deepcopy(self._report)
