"""Dynamixel servos of Protocol 1.0 (AX, RX, and MX with firmware of that protocol) on one wire."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivers.base.bus import ServoSpec
from drivers.dynamixel.legacy_sdk import Packets1
from drivers.dynamixel.port import Port
from drivers.protocol1.bus import Protocol1Bus


class LegacyBus(Protocol1Bus):
    """Protocol 1.0 servos on one serial port: MX are read together (bulk read), AX and RX one by one.

    Parameters
    ----------
    servos, options : see :class:`~drivers.protocol1.bus.Protocol1Bus`.
    port : device path, or a port that is shared with servos of the other protocol.
    baud, margin_s : see :class:`~drivers.dynamixel.port.Port`.
    """

    MODELS = ("ax-12a",)

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str | Port,
        baud: int = 1_000_000,
        margin_s: float | None = None,
        **options: Any,
    ) -> None:
        wire = port if isinstance(port, Port) else Port(port, baud, margin_s)
        super().__init__(servos, port=wire, packets=Packets1(), **options)
