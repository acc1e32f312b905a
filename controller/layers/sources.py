"""Joins the face's built-in sources of values: expressions, gaze and idle motion, each of which writes its layer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters
from controller.base.parts import Parts
from controller.layers.expression_player import ExpressionPlayer
from controller.layers.gaze import Gaze
from controller.layers.idle.motion import IdleMotion
from controller.layers.idle.pupils import Follower
from controller.layers.idle.settings import IdleSettings
from controller.layers.layer_part import LayerPart
from controller.layers.mixer import Layer, Mixer
from controller.vocabulary.vocabulary import Vocabulary


class Sources:
    """Expressions, gaze and idle motion; expressions can suppress blinks, gaze and speech.

    present : (P,) the parameters shown now, which gaze reads. life : settings of idle motion. seed : the same seed
    gives the same idle motion. parts : registers the sources, so that each fails alone; the layer of one that failed
    fades out, and the source begins again.

    Attributes
    ----------
    player : plays expressions. gaze : looks in a direction or at a point. life : idle motion. Each is replaced by a new
    object after it failed. beside : breath and pupils, which pictures show beside the parameters.
    """

    def __init__(
        self,
        mixer: Mixer,
        present: Floats,
        *,
        parameters: Parameters,
        vocabulary: Vocabulary,
        life: IdleSettings,
        seed: int,
        parts: Parts,
    ) -> None:
        self._parameters, self._vocabulary, self._present = parameters, vocabulary, present
        self._life_settings, self._seed, self._parts = life, seed, parts
        self.player = ExpressionPlayer(vocabulary["neutral"])
        self.gaze = Gaze(parameters)
        self.life, self.beside = IdleMotion(parameters, life, seed), Follower()
        self._expression, self._looking = mixer["expression"], mixer["gaze"]
        self._idle, self._speech, self._jaw = mixer["idle"], mixer["speech"], parameters.index("jawOpen")
        self._everything = np.ones(len(parameters), dtype=bool)
        self._blocks = (0.0, 0.0, 0.0)  # how much the expression suppresses blinks, gaze and speech
        self._suppression = (0.0, 0.0)  # of blinks and gaze, scaled by how far the expression's layer shows
        self._expressions = self._part("expressions", self._expression, self._write_expression, self._renew_expression)
        self._others = (
            self._part("idle motion", self._idle, self._write_idle, self._renew_idle),
            self._part("gaze", self._looking, self._write_gaze, self._renew_gaze),
        )

    def write(self, now_s: float) -> None:
        """Let each source write its layer for a time (s)."""
        self._expressions.update(now_s)
        blink, gaze, mouth = (block * self._expressions.share for block in self._blocks)
        self._suppression = blink, gaze
        self._looking.attenuate(gaze)
        self._speech.attenuate(mouth)
        for source in self._others:
            source.update(now_s)
        self.beside.follow(self.life.beside, now_s)

    def stop_looking(self, fade_s: float | None = None) -> None:
        """Look at nothing, and fade out the layer over ``fade_s``; None: over the layer's own fade-out time."""
        self.gaze.off()
        self._looking.release(fade_s=fade_s)

    def _part(self, name: str, layer: Layer, write: Callable[[float], None], renew: Callable[[], None]) -> LayerPart:
        return LayerPart(name, layer, self._parts, write, renew)

    def _write_expression(self, now_s: float) -> None:
        values = require_finite(self._parameters.rest + self.player.update(now_s))
        self._expression.write_masked(values, self._everything, now_s)
        self._blocks = self.player.blocks

    def _renew_expression(self) -> None:
        self.player = ExpressionPlayer(self._vocabulary["neutral"])

    def _write_gaze(self, now_s: float) -> None:
        if self.gaze.active:
            eyes_rad = self.life.eye_yaw_rad, self.life.eye_pitch_rad
            values = require_finite(self.gaze.update(self._present, eyes_rad, self.life.head_rad[:2]))
            self._looking.write(self.gaze.indices, values, now_s)

    def _renew_gaze(self) -> None:
        self.gaze = Gaze(self._parameters)

    def _write_idle(self, now_s: float) -> None:
        life, (blink_block, gaze_block) = self.life, self._suppression
        if life.liveliness > 0.0:
            how = {"blink_block": blink_block, "gaze_block": gaze_block, "loudness": self.loudness}
            life.update(now_s, looking=self.gaze.active, **how)
            self._idle.write_masked(require_finite(life.values), self._everything, now_s)
        elif self._idle.holding:
            life.update(now_s, looking=False)
            self._idle.release()

    @property
    def loudness(self) -> float:
        """How loud the face speaks, 0..1: the jaw opening of the speech layer; 0 without speech."""
        return float(self._speech.values[self._jaw]) if self._speech.held[self._jaw] else 0.0

    def _renew_idle(self) -> None:
        old, self.life = self.life, IdleMotion(self._parameters, self._life_settings, self._seed)
        self.life.liveliness, self.life.chosen = old.liveliness, old.chosen


def require_finite(values: Floats) -> Floats:
    """Return ``values`` unchanged. Raises ParameterError: not all of them are finite."""
    if not np.isfinite(values).all():
        raise ParameterError("it gave values that are not finite numbers")
    return values
