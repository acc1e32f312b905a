"""Channels: from the parameter vector to one angle per servo, as flat arrays.

The chain of a channel is mix (or anchor) -> calibrated points -> limits; safety rules (:mod:`controller.robot.safety`)
and limits of motion (:class:`controller.motion.motion.MotionLimiter`) follow at the clock of the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controller.base.parameters import Floats, Indices, Parameters
from controller.motion.motion import MotionLimiter
from controller.robot.settings import ChannelSettings
from controller.robot.terms import bend
from drivers.base.bus import ServoSpec


class Anchors(Protocol):
    """What solves the channels that say where they pull; see :mod:`controller.robot.anchors`.

    Attributes
    ----------
    names : the channels it solves, k of them. linear : (k, p) mm of pull per unit of each parameter, roughly.
    """

    names: tuple[str, ...]
    linear: Floats

    def pulls(self, values: Floats) -> Floats:
        """(k,) mm of pull for parameters (p,)."""


@dataclass(frozen=True)
class Terms:
    """Terms of mixes that are more than a weight, ``t`` of them, those of one channel together.

    Attributes
    ----------
    parameter, channel : (t,) where each leads from and to.
    start : (t,) value of the first corner. knots, widths, slopes : (t, k) straight pieces.
    first : (j,) where each channel's terms begin; target : (j,) the channels. join : (j,) 0 sum, 1 min, 2 max.
    """

    parameter: Indices
    channel: Indices
    start: Floats
    knots: Floats
    widths: Floats
    slopes: Floats
    first: Indices
    target: Indices
    join: Indices

    def add_to(self, mixed: Floats, values: Floats) -> None:
        """Add the terms for parameters (p,) to the mixes (n,), in place."""
        x = values[self.parameter]
        pieces = np.clip(x[:, None] - self.knots, 0.0, self.widths)
        each = self.start + (pieces * self.slopes).sum(axis=1)
        joins = [ufunc.reduceat(each, self.first) for ufunc in (np.add, np.minimum, np.maximum)]
        mixed[self.target] += np.choose(self.join, joins)

    def linear(self, shape: tuple[int, int]) -> Floats:
        """(n, p) mean slope of each term."""
        out = np.zeros(shape)
        rise = (self.slopes * self.widths).sum(axis=1) / np.maximum(self.widths.sum(axis=1), 1e-12)
        np.add.at(out, (self.channel, self.parameter), rise)
        return out


@dataclass(frozen=True)
class ChannelTable:
    """``n`` channels over ``p`` parameters; angles in radians from each servo's centre.

    Attributes
    ----------
    names : the channels, in order.
    mix : (n, p) float64, what of each parameter reaches the channel by weight alone.
    start_rad : (n,) angle of the first calibrated point.
    knots : (n, k) mix value where each straight piece begins.
    widths : (n, k) length of each piece; 0 where a channel has fewer pieces.
    slopes : (n, k) radians per unit of mix on each piece.
    low_rad, high_rad : (n,) limits.
    max_speed_rad_s, max_accel_rad_s2, max_jerk_rad_s3 : (n,) limits of the motion; infinite jerk for no limit.
    terms : terms that are more than a weight. anchors, anchored : what solves channels (k,) that pull at the skin.
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
    max_jerk_rad_s3: Floats
    terms: Terms | None = None
    anchors: Anchors | None = None
    anchored: Indices | None = None

    @property
    def linear(self) -> Floats:
        """(n, p) what a unit of each parameter adds to each mix, curves by their mean slope."""
        out = self.mix if self.terms is None else self.mix + self.terms.linear(self.mix.shape)
        if self.anchors is None:
            return out
        out = out.copy()
        out[self.anchored] = self.anchors.linear
        return out

    def mixed(self, values: Floats) -> Floats:
        """(n,) mixes for parameters (p,); mm of pull where a channel is anchored."""
        mixed = self.mix @ values
        if self.terms is not None:
            self.terms.add_to(mixed, values)
        if self.anchors is not None:
            mixed[self.anchored] = self.anchors.pulls(values)
        return mixed

    def angles(self, values: Floats) -> tuple[Floats, int]:
        """Angles for parameters, before limits of motion.

        Parameters
        ----------
        values : (p,) float64, the parameters.

        Returns
        -------
        (n,) float64 angles inside the limits, and how many channels the limits held back.
        """
        mixed = self.mixed(values)
        pieces = np.clip(mixed[:, None] - self.knots, 0.0, self.widths)
        wanted = self.start_rad + (pieces * self.slopes).sum(axis=1)
        held = np.clip(wanted, self.low_rad, self.high_rad)
        return held, int(np.count_nonzero(held != wanted))


