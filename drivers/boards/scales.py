"""Angles as the values that templates hold, rounded so that no limit is passed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.boards.hobby import PulseScale, hobby_model


class ValueScale:
    """Angles of ``n`` servos as one of a template's values.

    Parameters
    ----------
    field : ``us``, ``deg``, ``deg10``, ``angle``, ``unit``, or ``parameter`` (1 for 90 degrees of the shaft).
    decimals : that the value keeps on the wire.
    servos : n of them. pulses : their pulses, where the value is one.
    """

    def __init__(self, field: str, decimals: int, servos: Sequence[ServoSpec], pulses: PulseScale | None) -> None:
        self.field, self._step = field, 10.0**-decimals
        self._pulses = pulses if field == "us" else None
        self._offset, self._slope = (
            np.array(column) for column in zip(*(_line(field, s) for s in servos), strict=True)
        )
        ends = [self._plain(np.array([getattr(s, end) for s in servos])) for end in ("min_rad", "max_rad")]
        self._low, self._high = np.minimum(*ends), np.maximum(*ends)

    def values(self, angle_rad: Floats) -> Floats:
        """(n,) values for angles (n,) rad, in whole steps of the last decimal inside the servos' limits."""
        rounded = np.rint(self._plain(angle_rad) / self._step)
        low = np.ceil(self._low / self._step - 1e-9)
        high = np.floor(self._high / self._step + 1e-9)
        return np.minimum(np.maximum(rounded, low), high) * self._step

    def radians(self, values: Floats) -> Floats:
        """(n,) rad for values (n,)."""
        return self._pulses.radians(values) if self._pulses else (values - self._offset) / self._slope

    def radian(self, index: int, value: float) -> float:
        """The angle (rad) of one servo for a value."""
        if self._pulses:
            return self._pulses.radian(index, value)
        return float((value - self._offset[index]) / self._slope[index])

    def _plain(self, angle_rad: Floats) -> Floats:
        return self._pulses.pulses(angle_rad) if self._pulses else self._offset + self._slope * angle_rad


def _line(field: str, servo: ServoSpec) -> tuple[float, float]:
    """Value at angle 0, and value per radian; pulses are no line."""
    if field == "us":
        return 0.0, 1.0
    if field == "unit":
        span = servo.max_rad - servo.min_rad
        return -servo.min_rad / span, 1.0 / span
    middle, slope = math.degrees(servo.zero_rad), math.degrees(-1.0 if servo.reverse else 1.0)
    if field == "angle":
        middle -= math.degrees(hobby_model(servo.model).rad[0])
    factor = {"deg10": 10.0, "parameter": 1.0 / 90.0}.get(field, 1.0)
    return factor * middle, factor * slope
