"""Bus of Dynamixel servos with Protocol 2.0: one sync write and one sync read per cycle.

A servo that misses a deadline is left out of the group reads until it has answered a ping (sent once a second at most
while it is silent), so the others go on. Every goal is limited in angle and speed. A tripped bus watchdog is cleared
after the goal was set to the servo's position. A motor that switched its torque off is reported and stays off.
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
from drivers.dynamixel.indirect import set_up_pointers
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

MAX_POINTER_RESTORES = 5
"""How often the indirect addresses of one servo are set again between two starts."""


class DynamixelBus(ServoBus):
    """Dynamixel servos on one serial port. See :class:`~drivers.base.bus.Bus` for the contract.

    servos, port, baud, margin_s, clock : see :class:`~drivers.protocol1.bus.Protocol1Bus`.
    feedback : ``"full"`` reads velocity and current with every position, and by indirect addressing temperature,
        hardware error, torque and watchdog too; ``"position"`` reads only the position.
    fast : use fast sync and bulk reads where the firmware of every servo has them.
    indirect : use indirect addressing where the model has it.
    slow_group : number of servos of which one request reads values that are not in the feedback (supply voltage, and
        torque, error and watchdog without indirect addressing). Each value is read every half second. 0 reads these
        values only of servos that raise an alert.
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
        self._set_tables([load_table(servo.model) for servo in self.servos])
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, fast, slow_group)
        self._use_indirect = indirect and feedback == "full"
        self._group_reads({})
        self._pointer_restores: Counter[int] = Counter()
        self._last_cycle_s = 0.0
        self._warn = RateLimitedLogger(log, clock)

    # ------------------------------------------------------------------ discovering, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Return the servos that answer; ``ids`` None pings all ids with one broadcast, which takes about a second."""
        with self._detecting_loss():
            if ids is None:
                found = self._registers.packets.ping_all(self._port)
            else:
                found = {i: params for i in ids if len(params := self._ping(i)) == PING_DATA}
            return [self._info(i, params[0] | params[1] << 8, params[2]) for i, params in sorted(found.items())]

    def _ping(self, servo: int) -> bytes:
        """Ping a servo and return the data of its reply; empty where it does not answer, or only with an error."""
        reply = self._registers.packets.hello(self._port, servo).replies.get(servo)
        if reply is None and servo not in self.ids:
            self._port.suspects.discard(servo)  # no such servo
        return b"" if reply is None else reply.params

    def _startup(self, policy: Policy | None = None) -> Startup:
        return Startup(self._registers, policy or self.policy, self._use_indirect)

    def _group_reads(self, indirect: Mapping[int, Block]) -> None:
        self._indirect_blocks = dict(indirect)
        self._telemetry.rebuild(indirect)

    def _finish_start(self, started: Started) -> Floats:
        angle_rad = super()._finish_start(started)
        self._pointer_restores.clear()
        self._last_cycle_s = self._clock()
        return angle_rad

    def _store_started(self, started: Started) -> None:
        self._set_indirect_blocks(self._indirect_blocks | started.mapped)
        self._telemetry.tripped.difference_update(started.ticks)
        super()._store_started(started)

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        """Send all goals with one sync write per group of servos, clipped to the servos' own limits as well."""
        sent = self.scale.goals(angle_rad, self._goals)
        self._telemetry.send_goals(self._goals, self.driven)
        return sent

    def _settle(self, now: float) -> None:
        """Read all bus watchdogs, and clear tripped ones, if the last cycle is long enough ago for them to trip."""
        pause, self._last_cycle_s = now - self._last_cycle_s, now
        limit = self.policy.watchdog_ms / 1000.0
        if self._running and limit and pause > limit:
            self._telemetry.read_watchdogs(self._clock)
            self._clear_watchdogs()

    def _ask(self) -> BusState:
        """Read the feedback of all servos, and one slow value of some; restore lost indirect addresses first."""
        if self._telemetry.unmapped:
            unmapped, self._telemetry.unmapped = sorted(self._telemetry.unmapped), set()
            for servo in unmapped:
                self._restore_pointers(servo)
        state = self._telemetry.cycle(self._clock, self._running, self.scale)
        if self._running and self._telemetry.tripped:
            self._clear_watchdogs()
        return state

    def _set_indirect_blocks(self, blocks: dict[int, Block]) -> None:
        """Group the servos again if ``blocks``, read through indirect addresses, by servo id, differ from before."""
        if blocks != self._indirect_blocks:
            self._group_reads(blocks)

    def _restore_pointers(self, servo: int) -> None:
        """Set the indirect addresses of a servo that lost them, as after a reboot.

        A servo that does not keep them is read without indirect addressing until the next start.
        """
        self._pointer_restores[servo] += 1
        may_restore = self._pointer_restores[servo] <= MAX_POINTER_RESTORES
        blocks = set_up_pointers(self._registers, [servo]) if may_restore else {}
        if not blocks:
            self._set_indirect_blocks({i: block for i, block in self._indirect_blocks.items() if i != servo})

    def _clear_watchdogs(self) -> None:
        """Clear tripped watchdogs and set each goal to the servo's position, so that no servo jumps.

        Three writes do that: clear the watchdog, set the goal, arm the watchdog. Until all three are confirmed, the bus
        sends the servo no goals: it would obey them as soon as the first write has arrived, and they may be far from
        its position, because it has ignored all goals since the watchdog tripped.
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
                label = self._registers.label(servo)  # it stays in `tripped`, even if its register reads 0 already
                self._warn("watchdog of servo %s is not cleared yet", label)
                log.debug("%s", error)
                continue
            self._telemetry.tripped.discard(servo)
            self._begin_at(index, self._radians(index, goal))
            self._presence.join(index)

    def _goal_at_present(self, servo: int) -> int:
        """Read and return the goal, in steps, that keeps a servo with torque at its position, inside its own limits."""
        startup, index = self._startup(), self.ids.index(servo)
        startup.started.limits[servo] = int(self.scale.lowest[index]), int(self.scale.highest[index])
        return startup.goals_at_present([servo], held=[servo])[servo]
