"""Reads saved results of MediaPipe's face landmarker, or messages of the link ``json``, as takes.

A file is a list of results, ``{"frames": [...]}``, or one result per line. Each result has blend shapes, landmarks or
both, and is read as by the link ``json``. Its time is ``"time"`` (s), or ``"timestamp"``, ``"timestampMs"`` or
``"timestamp_ms"`` (ms), in all results or in none. Without times there are 30 results a second, or ``"fps"`` of the
file. Results without a face are left out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Parameters
from controller.formats.kinds.json_format import JsonDecoder, is_number
from controller.takes.livelink import Take
from surface.base import files

_RATE_HZ = 30.0
_TIMES = {"time": 1.0, "timestamp": 1e-3, "timestampMs": 1e-3, "timestamp_ms": 1e-3}
_HINT = "save the results of the face landmarker as a JSON list, or one per line, each with a time"
_KEYS = re.compile(
    rb'"(?:(?:multi_?)?face_?landmarks|landmarks|face_?blendshapes)"|"category_?name"|"parameters"\s*:', re.IGNORECASE
)


def is_mediapipe(start: bytes) -> bool:
    """Whether a file that begins with these bytes holds results of the face landmarker or messages of ``json``."""
    return _KEYS.search(start) is not None


def mediapipe_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from a file of results.

    Raises TakeError: the file cannot be read, no result has a face, or the times are not ascending.
    """
    results, rate_hz = _results(path)
    decoder, frames, times = JsonDecoder(parameters), [], []
    for number, result in enumerate(results):
        found = [frame for frame in decoder.read(result) if frame.face]
        frames += found
        times += [_time_s(result, number / rate_hz)] * len(found)
    if not frames:
        why = "; ".join(f"{count} {reason}" for reason, count in decoder.refused.items())
        raise TakeError(f"{path}: no result has a face{f' ({why})' if why else ''}", hint=_HINT)
    times_s = np.array(times, dtype=np.float64)
    if (np.diff(times_s) <= 0.0).any():
        raise TakeError(f"{path}: the times of its results are not ascending", hint=_HINT)
    values, mask = np.stack([frame.values for frame in frames]), frames[-1].mask
    return Take(path.name, times_s - times_s[0], values, mask, parameters.low, parameters.high)


def _results(path: Path) -> tuple[list[Any], float]:
    """Return the results of a file, and their rate where they have no times (Hz)."""
    with files.reading(path, TakeError, hint=_HINT):
        text = files.read_text(path)
        lines = [line for line in text.splitlines() if line.strip()]
        if len(lines) > 1 and all(line.strip()[0] in "{[" and line.strip()[-1] in "}]" for line in lines):
            return [files.parse_json(line) for line in lines], _RATE_HZ
        found = files.parse_json(text)
    rate_hz = _RATE_HZ
    if isinstance(found, dict) and isinstance(found.get("frames"), list):
        given = found.get("fps")
        rate_hz = float(given) if is_number(given) and 1.0 <= given <= 1000.0 else _RATE_HZ
        found = found["frames"]
    return (found if isinstance(found, list) else [found]), rate_hz


def _time_s(result: Any, default_s: float) -> float:
    for key, scale in _TIMES.items():
        if isinstance(result, dict) and is_number(result.get(key)):
            return scale * float(result[key])
    return default_s
