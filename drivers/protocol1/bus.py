"""A wire of servos with Protocol 1.0 framing: sync writes out, the families' ways of reading back.

What keeps it alive is what keeps every driver here alive: a servo that misses its time is left out until it has
answered a greeting (once a second at most while it is silent), so the others go on; every goal is limited in angle
and in speed, and carries its speed, so that a servo that lost its memory in a brown-out is no quicker; and a motor
that let go by itself is told, never switched on again behind the user's back. There is no bus watchdog.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import BusState, Flags, Floats, ServoInfo, ServoSpec, frozen
from drivers.base.errors import DriverError, PortLost
from drivers.core.dead_man_switch import DeadManSwitch
from drivers.packets.packet1 import Packet1
from drivers.port.serialport import SerialPort
from drivers.protocol1 import startup
from drivers.protocol1.exchange import Exchanges
from drivers.protocol1.registers import Registers
from drivers.protocol1.startup import Policy, Startup
from drivers.protocol1.telemetry import Telemetry
from drivers.servos.bus import ServoBus
from drivers.servos.startup import Started
from drivers.tables.tables import ControlTable, load_table, model_name

log = logging.getLogger(__name__)

LAST_ID = 252
LOOK_S = 1.0
"""How often a running bus looks whether its switch is still there."""


class Protocol1Bus(ServoBus):
    """Servos with Protocol 1.0 framing on one serial port. See :class:`~drivers.base.bus.Bus` for the contract.

    Parameters
    ----------
    servos : the servos in the order of all arrays.
    port : device path; ``/dev/serial/by-id/...`` survives a replug.
    baud : rate on the wire.
    feedback : ``"full"`` reads everything that is measured with every position, ``"position"`` position and speed.
    singles : of servos that must be read one by one, how many are read a cycle, in turn.
    slow_group : servos asked for one slow value (torque) each cycle; 0 asks only those that raise an alert.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.
    watchdog_ms : these servos have none. 0: they may hold their position when this program is killed. Any other time
        starts a small process that switches them off then (:mod:`drivers.core.dead_man_switch`); where that process
        is missing, it is reported once and counted as ``unkept``.
    clock : monotonic seconds.
    policy : fields of :class:`~drivers.protocol1.startup.Policy`, such as ``torque_limit``.

    Raises
    ------
    DriverError : unknown model, or an option that does not fit.
    """

    _registers: Registers
    _telemetry: Telemetry

    MODELS: ClassVar[tuple[str, ...]]
    """A model of each series that the family has, for what a servo says of itself."""

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: Any,
        packets: Exchanges,
        feedback: str = "full",
        singles: int = 6,
        slow_group: int = 4,
        watchdog_ms: int = 200,
        clock: Callable[[], float] = time.monotonic,
        **policy: Any,
    ) -> None:
        super().__init__(servos, clock=clock)
        self.policy = Policy(**policy)
        self._port, self._keep = port, watchdog_ms > 0 and os.name == "posix"
        self._switch: DeadManSwitch | None = None
        self._unkept, self._look_s = False, 0.0
        self._registers = Registers(packets, port, self.servos)
        self._tables([load_table(servo.model) for servo in self.servos])
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, singles, slow_group)
        self._group()

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Who is there; ``ids`` None asks every id by itself, which takes a while (nothing better is safe)."""
        with self._losing():
            found = []
            for servo in range(LAST_ID + 1) if ids is None else ids:
                reply = self._registers.packets.hello(self._port, servo).replies.get(servo)
                if reply is not None:
                    found.append(self._info(servo, reply))
                elif servo not in self.ids:
                    self._port.suspects.discard(servo)  # it is nobody
            return found

    def _info(self, servo: int, reply: Packet1) -> ServoInfo:
        number, firmware = startup.identity(reply, map(load_table, self.MODELS))
        probe = Registers(self._registers.packets, self._port, self.servos)
        try:
            probe.tables[servo] = self._table_of(servo, number)
            volts, celsius = probe.get(servo, "voltage"), probe.get(servo, "temperature")
            torque = probe.get(servo, "torque") == 1
            bits = probe.causes(servo, probe.flags[servo])
        except PortLost:
            raise
        except DriverError:  # an unknown model or a servo that keeps quiet is still found
            return ServoInfo(servo, number, model_name(number), firmware)
        model = probe.tables[servo].model
        return ServoInfo(servo, number, model, firmware, volts / 10.0, float(celsius), bits, torque)

    def _table_of(self, servo: int, number: int) -> ControlTable:
        """Table of a model number; that of the configured model where it has none that is known."""
        configured = self._registers.tables.get(servo)
        if configured is not None and configured.number >= startup.UNNUMBERED:
            return configured
        return load_table(number)

    def _startup(self) -> Startup:
        return Startup(self._registers, self.policy)

    def _bring_up(self) -> Floats:
        self._port.suspects.clear()
        begin = self._startup()
        begin.identify(self.servos)
        self._tables([self._registers.tables[servo] for servo in self.ids])
        self._group()
        self._watch()
        started = begin.bring_up(self.servos)
        self._started(started)
        return self.scale.radians(np.array([started.ticks[servo] for servo in self.ids]))

    def _watch(self) -> None:
        """Have the servos let go when this program is killed."""
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
            self._tell_unkept(str(error), error.hint)

    def _settle(self, now_s: float) -> None:
        """Look now and then whether the switch is still there."""
        if self._switch is None or now_s - self._look_s < LOOK_S:
            return
        self._look_s = now_s
        if not self._switch.watching:
            why = f"the process that switches the servos on {self.path} off if this program is killed has ended"
            self._tell_unkept(why, "stop and start again to start another")

    def _tell_unkept(self, why: str, hint: str) -> None:
        """Say once that the servos hold on when this program is killed."""
        if not self._unkept:
            self._unkept = True
            self._report.count("unkept")
            log.warning("%s; %s", why, hint)

    def _dismiss(self) -> None:
        switch, self._switch = self._switch, None
        if switch is not None:
            switch.dismiss()

    def _started(self, started: Started) -> None:
        self._report.eeprom_writes += started.eeprom
        self._narrow(started.limits)
        self._telemetry.started(list(started.ticks))

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Switch servos on again that let go, where they stand; ``ids`` None means all of them.

        Raises
        ------
        BusError : one does not come back; see :class:`~drivers.protocol1.startup.Policy` for what is allowed.
        """
        chosen = [servo for servo in self.servos if ids is None or servo.id in ids]
        with self._losing():
            begin = self._startup()
            begin.identify(chosen)
            started = begin.bring_up(chosen)
            self._started(started)
            for servo, ticks in started.ticks.items():
                self._hold(self.ids.index(servo), ticks)

    def _release(self) -> None:
        super()._release()
        self._dismiss()

    def _group(self) -> None:
        self._telemetry.rebuild({servo.id: startup.speed_steps(servo, self._registers) for servo in self.servos})

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        """Sync writes of all goals, inside the servos' own limits too."""
        ticks = np.minimum(np.maximum(self.scale.ticks(angle_rad), self.scale.low), self.scale.high)
        self._telemetry.send_goals(ticks)
        return self.scale.radians(ticks)

    def _ask(self) -> BusState:
        self._telemetry.cycle(self._clock, self._running)
        return self._telemetry.state(self.scale, self._clock())

    @property
    def load(self) -> Floats:
        """(n,) share of its stall torque that each motor gave when last read, positive towards greater angles."""
        return frozen(self.scale.sign * self._telemetry.load)

    @property
    def moving(self) -> Flags:
        """(n,) whether each servo said it was moving when last read; False where its model does not say."""
        return frozen(self._telemetry.moving, bool)


def _outlives_us(link: object) -> bool:
    """Whether what is behind a port is still there when this program is not: a bus simulated in it dies with it."""
    return isinstance(link, SerialPort) and not link.path.startswith("memory://")
