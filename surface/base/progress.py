"""Progress callbacks of long computations: they get a stage's name and the fraction of the work done, 0 to 1."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]


def no_progress(stage: str, part: float) -> None:
    """Report nothing."""


def part_of(progress: Progress, low: float, high: float) -> Progress:
    """Return a callback for a step that takes from ``low`` to ``high`` of the whole."""
    return lambda stage, part: progress(stage, low + part * (high - low))
