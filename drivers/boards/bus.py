"""What drivers of boards share whose servos tell nothing: an open loop, said to be one in every state.

The board is asked what it puts out; where it cannot be asked the position is what it was told. Nothing is fresh.
"""

from __future__ import annotations

import logging
import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import numpy as np

from drivers.base.bus import BusState, Floats, ServoInfo, ServoSpec, frozen
from drivers.base.errors import BusError, NoReply, PortLost
from drivers.base.rate_limited_log import RateLimitedLogger
from drivers.core.wirebus import WireBus
from drivers.port.serialport import SerialPort, as_serial_port, reply_margin_s

log = logging.getLogger(__name__)

STAGGER_S = 0.02
"""Pause between switching servos on: each jumps with all its power to its first pulse."""
OFF_TRIES = 6


class BoardBus(WireBus):
    """Servos behind a board that does not measure them. See :class:`~drivers.base.bus.Bus` for the contract.

    ``start`` goes on from the pulses that the board puts out already; a servo without any begins where it was last
    known to be, or at its ``rest_rad``.

    Parameters
    ----------
    servos : the servos in the order of all arrays.
    port : device path, or URL; or a :class:`~drivers.sim.serving.virtual.VirtualLink`, with its clock.
    baud : rate of the port.
    margin_s : longest wait for an answer beyond its time on the wire; None takes it from what the port is.
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
        self._mute: list[int] = []  # servos that a board answers nothing about, longest not asked first
        self._say = RateLimitedLogger(log, clock)

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _begin(self) -> Floats:
        """Make sure of the board, and say what it puts out: (n,) rad, NaN where a servo gets no pulses."""

    @abstractmethod
    def _go(self, angle_rad: Floats) -> Floats:
        """Send goals (n,) rad, NaN for none; returns what they became, (n,) rad."""

    @abstractmethod
    def _poll(self) -> None:
        """Ask for one cycle's worth of what can be asked, and note it."""

    @abstractmethod
    def _off(self, index: int) -> None:
        """Switch one servo off; nothing is awaited."""

    def _off_confirmed(self, index: int) -> bool:
        """Whether the board says that a servo is off; True where it cannot say."""
        return True

    # ------------------------------------------------------------------ the port

    @property
    def is_open(self) -> bool:
        """True while the port is held."""
        return self._port.is_open

    @property
    def path(self) -> str:
        """Device path in use."""
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

    def _wire_s(self, count: int) -> float:
        """Time of so many bytes on the wire."""
        return 10.0 * count / self._port.baud

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """The configured channels and whether they get pulses; a board cannot tell what is plugged into them."""
        with self._losing():
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
                self._switch_on(int(index), rest)
        except BaseException:
            self._switch_off()
            raise
        start = np.where(np.isnan(present), rest, present)
        self._on[:] = True
        self._position, self._position_s = start.copy(), np.full(len(start), self._clock())
        return start

    def _switch_on(self, index: int, rest: Floats) -> None:
        goal = np.full(len(rest), math.nan)
        goal[index] = rest[index]
        self._go(goal)
        if self._stagger_s:
            self._port.sleep(self._stagger_s)

    def _switch_off(self) -> None:
        """Pulses off for every servo, each by itself and asked after where the board can say."""
        left = list(range(len(self.servos)))
        lost: PortLost | None = None
        try:
            for index in left:
                self._off(index)
            for _ in range(OFF_TRIES):
                left = [index for index in left if not self._sure_off(index)]
                if not left:
                    break
        except PortLost as error:
            lost = error
        self._on[:] = False
        if left:
            raise self._not_off(left, lost) from lost

    def _sure_off(self, index: int) -> bool:
        try:
            self._off(index)
            return self._off_confirmed(index)
        except PortLost:
            raise
        except BusError:
            return False

    def _not_off(self, left: Sequence[int], lost: PortLost | None) -> BusError | PortLost:
        servos = [self.servos[index] for index in left]
        which = ", ".join(f"{servo.id} ({servo.name})" for servo in servos)
        kind = NoReply if lost is None else PortLost
        return kind(
            f"not confirmed off on {self.path}: {which}" + (f" ({lost})" if lost else ""),
            hint="switch the servos' power off",
            port=self.path,
            servo_ids=tuple(servo.id for servo in servos),
        )

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        sent = self._go(angle_rad)
        self._on[:] = True
        return sent

    def _ask(self) -> BusState:
        self._poll()
        return self._state()

    def _note(self, index: int, angle_rad: float) -> None:
        """What the board says of one servo; NaN is no pulses."""
        on = not math.isnan(angle_rad)
        if self._running and self._on[index] and not on:
            self._report.count("torque_lost", self.servos[index].id)
        self._on[index] = on
        self._position_s[index] = self._clock()
        if on:
            self._position[index] = angle_rad

    def _heard(self, answered: bool) -> None:
        """Whether the board answered this cycle."""
        if answered != self._silent:
            return
        self._silent = not answered
        if answered:
            self._say("the board on %s answers again", self.path)
        else:
            self._say(f"the board on {self.path} does not answer")

    def _state(self) -> BusState:
        n, now = len(self.servos), self._clock()
        unknown, none, silent = frozen(np.full(n, math.nan)), np.zeros(n, dtype=np.uint8), np.full(n, self._silent)
        silent[self._mute] = True
        self._report.silent = tuple(servo for servo, mute in zip(self.ids, silent, strict=True) if mute)
        return BusState(
            time_s=now,
            position_rad=frozen(self._position),
            velocity_rad_s=unknown,
            current_a=unknown,
            fresh=frozen(np.zeros(n), bool),
            age_s=frozen(now - self._position_s),
            error=frozen(none, np.uint8),
            silent=frozen(silent, bool),
            voltage_v=unknown,
            temperature_c=unknown,
            hardware_error=frozen(none, np.uint8),
            torque=frozen(self._on, bool),
        )
