"""Prepares the values of a source for a layer: eyes, mirror, neutral face, ranges, smoothing, gains."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from controller.base.errors import ControllerError
from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.frame import Frame
from controller.links.net.neutral import MOST, Neutral, Ranges, load_state, save_state
from controller.links.net.one_euro import OneEuro
from controller.links.net.settings import NetSettings

log = logging.getLogger(__name__)

_LOOKED = 0.02
"""Amount from which on eyes count as moved."""


class Conditioning:
    """The chain of one link.

    path : file in which neutral face and ranges are kept; None for nowhere.

    Raises LinkError: the file is damaged.
    """

    def __init__(self, settings: NetSettings, parameters: Parameters, path: Path | None = None) -> None:
        self._settings, self._parameters, self._path = settings, parameters, path
        self._low, self._high, self._rest = parameters.low, parameters.high, parameters.rest
        self._reach = np.maximum(self._high - self._rest, self._rest - self._low)
        self._mirrored = _mirror(parameters) if settings.mirror else None
        self._looks = np.array([i for i, name in enumerate(parameters.names) if name.startswith("eyeLook")])
        self._angles = np.array([i for i, name in enumerate(parameters.names) if _is_eye_angle(name)])
        self._looks_moved = self._angles_moved = False
        self._neutral, self._ranges = Neutral(parameters), Ranges(parameters)
        self._filter = OneEuro(len(parameters), settings.min_cutoff_hz, settings.beta) if settings.smoothing else None
        self._gain = np.ones(len(parameters))
        for region, factor in settings.gains.items():
            self._gain[parameters.region(region)] = factor
        if path is not None and settings.calibrate != "again":
            load_state(path, parameters, self._neutral, self._ranges)

    def apply(self, frame: Frame, now_s: float) -> tuple[Floats, Flags]:
        """Values (P,) in range, and which of them the layer gets."""
        values, mask = np.where(frame.mask, self._shares(frame.values), 0.0), frame.mask
        if self._mirrored is not None:
            swap, sign = self._mirrored
            values, mask = values[swap] * sign, mask[swap]
        if self._settings.calibrate != "off":
            values = self._calibrated(values, now_s)
        values = self._one_gaze(values, mask)
        if self._settings.ranges:
            values = self._ranges.apply(values, now_s)
        if self._filter is not None:
            values = self._filter(values, now_s)
        return np.clip(self._rest + values * self._reach * self._gain, self._low, self._high), mask

    def _shares(self, values: Floats) -> Floats:
        """Values as shares of the way from rest to the farther end of the range; see the module of the neutral face.

        One message with a huge number would otherwise stay in the filter for minutes, and in what is kept for ever.
        """
        beyond = MOST * self._reach
        return np.clip(values - self._rest, -beyond, beyond) / self._reach

    def reset(self) -> None:
        """The source fell silent: do not smooth across the gap."""
        if self._filter is not None:
            self._filter.reset()

    def save(self) -> None:
        """Keep what was learned. Raises ControllerError: the file cannot be written."""
        if self._path is not None and (self._neutral.known or self._settings.ranges):
            save_state(self._path, self._parameters, self._neutral, self._ranges)

    @property
    def neutral_known(self) -> bool:
        """Whether the neutral face of the source is known."""
        return self._neutral.known

    def _calibrated(self, values: Floats, now_s: float) -> Floats:
        if not self._neutral.known and self._neutral.learn(values, now_s):
            try:
                self.save()
            except ControllerError as error:  # the face goes on; it is learned again at the next start
                log.warning("what a link learned is not kept: %s", error)
        return self._neutral.apply(values) if self._neutral.known else values

    def _one_gaze(self, values: Floats, mask: Flags) -> Floats:
        """Hold at 0 one of the two ways to say where the eyes look, so that they do not add up to twice as much."""
        drop = {"looks": self._angles, "angles": self._looks}.get(self._settings.eyes)
        if self._settings.eyes == "auto" and mask[self._angles].any() and mask[self._looks].any():
            self._looks_moved |= bool((values[self._looks] > _LOOKED).any())
            self._angles_moved |= bool((np.abs(values[self._angles]) > _LOOKED).any())
            drop = self._angles if self._looks_moved and self._angles_moved else None
        if drop is not None:
            values[drop] = 0.0
        return values


def _mirror(parameters: Parameters) -> tuple[np.ndarray, Floats]:
    """(P,) where each value comes from, and its sign: yaw and roll turn the other way in a mirror."""
    turned = [-1.0 if name.endswith(("Yaw", "Roll")) else 1.0 for name in parameters.names]
    return parameters.mirror(), np.array(turned)


def _is_eye_angle(name: str) -> bool:
    return name.startswith(("leftEye", "rightEye"))
