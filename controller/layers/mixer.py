"""Mixes layers, the values of many sources, into one parameter vector, and reports which layer holds each parameter.

A layer keeps the latest value of each parameter that its source has given; nothing queues. ``out`` begins as the
neutral face. Then the layers are applied from the lowest priority to the highest. With v the layer's value and s its
effective weight for a parameter (weight x fade):

    set  out <- out + s (v - out)      add  out <- out + s v      max  out <- max(out, s v)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from controller.base.parameters import Flags, Floats, Indices, Parameters, did_you_mean

Mode = Literal["set", "add", "max"]
Which = Indices | Sequence[int] | slice

_MIN_FADE_S = 1e-9


@dataclass(frozen=True)
class LayerSettings:
    """Name, priority and timing of a layer; :class:`controller.layers.settings.LayerTable` checks those of files.

    name : unique name. priority : layers with a higher one are applied later. mode : how it is combined with the layers
    below. weight : 0..1. fade_in_s, fade_out_s : times in which a parameter fades in, and out when it is released.
    timeout_s : a parameter that has not been written for this long is released; infinity: never.
    gains : factors on its values by region; 1 for regions that are not named.
    """

    name: str
    priority: int
    mode: Mode = "set"
    weight: float = 1.0
    fade_in_s: float = 0.0
    fade_out_s: float = 0.4
    timeout_s: float = math.inf
    gains: Mapping[str, float] = field(default_factory=dict)


class Layer:
    """The values of one source in a :class:`Mixer`; all arrays are views of the mixer's rows, (P,) each.

    values : latest values. held : which parameters the source has given and not released.
    gain : factor on the values, for instance per region. share : factor 0..1 on the weight of each parameter.
    applied : effective weight of each parameter in the last mix.
    """

    def __init__(self, settings: LayerSettings, table: _Table, row: int) -> None:
        self.settings = settings
        self.name = settings.name
        self.values, self.gain, self.share = table.values[row], table.gain[row], table.share[row]
        self.applied, self.held, self._stamp = table.applied[row], table.held[row], table.stamp[row]
        self._fade_out, self._block, self._level = table.fade_out_s[row], table.block[row], table.level[row]
        self._fresh, self._positions = np.zeros(len(self.values), dtype=bool), np.arange(len(self.values))

    def write(self, indices: Which, values: Floats | Sequence[float] | float, now_s: float) -> None:
        """Hold some parameters at ``values`` from ``now_s`` on; values that are not finite are ignored."""
        positions, given = self._positions[indices], np.asarray(values, dtype=np.float64)
        finite = np.isfinite(given)
        if not finite.all():
            finite = np.broadcast_to(finite, positions.shape)
            positions, given = positions[finite], np.broadcast_to(given, positions.shape)[finite]
        self.values[positions] = given
        self._stamp[positions] = now_s
        self.held[positions] = True

    def write_masked(self, values: Floats, mask: Flags, now_s: float) -> None:
        """Hold the parameters in ``mask`` : (P,) bool at ``values`` : (P,), and release all others.

        A parameter whose value is not finite keeps its earlier value.
        """
        np.isfinite(values, out=self._fresh)
        self._fresh &= mask
        np.copyto(self.values, values, where=self._fresh)
        np.copyto(self._stamp, now_s, where=self._fresh)
        np.copyto(self.held, mask)

    def release(self, indices: Which = slice(None), *, fade_s: float | None = None) -> None:
        """Release parameters to the layers below, over ``fade_s``; None: over the layer's own fade-out time."""
        self.held[indices] = False
        self._fade_out[:] = self.settings.fade_out_s if fade_s is None else fade_s

    def attenuate(self, amount: float) -> None:
        """Reduce the layer's weight by a fraction ``amount`` 0..1, for an expression that suppresses it."""
        self._block[:] = 1.0 - amount

    @property
    def holding(self) -> int:
        """Number of parameters that the layer holds."""
        return int(np.count_nonzero(self.held))

    @property
    def level(self) -> float:
        """How far its most visible parameter has faded in, 0..1."""
        return float(self._level.max())


