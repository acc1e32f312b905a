"""Bus of servos with Protocol 1.0 framing: sync writes out, replies read as each family can.

A servo that misses a deadline is left out until it has answered a greeting, so the others go on. Every goal is limited
in angle and speed and carries its speed, so that a servo that lost its memory in a brown-out is no faster. A motor that
switched off by itself is reported and stays off. There is no bus watchdog.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar

from drivers.base.bus import BusState, Flags, Floats, ServoInfo, ServoSpec, frozen
from drivers.base.errors import DriverError
from drivers.core.dead_man_switch import DeadManSwitch
from drivers.packets.packet import MAX_ID
from drivers.port.serialport import SerialPort
from drivers.protocol1 import startup
from drivers.protocol1.exchange import Exchanges
from drivers.protocol1.registers import Registers
from drivers.protocol1.startup import Policy, Startup
from drivers.protocol1.telemetry import Telemetry
from drivers.servos.bus import ServoBus
from drivers.servos.layout import Block
from drivers.servos.port import Port
from drivers.tables.tables import ControlTable, load_table

log = logging.getLogger(__name__)

SWITCH_CHECK_S = 1.0
"""Time between two checks of whether the dead man's switch still runs."""


class Protocol1Bus(ServoBus):
    """Servos with Protocol 1.0 framing on one serial port. See :class:`~drivers.base.bus.Bus` for the contract.

    port : device path (``/dev/serial/by-id/...`` survives a replug), or a port shared with servos of another protocol.
    baud : rate on the wire.
    feedback : ``"full"`` reads everything that is measured with every position, ``"position"`` position and speed.
    singles : of servos that must be read one by one, how many are read a cycle, in turn.
    slow_group : servos from which one slow value (torque) is read each cycle; 0 reads only those that raise an alert.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.
    watchdog_ms : 0: servos may hold their position when this program is killed. Any other time starts a small process
        that switches them off then (:mod:`drivers.core.dead_man_switch`); where that process is missing, it is
        logged once and counted as ``unkept``.
    clock : monotonic seconds.
    policy : fields of :class:`~drivers.protocol1.startup.Policy`, such as ``torque_limit``.

    Raises DriverError for an unknown model or an option that does not fit.
    """

    policy: Policy
    _registers: Registers
    _telemetry: Telemetry

    MODELS: ClassVar[tuple[str, ...]]
    """A model of each series that the family has: their tables decode the identity of a servo that is found."""
    PACKETS: ClassVar[type[Exchanges]] = Exchanges

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str | Port,
        baud: int = 1_000_000,
        margin_s: float | None = None,
        feedback: str = "full",
        singles: int = 6,
        slow_group: int = 4,
        watchdog_ms: int = 200,
        clock: Callable[[], float] = time.monotonic,
        **policy: Any,
    ) -> None:
        super().__init__(servos, clock=clock)
        self.policy = Policy(**policy)
        self._port = port if isinstance(port, Port) else Port(port, baud, margin_s)
        self._keep = watchdog_ms > 0 and os.name == "posix"
        self._switch: DeadManSwitch | None = None
        self._unkept, self._checked_s = False, 0.0
        self._registers = Registers(self.PACKETS(), self._port, self.servos)
        self._set_tables([load_table(servo.model) for servo in self.servos])
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, singles, slow_group)
        self._group_reads({})

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Servos that answer; ``ids`` None asks every id by itself, which takes a while (nothing better is safe)."""
        with self._detecting_loss():
            found = []
            for servo in range(MAX_ID + 1) if ids is None else ids:
                reply = self._registers.packets.hello(self._port, servo).replies.get(servo)
                if reply is not None and reply.params:  # not an error alone
                    found.append(self._info(servo, *startup.identity(reply, map(load_table, self.MODELS))))
                elif reply is None and servo not in self.ids:
                    self._port.suspects.discard(servo)  # no such servo
            return found

    def _table_of(self, servo: int, number: int, firmware: int) -> ControlTable:
        """Table of a model number."""
        return load_table(number)

    def _startup(self, policy: Policy | None = None) -> Startup:
        return Startup(self._registers, policy or self.policy)

    def _group_reads(self, indirect: Mapping[int, Block]) -> None:
        self._telemetry.rebuild({servo.id: startup.speed_steps(servo, self._registers) for servo in self.servos})

    def _identified(self) -> None:
        """Start the process that switches the servos off when this program is killed."""
        if not self._keep or hasattr(self, "simulation") or not _outlives_us(self._port.link):
            return
        if self._switch is not None and self._switch.watching:
            return
        self._dismiss()
        frames = self._registers.frames(dict.fromkeys(self.ids, 0), "torque")
        try:
            self._switch = DeadManSwitch(self.path, self._port.baudrate, frames)
            self._unkept = False
        except DriverError as error:
            self._log_unkept(str(error), error.hint)

    def _settle(self, now_s: float) -> None:
        """Check now and then whether the dead man's switch still runs."""
        if self._switch is None or now_s - self._checked_s < SWITCH_CHECK_S:
            return
        self._checked_s = now_s
        if not self._switch.watching:
            why = f"the process that switches the servos on {self.path} off if this program is killed has ended"
            self._log_unkept(why, "stop and start again to start another")

    def _log_unkept(self, why: str, hint: str) -> None:
        """Log once that the servos keep their torque when this program is killed."""
        if not self._unkept:
            self._unkept = True
            self._report.count("unkept")
            log.warning("%s; %s", why, hint)

    def _dismiss(self) -> None:
        switch, self._switch = self._switch, None
        if switch is not None:
            switch.dismiss()

    def _release(self) -> None:
        super()._release()
        self._dismiss()

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        """Sync writes of all goals, inside the servos' own limits too."""
        sent = self.scale.goals(angle_rad, self._goals)
        self._telemetry.send_goals(self._goals, self.driven)
        return sent

    @property
    def _reads_a_turn(self) -> int:
        return self._telemetry.turn

    def _ask(self) -> BusState:
        return self._telemetry.cycle(self._clock, self._running, self.scale)

    @property
    def load(self) -> Floats:
        """(n,) share of its stall torque that each motor gave when last read, positive towards greater angles."""
        return frozen(self.scale.sign * self._telemetry.load)

    @property
    def moving(self) -> Flags:
        """(n,) whether each servo reported that it moves when last read; False where its model does not report it."""
        return frozen(self._telemetry.moving, bool)


def _outlives_us(link: object) -> bool:
    """Whether servos stay on when this program is killed: not those of a bus simulated in it."""
    return isinstance(link, SerialPort) and not link.path.startswith("memory://")
