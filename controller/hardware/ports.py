"""Gives tools the port of a robot's bus, to be opened several times in turn; a simulated bus is served meanwhile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from controller.robot.buses import SIMULATION, BusSettings
from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.core.registry import FAMILIES, SIMULATED
from drivers.sim import SimulatedBus


@dataclass(frozen=True)
class BusPort:
    """A bus that can be opened any number of times.

    name : of the bus. family : of its servos. port : path or URL. baud : bits/s. options : of the driver.
    """

    name: str
    family: str
    port: str
    baud: int
    options: dict[str, Any]

    def bus(self, servos: Sequence[ServoSpec], **changes: Any) -> Bus:
        """Create a driver for some of its servos; its port is not open yet."""
        return open_bus(self.family, servos, port=self.port, baud=self.baud, **self.options | changes)

    def holding(self, servos: Sequence[ServoSpec]) -> list[str]:
        """Read the names of servos that report that their torque is on; boards of hobby servos report none."""
        if FAMILIES.get(self.family).hobby:
            return []
        with self.bus(servos) as bus:
            on = {found.id for found in bus.discover([servo.id for servo in servos]) if found.torque}
        return [servo.name for servo in servos if servo.id in on]


@contextmanager
def serve_bus(bus: BusSettings, servos: Sequence[ServoSpec]) -> Iterator[BusPort]:
    """Give the port of a bus; where its kind is ``"simulated"``, run the simulator that its settings describe."""
    given = bus.options()
    options = {key: value for key, value in given.items() if key not in (*SIMULATION, "port", "baud")}
    if bus.kind != SIMULATED:
        yield BusPort(bus.name, bus.family, bus.port, bus.baud, options)
        return
    far_end = open_bus(bus.family, servos, port="", **options).far_end()
    with SimulatedBus(
        servos,
        faults=bus.faults,
        baud=bus.baud,
        wire=bus.wire,
        latency_s=bus.latency_s,
        seed=bus.seed,
        process=True,
        family=bus.family,
        options=far_end,
    ) as simulated:
        yield BusPort(bus.name, bus.family, simulated.path, bus.baud, options)
