"""Hobby servos: from angles to pulses and back, by model or as calibrated. A pulse is all that is ever known of one."""

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

from drivers.bus import Floats, ServoSpec
from drivers.errors import DriverError

Indices = NDArray[np.intp]

LOWEST_US, HIGHEST_US = 64.0, 4080.0
"""Pulses outside these no board makes and no servo understands."""


@dataclass(frozen=True)
class HobbyModel:
    """Pulse widths ``us`` (k,) at shaft angles ``rad`` (k,) from the middle, both without a tie, ``rad`` growing."""

    name: str
    rad: tuple[float, ...]
    us: tuple[float, ...]


@cache
def known_models() -> dict[str, HobbyModel]:
    """The models of hobby.toml by name."""
    data = tomllib.loads(Path(__file__).with_name("hobby.toml").read_text(encoding="utf-8"))
    return {
        name: HobbyModel(name, tuple(math.radians(deg) for deg in entry["deg"]), tuple(map(float, entry["us"])))
        for name, entry in data["models"].items()
    }


def hobby_model(model: str) -> HobbyModel:
    """A model by name, in any case.

    Raises
    ------
    DriverError : there is no such model; the hint lists those that look like it, or all.
    """
    name = model.strip().lower().replace("_", "-")
    models = known_models()
    if name in models:
        return models[name]
    near = difflib.get_close_matches(name, models, n=3) or sorted(models)
    raise DriverError(f"there is no hobby servo model {model!r}", hint=f"use one of {', '.join(near)}")


def check_hobby(model: str) -> None:
    """Raises DriverError where a board for hobby servos cannot drive the model."""
    hobby_model(model)


class PulseScale:
    """Angles of ``n`` hobby servos as pulses, and back.

    Parameters
    ----------
    servos : n of them.

    Attributes
    ----------
    low_us, high_us : (n,) shortest and longest pulse inside the servos' limits. us_per_rad : (n,) steepest slope.

    Raises
    ------
    DriverError : unknown model, a calibration that does not rise or fall all the way, or pulses no board makes.
    """

    def __init__(self, servos: Sequence[ServoSpec]) -> None:
        self._curves = [_curve(servo) for servo in servos]
        ends = np.array([[_bent(end, *curve) for end in (servo.min_rad, servo.max_rad)]
                         for servo, curve in zip(servos, self._curves, strict=True)])  # fmt: skip
        self.low_us, self.high_us = ends.min(axis=1), ends.max(axis=1)
        self.us_per_rad = np.array([np.max(np.abs(np.diff(us) / np.diff(rad))) for rad, us in self._curves])

    def pulses(self, angle_rad: Floats) -> Floats:
        """(n,) us for angles (n,) rad."""
        return np.array([_bent(a, rad, us) for a, (rad, us) in zip(angle_rad, self._curves, strict=True)])

    def steps(self, angle_rad: Floats, per_us: int) -> Indices:
        """(n,) whole steps of ``1 / per_us`` us for angles (n,) rad, never beyond the servos' limits."""
        steps = np.rint(self.pulses(angle_rad) * per_us)
        low, high = np.ceil(self.low_us * per_us), np.floor(self.high_us * per_us)
        return np.minimum(np.maximum(steps, low), high).astype(np.intp)

    def radians(self, pulse_us: Floats) -> Floats:
        """(n,) rad for pulses (n,) us; NaN for 0, which is no pulse."""
        return np.array([self.radian(k, pulse) for k, pulse in enumerate(pulse_us)])

    def radian(self, index: int, pulse_us: float) -> float:
        """The angle of one servo (rad) for a pulse; NaN for 0, which is no pulse."""
        return _back(pulse_us, *self._curves[index])


def _curve(servo: ServoSpec) -> tuple[Floats, Floats]:
    """The servo's angles (k,), growing, and its pulses (k,) there."""
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
    _check_reach(servo, rad, us)
    return rad, us


def _check_reach(servo: ServoSpec, rad: Floats, us: Floats) -> None:
    for limit in (servo.min_rad, servo.max_rad):
        pulse = _bent(limit, rad, us)
        if not LOWEST_US <= pulse <= HIGHEST_US:
            raise DriverError(
                f"servo {servo.name!r} (id {servo.id}): {math.degrees(limit):g} degrees would be a pulse of "
                f"{pulse:.0f} us, and none is outside {LOWEST_US:g} to {HIGHEST_US:g}",
                hint="narrow limit_deg, or calibrate its pulses",
            )


def _bent(x: float, at: Floats, gives: Floats) -> float:
    """The curve through points at x; beyond its ends it goes on straight."""
    k = min(max(int(np.searchsorted(at, x)) - 1, 0), len(at) - 2)
    return float(gives[k] + (x - at[k]) * (gives[k + 1] - gives[k]) / (at[k + 1] - at[k]))


def _back(pulse: float, rad: Floats, us: Floats) -> float:
    if not pulse > 0.0:
        return math.nan
    return _bent(pulse, us, rad) if us[-1] > us[0] else _bent(-pulse, -us, rad)
