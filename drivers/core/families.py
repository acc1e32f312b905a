"""Definition of a plug-in family of servos or boards, and the options that many families share.

A family is a folder of ``drivers`` whose module ``family`` has a :class:`Family` named ``FAMILY``, or another package
with an entry point to one in the group ``omote.drivers``; see docs/extending.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.options import option

API = 1
"""Version of the interface: this module, ``drivers.core.wirebus`` and ``drivers.sim.wire.simulator``."""

RESERVED = (
    "name", "kind", "port", "baud", "rate_hz", "let_go_s", "let_go_below_a", "simulates", "transport", "faults", "wire",
    "latency_s", "seed",
)  # fmt: skip
"""Keys of every bus in a robot file, which no family's settings may use."""

SERVO_BAUD, BOARD_BAUD = 1_000_000, 115_200
"""Factory default rates of servos and boards."""

USUAL_RATE_HZ, HIGH_RATE_HZ = 50.0, 100.0
"""Cycles per second of a bus whose robot file gives none; the high one where the wire carries it."""


@dataclass(frozen=True, kw_only=True)
class Family:
    """One family of servos or boards: its driver, settings and simulator.

    api : version of the interface it is made for; see :data:`API`.
    kind : name in robot files. title : name for people, as "Pololu Maestro boards".
    driver : ``"module:name"`` of a :class:`drivers.core.wirebus.WireBus`, or of a function that returns one for a
        sequence of servos.
    settings : dataclass of the driver's options besides :data:`RESERVED`, see :mod:`drivers.base.options`; its method
        ``check(self, rate_hz)``, if any, raises ValueError where values contradict each other.
    check_model : ``"module:name"`` of a function that raises DriverError for a model that it does not drive.
    cycle_bytes : ``"module:name"`` of a function that returns the bytes on the wire of one cycle for a sequence of
        models, infinity where a cycle waits for more than the wire; empty: every bus has the lower usual rate.
    simulator : ``"module:name"`` of a :class:`drivers.sim.wire.simulator.Simulator`; empty: none.
    baud : default rate of the port.
    hobby : its servos are hobby servos, whose pulses can be calibrated.
    install : argument of ``pip install`` where a package is missing.
    """

    api: int
    kind: str
    title: str
    driver: str
    settings: type
    check_model: str
    cycle_bytes: str = ""
    simulator: str = ""
    baud: int = BOARD_BAUD
    hobby: bool = False
    install: str = ""


@dataclass(frozen=True, kw_only=True)
class AnySettings:
    """Options of every driver."""

    margin_s: float | None = option(
        "Longest wait for an answer beyond its time on the wire (s).", at_least=0, at_most=600
    )


WATCHDOG_MS = 200
"""Default bus watchdog of servos."""


@dataclass(frozen=True, kw_only=True)
class ServoSettings(AnySettings):
    """Options of drivers of servos with control tables."""

    watchdog_ms: int | None = option(
        "Servos stop when they receive nothing for this time; 0 is never (ms).", at_least=0, at_most=2540
    )
    takeover: str | None = option("What becomes of servos that are on already.", choices=("adopt", "release", "refuse"))
    reboot_faulted: bool | None = option("Reboot servos that latched a hardware error.")
    min_voltage_v: float | None = option("Supply below which servos are not switched on (V).", above=0, at_most=60)
    voltage_wait_s: float | None = option("How long to wait for that supply (s).", at_least=0, at_most=600)
    feedback: str | None = option("What is read every cycle.", choices=("full", "position"))
    slow_group: int | None = option("Servos from which slow values are read in one cycle.", at_least=0, at_most=252)

    def check(self, rate_hz: float) -> None:
        """Raises ValueError for a watchdog that would trip between two cycles."""
        watchdog_ms = WATCHDOG_MS if self.watchdog_ms is None else self.watchdog_ms
        if 0 < watchdog_ms < 2000 / rate_hz:
            raise ValueError(f"watchdog_ms must be 0 or span two cycles, {2000 / rate_hz:g} at this rate_hz")


@dataclass(frozen=True, kw_only=True)
class PulseSettings(AnySettings):
    """Options of drivers of hobby servo boards."""

    stagger_s: float | None = option("Pause between switching servos on (s).", at_least=0, at_most=1)
