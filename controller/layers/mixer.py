"""Mixes layers, the values of many sources, into one parameter vector, and says which layer holds each parameter.

A layer keeps the latest value of each parameter it was given; nothing queues. From the lowest priority to the
highest, with s the layer's share of a parameter (weight x fade) and v its value, out begins with the neutral face:

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

_SHORTEST_S = 1e-9


@dataclass(frozen=True)
class LayerSettings:
    """Name, priority and timing of a layer; :class:`controller.layers.settings.LayerTable` checks those of files.

    name : unique name. priority : higher goes over lower. mode : how it joins what lies below.
    weight : 0..1. fade_in_s, fade_out_s : times to fade a parameter in and to release it.
    timeout_s : a parameter not written for so long is released; infinity keeps it.
    gains : factors on its values by region, 1 where none is given.
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
    """The values of one source in a :class:`Mixer`; all arrays are rows of the mixer's, (P,) each.

    values : latest values. held : which parameters the source has given and not released.
    gain : factor on the values, for instance per region.
    share : factor on the weight, for what blocks or fades the layer.
    applied : share it had in the last mix.
    """

    def __init__(self, settings: LayerSettings, table: _Table, row: int) -> None:
        self.settings = settings
        self.name = settings.name
        self.values, self.gain, self.share = table.values[row], table.gain[row], table.share[row]
        self.applied, self.held, self._stamp = table.applied[row], table.held[row], table.stamp[row]
        self._fade_out, self._block, self._level = table.fade_out_s[row], table.block[row], table.level[row]
        self._fresh, self._positions = np.zeros(len(self.values), dtype=bool), np.arange(len(self.values))

    def write(self, indices: Which, values: Floats | Sequence[float] | float, now_s: float) -> None:
        """Hold some parameters at ``values`` from ``now_s`` on; what is not finite changes nothing."""
        positions, given = self._positions[indices], np.asarray(values, dtype=np.float64)
        finite = np.isfinite(given)
        if not finite.all():
            finite = np.broadcast_to(finite, positions.shape)
            positions, given = positions[finite], np.broadcast_to(given, positions.shape)[finite]
        self.values[positions] = given
        self._stamp[positions] = now_s
        self.held[positions] = True

    def write_masked(self, values: Floats, mask: Flags, now_s: float) -> None:
        """Hold the parameters of ``mask`` : (P,) bool at ``values`` : (P,); all others are released."""
        np.isfinite(values, out=self._fresh)
        self._fresh &= mask
        np.copyto(self.values, values, where=self._fresh)
        np.copyto(self._stamp, now_s, where=self._fresh)
        np.copyto(self.held, mask)

    def release(self, indices: Which = slice(None), *, fade_s: float | None = None) -> None:
        """Give parameters back to the layers below, over ``fade_s`` or the layer's own fade."""
        self.held[indices] = False
        self._fade_out[:] = self.settings.fade_out_s if fade_s is None else fade_s

    def attenuate(self, amount: float) -> None:
        """Reduce the layer's weight by ``amount`` 0..1, for an expression that blocks it."""
        self._block[:] = 1.0 - amount

    @property
    def holding(self) -> int:
        """How many parameters the layer holds."""
        return int(np.count_nonzero(self.held))

    @property
    def level(self) -> float:
        """How far it has faded in where that is most, 0..1."""
        return float(self._level.max())


class _Table:
    """What ``n`` layers hold of ``p`` parameters, and how they fade; (n, p) or (n, 1) each."""

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
        """Advance fades and time-outs; (n,) which layers have any effect."""
        np.greater(self.stamp, now_s - self._timeout_s, out=self._fresh)
        self.held &= self._fresh
        rise, fall = (dt / np.maximum(fade, max(dt, _SHORTEST_S)) for fade in (self._fade_in_s, self.fade_out_s))
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

    layers : what layers there are; order in priority, not in the list.

    Raises ValueError: two layers of one name. ParameterError: gains of a region that is none.
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
        """The layer called ``name``. Raises KeyError with the nearest names."""
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
        """Name of the layer that decides a parameter since the last mix; None when none does.

        The highest ``set`` or winning ``max`` layer; where only ``add`` layers act, the highest of those.
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
    """Layers in the order in which they are mixed, lowest priority first."""
    return sorted(layers, key=lambda layer: layer.priority)
