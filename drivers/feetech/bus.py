"""A wire of Feetech servos: STS and SMS are read together (sync read), SCS one by one; all take sync writes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivers.base.bus import ServoSpec
from drivers.protocol1.bus import Protocol1Bus
from drivers.protocol1.exchange import Exchanges
from drivers.servos.port import Port
from drivers.tables.tables import check_feetech


class FeetechBus(Protocol1Bus):
    """Feetech servos on one serial port.

    Parameters
    ----------
    servos, options : see :class:`~drivers.protocol1.bus.Protocol1Bus`.
    port, baud, margin_s : see :class:`~drivers.servos.port.Port`.

    Raises
    ------
    DriverError : a model that is not Feetech's, or an option that does not fit.
    """

    MODELS = ("sts3215", "scs0009")

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        baud: int = 1_000_000,
        margin_s: float | None = None,
        **options: Any,
    ) -> None:
        servos = tuple(servos)
        for servo in servos:
            check_feetech(servo.model)
        super().__init__(servos, port=Port(port, baud, margin_s), packets=Exchanges(), **options)
