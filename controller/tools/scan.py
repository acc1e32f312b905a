"""Scans a serial port for servos, at every baud rate and in both protocols; nothing moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from drivers import open_bus
from drivers.base.bus import ServoInfo, ServoSpec
from drivers.port.serialport import SerialPort
from drivers.tools.scan_protocol1 import describe, ping_all

BAUDS = {
    2: (1_000_000, 57_600, 115_200, 2_000_000, 3_000_000, 4_000_000, 9_600),
    1: (1_000_000, 500_000, 57_600, 115_200, 250_000, 128_000, 76_800, 38_400, 400_000, 200_000, 19_200, 9_600),
}
"""Baud rates by protocol, the most common ones first: those of Dynamixel X, and those of AX, MX and Feetech."""

STEPS = 254
"""Progress steps of one baud rate and protocol."""

# A bus cannot be created without a servo; the scan does not use this one.
_PLACEHOLDER = ServoSpec(0, "any", "xl330-m288", -1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Found:
    """What answered at a baud rate in a protocol: a servo, or None for bytes that are not a valid answer."""

    baud: int
    protocol: int
    servo: ServoInfo | None

    @property
    def row(self) -> tuple[str, ...]:
        """Baud rate, protocol, id, model, firmware, voltage, temperature, error and torque as text."""
        head = (str(self.baud), f"{self.protocol}.0")
        info = self.servo
        if info is None:
            return (*head, "?", "answers are damaged: two servos with one id, or noise", "", "", "", "", "")
        return (
            *head,
            str(info.id),
            info.model or f"number {info.model_number}",
            str(info.firmware),
            "" if info.voltage_v is None else f"{info.voltage_v:.1f} V",
            "" if info.temperature_c is None else f"{info.temperature_c:.0f} C",
            "" if not info.hardware_error else f"0x{info.hardware_error:02x}",
            "" if info.torque is None else "on" if info.torque else "off",
        )


def plan_scan(bauds: Sequence[int] | None, protocols: Sequence[int]) -> list[tuple[int, int]]:
    """Return (protocol, baud rate) in the order of the scan; with ``bauds`` None, all of :data:`BAUDS`."""
    return [(protocol, baud) for protocol in protocols for baud in bauds or BAUDS[protocol]]


def scan_port(
    port: str, plan: Sequence[tuple[int, int]], progress: Callable[[str, int], object] = lambda text, step: None
) -> Iterator[Found]:
    """Yield everything that answers on a port; ``plan`` : see :func:`plan_scan`.

    ``progress`` is called with the present attempt as text, and the steps done: :data:`STEPS` for each of the plan.

    Raises PortError: the port cannot be opened or is lost.
    """
    for done, (protocol, baud) in enumerate(plan):
        text = f"{baud} baud, Protocol {protocol}.0"

        def step(servo: int, text: str = text, done: int = done) -> None:
            progress(text, done * STEPS + servo)

        step(0)
        if protocol == 1:
            yield from _scan_protocol_1(port, baud, step)
        else:
            with open_bus("dynamixel", [_PLACEHOLDER], port=port, baud=baud) as bus:
                yield from (Found(baud, 2, info) for info in bus.discover())
    progress("done", len(plan) * STEPS)


def _scan_protocol_1(port: str, baud: int, step: Callable[[int], None]) -> Iterator[Found]:
    link = SerialPort(port, baud)
    link.open()
    try:
        answers = ping_all(link, step)
        for servo in answers.ids:
            yield Found(baud, 1, describe(link, servo))
        if answers.noise and not answers.ids:
            yield Found(baud, 1, None)
    finally:
        link.close()
