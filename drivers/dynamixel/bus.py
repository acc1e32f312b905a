"""A wire of Dynamixel servos, Protocol 2.0: one sync write and one sync read a cycle.

What keeps it alive: a servo that misses its time is left out of the group until it has answered a ping (once a
second at most while it is silent), so the others go on; every goal is limited in angle and in speed; a tripped
watchdog is cleared with the goal where the servo is; and a motor that let go by itself is told, never switched
on again behind the user's back.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from drivers.base.bus import BusState, Floats, ServoInfo, ServoSpec
from drivers.base.errors import BusError, DriverError, PortLost
from drivers.dynamixel.indirect import set_up
from drivers.dynamixel.port import Port
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Packets
from drivers.dynamixel.startup import Policy, Startup
from drivers.dynamixel.telemetry import Telemetry
from drivers.servos.bus import ServoBus
from drivers.servos.layout import Block
from drivers.tables.tables import load_table, model_name, model_number

log = logging.getLogger(__name__)

MAP_TRIES = 5
"""How often the pointers of one servo are set again between two starts."""


class DynamixelBus(ServoBus):
    """Dynamixel servos on one serial port. See :class:`~drivers.base.bus.Bus` for the contract.

    Parameters
    ----------
    servos : the servos in the order of all arrays.
    port : device path; ``/dev/serial/by-id/...`` survives a replug.
    baud : rate on the wire.
    feedback : ``"full"`` reads velocity and current with every position, and by indirect addressing temperature,
        hardware error, torque and watchdog too; ``"position"`` reads only the position.
    fast : use fast reads where every servo's firmware has them.
    indirect : use indirect addressing where the model has it.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.
    slow_group : servos asked at once for what is not in the feedback (supply, and torque, error and watchdog where
        they are not), so that each is asked every half second; 0 asks only about servos that raise an alert.
    clock : monotonic seconds.
    policy : fields of :class:`~drivers.dynamixel.startup.Policy`, such as ``watchdog_ms``.

    Raises
    ------
    DriverError : unknown model, or an option that does not fit.
    """

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
        self._tables([load_table(model_number(servo.model)) for servo in self.servos])
        self._telemetry = Telemetry(self._registers, self.ids, self._report, feedback, fast, slow_group)
        self._may_map = indirect and feedback == "full"
        self._mapped: dict[int, Block] = {}
        self._mended: Counter[int] = Counter()
        self._goals = np.zeros(len(self.ids), np.int32)
        self._heard_s = 0.0

    # ------------------------------------------------------------------ looking, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Who is there; ``ids`` None asks everybody at once, which takes about a second."""
        with self._losing():
            if ids is None:
                found = self._registers.packets.ping_all(self._port)
            else:
                answers = [self._registers.packets.hello(self._port, i).replies for i in ids]
                found = {i: reply.params for replies in answers for i, reply in replies.items()}
            return [self._info(servo, params) for servo, params in sorted(found.items())]

    def _info(self, servo: int, params: bytes) -> ServoInfo:
        number, firmware = params[0] | params[1] << 8, params[2]
        info = ServoInfo(servo, number, model_name(number), firmware)
        probe = Registers(self._registers.packets, self._port, self.servos)
        try:
            probe.tables[servo] = load_table(number, firmware)
            volts, temperature = probe.get(servo, "voltage"), probe.get(servo, "temperature")
            hardware, torque = probe.get(servo, "hardware"), probe.get(servo, "torque")
        except PortLost:
            raise
        except DriverError:  # an unknown model or a servo that keeps quiet is still found
            return info
        return ServoInfo(*info_head(info), volts / 10.0, float(temperature), hardware, bool(torque))

    def _startup(self) -> Startup:
        return Startup(self._registers, self.policy)

    def _bring_up(self) -> Floats:
        self._port.suspects.clear()
        startup = self._startup()
        startup.identify(self.servos)
        self._tables([self._registers.tables[servo] for servo in self.ids])
        started = startup.bring_up(self.servos, indirect=self._may_map)
        self._report.eeprom_writes += started.eeprom
        self._mapped = started.mapped
        self._mended.clear()
        self._telemetry.rebuild(self._mapped)
        self._narrow(started.limits)
        self._telemetry.started(self.ids)
        self._heard_s = self._clock()
        self._goals = np.array([started.ticks[servo] for servo in self.ids], np.int32)
        return self.scale.radians(self._goals)

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Bring servos back that let go or were rebooted, where they stand; ``ids`` None means all of them.

        Raises
        ------
        BusError : one does not come back; see :class:`~drivers.dynamixel.startup.Policy` for what is allowed.
        """
        chosen = [servo for servo in self.servos if ids is None or servo.id in ids]
        with self._losing():
            startup = self._startup()
            startup.identify(chosen)
            started = startup.bring_up(chosen, indirect=self._may_map)
            self._report.eeprom_writes += started.eeprom
            self._use_map(self._mapped | started.mapped)
            for servo, ticks in started.ticks.items():
                self._hold(self.ids.index(servo), ticks)
            self._telemetry.started(list(started.ticks))

    def _hold(self, index: int, ticks: int) -> None:
        """One servo begins again from a position."""
        self._goals[index] = ticks
        super()._hold(index, ticks)

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        """One sync write of all goals, inside the servos' own limits too."""
        sent = self.scale.goals(angle_rad, self._goals)
        self._telemetry.send_goals(self._goals)
        return sent

    def _settle(self, now: float) -> None:
        """Look at all watchdogs when the caller was away for so long that they may have tripped."""
        pause, self._heard_s = now - self._heard_s, now
        limit = self.policy.watchdog_ms / 1000.0
        if self._running and limit and pause > limit:
            self._telemetry.ask_watchdogs(self._clock)
            self._clear_watchdogs()

    def _ask(self) -> BusState:
        """One sync read of all servos and one slow value of some."""
        for servo in self._telemetry.take_forgetful():
            self._map_again(servo)
        state = self._telemetry.cycle(self._clock, self._running, self.scale)
        if self._running:
            self._clear_watchdogs()
        return state

    def _use_map(self, mapped: dict[int, Block]) -> None:
        """Group the servos anew where other registers are mapped now."""
        if mapped != self._mapped:
            self._mapped = mapped
            self._telemetry.rebuild(mapped)

    def _map_again(self, servo: int) -> None:
        """Set the pointers of a servo that forgot them; one that will not keep them is read plainly from now on."""
        self._mended[servo] += 1
        mapped = set_up(self._registers, [servo]) if self._mended[servo] <= MAP_TRIES else {}
        if not mapped:
            self._use_map({i: block for i, block in self._mapped.items() if i != servo})

    def _clear_watchdogs(self) -> None:
        """Clear tripped watchdogs with the goal where the servo stands, so that nothing jumps."""
        for servo in self._telemetry.take_tripped():
            try:
                self._registers.put(servo, "watchdog", 0, tries=1)
                goal = self._startup().goals_at_present([servo])[servo]
                self._registers.put(servo, "goal", goal, tries=1)
                self._registers.put(servo, "watchdog", self.policy.watchdog_steps, tries=1)
            except PortLost:
                raise
            except BusError as error:
                log.warning("watchdog not cleared yet: %s", error)
                self._telemetry.retry_tripped(servo)  # its register may read 0 now: it would never be seen again
                continue
            self._hold(self.ids.index(servo), goal)


def info_head(info: ServoInfo) -> tuple[int, int, str, int]:
    """What a servo says in its ping."""
    return info.id, info.model_number, info.model, info.firmware
