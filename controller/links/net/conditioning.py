"""Prepares the values of a source for a layer: eyes, mirror, neutral face, ranges, smoothing, gains."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from controller.base.errors import ControllerError
from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.frame import Frame
from controller.links.net.neutral import MAX_VALUE, Neutral, Ranges, load_state, save_state
from controller.links.net.one_euro import OneEuro
from controller.links.net.settings import NetSettings

log = logging.getLogger(__name__)

_MIN_MOVEMENT = 0.02
"""Normalised value above which the eyes count as moved."""


class Conditioning:
    """The processing chain of one link.

    path : file in which the neutral face and the ranges are stored; None: they are not stored.

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
        """Return the values (P,) of a frame for the layer, clipped to their ranges, and their mask (P,)."""
        values, mask = np.where(frame.mask, self._normalise(frame.values), 0.0), frame.mask
        if self._mirrored is not None:
            swap, sign = self._mirrored
            values, mask = values[swap] * sign, mask[swap]
        if self._settings.calibrate != "off":
            values = self._calibrate(values, now_s)
        values = self._choose_gaze(values, mask)
        if self._settings.ranges:
            values = self._ranges.apply(values, now_s)
        if self._filter is not None:
            values = self._filter(values, now_s)
        return np.clip(self._rest + values * self._reach * self._gain, self._low, self._high), mask

    def _normalise(self, values: Floats) -> Floats:
        """Return values as fractions of the way from rest to the farther end of the range, clipped to -2..2.

        Without the limit, one message with a huge number would affect the filter for minutes, and the stored ranges for
        ever.
        """
        beyond = MAX_VALUE * self._reach
        return np.clip(values - self._rest, -beyond, beyond) / self._reach

    def reset(self) -> None:
        """Do not smooth across a gap in which the source was silent."""
        if self._filter is not None:
            self._filter.reset()

    def save(self) -> None:
        """Store the calibration. Raises ControllerError: the file cannot be written."""
        if self._path is not None and (self._neutral.known or self._settings.ranges):
            save_state(self._path, self._parameters, self._neutral, self._ranges)

    @property
    def neutral_known(self) -> bool:
        """Whether the neutral face of the source is known."""
        return self._neutral.known

    def _calibrate(self, values: Floats, now_s: float) -> Floats:
        if not self._neutral.known and self._neutral.learn(values, now_s):
            try:
                self.save()
            except ControllerError as error:  # the face continues; the calibration is learned again at the next start
                log.warning("what a link learned is not kept: %s", error)
        return self._neutral.apply(values) if self._neutral.known else values

    def _choose_gaze(self, values: Floats, mask: Flags) -> Floats:
        """Set the eyeLook shapes or the eye angles to 0, in place, so that the gaze does not count twice."""
        drop = {"looks": self._angles, "angles": self._looks}.get(self._settings.eyes)
        if self._settings.eyes == "auto" and mask[self._angles].any() and mask[self._looks].any():
            self._looks_moved |= bool((values[self._looks] > _MIN_MOVEMENT).any())
            self._angles_moved |= bool((np.abs(values[self._angles]) > _MIN_MOVEMENT).any())
            drop = self._angles if self._looks_moved and self._angles_moved else None
        if drop is not None:
            values[drop] = 0.0
        return values


def _mirror(parameters: Parameters) -> tuple[np.ndarray, Floats]:
    """Return (P,) the index that each value comes from, and (P,) its sign: a mirror reverses yaw and roll."""
    turned = [-1.0 if name.endswith(("Yaw", "Roll")) else 1.0 for name in parameters.names]
    return parameters.mirror(), np.array(turned)


def _is_eye_angle(name: str) -> bool:
    return name.startswith(("leftEye", "rightEye"))