class _Table:
    """The values of ``n`` layers for ``p`` parameters, and the state of their fades; arrays (n, p) or (n, 1)."""

    def __init__(self, settings: Sequence[LayerSettings], p: int) -> None:
        shape = (len(settings), p)
        self.values, self.stamp, self.level, self.applied, self.given = (np.zeros(shape) for _ in range(5))
        self.gain, self.share = np.ones(shape), np.ones(shape)
        self.held, self._fresh = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        columns = ("weight", "fade_in_s", "fade_out_s", "timeout_s")
        self._weight, self._fade_in_s, self.fade_out_s, self._timeout_s = (
            np.array([[getattr(each, name)] for each in settings]) for name in columns
        )
        self._rate, self.block = np.zeros(shape), np.ones((len(settings), 1))

    def advance(self, now_s: float, dt: float) -> Flags:
        """Advance fades and time-outs; return (n,) bool, which layers have faded in at all."""
        np.greater(self.stamp, now_s - self._timeout_s, out=self._fresh)
        self.held &= self._fresh
        rise, fall = (dt / np.maximum(fade, max(dt, _MIN_FADE_S)) for fade in (self._fade_in_s, self.fade_out_s))
        np.copyto(self._rate, -fall)
        np.copyto(self._rate, rise, where=self.held)
        self.level += self._rate
        np.maximum(self.level, 0.0, out=self.level)
        np.minimum(self.level, 1.0, out=self.level)
        np.multiply(self.level, self._weight * self.block, out=self.applied)
        self.applied *= self.share
        np.multiply(self.values, self.gain, out=self.given)
        shown: Flags = np.logical_or.reduce(self.level != 0.0, axis=1)
        return shown


class Mixer:
    """Mixes layers into one (P,) vector.

    layers : in any order; they are applied by priority.

    Raises ValueError: two layers have one name. ParameterError: a gain names an unknown region.
    """

    def __init__(self, parameters: Parameters, layers: Sequence[LayerSettings]) -> None:
        ordered = by_priority(layers)
        if len({layer.name for layer in ordered}) < len(ordered):
            raise ValueError("layers must have different names")
        self._table = _Table(ordered, len(parameters))
        self.layers = tuple(Layer(settings, self._table, i) for i, settings in enumerate(ordered))
        self._by_name = {layer.name: layer for layer in self.layers}
        self._work, self._rest = np.zeros(len(parameters)), parameters.neutral()
        self._better = np.zeros(len(parameters), dtype=bool)
        for layer in self.layers:
            for region, factor in layer.settings.gains.items():
                layer.gain[parameters.region(region)] = factor

    @property
    def names(self) -> tuple[str, ...]:
        """Layer names, lowest priority first."""
        return tuple(self._by_name)

    def __getitem__(self, name: str) -> Layer:
        """Return the layer of a name. Raises KeyError, with the most similar names."""
        try:
            return self._by_name[name]
        except KeyError:
            raise KeyError(f"unknown layer {name!r}{did_you_mean(name, self._by_name)}") from None

    def mix(self, now_s: float, dt: float, out: Floats) -> Floats:
        """Advance every layer by ``dt`` to ``now_s``; write their mix, not clipped, to ``out`` : (P,)."""
        np.copyto(out, self._rest)
        table = self._table
        for row in np.flatnonzero(table.advance(now_s, dt)).tolist():
            self._apply(self.layers[row].settings.mode, table.given[row], table.applied[row], out)
        return out

    @property
    def active(self) -> tuple[str, ...]:
        """Layers that had any effect in the last mix, lowest priority first."""
        return tuple(layer.name for layer in self.layers if layer.applied.any())

    def holder(self, index: int) -> str | None:
        """Return the name of the layer that decided a parameter in the last mix; None if none did.

        It is the highest ``set`` layer or ``max`` layer with an effect, or else the highest ``add`` layer.
        """
        adding = None
        for layer in reversed(self.layers):
            if layer.applied[index] > 0.0:
                if layer.settings.mode != "add":
                    return layer.name
                adding = adding or layer.name
        return adding

    def _apply(self, mode: Mode, given: Floats, share: Floats, out: Floats) -> None:
        work = self._work
        if mode == "set":
            np.subtract(given, out, out=work)
            work *= share
            out += work
            return
        np.multiply(given, share, out=work)
        if mode == "add":
            out += work
            return
        np.greater(work, out, out=self._better)
        np.copyto(out, work, where=self._better)
        share *= self._better


def by_priority(layers: Sequence[LayerSettings]) -> list[LayerSettings]:
    """Return the layers in the order in which they are mixed, lowest priority first."""
    return sorted(layers, key=lambda layer: layer.priority)
