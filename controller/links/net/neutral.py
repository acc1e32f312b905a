"""What a link learns of a person and keeps: the neutral face, and how far each parameter goes.

Values are shares of the way from a parameter's rest to the farther end of its range, -1 to 1; sources may send more. A
file in the user's state folder holds both, as JSON with parameters by name.
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

MOST = 2.0
"""Shares are kept from -2 to 2; beyond is what no source means."""
STILL_S = 2.0
"""How long a face must be still to be taken as neutral."""
_STILL = 0.03  # most that a parameter varies meanwhile
_LEARN_S = 10.0  # until what was seen of the ranges counts wholly
_LEAST_RANGE = 0.5  # smaller ones are not widened further
_FORMAT = 1
_MOST_BYTES = 100_000
_LONGEST_NAME = 100


def state_file(name: str) -> Path:
    """The file of a link's name, of which any character may be foreign to file names.

    Names in other alphabets, and long ones, keep apart by a checksum.
    """
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name)
    if not name.isascii() or len(plain) > _LONGEST_NAME:
        plain = f"{plain[:_LONGEST_NAME]}-{zlib.crc32(name.encode(errors='surrogatepass')):08x}"
    return state_folder() / "links" / f"{plain}.json"


class Neutral:
    """The neutral face of a source: learned in the first two seconds in which it is still.

    values : (P,) float64 shares that the source sends for a neutral face; zero until it is known.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.values = np.zeros(len(parameters))
        self.known = False
        self._signed = parameters.low < parameters.rest
        self._since_s = 0.0
        self._low = self._high = self._sum = self.values
        self._count = 0

    def learn(self, values: Floats, now_s: float) -> bool:
        """Look at a frame; True with the one that makes the neutral face known."""
        if self._count:
            low, high = np.minimum(self._low, values), np.maximum(self._high, values)
            if float((high - low).max()) <= _STILL:
                self._low, self._high, self._count = low, high, self._count + 1
                self._sum = self._sum + values
                if now_s - self._since_s >= STILL_S:
                    self.values, self.known = self._sum / self._count, True
                return self.known
        self._low = self._high = self._sum = values.copy()
        self._count, self._since_s = 1, now_s
        return False

    def apply(self, values: Floats) -> Floats:
        """Values relative to the neutral face: 0 there, and 1 still at 1 where a parameter runs from 0 to 1."""
        rest = np.clip(self.values, 0.0, 0.9)
        return np.where(self._signed, values - self.values, np.maximum(values - rest, 0.0) / (1.0 - rest))


class Ranges:
    """How far each parameter goes, learned while it moves; what stays small is widened to at most twice as much.

    top : (P,) float64, the largest amount seen, 0 for none.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.top = np.zeros(len(parameters))
        self.seen_s = 0.0
        self._last_s: float | None = None

    def apply(self, values: Floats, now_s: float) -> Floats:
        """Values with their ranges widened, as far as they are known."""
        self.seen_s += min(now_s - self._last_s, 0.1) if self._last_s is not None else 0.0
        self._last_s = now_s
        np.maximum(self.top, np.abs(values), out=self.top)
        known = min(self.seen_s / _LEARN_S, 1.0)
        factor = 1.0 / np.clip(self.top, _LEAST_RANGE, 1.0)
        factor[self.top < _LEAST_RANGE / 2] = 1.0  # never really moved
        widened: Floats = values * (1.0 + known * (factor - 1.0))
        return widened


def load_state(path: Path, parameters: Parameters, neutral: Neutral, ranges: Ranges) -> None:
    """Read what was kept; nothing where there is no file, or none that may be seen.

    Raises LinkError: the file is damaged, or of a newer omote.
    """
    if not os.path.exists(path):  # false, too, in a folder that is somebody else's
        return
    with files.reading(path, LinkError, hint=f"delete it: rm {path}"):
        table = files.read_json(path, _MOST_BYTES)
        if not isinstance(table, dict) or not all(isinstance(table.get(key), dict) for key in ("neutral", "ranges")):
            raise ValueError("is no calibration of a link")
        if fault := format_fault(table.get("format"), _FORMAT):
            raise ValueError(fault)
        given, found = _read(table["neutral"], parameters)
        tops, _ = _read(table["ranges"], parameters)
    neutral.values, neutral.known = given, bool(found.any())
    ranges.top, ranges.seen_s = np.abs(tops), _LEARN_S if tops.any() else 0.0


def save_state(path: Path, parameters: Parameters, neutral: Neutral, ranges: Ranges) -> None:
    """Keep what was learned. Raises ControllerError: the file cannot be written."""
    table = {
        "format": _FORMAT,
        "neutral": _written(neutral.values, parameters) if neutral.known else {},
        "ranges": _written(ranges.top, parameters),
    }
    with replacing(path) as beside:
        beside.write_text(json.dumps(table, indent=1), encoding="utf-8")


def _read(table: dict[str, object], parameters: Parameters) -> tuple[Floats, Flags]:
    """Values by position, and which there are. Raises ValueError: one is no number."""
    values, mask = np.zeros(len(parameters)), np.zeros(len(parameters), dtype=bool)
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not -MOST <= value <= MOST:
            raise ValueError(f"{name}: must be a number from {-MOST:g} to {MOST:g}")
        at = parameters.find(name)
        if at is not None:
            values[at], mask[at] = value, True
    return values, mask


def _written(values: Floats, parameters: Parameters) -> dict[str, float]:
    return {name: round(float(value), 6) for name, value in zip(parameters.names, values, strict=True)}
