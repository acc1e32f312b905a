"""Base class of all drivers on one port: loss of the port and reconnecting, absent servos, target limits, a safe stop.

A family of servos implements the hooks: methods that open its port and start, drive, read and switch off its servos.
"""

from __future__ import annotations

import copy
import logging
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from drivers.base.bus import Bus, BusReport, BusState, Flags, Floats, ServoSpec, frozen
from drivers.base.errors import BusError, DriverError, PortLost, merge_errors
from drivers.core.limits import TargetLimits
from drivers.core.presence import Presence

log = logging.getLogger(__name__)

E = TypeVar("E", bound=DriverError)

JOIN_INTERVAL_S = 1.0
"""Least time between two attempts to start a servo that was left out; each attempt starts one servo."""
RETRY_DELAY_FACTOR = 10.0
"""A servo whose attempt failed is tried again after this factor times the duration of the attempt times the number of
servos that wait for a retry. All servos of the bus wait during an attempt, so attempts then take a tenth of the time at
most."""
MAX_ATTEMPT_S = 15.0
"""An attempt counts as no longer than this, so that a process that was suspended during one does not wait for hours."""
FAR_RAD = 0.4
"""A servo that answers again no further than this from its last goal is driven on without a new start."""


class WireBus(Bus):
    """A bus on one port; see :class:`~drivers.base.bus.Bus`.

    clock : monotonic time, s. Families override the hooks: the abstract methods, and those whose docstring says "Hook".
    """

    def __init__(self, servos: Iterable[ServoSpec], *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(servos)
        self._clock = clock
        self._report = BusReport()
        self._limits = TargetLimits(self.servos, self._report)
        self._presence = Presence(len(self.servos))
        self._reasons: dict[int, BusError] = {}  # why servos were left out, by index
        self._next_join_s, self._last_attempt = 0.0, -1  # time of the next attempt; index of the servo tried last
        self._retry_after_s: dict[int, float] = {}  # time before which a servo is not tried again, by index
        self._running = False
        self._unconfirmed = False  # torque may be on although the bus is not running
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
        """Check every servo and enable its torque at its present position; return the positions (n,) rad.

        See :meth:`Bus.start`. Where it raises, it has disabled the torque that it enabled, or set ``_unconfirmed``.
        """

    def _bring_back(self) -> Floats:
        """Hook: start again servos that were started before in this run; return their positions (n,) rad.

        The position is NaN for a servo that cannot be started, for which ``_leave_out`` is called. By default it is
        :meth:`_bring_up`, which needs all servos.
        """
        return self._bring_up()

    def _join(self, index: int) -> float:
        """Hook: start a servo that was left out, return its position, rad; raises BusError where that is not safe."""
        raise BusError("this bus leaves no servo out")

    @abstractmethod
    def _send(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) rad that passed the limits; return them rounded to the servos' steps, (n,) rad.

        Nothing may be sent to servos that are not :attr:`driven`.
        """

    @abstractmethod
    def _ask(self) -> BusState:
        """Request the measurements of one cycle and return the state of the servos."""

    @abstractmethod
    def _switch_off(self) -> None:
        """Disable the torque of every reachable servo separately; raises NoReply for servos not confirmed off."""

    def _settle(self, now_s: float) -> None:
        """Hook: called before goals are sent and before a read, for maintenance such as clearing watchdogs."""

    @property
    def running(self) -> bool:
        return self._running

    @property
    def may_be_on(self) -> bool:
        return self._running or (self._unconfirmed and self.is_open)

    @property
    def driven(self) -> Flags:
        return self._presence.driven

    @property
    def _reads_a_turn(self) -> int:
        """Hook: number of reads within which the position of every servo is requested."""
        return 1

    def open(self) -> None:
        try:
            self._open_link()
        except BaseException:
            self._close_link()  # it may have been opened before the error
            raise
        self._lost = False

    def reconnect(self) -> None:
        """Open the port again and, if the bus was running, start from the servos' present positions.

        Servos that cannot be started are left out and join later, see :meth:`Bus.start`. When all of them fail, the bus
        sends no goals and its port counts as lost; call again later.
        """
        self._close_link()
        self.open()
        if not self._running:
            return
        try:
            self._start(partly=True)
        except BaseException:
            self._lost = True
            self._close_link()
            raise

    def _release(self) -> None:
        self._close_link()

    @contextmanager
    def _detecting_loss(self) -> Iterator[None]:
        """Use the port in this context: where it disappears, the loss is counted and the port is closed.

        Raises PortLost then, and where the port is lost or closed already.
        """
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

    def _raise_if_stopped(self) -> None:
        if not self._running:
            raise BusError(f"the bus on {self.path} is not started", hint="call start()", port=self.path)

    def _error(self, kind: type[E], message: str, hint: str = "", indices: Iterable[int] | None = None) -> E:
        """Return an error that names this port and the servos at ``indices``, by default all."""
        ids = self.ids if indices is None else tuple(self.ids[index] for index in indices)
        return kind(message, hint=hint, port=self.path, servo_ids=ids)

    def _note_loss(self) -> None:
        self._lost = True
        self._close_link()
        self._report.count("port_lost")
        log.error("port %s went away", self.path)

    def start(self, *, partly: bool = False) -> None:
        if not self._running:
            self._start(partly)

    def _start(self, partly: bool = False) -> None:
        ran_before = self._running
        with self._detecting_loss():
            self._begin_driving(self._bring_back() if partly else self._bring_up())
            if not self._presence.driven.any():
                # the next reconnect() starts them again, and stop() switches off what may still be on
                self._running, self._unconfirmed = ran_before, True
                raise merge_errors({self.ids[index]: why for index, why in self._reasons.items()})

    def _begin_driving(self, position_rad: Floats) -> None:
        """Drive servos from their positions (n,) rad; a servo whose position is NaN is left out."""
        started = np.isfinite(position_rad)
        self._reasons = {index: why for index, why in self._reasons.items() if not started[index]}
        self._limits.reset(np.where(started, position_rad, 0.0), self._clock())
        self._presence.reset(started)
        self._retry_after_s.clear()
        self._next_join_s = self._clock() + JOIN_INTERVAL_S
        self._running, self._unconfirmed = True, False

    def _back_out(self) -> None:
        """Disable torque after a failed start may have enabled it; where that fails, :meth:`stop` tries again."""
        self._unconfirmed = True
        self._switch_off()
        self._unconfirmed = False

    def stop(self) -> None:
        if not self._running and not self._unconfirmed:
            return
        self._running, self._unconfirmed = False, True
        if self._lost:  # the adapter may have been plugged in again
            try:
                self.reconnect()
            except DriverError as error:
                message = f"servos not confirmed off, because their port is gone: {error}"
                raise self._error(PortLost, message, "switch the servos' power off") from error
        with self._detecting_loss():
            self._switch_off()
        self._unconfirmed = False

    def write(self, angle_rad: ArrayLike) -> Floats:
        """As :meth:`drivers.base.bus.Bus.write`; raises ValueError for not n angles, BusError when not started."""
        wanted = np.asarray(angle_rad, dtype=np.float64)
        if wanted.shape != (len(self.servos),):
            raise ValueError(f"angle_rad: shape {wanted.shape}, expected {(len(self.servos),)}")
        self._raise_if_stopped()
        self._raise_if_lost()  # a context manager here would delay the goals of every cycle
        try:
            now = self._clock()
            self._settle(now)
            sent = self._send(self._limits.apply(wanted, now, None if self._presence.all_driven else self.driven))
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
            if self._running and self.measures:
                self._follow(state)
        except PortLost:
            self._note_loss()
            raise
        self._report.cycles += 1
        return state

    def _follow(self, state: BusState) -> None:
        """Drive only servos whose positions are known, each from where it is; see :mod:`drivers.core.presence`."""
        for index in self._presence.note(state, self._reads_a_turn):
            self._resume_driving(index, float(state.position_rad[index]))
        if self._presence.some_left_out and self._clock() >= self._next_join_s:
            self._try_to_start_one(np.flatnonzero(self._presence.left_out & ~state.silent).tolist())

    def _resume_driving(self, index: int, angle_rad: float) -> None:
        """Drive a servo that answers again, from its position; start it again where that is far from its last goal.

        A servo that kept its torque stands near its last goal. If it reads a position far from there, it has lost its
        torque and its settings, or two servos answer at once and the position is wrong. A new start reads and sets all
        its registers again.
        """
        goal_rad = float(self._limits.target[index])
        if abs(angle_rad - goal_rad) <= FAR_RAD:
            self._begin_at(index, angle_rad)
            return
        message = f"it came back at {angle_rad:.2f} rad, far from its last goal of {goal_rad:.2f} rad"
        hint = "it is started again; check its supply, and whether a second servo has its id"
        self._give_up(index, self._error(BusError, message, hint, [index]))

    def _give_up(self, index: int, why: BusError) -> None:
        """Leave a servo out: send it no more goals until it has been started again."""
        self._presence.leave_out(index)
        self._leave_out(index, why)

    def _begin_at(self, index: int, angle_rad: float) -> None:
        """Set the last goal of one servo to its position, from which the next goals begin."""
        self._limits.reset_one(index, angle_rad, self._clock())

    def _try_to_start_one(self, waiting: Sequence[int]) -> None:
        """Try to start the next of the ``waiting`` servos (indices): they were left out and answer."""
        begun_s = self._clock()
        self._next_join_s = begun_s + JOIN_INTERVAL_S
        ready = [index for index in waiting if begun_s >= self._retry_after_s.get(index, begun_s)]
        if not ready:
            return
        index = min(ready, key=lambda each: (each <= self._last_attempt, each))
        self._last_attempt = index
        try:
            position_rad = self._join(index)
        except BusError as error:
            self._leave_out(index, error)
            self._delay_retry(index, begun_s)
            return
        self._drive_again(index, position_rad)

    def _delay_retry(self, index: int, begun_s: float) -> None:
        """Delay the next attempt after one that began at ``begun_s`` failed, and longer the next one of this servo."""
        now_s = self._clock()
        took_s = min(now_s - begun_s, MAX_ATTEMPT_S)
        self._next_join_s = max(self._next_join_s, now_s + took_s)
        waiting = len(self._retry_after_s.keys() | {index})
        self._retry_after_s[index] = now_s + RETRY_DELAY_FACTOR * took_s * waiting

    def _drive_again(self, index: int, angle_rad: float) -> None:
        """Drive a servo that was started while the bus ran, from its position."""
        self._retry_after_s.pop(index, None)
        self._begin_at(index, angle_rad)
        self._presence.join(index)
        if self._reasons.pop(index, None) is not None:
            log.warning("servo %s is driven again", self._label(index))

    def _leave_out(self, index: int, why: BusError) -> None:
        """Store why a servo cannot be started with the others, and log a new reason."""
        before = self._reasons.get(index)
        self._reasons[index] = why
        if before is None or str(before) != str(why):
            log.warning("servo %s is left out, the others go on: %s (%s)", self._label(index), why, why.hint)

    def _label(self, index: int) -> str:
        """The name of a servo in messages."""
        return f'"{self.servos[index].name}" (id {self.ids[index]}) on {self.path}'

    def report(self) -> BusReport:
        away = np.flatnonzero(~self.driven) if self._running else ()
        self._report.not_driven = tuple(sorted(self.ids[index] for index in away))
        return copy.deepcopy(self._report)
