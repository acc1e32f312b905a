"""Conversion between angles of hobby servos and pulse widths or other values on the wire, by model or calibration."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Flags, Floats, ServoSpec
from drivers.base.errors import DriverError

Indices = NDArray[np.intp]

MIN_US, MAX_US = 64.0, 4080.0
"""Limits of the pulses that boards can make and servos understand."""


@dataclass(frozen=True)
class HobbyModel:
    """Pulse widths ``us`` (k,) at shaft angles ``rad`` (k,) from the middle, which strictly increase."""

    rad: tuple[float, ...]
    us: tuple[float, ...]


@cache
def known_models() -> dict[str, HobbyModel]:
    """The models of hobby.toml by name."""
    data = tomllib.loads(Path(__file__).with_name("hobby.toml").read_text(encoding="utf-8"))
    return {
        name: HobbyModel(tuple(math.radians(deg) for deg in entry["deg"]), tuple(map(float, entry["us"])))
        for name, entry in data["models"].items()
    }


def hobby_model(model: str) -> HobbyModel:
    """A model by name, in any case; raises DriverError with similar names, or all, for an unknown one."""
    name = model.strip().lower().replace("_", "-")
    models = known_models()
    if name in models:
        return models[name]
    near = difflib.get_close_matches(name, models, n=3) or sorted(models)
    raise DriverError(f"there is no hobby servo model {model!r}", hint=f"use one of {', '.join(near)}")


def check_hobby(model: str) -> None:
    """Raise DriverError for a model that is no hobby servo."""
    hobby_model(model)


class PulseScale:
    """Conversion between angles and pulses of n hobby servos.

    low_us, high_us : (n,) shortest and longest pulse inside the servos' limits. us_per_rad : (n,) steepest slope.

    Raises DriverError: unknown model, a calibration that is not monotonic, or pulses that no board can make.
    """

    def __init__(self, servos: Sequence[ServoSpec]) -> None:
        curves = [_curve(servo) for servo in servos]
        self._rad, self._us = (_padded([curve[side] for curve in curves]) for side in (0, 1))
        self._sign = np.sign(self._us[:, -1] - self._us[:, 0])
        ends = [self.pulses(np.array([getattr(s, end) for s in servos])) for end in ("min_rad", "max_rad")]
        self.low_us, self.high_us = np.minimum(*ends), np.maximum(*ends)
        self.us_per_rad = np.abs(np.diff(self._us) / np.diff(self._rad)).max(axis=1)
        for i, servo in enumerate(servos):
            low, high = float(self.low_us[i]), float(self.high_us[i])
            if low < MIN_US or high > MAX_US:
                raise DriverError(
                    f"servo {servo.name!r} (id {servo.id}): its limits would be pulses of {low:.0f} to {high:.0f} us, "
                    f"and none is outside {MIN_US:g} to {MAX_US:g}",
                    hint="narrow limit_deg, or calibrate its pulses",
                )

    def pulses(self, angle_rad: Floats) -> Floats:
        """Convert angles (n,) rad to pulses (n,) us."""
        return _extrapolated(angle_rad, self._rad, self._us)

    def steps(self, angle_rad: Floats, per_us: int) -> Indices:
        """Convert angles (n,) rad to whole steps (n,) of ``1 / per_us`` us, inside the servos' limits."""
        steps = np.rint(self.pulses(angle_rad) * per_us)
        low, high = np.ceil(self.low_us * per_us), np.floor(self.high_us * per_us)
        kept: Indices = np.minimum(np.maximum(steps, low), high).astype(np.intp)
        return kept

    def check_steps(self, servos: Sequence[ServoSpec], per_us: int) -> None:
        """Raise DriverError where no whole step of ``1 / per_us`` us lies inside a servo's limits."""
        low, high = np.ceil(self.low_us * per_us), np.floor(self.high_us * per_us)
        _check_steps(servos, low <= high, self.low_us, self.high_us, f"step of {1 / per_us:g} us")

    def radians(self, pulse_us: Floats) -> Floats:
        """Convert pulses (n,) us to angles (n,) rad; NaN for 0, which is no pulse."""
        angles = _extrapolated(self._sign * pulse_us, self._sign[:, None] * self._us, self._rad)
        return np.where(pulse_us > 0.0, angles, math.nan)


