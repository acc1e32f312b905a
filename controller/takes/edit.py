"""Edits takes (recorded faces): keep or cut out a range, smooth, layer one over another.

These are pure functions; every result is a new take.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats
from controller.takes.livelink import Take

_MIN_STEP_S = 1e-3


def keep(take: Take, from_s: float, to_s: float) -> Take:
    """Return a range of a take as a take that begins at 0, with rows exactly at both ends of the range.

    Raises ParameterError: the range is empty or not in the take.
    """
    from_s, to_s = _range(take, from_s, to_s)
    inside = (take.times_s > from_s) & (take.times_s < to_s)
    times = np.concatenate([[from_s], take.times_s[inside], [to_s]])
    return _with_rows(take, times - from_s, _interpolate(take, times))


def cut_out(take: Take, from_s: float, to_s: float, join_s: float = 0.2) -> Take:
    """Return a take without a range; a transition of ``join_s`` replaces it, so that the face does not jump.

    Raises ParameterError: the range is empty, not in the take, or all of it.
    """
    from_s, to_s = _range(take, from_s, to_s)
    before, after = take.times_s < from_s, take.times_s > to_s
    if from_s <= 0.0 and to_s >= take.duration_s:
        raise ParameterError("nothing would be left of the take", hint="choose a shorter range")
    first = np.append(take.times_s[before], from_s) if from_s > 0.0 else np.zeros(0)
    second = np.concatenate([[to_s], take.times_s[after]]) if to_s < take.duration_s else np.zeros(0)
    values = _interpolate(take, np.concatenate([first, second]))
    pause = join_s if len(first) and len(second) else 0.0
    start = first[-1] + pause if len(first) else 0.0
    return _with_rows(take, np.concatenate([first, second - to_s + start]), values)


def smooth(take: Take, seconds: float) -> Take:
    """Return a take smoothed in time by a Gaussian of standard deviation ``seconds``, without delay.

    Rows may be unevenly spaced: each is weighted by the time between its neighbours. The first and the last row stay
    unchanged.

    Raises ParameterError: ``seconds`` is not above 0 and at most 5.
    """
    if not 0.0 < seconds <= 5.0:
        raise ParameterError(f"a face is smoothed over 0 to 5 s, not {seconds:g}", hint="0.05 removes jitter")
    times, values = take.times_s, np.empty_like(take.values)
    spacing = np.gradient(times) if len(times) > 1 else np.ones(1)
    first, last = np.searchsorted(times, times - 4 * seconds), np.searchsorted(times, times + 4 * seconds, "right")
    for i, (low, high) in enumerate(zip(first, last, strict=True)):
        weights = spacing[low:high] * np.exp(-0.5 * ((times[low:high] - times[i]) / seconds) ** 2)
        values[i] = weights @ take.values[low:high] / weights.sum()
    values[[0, -1]] = take.values[[0, -1]]
    return _with_rows(take, times, values)


def layer_over(below: Take, above: Take, offset_s: float = 0.0) -> Take:
    """Return ``below`` with the values of ``above`` for its parameters, from ``offset_s`` to the end of ``above``.

    Raises ParameterError: ``offset_s`` is below 0 or after the end of ``below``.
    """
    if not 0.0 <= offset_s <= below.duration_s:
        raise ParameterError(f"a layer begins from 0 to {below.duration_s:g} s, not at {offset_s:g}", hint="0")
    end_s = offset_s + above.duration_s
    edges = np.array(
        [offset_s - 2.0 * _MIN_STEP_S, end_s + 2.0 * _MIN_STEP_S]
    )  # rows of ``below`` just before and after ``above``
    edges = edges[(edges > 0.0) & (edges < below.duration_s)]
    times = np.union1d(np.append(below.times_s, edges), offset_s + above.times_s)
    times = times[np.append(True, np.diff(times) > _MIN_STEP_S)]
    values = _interpolate(below, np.minimum(times, below.duration_s))
    inside = (times >= offset_s) & (times <= end_s + _MIN_STEP_S)
    over = _interpolate(above, np.clip(times[inside] - offset_s, 0.0, above.duration_s))
    values[np.ix_(inside, above.mask)] = over[:, above.mask]
    mask = below.mask | above.mask
    mask.flags.writeable = False
    return replace(_with_rows(below, times, values), mask=mask)


def _range(take: Take, from_s: float, to_s: float) -> tuple[float, float]:
    low, high = max(min(from_s, to_s), 0.0), min(max(from_s, to_s), take.duration_s)
    if high - low < _MIN_STEP_S:
        raise ParameterError(f"the range {from_s:g} to {to_s:g} s has no part of the take", hint="drag over the take")
    return low, high


def _interpolate(take: Take, times: Floats) -> Floats:
    """Return the values (n, P) of a take at times (n,)."""
    columns = [np.interp(times, take.times_s, column) for column in take.values.T]
    values: Floats = np.array(columns).T
    return values


def _with_rows(take: Take, times: Floats, values: Floats) -> Take:
    return replace(take, times_s=_freeze(times), values=_freeze(values))


def _freeze(array: Floats) -> Floats:
    array = np.array(array)
    array.flags.writeable = False
    return array
