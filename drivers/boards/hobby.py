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

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError

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
        curves = [_curve(servo) for servo in servos]
        self._rad, self._us = (_stacked([curve[side] for curve in curves]) for side in (0, 1))
        self._sign = np.sign(self._us[:, -1] - self._us[:, 0])
        ends = [self.pulses(np.array([getattr(s, end) for s in servos])) for end in ("min_rad", "max_rad")]
        self.low_us, self.high_us = np.minimum(*ends), np.maximum(*ends)
        self.us_per_rad = np.abs(np.diff(self._us) / np.diff(self._rad)).max(axis=1)
        for i, servo in enumerate(servos):
            _check_reach(servo, float(self.low_us[i]), float(self.high_us[i]))

    def pulses(self, angle_rad: Floats) -> Floats:
        """(n,) us for angles (n,) rad."""
        return _bent(angle_rad, self._rad, self._us)

    def steps(self, angle_rad: Floats, per_us: int) -> Indices:
        """(n,) whole steps of ``1 / per_us`` us for angles (n,) rad, never beyond the servos' limits."""
        steps = np.rint(self.pulses(angle_rad) * per_us)
        low, high = np.ceil(self.low_us * per_us), np.floor(self.high_us * per_us)
        kept: Indices = np.minimum(np.maximum(steps, low), high).astype(np.intp)
        return kept

    def radians(self, pulse_us: Floats) -> Floats:
        """(n,) rad for pulses (n,) us; NaN for 0, which is no pulse."""
        angles = _bent(self._sign * pulse_us, self._sign[:, None] * self._us, self._rad)
        return np.where(pulse_us > 0.0, angles, math.nan)

    def radian(self, index: int, pulse_us: float) -> float:
        """The angle of one servo (rad) for a pulse; NaN for 0, which is no pulse."""
        return float(self.radians(np.full(len(self._sign), pulse_us))[index])


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
    return rad, us


def _check_reach(servo: ServoSpec, low_us: float, high_us: float) -> None:
    if low_us < LOWEST_US or high_us > HIGHEST_US:
        raise DriverError(
            f"servo {servo.name!r} (id {servo.id}): its limits would be pulses of {low_us:.0f} to {high_us:.0f} us, "
            f"and none is outside {LOWEST_US:g} to {HIGHEST_US:g}",
            hint="narrow limit_deg, or calibrate its pulses",
        )


def _stacked(rows: Sequence[Floats]) -> Floats:
    """Points of several curves as (n, k): shorter ones go on straight."""
    k = max(len(row) for row in rows)
    return np.array([np.concatenate([row, row[-1] + (row[-1] - row[-2]) * np.arange(1, k - len(row) + 1)])
                     for row in rows])  # fmt: skip


def _bent(x: Floats, at: Floats, gives: Floats) -> Floats:
    """Each curve of points (n, k) at its own x (n,); beyond their ends they go on straight."""
    rows = np.arange(len(x))
    piece = (x[:, None] > at[:, 1:-1]).sum(axis=1)
    start, end = at[rows, piece], at[rows, piece + 1]
    low, high = gives[rows, piece], gives[rows, piece + 1]
    out: Floats = low + (x - start) * (high - low) / (end - start)
    return out
