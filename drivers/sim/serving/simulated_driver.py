"""Bus kind "simulated": the driver of any family over a simulated bus that it starts and ends."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError
from drivers.core.wirebus import WireBus
from drivers.sim.serving.simulated import SimulatedBus

TRANSPORTS = ("pty", "tcp", "memory")


class SimulatedDriver(WireBus):
    """Mixin that :func:`simulated` adds to a driver: it starts the simulated bus that the driver opens.

    The bus runs in a child process from ``open`` to ``close`` and keeps its state over ``reconnect``.

    servos : the servos in the order of all arrays; the simulated ones have the same ids and models.
    port : path that shall point at the simulated port, so that other programs can find it; empty: a private one.
    transport : ``"pty"`` (a pseudo-terminal), ``"tcp"`` (this machine's loopback) or ``"memory"`` (a thread of this
        process serves); empty: a pseudo-terminal where the system has them, else TCP.
    faults, wire, latency_s, seed, process : see :class:`drivers.sim.serving.simulated.SimulatedBus`.
    options : see the driver.

    Raises DriverError: unknown transport, and what the driver raises.
    """

    family: ClassVar[str]

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str = "",
        transport: str = "",
        baud: int = 1_000_000,
        faults: Sequence[str] = (),
        wire: bool = False,
        latency_s: float = 0.0,
        seed: int = 0,
        process: bool = True,
        **options: Any,
    ) -> None:
        super().__init__(servos, port=port, baud=baud, **options)  # type: ignore[call-arg]
        self.simulation: SimulatedBus | None = None
        self._transport = transport or ("pty" if hasattr(os, "openpty") else "tcp")
        if self._transport not in TRANSPORTS:
            raise DriverError(f"there is no transport {transport!r}", hint=f"use one of {', '.join(TRANSPORTS)}")
        self._link = port
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._settings: dict[str, Any] = {
            "faults": tuple(faults),
            "baud": baud,
            "wire": wire,
            "latency_s": latency_s,
            "seed": seed,
            "process": process and self._transport != "memory",
            "family": self.family,
            "options": self.far_end(),
        }

    def open(self) -> None:
        """Start the simulated bus if it does not run yet, and open its port."""
        try:
            if self.simulation is None:
                simulation = SimulatedBus(self.servos, link=self._link or self._private_link(), **self._settings)
                self.simulation = simulation.__enter__()
                self._use_path(simulation.path)
            super().open()
        except BaseException:
            if not self.running:
                self._release()
            raise

    def _private_link(self) -> str:
        if self._transport == "tcp":
            return "socket://127.0.0.1:0"
        if self._transport == "memory":
            return f"memory://omote-{id(self)}"
        self._folder = tempfile.TemporaryDirectory(prefix="omote-")
        return str(Path(self._folder.name) / "servos")

    def _release(self) -> None:
        super()._release()
        if self.simulation is not None:
            self.simulation.close()
        if self._folder is not None:
            self._folder.cleanup()
        self.simulation = self._folder = None


@cache
def simulated(driver: type[WireBus], family: str) -> type[WireBus]:
    """The driver of a family with its own simulated bus."""
    return type(f"Simulated{driver.__name__}", (SimulatedDriver, driver), {"family": family})
