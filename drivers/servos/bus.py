"""Base class of buses of servos with registers, for any protocol: port, start-up, recovery and switching off."""

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
"""Reverse bit of the register Drive Mode (Protocol 2.0)."""


@dataclass(frozen=True)
class OwnSettings:
    """Settings in a servo's permanent registers; angles are relative to the zero of its :class:`ServoSpec`.

    low_rad, high_rad : its own position limits. reverse : its drive mode reverses its direction, which omote undoes at
    start. offset_ticks : its homing offset. least_voltage_v : supply voltage below which it reports an error.
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
    """Ids of servos whose torque a failed start may have left on; None: the torque of any servo may be on."""
    _held: Sequence[int] = ()
    """Ids of servos whose torque was on already before the newest start."""

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _startup(self, policy: Any = None) -> Startup[Any]:
        """Create the start-up and stop sequence of the protocol; ``policy`` None means the bus's own."""

    @abstractmethod
    def _group_reads(self, indirect: Mapping[int, Block]) -> None:
        """Group the servos for reading. indirect : by servo id, the block that is read through indirect addresses."""

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
        """Return the control table of a model number; raises DriverError where the model is unknown."""
        return load_table(number, firmware)

    def _info(self, servo: int, number: int, firmware: int) -> ServoInfo:
        """Read and return the description of a servo that answered, which need not be a configured one."""
        probe = type(self._registers)(self._registers.packets, self._port, self.servos)
        return probe.info(servo, number, firmware, lambda: self._table_of(servo, number, firmware))

    def _bring_up(self) -> Floats:
        self._port.suspects.clear()
        return self._finish_start(self._start_all(self.servos, self._startup()))

    def _bring_back(self) -> Floats:
        """Start as many servos as possible, leaving out the servos that an error names."""
        self._port.suspects.clear()
        chosen = list(self.servos)
        while chosen:
            try:
                startup = self._startup(self._restart_policy(self.policy.reboot_faulted))
                return self._finish_start(self._start_all(chosen, startup))
            except BusError as error:
                named = [servo for servo in chosen if servo.id in error.servo_ids] or chosen
                for servo in named:
                    self._leave_out(self.ids.index(servo.id), error)
                chosen = [servo for servo in chosen if servo not in named]
        return self._finish_start(Started())

    def _restart_policy(self, reboot_faulted: bool) -> Policy:
        """Policy for servos that were started before: torque that is on stays on, and no servo waits for the supply."""
        return replace(self.policy, takeover="adopt", voltage_wait_s=0.0, reboot_faulted=reboot_faulted, partly=True)

    def _start_all(self, servos: Sequence[ServoSpec], startup: Startup[Any]) -> Started:
        for servo in servos:
            check_driven(load_table(servo.model))
        startup.identify(servos)
        self._set_tables([self._registers.tables[servo] for servo in self.ids])
        self._identified()
        try:
            started = startup.bring_up(servos)
        except BaseException:
            if startup.left_on and not startup.policy.partly:  # no servo of this bus was driven before
                self._to_switch_off, self._unconfirmed = startup.left_on, True
            raise
        self._to_switch_off, self._held, self._unconfirmed = None, started.held, True
        self._warn_slow_answers()
        return started

    def _undo_start(self) -> None:
        """Disable the torque that the newest start enabled; servos that held before stay on, without their watchdog."""
        self._to_switch_off = [servo for servo in self.ids if servo not in self._held]
        self._running, self._unconfirmed = False, True
        with self._detecting_loss():
            self._startup().switch_off_started(self._to_switch_off, self._held)
        self._unconfirmed = False

    def own_settings(self, servo: int) -> OwnSettings:
        """The settings of a servo that :meth:`discover` has found. Nothing is written.

        Raises NoReply, CorruptReply.
        """
        registers, index = self._registers, self.ids.index(servo)

        def read_value(name: str, default: int = 0) -> int:
            return registers.get(servo, name) if registers.item(servo, name) is not None else default

        table = registers.tables[servo]
        ends = read_value("min_ticks"), read_value("max_ticks", table.first_step + table.ticks_per_turn - 1)
        low, high = sorted(self._radians(index, end) for end in ends)
        return OwnSettings(
            low_rad=low,
            high_rad=high,
            reverse=bool(read_value("drive_mode") & REVERSE) and table.protocol == 2,
            offset_ticks=read_value("offset"),
            least_voltage_v=read_value("min_voltage") / 10.0,
        )

    @property
    def reply_delay_s(self) -> float | None:
        """Usual delay of the newest replies beyond their time on the wire, seconds; None if not known."""
        return self._port.delays.usual_s

    def slow_answers(self) -> tuple[str, str]:
        """How the adapter slows this bus down, and the command that fixes it; both empty where it does not."""
        return slow_answers(self.path, latency_s(self.path), self.reply_delay_s)

    def _warn_slow_answers(self) -> None:
        message, hint = self.slow_answers()
        if message:
            log.warning("%s; try: %s", message, hint)

    def _finish_start(self, started: Started) -> Floats:
        """Store the result of the start of the bus; return the angles (n,), rad, NaN for servos not started."""
        self._group_reads(started.mapped)
        self._store_started(started)
        position_ticks = np.array([started.ticks.get(servo, np.nan) for servo in self.ids])
        return self.scale.radians(position_ticks)

    def _join(self, index: int) -> float:
        """Start one servo without rebooting it, since the others would have to wait; return its angle, rad."""
        servo = self.ids[index]
        started = self._start_again([self.servos[index]], self._startup(self._restart_policy(reboot_faulted=False)))
        return self._radians(index, started.ticks[servo])

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Start servos again that switched off or were rebooted, at their present positions; ``ids`` None means all.

        Servos whose torque is on keep it. Raises BusError where some stay off, after all others were started. The
        policy of the family's start-up decides what may be done to a servo. Servos that stay off are sent no goals, and
        are tried again once a second without a reboot, as after :meth:`reconnect`. Raises BusError, too, where the bus
        is not started: nothing would switch the servos off again.
        """
        self._raise_if_stopped()
        failed = self._recover(self.ids if ids is None else ids)
        if failed:
            raise merge_errors(failed)

    def _recover(self, ids: Sequence[int]) -> dict[int, BusError]:
        """Start servos as :meth:`recover` does; return the errors of servos that stay off, by id."""
        chosen = [servo for servo in self.servos if servo.id in ids]
        failed: dict[int, BusError] = {}
        with self._detecting_loss():
            while chosen:
                try:
                    started = self._start_again(chosen, self._startup(self._recovery_policy()))
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

    def _recovery_policy(self) -> Policy:
        """Policy for recovering servos: torque that is on stays on."""
        return replace(self.policy, takeover="adopt", partly=True)

    def _start_again(self, chosen: Sequence[ServoSpec], startup: Startup[Any] | None = None) -> Started:
        """Start some servos of a bus that is running."""
        startup = startup or self._startup()
        startup.identify(chosen)
        started = startup.bring_up(chosen)
        self._store_started(started)
        return started

    def _store_started(self, started: Started) -> None:
        """Store the result of a start-up: limits, positions and writes to permanent registers."""
        self._report.eeprom_writes += started.eeprom
        for servo, (low, high) in started.limits.items():
            self.scale.narrow(self.ids.index(servo), low, high)
        for servo, ticks in started.ticks.items():
            self._goals[self.ids.index(servo)] = ticks
        self._telemetry.started(list(started.ticks))

    def _switch_off(self) -> None:
        self._startup().switch_off(self.ids if self._to_switch_off is None else self._to_switch_off)
        self._to_switch_off = None

    def _set_tables(self, tables: Sequence[ControlTable]) -> None:
        """Use these control tables, in the order of the servos, and set all goals to zero."""
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
