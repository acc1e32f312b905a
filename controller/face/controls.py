"""Maps the sticks and buttons of a gamepad, and keys, to requests of a panel, by a file of ``configs/controls``.

Reading the devices is left to :mod:`controller.face.devices`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from controller.base.parameters import Parameters
from controller.body.messages import Hold, PanelRequest, Show
from controller.vocabulary.controls import Action, ControlsFile
from controller.vocabulary.sides import sides

_MIN_CHANGE = 0.004
"""Smallest change of a parameter that is sent."""


class Controls:
    """The parameters and expressions that sticks, buttons and keys request now; :meth:`update` is called once a frame.

    files : what each of them does. All files apply; if two of them name the same button or key, the last one counts.
    """

    def __init__(self, files: Collection[ControlsFile], parameters: Parameters) -> None:
        self._files, self._parameters = tuple(files), parameters
        self._actions: dict[str, Action] = {}
        for file in self._files:
            self._actions |= {f"button {name}": action for name, action in file.buttons.items()}
            self._actions |= {f"key {name}": action for name, action in file.keys.items()}
        self._down: frozenset[str] = frozenset()
        self._held: dict[int, float] = {}

    @property
    def keys(self) -> list[str]:
        """Names of the keys that have an effect."""
        return [name.removeprefix("key ") for name in self._actions if name.startswith("key ")]

    def update(
        self, axes: Mapping[str, float], buttons: Collection[str], keys: Collection[str]
    ) -> Iterator[PanelRequest]:
        """Yield requests for what changed: expressions of buttons that went down, parameters to hold or release.

        axes : position of each, -1 to 1, those of triggers 0 to 1. buttons, keys : names of those that are down.
        """
        down = frozenset([*(f"button {name}" for name in buttons), *(f"key {name}" for name in keys)])
        for name in sorted(down - self._down):
            action = self._actions.get(name)
            if isinstance(action, str):
                yield Show(action, 1.0)
        self._down = down
        yield from self._hold(self._wanted(axes, down))

    def _wanted(self, axes: Mapping[str, float], down: Collection[str]) -> dict[int, float]:
        """Return the values, clipped to their ranges, of all parameters that sticks, buttons and keys move now."""
        wanted: dict[int, float] = {}
        for file in self._files:
            for name, weights in file.axes.items():
                amount = _apply_dead_zone(axes.get(name, 0.0), file.dead_zone)
                if amount:
                    self._add(wanted, weights, amount)
        for name in down:
            action = self._actions.get(name)
            if action is not None and not isinstance(action, str):
                self._add(wanted, action, 1.0)
        low, high = self._parameters.low, self._parameters.high
        return {index: float(np.clip(value, low[index], high[index])) for index, value in wanted.items()}

    def _add(self, wanted: dict[int, float], weights: Mapping[str, float], amount: float) -> None:
        for name, weight in weights.items():
            for index in sides(self._parameters, name):
                wanted[index] = wanted.get(index, 0.0) + amount * weight

    def _hold(self, wanted: dict[int, float]) -> Iterator[PanelRequest]:
        for index in [index for index in self._held if index not in wanted]:
            del self._held[index]
            yield Hold(index, None)
        for index, value in wanted.items():
            if abs(value - self._held.get(index, np.inf)) >= _MIN_CHANGE:
                self._held[index] = value
                yield Hold(index, value)


def _apply_dead_zone(amount: float, dead_zone: float) -> float:
    """Return how far a stick is outside its dead zone, -1 to 1."""
    if abs(amount) <= dead_zone or dead_zone >= 1.0:
        return 0.0
    return float(np.copysign((min(abs(amount), 1.0) - dead_zone) / (1.0 - dead_zone), amount))
