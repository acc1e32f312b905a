"""Channels: from the parameter vector to one angle per servo, as flat arrays.

The chain of a channel is mix -> calibrated points -> limits; speed and acceleration are kept by
:class:`controller.motion.MotionLimiter` at the clock of the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.motion import MotionLimiter
from controller.parameters import Parameters
from controller.robot import ChannelSettings
from drivers.bus import ServoSpec

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ChannelTable:
    """``n`` channels over ``p`` parameters; angles in radians from each servo's centre.

    Attributes
    ----------
    names : the channels, in order.
    mix : (n, p) float64, what of each parameter reaches the channel.
    start_rad : (n,) angle of the first calibrated point.
    knots : (n, k) mix value where each straight piece begins.
    widths : (n, k) length of each piece; 0 where a channel has fewer pieces.
    slopes : (n, k) radians per unit of mix on each piece.
    low_rad, high_rad : (n,) limits.
    max_speed_rad_s, max_accel_rad_s2 : (n,) limits of the motion.
    """

    names: tuple[str, ...]
    mix: Floats
    start_rad: Floats
    knots: Floats
    widths: Floats
    slopes: Floats
    low_rad: Floats
    high_rad: Floats
    max_speed_rad_s: Floats
    max_accel_rad_s2: Floats

    def angles(self, values: Floats) -> tuple[Floats, int]:
        """Angles for parameters, before limits of motion.

        Parameters
        ----------
        values : (p,) float64, the parameters.

        Returns
        -------
        (n,) float64 angles inside the limits, and how many channels the limits held back.
        """
        mixed = self.mix @ values
        pieces = np.clip(mixed[:, None] - self.knots, 0.0, self.widths)
        wanted = self.start_rad + (pieces * self.slopes).sum(axis=1)
        held = np.clip(wanted, self.low_rad, self.high_rad)
        return held, int(np.count_nonzero(held != wanted))


def limiter_of(table: ChannelTable, period_s: float) -> MotionLimiter:
    """Keeps the table's limits of position (rad), speed and acceleration at a bus that cycles every ``period_s``."""
    return MotionLimiter(
        table.max_speed_rad_s, table.max_accel_rad_s2, table.low_rad, table.high_rad, response_s=period_s
    )


def build_table(channels: Sequence[ChannelSettings], parameters: Parameters) -> ChannelTable:
    """Flatten the settings of ``n`` channels into a :class:`ChannelTable`."""
    mix = np.zeros((len(channels), len(parameters.names)))
    for row, channel in zip(mix, channels, strict=True):
        for name, share in channel.mix.items():
            row[parameters.index(name)] = share
    knots, widths, slopes = _pieces(channels)
    return ChannelTable(
        names=tuple(channel.name for channel in channels),
        mix=mix,
        start_rad=np.radians([channel.map.deg[0] + channel.trim_deg for channel in channels]),
        knots=knots,
        widths=widths,
        slopes=slopes,
        low_rad=np.radians([channel.limit_deg[0] for channel in channels]),
        high_rad=np.radians([channel.limit_deg[1] for channel in channels]),
        max_speed_rad_s=np.radians([channel.max_speed_deg_s for channel in channels]),
        max_accel_rad_s2=np.radians([channel.max_accel_deg_s2 for channel in channels]),
    )


def _pieces(channels: Sequence[ChannelSettings]) -> tuple[Floats, Floats, Floats]:
    most = max(len(channel.map.at) for channel in channels) - 1
    knots, widths, slopes = (np.zeros((len(channels), most)) for _ in range(3))
    for i, channel in enumerate(channels):
        at, rad = np.array(channel.map.at), np.radians(channel.map.deg)
        k = len(at) - 1
        knots[i, :k] = at[:-1]
        widths[i, :k] = np.diff(at)
        slopes[i, :k] = np.diff(rad) / np.diff(at)
    return knots, widths, slopes


def play(channels: Sequence[ChannelSettings]) -> tuple[Floats, Floats]:
    """Dead band and slack of ``n`` channels, each (n,) rad."""
    return (
        np.radians([channel.dead_band_deg for channel in channels]),
        np.radians([channel.slack_deg for channel in channels]),
    )


def servo_specs(channels: Sequence[ChannelSettings]) -> list[ServoSpec]:
    """What the driver has to know of each channel's servo."""
    return [
        ServoSpec(
            id=channel.id,
            name=channel.name,
            model=channel.model,
            min_rad=float(np.radians(channel.limit_deg[0])),
            max_rad=float(np.radians(channel.limit_deg[1])),
            max_speed_rad_s=float(np.radians(channel.max_speed_deg_s)),
            max_accel_rad_s2=float(np.radians(channel.max_accel_deg_s2)),
            reverse=channel.reverse,
            zero_rad=float(np.radians(channel.zero_deg)),
        )
        for channel in channels
    ]
