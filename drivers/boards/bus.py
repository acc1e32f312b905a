"""Base class of drivers for boards whose servos measure nothing: open loop, and no state is ever fresh.

A position is what the board reports it puts out, or what was sent where the board reports nothing.
"""

from __future__ import annotations

import logging
import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import numpy as np

from drivers.base.bus import BusState, Floats, ServoInfo, ServoSpec, frozen, make_state, read_only
from drivers.base.errors import BusError, DriverError, NoReply, PortLost
from drivers.base.rate_limited_log import RateLimitedLogger
from drivers.core.wirebus import WireBus
from drivers.port.serialport import SerialPort, as_serial_port, reply_margin_s

log = logging.getLogger(__name__)

STAGGER_S = 0.02
"""Pause between switching servos on, because each draws its full current as it jumps to its first pulse."""
MAX_OFF_TRIES = 6


class BoardBus(WireBus):
    """Servos on a board that does not measure them; see :class:`~drivers.base.bus.Bus`.

    ``start`` continues from the pulses that the board puts out already; a servo without pulses starts at its last known
    position, or at its ``rest_rad``.

    port : device path, or URL; or a :class:`~drivers.sim.serving.virtual.VirtualLink`, with its clock.
    baud : rate of the port.
    margin_s : longest wait for an answer beyond its time on the wire; None means it depends on the kind of port.
    stagger_s : pause between switching servos on.
    clock : monotonic seconds.
    """

    measures: ClassVar[bool] = False
    tells_torque: ClassVar[bool] = True
    """Whether the board can be asked which servos get pulses."""

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str | SerialPort,
        baud: int = 115_200,
        margin_s: float | None = None,
        stagger_s: float = STAGGER_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(servos, clock=clock)
        n = len(self.servos)
        self._port = as_serial_port(port, baud)
        self._margin_s, self._margin_set = margin_s or 0.0, margin_s is not None
        self._stagger_s = stagger_s
        self._position, self._position_s = np.full(n, math.nan), np.full(n, -math.inf)
        self._on = np.zeros(n, dtype=bool)
        self._silent = False
        self._mute: list[int] = []  # indices of servos that do not answer; the first was polled longest ago
        self._warn = RateLimitedLogger(log, clock)

    @abstractmethod
    def _begin(self) -> Floats:
        """Check the board and return what it puts out: (n,) rad, NaN where a servo gets no pulses."""

    @abstractmethod
    def _go(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) rad, NaN for none; returns them rounded to the board's steps, (n,) rad."""

    @abstractmethod
    def _poll(self) -> None:
        """Request positions from the board, and call :meth:`_note` for each that it reports."""

    @abstractmethod
    def _off(self, index: int) -> None:
        """Switch one servo off, without waiting."""

    def _off_confirmed(self, index: int) -> bool:
        """Whether the board reports that a servo is off; True where it cannot report that."""
        return True

    @property
    def is_open(self) -> bool:
        return self._port.is_open

    @property
    def path(self) -> str:
        return self._port.path

    def _use_path(self, path: str) -> None:
        self._port.path = path

    def _open_link(self) -> None:
        self._port.open()
        self._silent = False
        self._mute = []
        if not self._margin_set:
            self._margin_s = reply_margin_s(self._port.path)

    def _close_link(self) -> None:
        self._port.close()

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Return the configured channels and whether they get pulses; whether a servo is connected is unknown."""
        with self._detecting_loss():
            present = self._begin()
        return [
            ServoInfo(servo.id, 0, servo.model, 0, torque=bool(on) if self.tells_torque else None)
            for servo, on in zip(self.servos, np.isfinite(present), strict=True)
            if ids is None or servo.id in ids
        ]

    def _bring_up(self) -> Floats:
        present = self._begin()
        rest = np.where(np.isnan(self._position), [servo.rest_rad for servo in self.servos], self._position)
        rest = np.clip(rest, [servo.min_rad for servo in self.servos], [servo.max_rad for servo in self.servos])
        try:
            for index in np.flatnonzero(np.isnan(present)):
                self._go(np.where(np.arange(len(rest)) == index, rest, math.nan))
                if self._stagger_s:
                    self._port.sleep(self._stagger_s)
        except BaseException:
            self._back_out()
            raise
        start = np.where(np.isnan(present), rest, present)
        self._on[:] = True
        self._position, self._position_s = start.copy(), np.full(len(start), self._clock())
        return start

    def _switch_off(self) -> None:
        """Switch off every servo separately, and again until the board confirms it where it can."""
        left = list(range(len(self.servos)))
        lost: PortLost | None = None
        try:
            for index in left:
                self._off(index)
            for _ in range(MAX_OFF_TRIES):
                left = [index for index in left if not self._try_off(index)]
                if not left:
                    break
        except PortLost as error:
            lost = error
        self._on[:] = False
        if left:
            raise self._not_off_error(left, lost) from lost

    def _try_off(self, index: int) -> bool:
        try:
            self._off(index)
            return self._off_confirmed(index)
        except BusError:
            return False

    def _not_off_error(self, left: Sequence[int], lost: PortLost | None) -> DriverError:
        which = ", ".join(f"{self.ids[index]} ({self.servos[index].name})" for index in left)
        message = f"not confirmed off on {self.path}: {which}" + (f" ({lost})" if lost else "")
        return self._error(PortLost if lost else NoReply, message, "switch the servos' power off", left)

    def _send(self, angle_rad: Floats) -> Floats:
        sent = self._go(angle_rad)
        self._on[:] = True
        return sent

    def _ask(self) -> BusState:
        self._poll()
        n, now = len(self.servos), self._clock()
        unknown, none = frozen(np.full(n, math.nan)), frozen(np.zeros(n), np.uint8)
        silent = np.full(n, self._silent)
        silent[self._mute] = True
        self._report.silent = tuple(servo for servo, mute in zip(self.ids, silent, strict=True) if mute)
        measured = np.array([self._position, unknown, unknown, now - self._position_s])
        slow = none, unknown, unknown, none, frozen(self._on, bool)
        return make_state(now, measured, frozen(np.zeros(n), bool), read_only(silent), slow)

    def _note(self, index: int, angle_rad: float) -> None:
        """Store what the board reports of one servo; NaN is no pulses."""
        on = not math.isnan(angle_rad)
        if self._running and self._on[index] and not on:
            self._report.count("torque_lost", self.servos[index].id)
        self._on[index] = on
        self._position_s[index] = self._clock()
        if on:
            self._position[index] = angle_rad

    def _note_answer(self, answered: bool) -> None:
        """Store whether the board answered in this cycle; log changes."""
        if answered == self._silent:
            self._silent = not answered
            self._warn(f"the board on {self.path} {'answers again' if answered else 'does not answer'}")
