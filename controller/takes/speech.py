"""Makes takes of timed visemes, timed phonemes and the output of Rhubarb Lip Sync.

Timed sounds are blended by dominance (after Cohen and Massaro 1993): each sound reaches into its neighbours, the less
the firmer they hold their own shape, so that lips meet for a short "p" between two open vowels.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError, TakeError
from controller.base.parameters import Floats, Parameters
from controller.motion.motion import minimum_jerk
from controller.takes.livelink import Take
from controller.vocabulary.visemes import Visemes

RATE_HZ = 100.0
"""Rows per second of the takes made here."""

_BEFORE_S = 0.12
_AFTER_S = 0.08
_FIRM = 0.85
_NEIGHBOURS = 3


@dataclass(frozen=True, eq=False)
class Cue:
    """One sound: when it begins (s), and its visemes (n,)."""

    start_s: float
    weights: Floats


def speech_take(name: str, cues: Sequence[Cue], end_s: float, parameters: Parameters, visemes: Visemes) -> Take:
    """A take of timed sounds.

    ``cues`` : rising in time; the last lasts until ``end_s``.

    Raises TakeError: no cue, or times that do not rise.
    """
    starts = np.array([cue.start_s for cue in cues])
    if len(cues) == 0 or np.any(np.diff(starts) < 0) or end_s < starts[-1]:
        raise TakeError(f"{name}: needs at least one sound, with times that rise", hint="sort the sounds by time")
    ends = np.append(starts[1:], end_s)
    weights = np.stack([cue.weights for cue in cues])
    hold = weights @ visemes.hold
    times = np.arange(0.0, end_s + _AFTER_S + 1 / RATE_HZ, 1 / RATE_HZ)
    values = np.stack([visemes.matrix @ _mix(t, starts, ends, weights, hold) for t in times])
    return Take(name, times, np.minimum(values, 1.0), visemes.mask, parameters.low, parameters.high, visemes.through)


def _mix(t: float, starts: Floats, ends: Floats, weights: Floats, hold: Floats) -> Floats:
    """(n,) weights of the visemes at a time: the sounds near it, each by its dominance there."""
    here = max(int(np.searchsorted(starts, t, side="right")) - 1, 0)
    near = range(max(here - _NEIGHBOURS, 0), min(here + _NEIGHBOURS + 1, len(starts)))
    room = 1.0 - _FIRM * hold[here]
    dominance = np.array([_dominance(t, starts[k], ends[k], room) * (0.2 + 0.8 * hold[k]) for k in near])
    total = dominance.sum()
    if total <= 0.0:
        return np.zeros(weights.shape[1])
    mixed: Floats = dominance @ weights[near.start : near.stop] / total
    mixed *= min(1.0, _dominance(t, starts[0], ends[-1], 1.0))
    return mixed


def _dominance(t: float, start: float, end: float, room: float) -> float:
    """1 during a sound, falling to 0 before and after it over a time that ``room`` scales."""
    if t < start:
        return 1.0 - minimum_jerk((start - t) / (_BEFORE_S * room))
    if t >= end:
        return 1.0 - minimum_jerk((t - end) / (_AFTER_S * room))
    return 1.0


def cue_take(path: Path, parameters: Parameters) -> Take:
    """A take from Rhubarb's TSV or JSON, or from a TSV of phonemes or visemes (time, tab, name). Raises TakeError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TakeError(f"{path}: cannot be read: {error}", hint=f"look at: ls -l {path}") from error
    visemes = Visemes.load(parameters)
    rows, end_s = _json_rows(path, text) if path.suffix.lower() == ".json" else _tsv_rows(path, text)
    shapes = all(name in visemes.rhubarb for _, _, name in rows)
    cues = [Cue(start_s, _weights(path, line, name, visemes, shapes)) for line, start_s, name in rows]
    return speech_take(path.name, cues, end_s, parameters, visemes)


def _weights(path: Path, line: str, name: str, visemes: Visemes, shapes: bool) -> Floats:
    """Rhubarb's letters mean its shapes only where every name in the file is one: B and F are phonemes, too."""
    if shapes:
        return visemes.rhubarb[name]
    try:
        return visemes.weights(name)
    except ParameterError as error:
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
        cues = json.loads(text)["mouthCues"]
        rows = [(f"mouthCues[{i}]", float(cue["start"]), str(cue["value"])) for i, cue in enumerate(cues)]
        return rows, float(cues[-1]["end"]) if cues else 0.0
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise TakeError(
            f"{path}: not the output of rhubarb -f json: {error}", hint="rhubarb -f json voice.wav"
        ) from error
