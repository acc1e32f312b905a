"""What the tests of idle motion share."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.motion import IdleMotion
from controller.layers.idle.settings import IdleSettings, Manner

Live = Callable[..., np.ndarray]


@pytest.fixture(scope="session")
def settings() -> IdleSettings:
    return IdleSettings.named("natural", P)


@pytest.fixture(scope="session")
def live(settings: IdleSettings) -> Live:
    """A function that gives (n, 59) what idle motion adds."""

    def path(
        seconds: float = 60.0, *, seed: int = 1, amount: float = 1.0, rate_hz: float = 100.0,
        manner: Manner | None = None, own: IdleSettings | None = None,
        voice: Callable[[float], float] | None = None, **how: float,
    ) -> np.ndarray:  # fmt: skip
        life = IdleMotion(P, own or settings, seed)
        life.liveliness, life.chosen = amount, manner
        rows = []
        for t in np.arange(round(seconds * rate_hz)) / rate_hz:
            loudness = voice(t) if voice else 0.0
            rows.append(life.update(50.0 + t, looking=False, loudness=loudness, **how).copy())
        return np.array(rows)

    return path


@pytest.fixture(scope="session")
def voice() -> Callable[[float], float]:
    """How loud somebody speaks: utterances of 6 s with pauses of 2 s, 4.5 syllables a second, each its own loudness."""
    numbers = random.Random(7)
    loud = [numbers.uniform(0.15, 0.5) for _ in range(5000)]

    def loudness(now_s: float) -> float:
        if now_s % 8.0 > 6.0:
            return 0.0
        syllable = now_s * 4.5
        return loud[int(syllable)] * math.sin(math.pi * (syllable % 1.0))

    return loudness
