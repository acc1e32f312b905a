"""Channels map the parameter vector to one angle per servo; all channels of a bus are computed as flat arrays.

The chain of a channel is mix (or anchor) -> calibrated points -> limits; safety rules (:mod:`controller.robot.safety`)
and limits of motion (:class:`controller.motion.motion.MotionLimiter`) follow at the clock of the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from controller.base.parameters import Flags, Floats, Indices, Parameters
from controller.motion.motion import MotionLimiter
from controller.robot.formulas import ChannelFormulas, parse_formula
from controller.robot.linkages.kind import LinkageSettings
from controller.robot.linkages.linked_channels import LinkedChannels
from controller.robot.settings import ChannelSettings
from controller.robot.terms import curve_corners
from drivers.base.bus import ServoSpec

if TYPE_CHECKING:
    from controller.robot.anchors import AnchorSolver  # imported lazily: it loads the head

_LIMIT_TOLERANCE_RAD = 1e-9  # rounding of degrees to radians
_STEP, _SLOPE_POINTS, _SEED = 1e-4, 16, 5


class BoundChannels(Protocol):
    """Channels whose mixes are computed together, by formulas or a linkage.

    at : (n,) indices of the channels. needs : (k,) indices of the parameters that they depend on.
    """

    @property
    def at(self) -> Indices: ...
    @property
    def needs(self) -> Indices: ...
    def __call__(self, values: Floats) -> Floats:
        """(n,) mixes of the channels for parameters (p,); NaN where one has no value."""


@dataclass(frozen=True)
class PiecewiseLinear:
    """``n`` functions made of straight pieces, constant on either side of them.

    start : (n,) first value. knots : (n, k) where each piece begins. widths : (n, k) its length, 0 where a function has
    fewer pieces. slopes : (n, k).
    """

    start: Floats
    knots: Floats
    widths: Floats
    slopes: Floats

    @classmethod
    def through(cls, corners: Sequence[tuple[Floats, Floats]]) -> PiecewiseLinear:
        """Create functions from their corners: abscissas and values, (j,) each."""
        max_pieces = max(len(at) for at, _ in corners) - 1
        knots, widths, slopes = np.zeros((3, len(corners), max_pieces))
        for i, (at, gives) in enumerate(corners):
            k = len(at) - 1
            knots[i, :k], widths[i, :k], slopes[i, :k] = at[:-1], np.diff(at), np.diff(gives) / np.diff(at)
        return cls(np.array([gives[0] for _, gives in corners]), knots, widths, slopes)

    def __call__(self, x: Floats) -> Floats:
        """(n,) values at ``x`` : (n,)."""
        pieces = np.clip(x[:, None] - self.knots, 0.0, self.widths)
        values: Floats = self.start + (pieces * self.slopes).sum(axis=1)
        return values


@dataclass(frozen=True)
class Terms:
    """The ``t`` terms of mixes that are more than a weight, sorted by channel.

    parameter, channel : (t,) input and output of each. curves : t functions.
    first : (j,) where each channel's terms begin; target : (j,) the channels. join : (j,) 0 sum, 1 min, 2 max.
    """

    parameter: Indices
    channel: Indices
    curves: PiecewiseLinear
    first: Indices
    target: Indices
    join: Indices

    def add_to(self, mixed: Floats, values: Floats) -> None:
        """Add the terms for parameters (p,) to the mixes (n,), in place."""
        each = self.curves(values[self.parameter])
        joins = [ufunc.reduceat(each, self.first) for ufunc in (np.add, np.minimum, np.maximum)]
        mixed[self.target] += np.choose(self.join, joins)

    def linear(self, shape: tuple[int, int]) -> Floats:
        """(n, p) mean slope of each term."""
        out, widths = np.zeros(shape), self.curves.widths
        mean = (self.curves.slopes * widths).sum(axis=1) / np.maximum(widths.sum(axis=1), 1e-12)
        np.add.at(out, (self.channel, self.parameter), mean)
        return out


@dataclass(frozen=True)
class ChannelTable:
    """``n`` channels over ``p`` parameters; angles in radians from each servo's centre.

    names : the channels, in order. mix : (n, p) weights of the parameters.
    curves : n functions from mix to angle, the calibrated points. low_rad, high_rad : (n,) limits of position.
    max_speed_rad_s, max_accel_rad_s2, max_jerk_rad_s3 : (n,) limits of motion; infinite jerk for no limit.
    dead_band_rad, slack_rad : (n,), 0 for none.
    rest : (p,) the neutral face.
    terms : terms that are more than a weight. anchors, anchored : the solver of k channels, and their indices (k,).
    bound : formulas and linkages, which give the mixes of their channels.
    """

    names: tuple[str, ...]
    mix: Floats
    curves: PiecewiseLinear
    low_rad: Floats
    high_rad: Floats
    max_speed_rad_s: Floats
    max_accel_rad_s2: Floats
    max_jerk_rad_s3: Floats
    dead_band_rad: Floats
    slack_rad: Floats
    rest: Floats
    terms: Terms | None = None
    anchors: AnchorSolver | None = None
    anchored: Indices | None = None
    bound: tuple[BoundChannels, ...] = ()
    low: Floats | None = None
    high: Floats | None = None

    @cached_property
    def linear(self) -> Floats:
        """(n, p) increase of each mix per unit of each parameter; for curves, formulas and linkages the mean slope."""
        out = self.mix if self.terms is None else self.mix + self.terms.linear(self.mix.shape)
        if self.anchors is not None or self.bound:
            out = out.copy()
        if self.anchors is not None:
            out[self.anchored] = self.anchors.linear
        for bound in self.bound:
            out[bound.at] = self._mean_slopes(bound)
        return out

    def slopes(self, values: Floats) -> Floats:
        """(n, p) slopes of the mixes at parameters (p,): local for formulas and linkages, else as in ``linear``."""
        out = self.linear.copy()
        for bound in self.bound:
            out[bound.at] = self._slopes(bound, values)
        return out

    def _mean_slopes(self, bound: BoundChannels) -> Floats:
        """(n, p) mean of the slopes at fixed pseudo-random points of the whole range."""
        low, high = self._ends
        points = np.random.default_rng(_SEED).uniform(low, high, (_SLOPE_POINTS, len(low)))
        mean: Floats = np.mean([self._slopes(bound, point) for point in points], axis=0)
        return mean

    def _slopes(self, bound: BoundChannels, values: Floats) -> Floats:
        """(n, p) central differences, one-sided at the ends of the range; 0 where a mix has no value."""
        low, high = self._ends
        out = np.zeros((len(bound.at), len(values)))
        for p in bound.needs:
            ends = np.array([values, values])
            ends[:, p] = max(values[p] - _STEP, low[p]), min(values[p] + _STEP, high[p])
            before, after = bound(ends[0]), bound(ends[1])
            out[:, p] = np.nan_to_num((after - before) / max(ends[1, p] - ends[0, p], 1e-9))
        return out

    @property
    def _ends(self) -> tuple[Floats, Floats]:
        p = self.mix.shape[1]
        return (np.zeros(p) if self.low is None else self.low), (np.ones(p) if self.high is None else self.high)

    @property
    def reached(self) -> Flags:
        """(p,) whether each parameter moves any channel."""
        out: Flags = np.abs(self.linear).sum(axis=0) > 0.0
        for bound in self.bound:
            out[bound.needs] = True
        return out

    @property
    def neutral_rad(self) -> Floats:
        """(n,) angles of the neutral face."""
        return self.angles(self.rest)[0]

    def mixed(self, values: Floats) -> Floats:
        """(n,) mixes for parameters (p,); mm of pull where a channel is anchored."""
        mixed = self.mix @ values
        if self.terms is not None:
            self.terms.add_to(mixed, values)
        if self.anchors is not None:
            mixed[self.anchored] = self.anchors.pulls_mm(values)
        for bound in self.bound:
            mixed[bound.at] = bound(values)
        return mixed

    def angles(self, values: Floats) -> tuple[Floats, int]:
        """Angles (n,) inside the limits for parameters (p,), and how many channels the limits held back."""
        wanted = self.curves(self.mixed(values))
        return np.clip(wanted, self.low_rad, self.high_rad), int(np.count_nonzero(self.beyond(wanted)))

    def beyond(self, wanted_rad: Floats) -> Flags:
        """(n,) whether an angle lies beyond its limits, by more than rounding."""
        return (wanted_rad < self.low_rad - _LIMIT_TOLERANCE_RAD) | (wanted_rad > self.high_rad + _LIMIT_TOLERANCE_RAD)

    def limiter(self, period_s: float) -> MotionLimiter:
        """Create the limiter of position and motion for a bus with cycles of ``period_s``."""
        return MotionLimiter(
            self.max_speed_rad_s,
            self.max_accel_rad_s2,
            self.low_rad,
            self.high_rad,
            response_s=period_s,
            max_jerk=self.max_jerk_rad_s3,
            period_s=period_s,
        )


def build_table(
    channels: Sequence[ChannelSettings], parameters: Parameters, anchors: AnchorSolver | None = None,
    linkages: Sequence[LinkageSettings] = (),
) -> ChannelTable:  # fmt: skip
    """Convert the settings of ``n`` channels to arrays; without ``anchors``, anchored channels stay at 0 mm.

    ``linkages`` : of these channels; a channel whose linkage is missing stays at mix 0.
    """
    mix = np.zeros((len(channels), len(parameters.names)))
    for row, channel in zip(mix, channels, strict=True):
        for name, term in channel.mix.items():
            if term.is_weight and channel.join == "sum":
                row[parameters.index(name)] = term.by

    trim_rad = np.radians([channel.trim_deg for channel in channels])
    corners = [curve_corners(np.array(c.map.at), np.radians(c.map.deg), c.map.curve) for c in channels]
    names = tuple(channel.name for channel in channels)
    return ChannelTable(
        names=names,
        mix=mix,
        curves=PiecewiseLinear.through([(at, rad + trim) for (at, rad), trim in zip(corners, trim_rad, strict=True)]),
        low_rad=np.radians([c.limit_deg[0] for c in channels]),
        high_rad=np.radians([c.limit_deg[1] for c in channels]),
        max_speed_rad_s=np.radians([c.max_speed_deg_s for c in channels]),
        max_accel_rad_s2=np.radians([c.max_accel_deg_s2 for c in channels]),
        max_jerk_rad_s3=np.radians([c.max_jerk_deg_s3 or np.inf for c in channels]),
        dead_band_rad=np.radians([c.dead_band_deg for c in channels]),
        slack_rad=np.radians([c.slack_deg for c in channels]),
        rest=parameters.neutral(),
        terms=_terms(channels, parameters),
        anchors=anchors,
        anchored=None if anchors is None else np.array([names.index(name) for name in anchors.names], dtype=np.intp),
        bound=(*_formulas(channels, parameters), *(LinkedChannels.of(each, names, parameters) for each in linkages)),
        low=parameters.low,
        high=parameters.high,
    )


def _formulas(channels: Sequence[ChannelSettings], parameters: Parameters) -> list[ChannelFormulas]:
    found = [(i, parse_formula(channel.formula)) for i, channel in enumerate(channels) if channel.formula is not None]
    return [ChannelFormulas.of(found, parameters)] if found else []


def _terms(channels: Sequence[ChannelSettings], parameters: Parameters) -> Terms | None:
    found = [
        (i, parameters.index(name), term)
        for i, channel in enumerate(channels)
        for name, term in channel.mix.items()
        if not (term.is_weight and channel.join == "sum")
    ]
    if not found:
        return None
    curves = PiecewiseLinear.through([term.points(parameters.low[p], parameters.high[p]) for _, p, term in found])
    channel, parameter = np.array([(i, p) for i, p, _ in found], dtype=np.intp).T
    target, first = np.unique(channel, return_index=True)
    join = np.array([("sum", "min", "max").index(channels[i].join) for i in target], dtype=np.intp)
    return Terms(parameter, channel, curves, first=first, target=target, join=join)


def servo_specs(channels: Sequence[ChannelSettings], rest_rad: Floats | None = None) -> list[ServoSpec]:
    """Return the driver's specification of each channel's servo.

    ``rest_rad`` : (n,) angles of the neutral face, at which servos start that do not measure; None means 0.
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
    """Measured (rad, us) points of a hobby servo; empty where the file gives none."""
    pulse = channel.pulse
    return () if pulse is None else tuple(zip(np.radians(pulse.deg).tolist(), pulse.us, strict=True))
