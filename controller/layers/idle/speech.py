"""Detects utterances and stressed syllables in the face's own speech, and underlines them.

The input is how loud the face speaks, 0 to 1: the jaw opening of its speech. A syllable counts as stressed when the
loudness rises above a fraction of the loudest of the last seconds.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from controller.base.parameters import Floats, Parameters
from controller.layers.idle.gestures import draw_pose, poses
from controller.layers.idle.settings import SpeechSettings
from controller.motion.motion import Envelope

_LOUDEST_DECAY_S = 4.0
_MIN_LOUDEST = 0.12
"""Lower bound of the loudness that stresses are compared with, so that a murmur has none."""
_REARM_FRACTION = 0.7
"""Hysteresis: the loudness must fall below this fraction of the threshold before the next stress."""


@dataclass
class SpeechEvents:
    """What was detected at one moment."""

    began: bool = False
    ended: bool = False
    stressed: bool = False


class SpeechDetector:
    """Detects utterances and stresses by loudness.

    speaking : whether an utterance is in progress. silent_since_s : when the last one ended.
    """

    def __init__(self, settings: SpeechSettings) -> None:
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Start again, without speech."""
        self.speaking, self.silent_since_s = False, -math.inf
        self._last_s = self._sound_s = self._stress_s = -math.inf
        self._loudest, self._armed = _MIN_LOUDEST, True

    def update(self, loudness: float, now_s: float) -> SpeechEvents:
        """Process the loudness 0..1 at ``now_s`` and return what it shows."""
        speech, events = self._settings, SpeechEvents()
        passed = min(max(now_s - self._last_s, 0.0), _LOUDEST_DECAY_S * 10)
        self._last_s = now_s
        self._loudest = max(loudness, _MIN_LOUDEST, self._loudest * math.exp(-passed / _LOUDEST_DECAY_S))
        if loudness > speech.gate:
            events.began, self.speaking, self._sound_s = not self.speaking, True, now_s
        elif self.speaking and now_s - self._sound_s >= speech.pause_s:
            events.ended, self.speaking, self.silent_since_s = True, False, now_s
        events.stressed = self._detect_stress(loudness, now_s)
        return events

    def _detect_stress(self, loudness: float, now_s: float) -> bool:
        threshold = self._settings.stress * self._loudest
        if loudness < _REARM_FRACTION * threshold:
            self._armed = True
        loud = self._armed and loudness >= max(threshold, self._settings.gate)
        if not loud or now_s - self._stress_s < self._settings.stress_gap_s:
            return False
        self._armed, self._stress_s = False, now_s
        return True


@dataclass
class Beat:
    """A nod and a blink that accompany a stressed syllable or the end of an utterance."""

    nod_rad: float = 0.0
    blink: bool = False


@dataclass
class _Raise:
    """A movement of the brows that accompanies a syllable."""

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
        """Underline a syllable at ``now_s``: perhaps move the brows, and return a nod and a blink to make."""
        speech, numbers = self._settings, self._random
        brows, nod, blink = (numbers.random() for _ in range(3))
        hold_s, depth = numbers.uniform(*speech.hold_s), math.radians(numbers.uniform(*speech.nod_deg))
        values = draw_pose(self._poses, numbers)
        free = now_s >= self._brows.envelope.end_s
        if brows < speech.brow_share and values is not None and free:
            self._brows = _Raise(values, Envelope(now_s, speech.rise_s, hold_s, speech.fall_s))
        return Beat(depth if nod < speech.nod_share else 0.0, blink < speech.blink_share)

    def end(self) -> Beat:
        """Return what accompanies the end of an utterance: people often blink then (Nakano and Kitazawa 2010)."""
        return Beat(blink=self._random.random() < self._settings.end_blink_share)

    def draw_look_away(self) -> bool:
        """Decide at random whether the speaker looks away at the beginning of this utterance (Kendon 1967)."""
        return self._random.random() < self._settings.away_share

    def add(self, out: Floats, now_s: float, liveliness: float) -> None:
        """Add the movement of the brows at ``now_s`` to ``out`` : (P,)."""
        level = self._brows.envelope.level(now_s)
        if level > 0.0:
            out += level * self._settings.amount * liveliness * self._brows.values
