"""What a bus knows of its servos, and who of them is asked: silent ones are left out and greeted now and then."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, Flags
from drivers.base.rate_limited_log import RateLimitedLogger
from drivers.core.scale import Scale
from drivers.packets.packet import ALERT
from drivers.servos.registers import Registers

log = logging.getLogger(__name__)

PROBE_S = 1.0
"""How often one silent servo is asked whether it is back."""
FAILED_GREETINGS = 3
"""Greetings without an answer that one cycle may wait for."""


class Telemetry(ABC):
    """Remembers what the servos of a bus said, and who of them keeps silent. A protocol asks them.

    Parameters
    ----------
    registers : the wire and the control tables.
    ids : n servo ids in the order of all arrays.
    report : counters to add to.
    """

    def __init__(self, registers: Registers[Any], ids: Sequence[int], report: BusReport) -> None:
        self._registers, self._packets, self._port = registers, registers.packets, registers.port
        self.ids, self.report = tuple(ids), report
        n = len(self.ids)
        self._known = np.full((6, n), np.nan)
        self._ticks, self._speed, self._current, self._seen_s, self._volts, self._celsius = self._known
        self._octets = np.zeros((4, n), np.uint8)
        self._error, self._hardware = self._octets[:2]
        self._torque, self._fresh = self._octets[2:].view(bool)
        self._alarmed = False
        self._slow_state: tuple[NDArray[Any], ...] | None = None
        self._place = {servo: index for index, servo in enumerate(self.ids)}
        self._missed: set[int] = set()
        self._say = RateLimitedLogger(log, self._port.clock)
        self._silent: deque[int] = deque()
        self._probe_s = -np.inf

    @abstractmethod
    def _look_at(self, servo: int) -> None:
        """Ask one servo next whether it holds, before the turn of the others."""

    def _forget(self) -> None:
        """Nothing is known of where the servos are, and nobody is silent."""
        self._ticks[:] = np.nan  # the servos may have been moved since
        self._seen_s[:] = -np.inf
        self._missed.clear()
        self._silent.clear()

    def started(self, ids: Sequence[int]) -> None:
        """Torque of these servos was read back as on."""
        self._slow_state = None
        self._torque[[self._place[servo] for servo in ids]] = True

    def silent_ids(self) -> tuple[int, ...]:
        """Servos that are only probed now and then."""
        return tuple(sorted(self._silent))

    def state(self, scale: Scale, now: float) -> BusState:
        """Everything known, in SI units."""
        silent = np.isin(self.ids, self._silent) if self._silent else np.zeros(len(self.ids), bool)
        error, volts, celsius, hardware, torque = self._told()
        position, velocity, current, age = sealed(scale.measured(self._known, now))
        return BusState(
            time_s=now,
            position_rad=position,
            velocity_rad_s=velocity,
            current_a=current,
            fresh=sealed(self._fresh.copy()),
            age_s=age,
            error=error,
            silent=sealed(silent),
            voltage_v=volts,
            temperature_c=celsius,
            hardware_error=hardware,
            torque=torque,
        )

    def _told(self) -> tuple[NDArray[Any], ...]:
        """Error, supply, temperature, hardware error and torque, read-only; new arrays only where something changed."""
        if self._slow_state is None:
            slow = (self._error, self._volts, self._celsius, self._hardware, self._torque)
            self._slow_state = tuple(sealed(array.copy()) for array in slow)
        return self._slow_state

    # ------------------------------------------------------------------ who answers

    def _revive(self, now: float) -> None:
        """Greet who missed its time: at once the first time, then one silent servo a second."""
        suspects, failed = self._port.suspects, 0
        for servo in [i for i in self._silent if i not in suspects]:  # it answered another question, as in recover()
            self._silent.remove(servo)
            self._returned(servo)
        for servo in [i for i in self.ids if i in suspects and i not in self._silent]:
            if self._packets.revive(self._port, servo):
                self._missed.discard(servo)
                continue
            self._silent.append(servo)
            self._say("servo %s stopped answering", self._registers.label(servo))
            failed += 1
            if failed == FAILED_GREETINGS:
                return
        if failed:
            self._probe_s = now + PROBE_S
        if self._silent and now >= self._probe_s:
            self._probe(now)

    def _probe(self, now: float) -> None:
        self._probe_s = now + PROBE_S
        while self._silent:
            servo = self._silent[0]
            if not self._packets.revive(self._port, servo):
                self._silent.rotate(-1)
                return
            self._silent.popleft()
            self._returned(servo)

    def _returned(self, servo: int) -> None:
        self._missed.discard(servo)
        self._look_at(servo)  # it may have lost its supply, and its torque with it
        self._say("servo %s answers again", self._registers.label(servo))

    def _note_missing(self, missing: Sequence[int], corrupt: bool) -> None:
        for servo in missing:
            if servo not in self._missed:
                self._missed.add(servo)
                self.report.count("corrupt" if corrupt else "no_reply", servo)

    # ------------------------------------------------------------------ what they say

    def _note_errors(self, ids: Sequence[int], where: NDArray[np.intp], errors: NDArray[np.uint8]) -> None:
        """Keep the error bytes of k servos, and tell whose alert is new."""
        rising = errors & ~self._error[where] & ALERT
        self._error[where] = errors
        self._alarmed, self._slow_state = bool(self._error.any()), None
        if rising.any():
            for servo in [servo for servo, new in zip(ids, rising, strict=True) if new]:
                self.report.count("alert", servo)
                self._say("servo %s reports a hardware error", self._registers.label(servo))
                self._look_at(servo)

    def _note_torque(self, ids: Sequence[int], where: NDArray[np.intp], now_on: Flags, running: bool) -> None:
        """Keep whether the motors of k servos are on, and tell which let go by themselves."""
        let_go = self._torque[where] & ~now_on
        self._torque[where], self._slow_state = now_on, None
        if not running or not let_go.any():
            return
        for servo in [servo for servo, gone in zip(ids, let_go, strict=True) if gone]:
            self.report.count("torque_lost", servo)
            self._say("servo %s let go: its torque is off", self._registers.label(servo))


def sealed(array: NDArray[Any]) -> NDArray[Any]:
    """The array itself, read-only from now on."""
    array.flags.writeable = False
    return array
