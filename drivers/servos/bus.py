"""Base class of buses of servos with registers: port, start-up, recovery and switching off, in any protocol."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drivers.base.bus import BusReport, Floats, ServoInfo
from drivers.core.scale import Scale
from drivers.core.wirebus import WireBus
from drivers.servos.layout import Block
from drivers.servos.port import Port
from drivers.servos.registers import Registers
from drivers.servos.startup import Started, Startup
from drivers.servos.telemetry import Telemetry
from drivers.tables.tables import ControlTable, load_table


class ServoBus(WireBus):
    """Servos with registers on one port; see :class:`~drivers.core.wirebus.WireBus` for the other hooks.

    scale : conversion between encoder steps and angles.
    """

    _port: Port
    _registers: Registers[Any]
    _telemetry: Telemetry

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _startup(self) -> Startup[Any]:
        """The start-up and stop sequence of the protocol."""

    @abstractmethod
    def _group(self, mapped: Mapping[int, Block]) -> None:
        """Group the servos for reading; `mapped` are the blocks that are read through pointers, by id."""

    def _identified(self) -> None:
        """Do what must be done between the identification of all servos and torque; nothing by default."""

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
        startup = self._startup()
        startup.identify(self.servos)
        self._tables([self._registers.tables[servo] for servo in self.ids])
        self._identified()
        started = startup.bring_up(self.servos)
        self._group(started.mapped)
        self._use(started)
        return self.scale.radians(np.array([started.ticks[servo] for servo in self.ids]))

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Bring servos back that switched off or were rebooted, where they are; ``ids`` None means all of them.

        Raises BusError where one stays off; see the policy of the family's start-up for what is allowed.
        """
        chosen = [servo for servo in self.servos if ids is None or servo.id in ids]
        with self._losing():
            startup = self._startup()
            startup.identify(chosen)
            started = startup.bring_up(chosen)
            self._use(started)
            for servo, ticks in started.ticks.items():
                self._hold(self.ids.index(servo), ticks)

    def _use(self, started: Started) -> None:
        """Keep what start-up found and did."""
        self._report.eeprom_writes += started.eeprom
        for servo, (low, high) in started.limits.items():
            self.scale.narrow(self.ids.index(servo), low, high)
        self._telemetry.started(list(started.ticks))

    def _switch_off(self) -> None:
        self._startup().switch_off(self.ids)

    def _tables(self, tables: Sequence[ControlTable]) -> None:
        """Use these control tables, in the order of the servos."""
        self._registers.tables = dict(zip(self.ids, tables, strict=True))
        self.scale = Scale(self.servos, tables)

    def _hold(self, index: int, ticks: int) -> None:
        """Let the goals of one servo begin at a position."""
        full = np.zeros(len(self.ids))
        full[index] = ticks
        self._limits.reset_one(index, float(self.scale.radians(full)[index]))

    def report(self) -> BusReport:
        self._report.stray = self._port.stray
        self._report.silent = self._telemetry.silent_ids()
        return super().report()
