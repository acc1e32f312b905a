"""Base class of all drivers on one port: loss of the port and reconnecting, absent servos, target limits, a safe stop.

A family implements hooks that open its port and start, drive, read and switch off its servos.
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

JOIN_S = 1.0
"""Time between two attempts to start servos that were left out, one of them at a time."""
JOIN_REST = 10.0
"""A servo whose attempt failed rests for so many times as long as that took, and as many times longer as servos rest:
all servos wait for each attempt, but for a tenth of the time at most once each has been tried."""
LONGEST_TRY_S = 15.0
"""An attempt counts as no longer than this: a process that was stopped in the middle of one must not wait for hours."""
FAR_RAD = 0.4
"""How far from its last goal a servo may stand that comes back and is simply driven on."""


class WireBus(Bus):
    """A bus on one port; see :class:`~drivers.base.bus.Bus`. Its hooks are abstract methods; `clock` is monotonic."""

    def __init__(self, servos: Iterable[ServoSpec], *, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(servos)
        self._clock = clock
        self._report = BusReport()
        self._limits = TargetLimits(self.servos, self._report)
        self._presence = Presence(len(self.servos))
        self._reasons: dict[int, BusError] = {}  # why servos were left out, by index
        self._join_s, self._tried = 0.0, -1
        self._rests_s: dict[int, float] = {}  # until when servos rest whose attempts failed, by index
        self._running = False
        self._unconfirmed = False  # servos may be on although the bus was stopped
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
        """Check every servo, switch it on at its present position, and return these (n,) rad; see :meth:`Bus.start`.

        Where it raises, what it had switched on was switched off, or ``_unconfirmed`` is set.
        """

    def _bring_back(self) -> Floats:
        """As :meth:`_bring_up`, but NaN for servos that cannot be started, with ``_leave_out`` called for each.

        For servos that ran already in this run. By default as many as a start needs: all of them.
        """
        return self._bring_up()

    def _join(self, index: int) -> float:
        """Start a servo that was left out, where it is (rad); raises BusError where that is not safe."""
        raise BusError("this bus leaves no servo out")

    @abstractmethod
    def _send(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) rad that passed the limits; returns them rounded to the servos' steps, (n,) rad.

        Nothing may be sent to servos that are not in :attr:`driven`.
        """

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

    @property
    def may_be_on(self) -> bool:
        return self._running or (self._unconfirmed and self.is_open)

    @property
    def driven(self) -> Flags:
        return self._presence.driven

    @property
    def _reads_a_turn(self) -> int:
        """Reads within which every servo is asked for its position."""
        return 1

    def open(self) -> None:
        try:
            self._open_link()
        except BaseException:
            self._close_link()  # it may be open already
            raise
        self._lost = False

    def reconnect(self) -> None:
        """Open the port again and, if the bus was running, start from the servos' present positions.

        Servos that cannot be started are left out and join later, see :meth:`Bus.start`. When all of them fail, the bus
        stays lost and sends no goals; call again later.
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

    def _raise_if_stopped(self) -> None:
        if not self._running:
            raise BusError(f"the bus on {self.path} is not started", hint="call start()", port=self.path)

    def _error(self, kind: type[E], message: str, hint: str = "", indices: Iterable[int] | None = None) -> E:
        """An error of this port that concerns some servos, by default all."""
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
        with self._losing():
            self._begin_driving(self._bring_back() if partly else self._bring_up())
            if not self._presence.driven.any():
                # the next reconnect() starts them again, and stop() switches off what may still be on
                self._running, self._unconfirmed = ran_before, True
                raise merge_errors({self.ids[index]: why for index, why in self._reasons.items()})

    def _begin_driving(self, here_rad: Floats) -> None:
        """Drive servos from where they are, (n,) rad; NaN for one that is left out."""
        started = np.isfinite(here_rad)
        self._reasons = {index: why for index, why in self._reasons.items() if not started[index]}
        self._limits.reset(np.where(started, here_rad, 0.0), self._clock())
        self._presence.reset(started)
        self._rests_s.clear()
        self._join_s = self._clock() + JOIN_S
        self._running, self._unconfirmed = True, False

    def _back_out(self) -> None:
        """Switch off what a failed start may have switched on; :meth:`stop` tries again where that is not confirmed."""
        self._unconfirmed = True
        self._switch_off()
        self._unconfirmed = False

    def stop(self) -> None:
        if not self._running and not self._unconfirmed:
            return
        self._running, self._unconfirmed = False, True
        if self._lost:  # the adapter may be back
            try:
                self.reconnect()
            except DriverError as error:
                message = f"servos not confirmed off, for their port is gone: {error}"
                raise self._error(PortLost, message, "switch the servos' power off") from error
        with self._losing():
            self._switch_off()
        self._unconfirmed = False

    def write(self, angle_rad: ArrayLike) -> Floats:
        """As :meth:`drivers.base.bus.Bus.write`; raises ValueError for not n angles, BusError when not started."""
        wanted = np.asarray(angle_rad, dtype=np.float64)
        if wanted.shape != (len(self.servos),):
            raise ValueError(f"angle_rad: shape {wanted.shape}, expected {(len(self.servos),)}")
        self._raise_if_stopped()
        self._raise_if_lost()  # not _losing(): the wire waits for every line between a reply and the next goals
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
            self._come_back(index, float(state.position_rad[index]))
        if self._presence.some_left_out and self._clock() >= self._join_s:
            self._let_join(np.flatnonzero(self._presence.left_out & ~state.silent).tolist())

    def _come_back(self, index: int, angle_rad: float) -> None:
        """Go on driving a servo that was away, from its position.

        One that kept its torque stands near its last goal. One that reads far from there has lost its torque and its
        settings, or two servos answer at once and what is read is wrong: it is started as if it were new, which reads
        all of it again.
        """
        goal_rad = float(self._limits.target[index])
        if abs(angle_rad - goal_rad) <= FAR_RAD:
            self._begin_at(index, angle_rad)
            return
        message = f"it came back at {angle_rad:.2f} rad, far from its last goal of {goal_rad:.2f} rad"
        hint = "it is started again; look for a second servo of its id, and at its supply"
        self._give_up(index, self._error(BusError, message, hint, [index]))

    def _give_up(self, index: int, why: BusError) -> None:
        """Send a servo no more goals until it has been started again."""
        self._presence.leave_out(index)
        self._leave_out(index, why)

    def _begin_at(self, index: int, angle_rad: float) -> None:
        """Let the goals of one servo begin at a position."""
        self._limits.reset_one(index, angle_rad, self._clock())

    def _let_join(self, waiting: Sequence[int]) -> None:
        """Try to start one of the servos that were left out and answer, each in its turn."""
        begun_s = self._clock()
        self._join_s = begun_s + JOIN_S
        ready = [index for index in waiting if begun_s >= self._rests_s.get(index, begun_s)]
        if not ready:
            return
        index = min(ready, key=lambda each: (each <= self._tried, each))
        self._tried = index
        try:
            here = self._join(index)
        except BusError as error:
            self._leave_out(index, error)
            self._let_rest(index, begun_s)
            return
        self._drive_again(index, here)

    def _let_rest(self, index: int, begun_s: float) -> None:
        """Try others first, after as long a pause as the attempt that failed took."""
        now_s = self._clock()
        took_s = min(now_s - begun_s, LONGEST_TRY_S)
        self._join_s = max(self._join_s, now_s + took_s)
        self._rests_s[index] = now_s + JOIN_REST * took_s * len(self._rests_s.keys() | {index})

    def _drive_again(self, index: int, angle_rad: float) -> None:
        """Drive a servo that was started by itself, from where it is."""
        self._rests_s.pop(index, None)
        self._begin_at(index, angle_rad)
        self._presence.join(index)
        if self._reasons.pop(index, None) is not None:
            log.warning("servo %s is driven again", self._label(index))

    def _leave_out(self, index: int, why: BusError) -> None:
        """Keep, and log where it is new, why a servo cannot be started with the others."""
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
