"""Bus of Dynamixel servos with Protocol 2.0: one sync write and one sync read a cycle.

A servo that misses a deadline is left out of the group until it has answered a ping (once a second at most while it is
silent), so the others go on. Every goal is limited in angle and speed. A tripped watchdog is cleared with the goal
where the servo is. A motor that switched off by itself is reported and stays off.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from drivers.base.bus import BusState, Floats, ServoInfo, ServoSpec
from drivers.base.errors import BusError, PortLost
from drivers.base.rate_limited_log import RateLimitedLogger
from drivers.dynamixel.indirect import set_up
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import PING_DATA, Packets
from drivers.dynamixel.startup import Policy, Startup
from drivers.dynamixel.telemetry import Telemetry
from drivers.servos.bus import ServoBus
from drivers.servos.layout import Block
from drivers.servos.port import Port
from drivers.servos.startup import Started
from drivers.tables.tables import load_table

log = logging.getLogger(__name__)

MAP_TRIES = 5
"""How often the pointers of one servo are set again between two starts."""


class DynamixelBus(ServoBus):
    """Dynamixel servos on one serial port. See :class:`~drivers.base.bus.Bus` for the contract.

    servos, port, baud, margin_s, clock : see :class:`~drivers.protocol1.bus.Protocol1Bus`.
    feedback : ``"full"`` reads velocity and current with every position, and by indirect addressing temperature,
        hardware error, torque and watchdog too; ``"position"`` reads only the position.
    fast : use fast reads where every servo's firmware has them.
    indirect : use indirect addressing where the model has it.
    slow_group : servos read at once for values that are not in the feedback (supply, and torque, error and watchdog
        where they are not), so that each is read every half second; 0 reads only servos that raise an alert.
    policy : fields of :class:`~drivers.dynamixel.startup.Policy`, such as ``watchdog_ms``.

    Raises DriverError for an unknown model or an option that does not fit.
    """

    policy: Policy
    _port: Port
    _registers: Registers
    _telemetry: Telemetry

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        baud: int = 1_000_000,
        feedback: str = "full",
        fast: bool = True,
        indirect: bool = True,
        margin_s: float | None = None,
        slow_group: int = 4,
        clock: Callable[[], float] = time.monotonic,
        **policy: object,
    ) -> None:
        super().__init__(servos, clock=clock)
        self.policy = Policy(**policy)  # type: ignore[arg-type]
        self._port = Port(port, baud, margin_s)
        self._registers = Registers(Packets(), self._port, self.servos)
        self._tables([load_table(servo.model) for servo in self.servos])
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, fast, slow_group)
        self._may_map = indirect and feedback == "full"
        self._group({})
        self._remapped: Counter[int] = Counter()
        self._heard_s = 0.0
        self._warn = RateLimitedLogger(log, clock)

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Servos that answer; ``ids`` None asks all ids at once, which takes about a second."""
        with self._losing():
            if ids is None:
                found = self._registers.packets.ping_all(self._port)
            else:
                found = {i: params for i in ids if len(params := self._ping(i)) == PING_DATA}
            return [self._info(i, params[0] | params[1] << 8, params[2]) for i, params in sorted(found.items())]

    def _ping(self, servo: int) -> bytes:
        """The data of a servo's answer to a ping; empty where it does not answer, or only with an error."""
        reply = self._registers.packets.hello(self._port, servo).replies.get(servo)
        if reply is None and servo not in self.ids:
            self._port.suspects.discard(servo)  # no such servo
        return b"" if reply is None else reply.params

    def _startup(self, policy: Policy | None = None) -> Startup:
        return Startup(self._registers, policy or self.policy, self._may_map)

    def _group(self, mapped: Mapping[int, Block]) -> None:
        self._mapped = dict(mapped)
        self._telemetry.rebuild(mapped)

    def _started(self, started: Started) -> Floats:
        here = super()._started(started)
        self._remapped.clear()
        self._heard_s = self._clock()
        return here

    def _use(self, started: Started) -> None:
        self._use_map(self._mapped | started.mapped)
        self._telemetry.tripped.difference_update(started.ticks)
        super()._use(started)

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        """One sync write of all goals, inside the servos' own limits too."""
        sent = self.scale.goals(angle_rad, self._goals)
        self._telemetry.send_goals(self._goals, self.driven)
        return sent

    def _settle(self, now: float) -> None:
        """Read all watchdogs when the caller paused for so long that they may have tripped."""
        pause, self._heard_s = now - self._heard_s, now
        limit = self.policy.watchdog_ms / 1000.0
        if self._running and limit and pause > limit:
            self._telemetry.ask_watchdogs(self._clock)
            self._clear_watchdogs()

    def _ask(self) -> BusState:
        """One sync read of all servos and one slow value of some."""
        if self._telemetry.unmapped:
            unmapped, self._telemetry.unmapped = sorted(self._telemetry.unmapped), set()
            for servo in unmapped:
                self._map_again(servo)
        state = self._telemetry.cycle(self._clock, self._running, self.scale)
        if self._running and self._telemetry.tripped:
            self._clear_watchdogs()
        return state

    def _use_map(self, mapped: dict[int, Block]) -> None:
        """Group the servos again where other registers are mapped now."""
        if mapped != self._mapped:
            self._group(mapped)

    def _map_again(self, servo: int) -> None:
        """Set the pointers of a servo that lost them; one that does not keep them is read without from now on."""
        self._remapped[servo] += 1
        mapped = set_up(self._registers, [servo]) if self._remapped[servo] <= MAP_TRIES else {}
        if not mapped:
            self._use_map({i: block for i, block in self._mapped.items() if i != servo})

    def _clear_watchdogs(self) -> None:
        """Clear tripped watchdogs with the goal where the servo is, so that nothing jumps.

        Until all of that is confirmed the servo is sent no goals. It ignored those since the watchdog tripped, so they
        may be far from it, and it would obey the next one as soon as the first write of these has reached it.
        """
        left_out = {self.ids[index] for index in np.flatnonzero(self._presence.left_out)}
        for servo in sorted(self._telemetry.tripped - left_out):
            index = self.ids.index(servo)
            self._presence.hold_back(index)
            try:
                self._registers.put(servo, "watchdog", 0, tries=1)
                goal = self._goal_at_present(servo)
                self._registers.put(servo, "goal", goal, tries=1)
                self._registers.put(servo, "watchdog", self.policy.watchdog_steps, tries=1)
            except PortLost:
                raise
            except BusError as error:
                label = self._registers.label(servo)  # it is not forgotten: its register may read 0 now
                self._warn("watchdog of servo %s is not cleared yet", label)
                log.debug("%s", error)
                continue
            self._telemetry.tripped.discard(servo)
            self._begin_at(index, self._radians(index, goal))
            self._presence.join(index)

    def _goal_at_present(self, servo: int) -> int:
        """The goal that keeps a servo that holds where it is, inside its own limits: it refuses any other."""
        startup, index = self._startup(), self.ids.index(servo)
        startup.started.limits[servo] = int(self.scale.lowest[index]), int(self.scale.highest[index])
        return startup.goals_at_present([servo], held=[servo])[servo]
