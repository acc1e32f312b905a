"""Makes takes from timed visemes, timed phonemes and the output of Rhubarb Lip Sync.

Sounds are blended by dominance functions (after Cohen and Massaro 1993): each sound influences its neighbours, but less
those that hold their own shape firmly, so that the lips meet for a short "p" between two open vowels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import ParameterError, TakeError
from controller.base.parameters import Floats, Parameters
from controller.takes.livelink import Take
from controller.vocabulary.visemes import Visemes
from surface.base import files

RATE_HZ = 100.0
"""Rows per second of the takes made here."""

MAX_LENGTH_S = 3600.0
"""Length of the longest take made here."""

_MAX_FILE_BYTES = 4 << 20
_ONSET_S = 0.12  # how long before its beginning a sound shows
_OFFSET_S = 0.08  # how long after its end a sound shows
_FIRMNESS = 0.85  # fraction by which a sound with the firmest hold shortens both times of its neighbours
_NEIGHBOURS = 3  # on each side


@dataclass(frozen=True, eq=False)
class Cue:
    """One sound: when it begins (s), and its visemes (n,)."""

    start_s: float
    weights: Floats


def speech_take(name: str, cues: Sequence[Cue], end_s: float, parameters: Parameters, visemes: Visemes) -> Take:
    """Return a take of timed sounds.

    cues : ascending in time; the last one lasts until ``end_s``.

    Raises TakeError: there is no cue, or the times are not ascending or not within 0 to an hour.
    """
    starts = np.array([cue.start_s for cue in cues])
    if len(cues) == 0 or not (np.diff(starts) >= 0).all() or not starts[-1] <= end_s:
        raise TakeError(f"{name}: needs at least one sound, with ascending times", hint="sort the sounds by time")
    if not 0.0 <= starts[0] <= end_s <= MAX_LENGTH_S:
        why = f"its sounds are at {starts[0]:g} to {end_s:g} s; 0 to {MAX_LENGTH_S:g} s are read"
        raise TakeError(f"{name}: {why}", hint="give the times in seconds")
    ends = np.append(starts[1:], end_s)
    weights = np.stack([cue.weights for cue in cues])
    hold = weights @ visemes.hold
    times = np.arange(0.0, end_s + _OFFSET_S + 1 / RATE_HZ, 1 / RATE_HZ)
    values = _mix(times, starts, ends, weights, hold) @ visemes.matrix.T
    return Take(name, times, np.minimum(values, 1.0), visemes.mask, parameters.low, parameters.high, visemes.through)


def _mix(times: Floats, starts: Floats, ends: Floats, weights: Floats, hold: Floats) -> Floats:
    """Return the (t, n) weights of the visemes at times (t,): the sounds around each, weighted by their dominance."""
    current = np.maximum(np.searchsorted(starts, times, side="right") - 1, 0)
    room = 1.0 - _FIRMNESS * hold[current]
    mixed, total = np.zeros((len(times), weights.shape[1])), np.zeros(len(times))
    for step in range(-_NEIGHBOURS, _NEIGHBOURS + 1):
        near = np.clip(current + step, 0, len(starts) - 1)
        dominance = _dominance(times, starts[near], ends[near], room) * (0.2 + 0.8 * hold[near])
        dominance[near != current + step] = 0.0
        mixed += dominance[:, None] * weights[near]
        total += dominance
    outside = total == 0.0  # so long before the first sound or after the last one that none shows
    mixed[outside], total[outside] = weights[current[outside]], 1.0
    mixed /= total[:, None]
    whole: Floats = _dominance(times, starts[0], ends[-1], 1.0)
    return mixed * np.minimum(1.0, whole)[:, None]


def _dominance(t: Floats, start: Floats, end: Floats, room: Floats | float) -> Floats:
    """Return 1 during a sound, falling to 0 before and after it; ``room`` scales the onset and offset times."""
    distance = np.maximum((start - t) / (_ONSET_S * room), (t - end) / (_OFFSET_S * room))
    distance = np.clip(distance, 0.0, 1.0)
    level: Floats = 1.0 - distance**3 * (10.0 + distance * (6.0 * distance - 15.0))
    return level


def cue_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from Rhubarb's TSV or JSON, or from a TSV of sounds (time, tab, name). Raises TakeError.

    Sounds are visemes, ARPAbet phonemes or IPA symbols. Letters mean Rhubarb's shapes only if every name in the file is
    one of them, because B and F are also phonemes.
    """
    with files.reading(path, TakeError, hint="save it as UTF-8"):
        text = files.read_text(path, _MAX_FILE_BYTES)
    visemes = Visemes.load(parameters)
    rows, end_s = _json_rows(path, text) if path.suffix.lower() == ".json" else _tsv_rows(path, text)
    shapes = all(name in visemes.rhubarb for _, _, name in rows)
    sounds = [visemes.rhubarb[name] for _, _, name in rows] if shapes else _sounds(path, rows, visemes)
    cues = [Cue(start_s, weights) for (_, start_s, _), weights in zip(rows, sounds, strict=True)]
    return speech_take(path.name, cues, end_s, parameters, visemes)


def _sounds(path: Path, rows: Sequence[tuple[str, float, str]], visemes: Visemes) -> list[Floats]:
    """Return the weights of the sounds of rows. Raises TakeError, with the place of the first unknown sound."""
    try:
        return visemes.sounds([name for _, _, name in rows])
    except ParameterError as error:
        line = next(line for line, _, name in rows if not visemes.knows(name))
        raise TakeError(f"{path}, {line}: {error}", hint=error.hint) from error


def _tsv_rows(path: Path, text: str) -> tuple[list[tuple[str, float, str]], float]:
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            time, name = line.split()
            start = float(time)
            if not 0.0 <= start < math.inf:
                raise ValueError
        except ValueError:
            raise TakeError(f"{path}, line {number}: {line!r} is not a time in seconds, a tab and a name",
                            hint="write it like: 0.27<tab>C") from None  # fmt: skip
        rows.append((f"line {number}", start, name))
    return rows, rows[-1][1] + 0.1 if rows else 0.0


def _json_rows(path: Path, text: str) -> tuple[list[tuple[str, float, str]], float]:
    try:
        table = files.parse_json(text)
        cues = table.get("mouthCues") if isinstance(table, dict) else None
        if not isinstance(cues, list):
            raise ValueError("there is no list mouthCues")
        every = [_json_cue(f"mouthCues[{i}]", cue) for i, cue in enumerate(cues)]
    except ValueError as error:
        why = f"{path}: not the output of rhubarb -f json: {error}"
        raise TakeError(why, hint="rhubarb -f json voice.wav") from error
    return [(where, start_s, name) for where, start_s, _, name in every], every[-1][2] if every else 0.0


def _json_cue(where: str, cue: Any) -> tuple[str, float, float, str]:
    """Return the place, start (s), end (s) and name of a cue. Raises ValueError, which names the key."""
    if not isinstance(cue, dict):
        raise ValueError(f"{where} must be a table")
    for key in ("start", "end"):
        value = cue.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < 1e12:
            raise ValueError(f"{where}.{key} must be a time in seconds")
    if not isinstance(cue.get("value"), str):
        raise ValueError(f"{where}.value must be a name")
    return where, float(cue["start"]), float(cue["end"]), cue["value"]