def limiter_of(table: ChannelTable, period_s: float) -> MotionLimiter:
    """Keeps the table's limits of position (rad) and motion at a bus that cycles every ``period_s``."""
    return MotionLimiter(
        table.max_speed_rad_s,
        table.max_accel_rad_s2,
        table.low_rad,
        table.high_rad,
        response_s=period_s,
        max_jerk=table.max_jerk_rad_s3,
        period_s=period_s,
    )


def build_table(
    channels: Sequence[ChannelSettings], parameters: Parameters, anchors: Anchors | None = None
) -> ChannelTable:  # fmt: skip
    """Flatten the settings of ``n`` channels into a :class:`ChannelTable`.

    Parameters
    ----------
    anchors : solves the channels that have an anchor; they stay at 0 mm without.
    """
    mix = np.zeros((len(channels), len(parameters.names)))
    for row, channel in zip(mix, channels, strict=True):
        for name, term in channel.mix.items():
            if term.plain and channel.join == "sum":
                row[parameters.index(name)] = term.by
    corners = [bend(np.array(c.map.at), np.radians(c.map.deg), c.map.curve) for c in channels]
    start, knots, widths, slopes = _pieces(corners)
    names = tuple(channel.name for channel in channels)
    return ChannelTable(
        names=names,
        mix=mix,
        start_rad=start + np.radians([channel.trim_deg for channel in channels]),
        knots=knots,
        widths=widths,
        slopes=slopes,
        low_rad=np.radians([channel.limit_deg[0] for channel in channels]),
        high_rad=np.radians([channel.limit_deg[1] for channel in channels]),
        max_speed_rad_s=np.radians([channel.max_speed_deg_s for channel in channels]),
        max_accel_rad_s2=np.radians([channel.max_accel_deg_s2 for channel in channels]),
        max_jerk_rad_s3=np.radians([channel.max_jerk_deg_s3 or np.inf for channel in channels]),
        terms=_terms(channels, parameters),
        anchors=anchors,
        anchored=None if anchors is None else np.array([names.index(name) for name in anchors.names], dtype=np.intp),
    )


def _pieces(corners: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats, Floats, Floats]:
    """First values (n,), and knots, widths and slopes (n, k) of curves given by their corners."""
    most = max(len(at) for at, _ in corners) - 1
    knots, widths, slopes = (np.zeros((len(corners), most)) for _ in range(3))
    for i, (at, gives) in enumerate(corners):
        k = len(at) - 1
        knots[i, :k] = at[:-1]
        widths[i, :k] = np.diff(at)
        slopes[i, :k] = np.diff(gives) / np.diff(at)
    return np.array([gives[0] for _, gives in corners]), knots, widths, slopes


def _terms(channels: Sequence[ChannelSettings], parameters: Parameters) -> Terms | None:
    found = [
        (i, parameters.index(name), term)
        for i, channel in enumerate(channels)
        for name, term in channel.mix.items()
        if not (term.plain and channel.join == "sum")
    ]
    if not found:
        return None
    corners = [term.points(parameters.low[p], parameters.high[p]) for _, p, term in found]
    channel = np.array([i for i, _, _ in found], dtype=np.intp)
    target, first = np.unique(channel, return_index=True)
    join = np.array([("sum", "min", "max").index(channels[i].join) for i in target], dtype=np.intp)
    parameter = np.array([p for _, p, _ in found], dtype=np.intp)
    return Terms(parameter, channel, *_pieces(corners), first=first, target=target, join=join)


def play(channels: Sequence[ChannelSettings]) -> tuple[Floats, Floats]:
    """Dead band and slack of ``n`` channels, each (n,) rad."""
    return (
        np.radians([channel.dead_band_deg for channel in channels]),
        np.radians([channel.slack_deg for channel in channels]),
    )


def servo_specs(channels: Sequence[ChannelSettings], rest_rad: Floats | None = None) -> list[ServoSpec]:
    """What the driver has to know of each channel's servo.

    Parameters
    ----------
    rest_rad : (n,) angles of the neutral face, where servos begin that cannot tell where they are; 0 without.
    """
    rest = np.zeros(len(channels)) if rest_rad is None else rest_rad
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
            rest_rad=float(rest[i]),
            pulse_us=_pulses(channel),
            wire_name=channel.wire_name,
        )
        for i, channel in enumerate(channels)
    ]


def _pulses(channel: ChannelSettings) -> tuple[tuple[float, float], ...]:
    """Measured (rad, us) of a hobby servo; none without."""
    pulse = channel.pulse
    return () if pulse is None else tuple(zip(np.radians(pulse.deg).tolist(), pulse.us, strict=True))
