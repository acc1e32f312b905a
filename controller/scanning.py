"""Looking for servos on a port at every rate they may listen at; nothing moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from drivers.bus import ServoInfo, ServoSpec

BAUDS = (1_000_000, 57_600, 115_200, 2_000_000, 3_000_000, 4_000_000, 9_600)
"""Rates of the Dynamixel baud register, the usual ones first."""

# A bus is made for servos; looking around uses none of this one's settings.
_ANY = ServoSpec(0, "any", "xl330-m288", -1.0, 1.0, 1.0, 1.0)


def scan_port(port: str, bauds: Sequence[int] | None, tell: Callable[[str], None]) -> Iterator[tuple[str, ...]]:
    """Rows of what answers: baud, id, model, firmware, voltage, temperature, hardware error.

    Parameters
    ----------
    port : device path.
    bauds : rates to try; None tries :data:`BAUDS`.
    tell : called with the rate being tried.

    Raises
    ------
    PortError
        when the port cannot be opened.
    """
    from drivers import open_bus

    for baud in bauds or BAUDS:
        tell(f"{port} at {baud} baud")
        with open_bus("dynamixel", [_ANY], port=port, baud=baud) as bus:
            for info in bus.discover():
                yield _row(baud, info)


def _row(baud: int, info: ServoInfo) -> tuple[str, ...]:
    return (
        str(baud),
        str(info.id),
        info.model or f"number {info.model_number}",
        str(info.firmware),
        "" if info.voltage_v is None else f"{info.voltage_v:.1f} V",
        "" if info.temperature_c is None else f"{info.temperature_c:.0f} C",
        "" if not info.hardware_error else f"0x{info.hardware_error:02x}",
    )
