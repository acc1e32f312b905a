"""How far a long computation has come: callbacks that are told a stage and the part that is done, 0 to 1."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]


def silent(stage: str, part: float) -> None:
    """Tell nobody."""


def between(progress: Progress, low: float, high: float) -> Progress:
    """A callback for a step that takes from ``low`` to ``high`` of the whole."""

    def tell(stage: str, part: float) -> None:
        progress(stage, low + part * (high - low))

    return tell