def _check_steps(servos: Sequence[ServoSpec], fits: Flags, low: Floats, high: Floats, what: str) -> None:
    """Raise DriverError for the first servo without a step between its limits: any goal would be outside."""
    for i in np.flatnonzero(~fits).tolist():
        raise DriverError(
            f"servo {servos[i].name!r} (id {servos[i].id}): "
            f"no {what} lies inside its limits, {low[i]:g} to {high[i]:g}",
            hint="widen limit_deg, or use a template with more decimals",
        )


def _curve(servo: ServoSpec) -> tuple[Floats, Floats]:
    """Increasing angles (k,) of a servo, and its pulses (k,) at them."""
    if servo.pulse_us:
        points = sorted(servo.pulse_us)
        rad, us = (np.array(column) for column in zip(*points, strict=True))
    else:
        model, sign = hobby_model(servo.model), -1.0 if servo.reverse else 1.0
        rad, us = sign * (np.array(model.rad) - servo.zero_rad), np.array(model.us)
        order = np.argsort(rad)
        rad, us = rad[order], us[order]
    steps = np.diff(us)
    if len(us) < 2 or not (np.diff(rad) > 0).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise DriverError(
            f"servo {servo.name!r} (id {servo.id}): its pulses must rise, or fall, with every angle",
            hint="give two or more points, as pulse = { deg = [-45, 45], us = [1000, 2000] }",
        )
    return rad, us


def _padded(rows: Sequence[Floats]) -> Floats:
    """Points of several curves as (n, k); shorter ones are extended linearly."""
    k = max(len(row) for row in rows)
    return np.array([np.concatenate([row, row[-1] + (row[-1] - row[-2]) * np.arange(1, k - len(row) + 1)])
                     for row in rows])  # fmt: skip


def _extrapolated(x: Floats, at: Floats, gives: Floats) -> Floats:
    """Piecewise linear curves through points (n, k), each at its own x (n,); extrapolated beyond their ends."""
    rows = np.arange(len(x))
    piece = (x[:, None] > at[:, 1:-1]).sum(axis=1)
    start, end = at[rows, piece], at[rows, piece + 1]
    low, high = gives[rows, piece], gives[rows, piece + 1]
    out: Floats = low + (x - start) * (high - low) / (end - start)
    return out


class ValueScale:
    """Conversion between angles of n servos and the values in lines of text.

    fields : value of each servo: ``us``, ``deg``, ``deg10``, ``angle``, ``unit`` (:mod:`drivers.text.template`), or
        ``parameter`` (1 for 90 degrees of the shaft).
    decimals : of each value on the wire.

    Raises DriverError: no value with so few decimals lies inside a servo's limits.
    """

    def __init__(self, servos: Sequence[ServoSpec], fields: Sequence[str], decimals: Sequence[int]) -> None:
        self._step = np.array([10.0**-places for places in decimals])
        self._offset, self._slope = np.array([_line(field, s) for field, s in zip(fields, servos, strict=True)]).T
        self._us = [i for i, field in enumerate(fields) if field == "us"]
        self._pulses = PulseScale([servos[i] for i in self._us]) if self._us else None
        ends = [self._exact(np.array([getattr(s, end) for s in servos])) for end in ("min_rad", "max_rad")]
        self._low, self._high = np.minimum(*ends), np.maximum(*ends)
        low, high = self._whole_ends()
        _check_steps(servos, low <= high, self._low, self._high, "value on the wire")

    def _whole_ends(self) -> tuple[Floats, Floats]:
        """The lowest and the highest whole step inside the limits, (n,) each."""
        return np.ceil(self._low / self._step - 1e-9), np.floor(self._high / self._step + 1e-9)

    def values(self, angle_rad: Floats) -> Floats:
        """Convert angles (n,) rad to values (n,), rounded to the last decimal inside the servos' limits."""
        rounded = np.rint(self._exact(angle_rad) / self._step)
        low, high = self._whole_ends()
        values: Floats = np.minimum(np.maximum(rounded, low), high) * self._step
        return values

    def radians(self, values: Floats) -> Floats:
        """Convert values (n,) to angles (n,) rad."""
        angles: Floats = (values - self._offset) / self._slope
        if self._pulses:
            angles[self._us] = self._pulses.radians(values[self._us])
        return angles

    def _exact(self, angle_rad: Floats) -> Floats:
        values: Floats = self._offset + self._slope * angle_rad
        if self._pulses:
            values[self._us] = self._pulses.pulses(angle_rad[self._us])
        return values


def _line(field: str, servo: ServoSpec) -> tuple[float, float]:
    """Value at angle 0, and value per radian; unused for pulses."""
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
