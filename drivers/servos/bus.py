"""Base class of buses of servos with registers: port, start-up, recovery and switching off, in any protocol."""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drivers.base.bus import BusReport, Floats, ServoInfo, ServoSpec
from drivers.base.errors import BusError, merge_errors
from drivers.core.scale import Scale
from drivers.core.wirebus import WireBus
from drivers.port.latency import slow_answers
from drivers.port.serialport import latency_s
from drivers.servos.layout import Block
from drivers.servos.port import Port
from drivers.servos.registers import Registers
from drivers.servos.startup import Policy, Started, Startup
from drivers.servos.telemetry import Telemetry
from drivers.tables.models import check_driven
from drivers.tables.tables import ControlTable, load_table

log = logging.getLogger(__name__)


REVERSE = 0x01
"""Bit of Drive Mode (Protocol 2.0)."""


@dataclass(frozen=True)
class OwnSettings:
    """Settings in a servo's permanent registers; angles are measured as its specification says.

    low_rad, high_rad : its own position limits. reverse : its drive mode reverses its direction, which omote undoes at
    start. offset_ticks : its homing offset. least_voltage_v : below this supply it reports an error.
    """

    low_rad: float
    high_rad: float
    reverse: bool
    offset_ticks: int
    least_voltage_v: float


class ServoBus(WireBus):
    """Servos with registers on one port; see :class:`~drivers.core.wirebus.WireBus` for the other hooks.

    scale : conversion between encoder steps and angles.
    """

    _port: Port
    _registers: Registers[Any]
    _telemetry: Telemetry
    policy: Policy
    _to_switch_off: Sequence[int] | None = None
    """Ids of servos that a failed start left on; None: any of them may be on."""
    _held: Sequence[int] = ()
    """Ids of servos that held with torque before the newest start."""

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _startup(self, policy: Any = None) -> Startup[Any]:
        """The start-up and stop sequence of the protocol, with the bus's policy by default."""

    @abstractmethod
    def _group(self, mapped: Mapping[int, Block]) -> None:
        """Group the servos for reading. mapped : by servo id, the blocks that are read through indirect addresses."""

    def _identified(self) -> None:
        """Called after all servos are identified, before torque is switched on; does nothing by default."""

    # ------------------------------------------------------------------ the port

    @property
    def is_open(self) -> bool:
        return self._port.link.is_open

    @property
    def path(self) -> str:
        return self._port.link.path

    def _use_path(self, path: str) -> None:
        self._port.setPortName(path)

    def _open_link(self) -> None:
        self._port.openPort()

    def _close_link(self) -> None:
        self._port.closePort()

    # ------------------------------------------------------------------ starting and stopping

    def _table_of(self, servo: int, number: int, firmware: int) -> ControlTable:
        """Control table of a servo that was found; raises DriverError where the model is unknown."""
        return load_table(number, firmware)

    def _info(self, servo: int, number: int, firmware: int) -> ServoInfo:
        """Description of a servo that was found, which need not be a configured one."""
        probe = type(self._registers)(self._registers.packets, self._port, self.servos)
        return probe.info(servo, number, firmware, lambda: self._table_of(servo, number, firmware))

    def _bring_up(self) -> Floats:
        self._port.suspects.clear()
        return self._started(self._start_all(self.servos, self._startup()))

    def _bring_back(self) -> Floats:
        """Start as many servos as possible, leaving out those that an error names."""
        self._port.suspects.clear()
        chosen = list(self.servos)
        while chosen:
            try:
                startup = self._startup(self._restart_policy(self.policy.reboot_faulted))
                return self._started(self._start_all(chosen, startup))
            except BusError as error:
                named = [servo for servo in chosen if servo.id in error.servo_ids] or chosen
                for servo in named:
                    self._leave_out(self.ids.index(servo.id), error)
                chosen = [servo for servo in chosen if servo not in named]
        return self._started(Started())

    def _restart_policy(self, reboot_faulted: bool) -> Policy:
        """The policy for servos that ran before: those that hold go on holding, and the others do not wait for them."""
        return replace(self.policy, takeover="adopt", voltage_wait_s=0.0, reboot_faulted=reboot_faulted, partly=True)

    def _start_all(self, servos: Sequence[ServoSpec], startup: Startup[Any]) -> Started:
        for servo in servos:
            check_driven(load_table(servo.model))
        startup.identify(servos)
        self._tables([self._registers.tables[servo] for servo in self.ids])
        self._identified()
        try:
            started = startup.bring_up(servos)
        except BaseException:
            if startup.left_on and not startup.policy.partly:  # no servo of this bus was driven before
                self._to_switch_off, self._unconfirmed = startup.left_on, True
            raise
        self._to_switch_off, self._held, self._unconfirmed = None, started.held, True
        self._say_slow_answers()
        return started

    def _let_go(self) -> None:
        """Switch off the servos that the newest start switched on; those that held before go on, without a watchdog."""
        self._to_switch_off = [servo for servo in self.ids if servo not in self._held]
        self._running, self._unconfirmed = False, True
        with self._losing():
            self._startup().let_go(self._to_switch_off, self._held)
        self._unconfirmed = False

    def own_settings(self, servo: int) -> OwnSettings:
        """The settings of a servo that :meth:`discover` has found. Nothing is written.

        Raises NoReply, CorruptReply.
        """
        registers, index = self._registers, self.ids.index(servo)

        def value(name: str, otherwise: int = 0) -> int:
            return registers.get(servo, name) if registers.item(servo, name) is not None else otherwise

        table = registers.tables[servo]
        ends = value("min_ticks"), value("max_ticks", table.first_step + table.ticks_per_turn - 1)
        low, high = sorted(self._radians(index, end) for end in ends)
        return OwnSettings(
            low_rad=low,
            high_rad=high,
            reverse=bool(value("drive_mode") & REVERSE) and table.protocol == 2,
            offset_ticks=value("offset"),
            least_voltage_v=value("min_voltage") / 10.0,
        )

    @property
    def reply_delay_s(self) -> float | None:
        """Usual delay of the newest answers beyond their time on the wire, seconds; None: not known."""
        return self._port.delays.usual_s

    def slow_answers(self) -> tuple[str, str]:
        """How the adapter slows this bus down, and the command that mends it; both empty where it does not."""
        return slow_answers(self.path, latency_s(self.path), self.reply_delay_s)

    def _say_slow_answers(self) -> None:
        message, hint = self.slow_answers()
        if message:
            log.warning("%s; try: %s", message, hint)

    def _started(self, started: Started) -> Floats:
        """Store what start-up found and did; returns the servos' angles (n,), rad, NaN for those not started."""
        self._group(started.mapped)
        self._use(started)
        here = np.array([started.ticks.get(servo, np.nan) for servo in self.ids])
        return self.scale.radians(here)

    def _join(self, index: int) -> float:
        """Start one servo without rebooting it, since the others would have to wait; returns its angle, rad."""
        servo = self.ids[index]
        started = self._start_again([self.servos[index]], self._startup(self._restart_policy(reboot_faulted=False)))
        return self._radians(index, started.ticks[servo])

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Start servos again that switched off or were rebooted, at their present positions; ``ids`` None means all.

        Servos that hold go on holding. Raises BusError where some stay off, after all others were started. What may be
        done to a servo depends on the policy of the family's start-up. Those that stay off are sent no goals, and are
        tried again once a second without a reboot, as after :meth:`reconnect`. Raises BusError, too, where the bus is
        not started: nothing would switch the servos off again.
        """
        self._raise_if_stopped()
        failed = self._recover(self.ids if ids is None else ids)
        if failed:
            raise merge_errors(failed)

    def _recover(self, ids: Sequence[int]) -> dict[int, BusError]:
        """As :meth:`recover`; returns why servos stay off, by id."""
        chosen = [servo for servo in self.servos if servo.id in ids]
        failed: dict[int, BusError] = {}
        with self._losing():
            while chosen:
                try:
                    started = self._start_again(chosen, self._startup(self._for_recovery()))
                except BusError as error:
                    named = [servo.id for servo in chosen if servo.id in error.servo_ids] or [s.id for s in chosen]
                    failed |= dict.fromkeys(named, error)
                    for number in named:
                        self._give_up(self.ids.index(number), error)
                    chosen = [servo for servo in chosen if servo.id not in failed]
                    continue
                for servo, ticks in started.ticks.items():
                    index = self.ids.index(servo)
                    self._drive_again(index, self._radians(index, ticks))
                break
        return failed

    def _for_recovery(self) -> Policy:
        """The policy for servos of which some may hold: these are not switched off for the others."""
        return replace(self.policy, takeover="adopt", partly=True)

    def _start_again(self, chosen: Sequence[ServoSpec], startup: Startup[Any] | None = None) -> Started:
        """Start some servos of a bus that runs already."""
        startup = startup or self._startup()
        startup.identify(chosen)
        started = startup.bring_up(chosen)
        self._use(started)
        return started

    def _use(self, started: Started) -> None:
        """Store what start-up found and did: limits, positions and writes to permanent registers."""
        self._report.eeprom_writes += started.eeprom
        for servo, (low, high) in started.limits.items():
            self.scale.narrow(self.ids.index(servo), low, high)
        for servo, ticks in started.ticks.items():
            self._goals[self.ids.index(servo)] = ticks
        self._telemetry.started(list(started.ticks))

    def _switch_off(self) -> None:
        self._startup().switch_off(self.ids if self._to_switch_off is None else self._to_switch_off)
        self._to_switch_off = None

    def _tables(self, tables: Sequence[ControlTable]) -> None:
        """Use these control tables, in the order of the servos."""
        self._registers.tables = dict(zip(self.ids, tables, strict=True))
        self.scale = Scale(self.servos, tables)
        self._goals = np.zeros(len(self.ids), np.int32)

    def _begin_at(self, index: int, angle_rad: float) -> None:
        super()._begin_at(index, angle_rad)
        self._goals[index] = self.scale.tick(index, angle_rad)

    def _radians(self, index: int, ticks: int) -> float:
        """The angle of one servo, rad, at an encoder step."""
        return float(self.scale.radians(np.full(len(self.ids), ticks))[index])

    def report(self) -> BusReport:
        self._report.stray = self._port.stray
        self._report.silent = self._telemetry.silent_ids()
        return super().report()
