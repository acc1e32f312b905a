"""A wire of servos with registers, as far as it is the same in every protocol."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drivers.base.bus import BusReport
from drivers.core.scale import Scale
from drivers.core.wirebus import WireBus
from drivers.servos.port import Port
from drivers.servos.registers import Registers
from drivers.servos.startup import Startup
from drivers.servos.telemetry import Telemetry
from drivers.tables.tables import ControlTable


class ServoBus(WireBus):
    """Servos with registers on one port; see :class:`~drivers.core.wirebus.WireBus` for the hooks that are left.

    Attributes
    ----------
    scale : steps of the servos' encoders and the angles they mean.
    """

    _port: Port
    _registers: Registers[Any]
    _telemetry: Telemetry

    @abstractmethod
    def _startup(self) -> Startup:
        """What brings the servos up, and switches them off."""

    # ------------------------------------------------------------------ the port

    @property
    def is_open(self) -> bool:
        """True while the port is held."""
        return self._port.link.is_open

    @property
    def path(self) -> str:
        """Device path in use."""
        return self._port.link.path

    def _use_path(self, path: str) -> None:
        self._port.setPortName(path)

    def _open_link(self) -> None:
        self._port.openPort()

    def _close_link(self) -> None:
        self._port.closePort()

    # ------------------------------------------------------------------ what starting and stopping share

    def _switch_off(self) -> None:
        self._startup().switch_off(self.ids)

    def _tables(self, tables: Sequence[ControlTable]) -> None:
        """Use these control tables, in the order of the servos."""
        self._registers.tables = dict(zip(self.ids, tables, strict=True))
        self.scale = Scale(self.servos, tables)

    def _narrow(self, limits: Mapping[int, tuple[int, int]]) -> None:
        """Keep servos inside the limits that their own registers hold; (lowest, highest) step by id."""
        for servo, (low, high) in limits.items():
            self.scale.narrow(self.ids.index(servo), low, high)

    def _hold(self, index: int, ticks: int) -> None:
        """One servo begins again from a position."""
        full = np.zeros(len(self.ids))
        full[index] = ticks
        self._limits.reset_one(index, float(self.scale.radians(full)[index]))

    def report(self) -> BusReport:
        """A copy of the counters."""
        self._report.stray = self._port.stray
        self._report.silent = self._telemetry.silent_ids()
        return super().report()
