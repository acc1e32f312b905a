"""Bus of Feetech servos: STS and SMS are read together (sync read), SCS one by one; all take sync writes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivers.base.bus import ServoSpec
from drivers.protocol1.bus import Protocol1Bus
from drivers.tables.models import check_feetech


class FeetechBus(Protocol1Bus):
    """Feetech servos on one serial port; options as for :class:`~drivers.protocol1.bus.Protocol1Bus`.

    Raises DriverError for a model that is not Feetech's or an option that does not fit.
    """

    MODELS = ("sts3215", "scs0009")

    def __init__(self, servos: Iterable[ServoSpec], **options: Any) -> None:
        servos = tuple(servos)
        for servo in servos:
            check_feetech(servo.model)
        super().__init__(servos, **options)
