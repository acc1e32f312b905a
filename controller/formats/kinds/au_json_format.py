"""Format of openFACS, action units as JSON: ``{"AU1": 0, "AU12": 3, "AU26": 5, "Speed": 0.05}``, 0 to 5.

Source: python/openFACS.py and JSonParser.cpp of phuselab/openFACS, which have 18 units with whole numbers. The decoder
also accepts fractions, other units of ``configs/vocabularies/facs.toml``, one side (``AUL12``), and the single quotes
of openFACS's README. A unit that is not named keeps its intensity.
"""

from __future__ import annotations

import json
import math
from functools import cache, lru_cache
from typing import Any

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Flags, Indices, Parameters
from controller.formats.format import API, Format, nothing
from controller.formats.frame import Frame, Refusals
from controller.vocabulary.facs import Facs

UNITS = (1, 2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 20, 23, 25, 26, 28, 45)
"""Action units that openFACS reads."""
_MAX_INTENSITY = 5.0
_SPEED = "Speed"
_MAX_NAME_LENGTH = 12


class AuJsonDecoder:
    """Decodes objects of intensities; an invalid entry is counted, and the other entries of the object are used."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._facs = _facs(parameters)
        self._levels = np.zeros(len(self._facs.names))
        self._mask = about(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for an object with at least one valid unit, else none."""
        table = _parse_object(message)
        if table is None:
            self.refused.add("no object of action units")
            return []
        if not [name for name, value in table.items() if name != _SPEED and self._take(name, value)]:
            return []
        return [Frame(np.minimum(self._facs.matrix @ self._levels, 1.0), self._mask.copy())]

    def _take(self, name: str, value: Any) -> bool:
        """Store an intensity 0..5 of a unit; return whether name and value are valid."""
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1e6:
            self.refused.add("invalid intensities")
            return False
        columns = unit_columns(self._facs, name)
        if columns is None:
            self.refused.add("unknown units")
            return False
        self._levels[columns] = min(value / _MAX_INTENSITY, 1.0)
        return True


class AuJsonEncoder:
    """Encodes a face as the intensities that fit it best, in whole numbers."""

    def __init__(self, parameters: Parameters) -> None:
        self._facs = _facs(parameters)
        self._columns = [np.flatnonzero(self._facs.levels(str(unit))) for unit in UNITS]

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message; none for a frame without a face."""
        if not frame.face:
            return []
        levels = self._facs.read(np.clip(np.where(frame.mask, frame.values, 0.0), -1.0, 1.0))
        found = (float(levels[columns].mean()) for columns in self._columns)
        table: dict[str, float] = {
            f"AU{unit}": round(_MAX_INTENSITY * min(level, 1.0)) for unit, level in zip(UNITS, found, strict=True)
        }
        return [json.dumps(table | {_SPEED: 1.0}, separators=(",", ":")).encode()]


def _parse_object(message: bytes) -> dict[str, Any] | None:
    """Parse a JSON object, also one with single quotes; return None for anything else."""
    text = message.decode("utf-8", "replace")
    for spelling in (text, text.replace("'", '"')):
        try:
            found = json.loads(spelling)
        except (ValueError, RecursionError):
            continue
        return found if isinstance(found, dict) else None
    return None


_facs = cache(Facs.load)


@lru_cache(maxsize=256)
def unit_columns(facs: Facs, name: str) -> Indices | None:
    """Return the columns of ``facs`` for a unit such as ``AU12`` or ``AUL12``; None for any other name."""
    if len(name) > _MAX_NAME_LENGTH or "+" in name:
        return None
    try:
        found: Indices = np.flatnonzero(facs.levels(name))
    except ParameterError:
        return None
    return found if len(found) else None


def about(parameters: Parameters) -> Flags:
    """Return a mask (P,) of the parameters that action units move."""
    return np.asarray((_facs(parameters).matrix != 0.0).any(axis=1))


FORMAT = Format(
    api=API,
    kind="au-json",
    title="action units as JSON (openFACS)",
    transports=("udp", "tcp", "serial", "lines"),
    port=5000,
    decoder=AuJsonDecoder,
    encoder=AuJsonEncoder,
    carries=nothing,
    about=about,
    delimiter=b"\n",
    timeout_s=math.inf,
    note="18 units of both sides, in steps of a fifth; no angles",
)
