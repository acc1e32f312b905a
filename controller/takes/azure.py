"""Reads the mouth movement that Azure's speech synthesis reports, saved as JSON: viseme numbers or blend shapes.

Source: learn.microsoft.com, "Get facial position with viseme". A viseme event has an offset in ticks of 100 ns and a
number from 0 to 21. If blend shapes were requested, it has an animation, which is itself JSON: ``FrameIndex``, and
``BlendShapes`` with 55 numbers per frame at 60 frames a second. They are ARKit's 52, then the rolls of the head and of
the left and right eye, which are left out here because their unit is not documented.
A file holds one event, a list of events, or one event per line, with the key names of the SDK for any language.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats, Parameters
from controller.takes.livelink import Take
from controller.takes.speech import Cue, speech_take
from controller.vocabulary.visemes import Visemes
from surface.base import files

_TICKS_PER_S = 1e7
_RATE_HZ = 60.0
_MAX_FRAMES = 60 * 3600
_LAST_VISEME_S = 0.1  # length of the last viseme, which has no successor
_MIN_MEAN_STEP_S = 1e-3
"""A smaller mean time between visemes shows that the offsets are in another unit."""
_ARKIT_COUNT = 52
_SHAPE_COUNT = 55
_HINT = "save every viseme event as {audio_offset, viseme_id}, or its animation: a list, or one a line"
_VISEME = re.compile(rb'"(?:priv)?viseme_?id"', re.IGNORECASE)
_SHAPE = re.compile(rb'\\?"blendshapes\\?"', re.IGNORECASE)
_OFFSETS, _IDS = ("audiooffset", "privaudiooffset", "offset"), ("visemeid", "privvisemeid")
_ANIMATIONS = ("animation", "privanimation")


def is_visemes(start: bytes) -> bool:
    """Whether a file that begins with these bytes holds viseme events without blend shapes."""
    return _VISEME.search(start) is not None and _SHAPE.search(start) is None


def is_blend_shapes(start: bytes) -> bool:
    """Whether a file that begins with these bytes holds frames of blend shapes, in events or not."""
    return _SHAPE.search(start) is not None


def viseme_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from viseme events. Raises TakeError."""
    visemes, cues = Visemes.load(parameters), list[Cue]()
    for where, event in _events(path):
        offset, number = _value(event, _OFFSETS), _value(event, _IDS)
        if cues and offset == 0 and _value(event, _ANIMATIONS):
            continue  # events of blend shapes come after those of visemes, without a viseme of their own
        if not _is_number(offset) or offset < 0:
            raise _fault(path, where, "its offset must be a number of ticks of 100 ns")
        if isinstance(number, bool) or not isinstance(number, int) or number not in visemes.sapi:
            raise _fault(path, where, f"viseme {number!r}: must be 0 to {max(visemes.sapi, default=0)}")
        cues.append(Cue(offset / _TICKS_PER_S, visemes.sapi[number]))
    span_s = cues[-1].start_s - cues[0].start_s if cues else 0.0
    if 0.0 < span_s < _MIN_MEAN_STEP_S * (len(cues) - 1):
        why = f"{path}: {len(cues)} visemes within {1e3 * span_s:.3g} ms: offsets are ticks of 100 ns"
        raise TakeError(why, hint="multiply milliseconds by 10,000, seconds by 10,000,000")
    end_s = cues[-1].start_s + _LAST_VISEME_S if cues else 0.0
    return speech_take(path.name, cues, end_s, parameters, visemes)


def blend_shape_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from frames of blend shapes; shapes that are zero throughout are not part of it. Raises TakeError."""
    rows: dict[int, Floats] = {}
    for where, frames in _chunks(path):
        first = _value(frames, ("frameindex",))
        if isinstance(first, bool) or not isinstance(first, int) or not 0 <= first < _MAX_FRAMES:
            raise _fault(path, where, "FrameIndex must be the number of a frame")
        shapes = _value(frames, ("blendshapes",))
        if not isinstance(shapes, list):
            raise _fault(path, where, "BlendShapes must be a list of frames")
        for i, row in enumerate(shapes):
            rows[first + i] = _row(path, f"{where}, frame {i}", row)
    if not rows:
        raise TakeError(f"{path}: no frame of blend shapes", hint=_HINT)
    times = np.array(sorted(rows), dtype=np.float64)
    return _take(path, (times - times[0]) / _RATE_HZ, np.stack([rows[i] for i in sorted(rows)]), parameters)


def _take(path: Path, times: Floats, shapes: Floats, parameters: Parameters) -> Take:
    values, mask = np.zeros((len(times), len(parameters))), np.zeros(len(parameters), dtype=bool)
    indices = [parameters.index(name) for name in _arkit_order(parameters)]
    values[:, indices] = shapes[:, :_ARKIT_COUNT]
    mask[indices] = values[:, indices].any(axis=0)
    return Take(path.name, times, values, mask, parameters.low, parameters.high)


def _arkit_order(parameters: Parameters) -> tuple[str, ...]:
    """Return the names of the 52 shapes in their order, which is that of the base vocabulary."""
    return parameters.names[:_ARKIT_COUNT]


def _row(path: Path, where: str, row: Any) -> Floats:
    if not isinstance(row, list) or len(row) != _SHAPE_COUNT:
        raise _fault(path, where, f"must be a list of {_SHAPE_COUNT} numbers")
    if not all(_is_number(value) for value in row):
        raise _fault(path, where, "contains a value that is not a finite number")
    return np.array(row, dtype=np.float64)


def _chunks(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each object that holds frames, a plain one or the animation of an event, with its place for errors."""
    for where, event in _events(path):
        text = _value(event, _ANIMATIONS)
        if text is None:
            if _value(event, ("blendshapes",)) is not None or _value(event, _IDS) is None:
                yield where, event
        elif isinstance(text, str) and text.strip():
            yield where, _check_object(path, f"{where}.animation", _parse_json(path, text))
        elif isinstance(text, dict):
            yield where, text


def _events(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each object of a file, with its place for errors."""
    with files.reading(path, TakeError, hint=_HINT):
        text = files.read_text(path)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    if len(lines) > 1 and all(line.strip().startswith("{") and line.strip().endswith("}") for _, line in lines):
        yield from ((f"line {n}", _check_object(path, f"line {n}", _parse_json(path, line))) for n, line in lines)
        return
    found = _parse_json(path, text)
    if isinstance(found, dict) and isinstance(inner := _value(found, ("visemes", "events", "frames")), list):
        found = inner
    listed = found if isinstance(found, list) else [found]
    yield from ((f"[{i}]", _check_object(path, f"[{i}]", each)) for i, each in enumerate(listed))


def _parse_json(path: Path, text: str) -> Any:
    with files.reading(path, TakeError, hint=_HINT):
        return files.parse_json(text)


def _check_object(path: Path, where: str, found: Any) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise _fault(path, where, "must be an object")
    return found


def _value(event: dict[str, Any], names: tuple[str, ...]) -> Any:
    """Return the value of the first key that has one of these names, ignoring case and underscores; else None."""
    folded = {str(key).replace("_", "").lower(): value for key, value in event.items()}
    return next((folded[name] for name in names if name in folded), None)


def _is_number(value: Any) -> bool:
    """Whether a value is a number that a float can hold; integers in JSON may be larger."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _fault(path: Path, where: str, why: str) -> TakeError:
    return TakeError(f"{path}, {where}: {why}", hint=_HINT)
