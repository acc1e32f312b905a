"""Joins the behaviours of idle motion into the values that are added to one face.

The result depends only on the settings (``configs/life``), the seed, the times of the updates, and the given gaze
shifts, loudness and manners.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from controller.base.mailboxes import REST, Life
from controller.base.parameters import Floats, Parameters
from controller.layers.idle.attention import Attention, Shift
from controller.layers.idle.blinks import Blinks
from controller.layers.idle.draws import MAX_GAP_S, generator
from controller.layers.idle.eyes import Eyes
from controller.layers.idle.gestures import Gestures
from controller.layers.idle.head import Nods, Posture, Sway, Turn, lung_volume
from controller.layers.idle.pupils import Pupils
from controller.layers.idle.settings import IdleSettings, Manner, MannerSettings
from controller.layers.idle.speech import Emphasis, SpeechDetector
from controller.vocabulary.sides import spread

_EYES = ("leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch")
_HEAD = ("headYaw", "headPitch", "headRoll")

Angles = tuple[float, float, float]


class IdleMotion:
    """Idle motion of one face.

    Parameters
    ----------
    settings : rates and sizes. seed : the same seed gives the same motion.

    Attributes
    ----------
    liveliness : 0..1, scales everything; at 0 nothing moves. values : (P,) float64, added to the face.
    chosen : the commanded manner; None: ``speak`` while the face speaks, ``listen`` for a time after that, else
    ``alone``. manner : the current manner.
    eye_yaw_rad, eye_pitch_rad : offset of the eyes from their target by micro-saccades and drift.
    head_rad : (3,) yaw, pitch, roll of the head. beside : what pictures show beside the parameters: breath and pupils.
    """

    def __init__(self, parameters: Parameters, settings: IdleSettings, seed: int = 0) -> None:
        self.liveliness = 0.0
        self.values = parameters.neutral()
        self.chosen: Manner | None = None
        self.manner: Manner = "alone"
        self.eye_yaw_rad = self.eye_pitch_rad = 0.0
        self.head_rad = np.zeros(3)
        self.beside: Life = REST
        self._settings, self._last_s, self._was_looking = settings, -math.inf, False
        self._lids = parameters.indices(["eyeBlinkLeft", "eyeBlinkRight"])
        self._along = spread(parameters, settings.blink.along)
        self._head_indices = parameters.indices(_HEAD)
        self._eye_indices: list[int] = parameters.indices(_EYES).tolist()
        self._eye_scale = parameters.full_scale_rad[self._eye_indices].tolist()
        self._head_scale = parameters.full_scale_rad[self._head_indices]
        self._lag_s = _lag_s(parameters)
        self._blinks = Blinks(settings.blink, generator(seed, "blinks"))
        self._attention = Attention(settings.gaze, generator(seed, "attention"))
        self._eyes = Eyes(settings.eyes, generator(seed, "eyes"))
        self._turn, self._posture = Turn(settings.turn), Posture(settings.posture, generator(seed, "posture"))
        self._sway = Sway(settings.head, settings.breath, generator(seed, "sway"))
        self._pupils = Pupils(settings.pupil, settings.breath, generator(seed, "pupils"))
        self._nods = Nods(settings.nod, generator(seed, "nods"))
        self._fidgets = Gestures(parameters, settings.fidget, generator(seed, "fidgets"))
        self._smiles = Gestures(parameters, settings.smile, generator(seed, "smiles"))
        self._swallows = Gestures(parameters, settings.swallow, generator(seed, "swallows"))
        self._speech = SpeechDetector(settings.speech)
        self._emphasis = Emphasis(parameters, settings.speech, generator(seed, "emphasis"))

    def shift(self, angle_rad: float, now_s: float) -> None:
        """React to a commanded jump of the gaze by an angle; a large jump may cause a blink."""
        self._blinks.shift(angle_rad, now_s)

    def update(self, now_s: float, *, looking: bool, blink_block: float = 0.0, gaze_block: float = 0.0,
               loudness: float = 0.0) -> Floats:  # fmt: skip
        """Advance to ``now_s`` and return :attr:`values`.

        looking : whether a gaze is commanded; if so, there are no glances, and no eye angles in ``values``.
        blink_block, gaze_block : how much an expression suppresses blinks and glances, 0..1.
        loudness : how loud the face speaks, 0..1.
        """
        self.values.fill(0.0)
        if self.liveliness <= 0.0:
            self._rest()
            return self.values
        if not 0.0 <= now_s - self._last_s <= MAX_GAP_S:
            self._begin(now_s)
        self._last_s = now_s
        self._follow_speech(loudness, now_s, looking)
        self._advance(now_s, looking)
        self._write_face(now_s, 1.0 - blink_block)
        self._write_head(now_s, 1.0 - gaze_block, looking)
        breath = self._settings.breath
        rise_mm = self.liveliness * breath.rise_mm * lung_volume(breath, now_s)
        self.beside = rise_mm, self.liveliness * self._pupils.at(now_s)
        return self.values

    def _rest(self) -> None:
        self.eye_yaw_rad = self.eye_pitch_rad = 0.0
        self.head_rad[:] = 0.0
        self.beside = REST
        self._last_s = -math.inf

    @property
    def _table(self) -> MannerSettings:
        return self._settings.manner(self.manner)

    def _begin(self, now_s: float) -> None:
        """Start every behaviour again; their random numbers continue."""
        self._speech.reset()
        self.manner = self.chosen or "alone"
        self._turn.begin()
        self._sway.begin()
        self._emphasis.begin()
        self._eyes.begin(now_s)
        for each in (self._posture, self._nods, self._fidgets, self._smiles, self._swallows):
            each.begin(now_s)
        self._blinks.begin(now_s, self._table.blink_rate)
        self._look(self._attention.begin(now_s, self._table), looking=False)

    def _follow_speech(self, loudness: float, now_s: float, looking: bool) -> None:
        """Choose the manner by the face's speech, and start the movements that accompany it."""
        events, before = self._speech.update(loudness, now_s), self.manner
        self.manner = self.chosen or self._choose_manner(now_s)
        if events.stressed:
            beat = self._emphasis.stress(now_s)
            if beat.nod_rad > 0.0:
                self._nods.nod(now_s, beat.nod_rad, self._settings.speech.nod_s)
            self._blink_now(beat.blink, now_s)
        if events.ended:
            self._blink_now(self._emphasis.end().blink, now_s)
        away = events.began and self.manner == "speak" and self._emphasis.draw_look_away()
        if away or events.ended or (self.manner == "listen" and before != "listen"):
            self._look(self._attention.advance(now_s, self._table), looking)
            self._look(self._attention.turn(now_s, self._table, on_listener=not away), looking)

    def _choose_manner(self, now_s: float) -> Manner:
        """Return the manner that fits the face's speech."""
        if self._speech.speaking:
            return "speak"
        return "listen" if now_s - self._speech.silent_since_s < self._settings.speech.listen_s else "alone"

    def _blink_now(self, wanted: bool, now_s: float) -> None:
        if wanted:
            self._blinks.advance(now_s, self._table.blink_rate)
            self._blinks.request(now_s)

    def _advance(self, now_s: float, looking: bool) -> None:
        """Let every behaviour begin what is due."""
        if looking and not self._was_looking:
            self._look([Shift(now_s, 0.0, 0.0)], looking)
        self._was_looking = looking
        self._look(self._attention.advance(now_s, self._table), looking)
        self._eyes.advance(now_s)
        self._turn.drop_finished(now_s)
        self._sway.set_gain(self._table.sway, now_s)
        self._posture.advance(now_s)
        self._nods.advance(now_s, listening=self.manner == "listen")
        self._blinks.advance(now_s, self._table.blink_rate)
        quiet = not self._speech.speaking
        self._fidgets.advance(now_s, wanted=quiet)
        self._smiles.advance(now_s, wanted=quiet and self.manner == "listen")
        self._swallows.advance(now_s, wanted=quiet)

    def _look(self, shifts: Iterable[Shift], looking: bool) -> None:
        """Move eyes and head to each shift in turn; while a gaze is commanded, idle motion looks straight ahead."""
        for shift in shifts:
            goal = Shift(shift.time_s, 0.0, 0.0) if looking else shift
            size_rad = self._eyes.look(goal)
            self._turn.follow(goal)
            if not looking:
                self._blinks.advance(shift.time_s, self._table.blink_rate)
                self._blinks.shift(size_rad, shift.time_s)

    def _write_face(self, now_s: float, blinking: float) -> None:
        for each in (self._fidgets, self._smiles, self._swallows, self._emphasis):
            each.add(self.values, now_s, self.liveliness)
        left, right = self._blinks.levels(now_s, self.liveliness)
        closed = 0.5 * blinking * (left + right)
        if closed > 0.0:
            self.values += closed * self._along
            self.values[self._lids] += left * blinking, right * blinking

    def _write_head(self, now_s: float, glancing: float, looking: bool) -> None:
        """Write the angles of head and eyes.

        The eyes turn back by the angle of the head, which lags the eyes because of its motion limits. Sway is so slow
        that its lag, 0.2 degrees at most, does not matter.
        """
        liveliness, sway = self.liveliness, self._sway.at(now_s)
        self.head_rad[:] = self._head_at(now_s, glancing, sway)
        self.head_rad *= liveliness
        self.values[self._head_indices] += self.head_rad / self._head_scale
        self.eye_yaw_rad, self.eye_pitch_rad = (liveliness * angle for angle in self._eyes.fixational_offset(now_s))
        if looking:
            return
        yaw, pitch, _ = self._head_at(now_s - self._lag_s, glancing, sway)
        gaze_yaw, gaze_pitch = self._eyes.direction(now_s)
        yaw = liveliness * (glancing * gaze_yaw - yaw) + self.eye_yaw_rad
        pitch = liveliness * (glancing * gaze_pitch - pitch) + self.eye_pitch_rad
        angles = (yaw, pitch, yaw, pitch)
        for index, angle, full in zip(self._eye_indices, angles, self._eye_scale, strict=True):
            self.values[index] = min(max(angle / full, -1.0), 1.0)

    def _head_at(self, now_s: float, glancing: float, sway: Angles) -> Angles:
        """Return yaw, pitch and roll (rad) of the head at full liveliness, including ``sway``."""
        posture, nods = self._posture.at(now_s), self._nods.at(now_s)
        turn_yaw, turn_pitch, _ = self._turn.at(now_s)
        yaw = sway[0] + posture[0] + glancing * turn_yaw
        return yaw, sway[1] + posture[1] + nods[1] + glancing * turn_pitch, sway[2] + posture[2]


def _lag_s(parameters: Parameters) -> float:
    """Return how far the head lags the eyes (s), by the time constants of their motion limits."""
    head, eye = parameters.index("headYaw"), parameters.index("leftEyeYaw")
    later = parameters.response_s[head] - parameters.response_s[eye]
    smoothing = parameters.max_acceleration[head] / parameters.max_jerk[head] / 2
    return float(min(max(later + smoothing, 0.0), 0.4))
