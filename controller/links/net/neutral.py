"""Calibrates a source: learns and stores a person's neutral face and the range of each parameter.

Values are normalised: the fraction of the way from a parameter's rest to the farther end of its range, -1 to 1, or more
if a source sends more. A file in the user's state folder holds both, as JSON with parameters by name.
"""

from __future__ import annotations

import json
import os
import re
import zlib
from pathlib import Path

import numpy as np

from controller.base.errors import LinkError
from controller.base.files import format_fault, replacing
from controller.base.parameters import Flags, Floats, Parameters
from controller.links.access import state_folder
from surface.base import files

MAX_VALUE = 2.0
"""Normalised values are clipped to -2..2; no source sends larger ones on purpose."""
STILL_S = 2.0
"""How long a face must be still to count as neutral."""
_STILL_TOLERANCE = 0.03  # greatest variation of a parameter of a still face
_LEARN_S = 10.0  # time until the learned ranges have their full effect
_MIN_RANGE = 0.5  # smaller ranges are widened only as much as this one
_FORMAT = 1
_MAX_FILE_BYTES = 100_000
_MAX_NAME_LENGTH = 100


def state_file(name: str) -> Path:
    """Return the file for a link's name; characters that do not belong in file names are replaced.

    A checksum keeps names in other alphabets, and long names, distinct.
    """
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name)
    if not name.isascii() or len(plain) > _MAX_NAME_LENGTH:
        plain = f"{plain[:_MAX_NAME_LENGTH]}-{zlib.crc32(name.encode(errors='surrogatepass')):08x}"
    return state_folder() / "links" / f"{plain}.json"


class Neutral:
    """The neutral face of a source, learned in the first two seconds in which the face is still.

    values : (P,) float64 normalised values that the source sends for a neutral face; zero until it is known.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.values = np.zeros(len(parameters))
        self.known = False
        self._signed = parameters.low < parameters.rest
        self._since_s = 0.0
        self._low = self._high = self._sum = self.values
        self._count = 0

    def learn(self, values: Floats, now_s: float) -> bool:
        """Process the values of a frame; return True as soon as the neutral face is known."""
        if self._count:
            low, high = np.minimum(self._low, values), np.maximum(self._high, values)
            if float((high - low).max()) <= _STILL_TOLERANCE:
                self._low, self._high, self._count = low, high, self._count + 1
                self._sum = self._sum + values
                if now_s - self._since_s >= STILL_S:
                    self.values, self.known = self._sum / self._count, True
                return self.known
        self._low = self._high = self._sum = values.copy()
        self._count, self._since_s = 1, now_s
        return False

    def apply(self, values: Floats) -> Floats:
        """Return values relative to the neutral face, which becomes 0; for parameters from 0 to 1, 1 stays 1."""
        rest = np.clip(self.values, 0.0, 0.9)
        return np.where(self._signed, values - self.values, np.maximum(values - rest, 0.0) / (1.0 - rest))


class Ranges:
    """The range of each parameter of a source, learned while it moves; small ranges are widened by at most a factor 2.

    top : (P,) float64, the largest absolute value seen; 0 before any.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.top = np.zeros(len(parameters))
        self.seen_s = 0.0
        self._last_s: float | None = None

    def apply(self, values: Floats, now_s: float) -> Floats:
        """Return values with their ranges widened, by an amount that grows over the first ten seconds."""
        self.seen_s += min(now_s - self._last_s, 0.1) if self._last_s is not None else 0.0
        self._last_s = now_s
        np.maximum(self.top, np.abs(values), out=self.top)
        known = min(self.seen_s / _LEARN_S, 1.0)
        factor = 1.0 / np.clip(self.top, _MIN_RANGE, 1.0)
        factor[self.top < _MIN_RANGE / 2] = 1.0  # the parameter has not moved enough to know its range
        widened: Floats = values * (1.0 + known * (factor - 1.0))
        return widened


def load_state(path: Path, parameters: Parameters, neutral: Neutral, ranges: Ranges) -> None:
    """Read a stored calibration into ``neutral`` and ``ranges``; without a readable file they stay unchanged.

    Raises LinkError: the file is damaged, or of a newer omote.
    """
    if not os.path.exists(path):  # False also in a folder that this user may not read
        return
    with files.reading(path, LinkError, hint=f"delete it: rm {path}"):
        table = files.read_json(path, _MAX_FILE_BYTES)
        if not isinstance(table, dict) or not all(isinstance(table.get(key), dict) for key in ("neutral", "ranges")):
            raise ValueError("is not a calibration of a link")
        if fault := format_fault(table.get("format"), _FORMAT):
            raise ValueError(fault)
        given, found = _read(table["neutral"], parameters)
        tops, _ = _read(table["ranges"], parameters)
    neutral.values, neutral.known = given, bool(found.any())
    ranges.top, ranges.seen_s = np.abs(tops), _LEARN_S if tops.any() else 0.0


def save_state(path: Path, parameters: Parameters, neutral: Neutral, ranges: Ranges) -> None:
    """Store a calibration. Raises ControllerError: the file cannot be written."""
    table = {
        "format": _FORMAT,
        "neutral": _values_by_name(neutral.values, parameters) if neutral.known else {},
        "ranges": _values_by_name(ranges.top, parameters),
    }
    with replacing(path) as beside:
        beside.write_text(json.dumps(table, indent=1), encoding="utf-8")


def _read(table: dict[str, object], parameters: Parameters) -> tuple[Floats, Flags]:
    """Return the values (P,) and the mask (P,) of those that are given. Raises ValueError: an invalid value."""
    values, mask = np.zeros(len(parameters)), np.zeros(len(parameters), dtype=bool)
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not -MAX_VALUE <= value <= MAX_VALUE:
            raise ValueError(f"{name}: must be a number from {-MAX_VALUE:g} to {MAX_VALUE:g}")
        index = parameters.find(name)
        if index is not None:
            values[index], mask[index] = value, True
    return values, mask


def _values_by_name(values: Floats, parameters: Parameters) -> dict[str, float]:
    return {name: round(float(value), 6) for name, value in zip(parameters.names, values, strict=True)}
