"""Hears the face speak: when an utterance begins and ends, and which syllables are stressed.

What it hears is how loud the face speaks, 0 to 1, as its jaw shows. A syllable is stressed where loudness rises past a
share of the loudest of the last seconds.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from controller.base.parameters import Floats, Parameters
from controller.layers.idle.gestures import chosen, poses
from controller.layers.idle.settings import SpeechSettings
from controller.motion.motion import Envelope

_MEMORY_S = 4.0
_LEAST_LOUD = 0.12
"""Loudest sound that stresses are compared with at least: a murmur has none."""
_AGAIN = 0.7
"""Loudness must fall below this share of the threshold before it can pass it again."""


@dataclass
class Heard:
    """What happened at one moment."""

    began: bool = False
    ended: bool = False
    stressed: bool = False


class Hearing:
    """Finds utterances and stresses in loudness.

    speaking : whether an utterance is going on. silent_since_s : when the last one ended.
    """

    def __init__(self, settings: SpeechSettings) -> None:
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Nothing was heard yet."""
        self.speaking, self.silent_since_s = False, -math.inf
        self._last_s = self._sound_s = self._stress_s = -math.inf
        self._loudest, self._armed = _LEAST_LOUD, True

    def hear(self, loudness: float, now_s: float) -> Heard:
        """Take the loudness at ``now_s``, 0..1."""
        speech, heard = self._settings, Heard()
        passed = min(max(now_s - self._last_s, 0.0), _MEMORY_S * 10)
        self._last_s = now_s
        self._loudest = max(loudness, _LEAST_LOUD, self._loudest * math.exp(-passed / _MEMORY_S))
        if loudness > speech.gate:
            heard.began, self.speaking, self._sound_s = not self.speaking, True, now_s
        elif self.speaking and now_s - self._sound_s >= speech.pause_s:
            heard.ended, self.speaking, self.silent_since_s = True, False, now_s
        heard.stressed = self._stressed(loudness, now_s)
        return heard

    def _stressed(self, loudness: float, now_s: float) -> bool:
        threshold = self._settings.stress * self._loudest
        if loudness < _AGAIN * threshold:
            self._armed = True
        loud = self._armed and loudness >= max(threshold, self._settings.gate)
        if not loud or now_s - self._stress_s < self._settings.stress_gap_s:
            return False
        self._armed, self._stress_s = False, now_s
        return True


@dataclass
class Beat:
    """What goes along with a stressed syllable or the end of an utterance."""

    nod_rad: float = 0.0
    blink: bool = False


@dataclass
class _Raise:
    """Brows that show with a syllable."""

    values: Floats
    envelope: Envelope = field(default_factory=lambda: Envelope(-math.inf, 1.0, 0.0, 1.0))


class Emphasis:
    """Brows, nods and blinks that underline speech."""

    def __init__(self, parameters: Parameters, settings: SpeechSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self._poses = poses(parameters, settings.brows)
        self._brows = _Raise(parameters.neutral())

    def begin(self) -> None:
        """Start with brows at rest."""
        self._brows.envelope = Envelope(-math.inf, 1.0, 0.0, 1.0)

    def stress(self, now_s: float) -> Beat:
        """Underline a syllable at ``now_s``."""
        speech, numbers = self._settings, self._random
        brows, nod, blink = (numbers.random() for _ in range(3))
        hold_s, depth = numbers.uniform(*speech.hold_s), math.radians(numbers.uniform(*speech.nod_deg))
        values = chosen(self._poses, numbers)
        free = now_s >= self._brows.envelope.end_s
        if brows < speech.brow_share and values is not None and free:
            self._brows = _Raise(values, Envelope(now_s, speech.rise_s, hold_s, speech.fall_s))
        return Beat(depth if nod < speech.nod_share else 0.0, blink < speech.blink_share)

    def end(self) -> Beat:
        """Close an utterance: people often blink there (Nakano and Kitazawa 2010)."""
        return Beat(blink=self._random.random() < self._settings.end_blink_share)

    def looks_away(self) -> bool:
        """Whether a speaker looks away at the beginning of this utterance (Kendon 1967)."""
        return self._random.random() < self._settings.away_share

    def add(self, out: Floats, now_s: float, liveliness: float) -> None:
        """Add what the brows show at ``now_s`` to ``out`` : (P,)."""
        level = self._brows.envelope.level(now_s)
        if level > 0.0:
            out += level * self._settings.amount * liveliness * self._brows.values
