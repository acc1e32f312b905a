"""controller.layers.sources: what expressions, gaze and idle motion write, and what they hold back of each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.base.parts import Parts
from controller.layers.idle.settings import IdleSettings
from controller.layers.mixer import Mixer
from controller.layers.settings import default_layers
from controller.layers.sources import Sources, require_finite
from controller.vocabulary.vocabulary import Vocabulary

SMILE, JAW, YAW = P.index("mouthSmileLeft"), P.index("jawOpen"), P.index("leftEyeYaw")
VOCABULARY = Vocabulary.load(P)


class Rig:
    """Sources with their layers, and a clock."""

    def __init__(self) -> None:
        self.mixer, self.present, self.now_s = Mixer(P, default_layers()), P.neutral(), 10.0
        life = IdleSettings.named("natural", P)
        self.sources = Sources(
            self.mixer, self.present, parameters=P, vocabulary=VOCABULARY, life=life, seed=3, parts=Parts()
        )

    def run(self, seconds: float) -> np.ndarray:
        """(P,) what all layers show after some time."""
        for _ in range(round(seconds * 50)):
            self.now_s += 0.02
            self.sources.write(self.now_s)
            self.mixer.mix(self.now_s, 0.02, self.present)
        return self.present


def test_an_expression_shows_and_a_gaze_turns_the_eyes_until_it_ends() -> None:
    rig = Rig()
    rig.sources.player.play(VOCABULARY["happiness"], 1.0, None, rig.now_s)
    rig.sources.gaze.look(0.4, 0.0)
    shown = rig.run(2.0)
    assert shown[SMILE] > 0.5 and shown[YAW] > 0.1 and rig.mixer["gaze"].holding
    rig.sources.stop_looking(0.2)
    assert not rig.sources.gaze.active and abs(rig.run(1.0)[YAW]) < 1e-6 and not rig.mixer["gaze"].holding


def test_life_moves_the_face_only_where_there_is_some_and_lets_go_of_it() -> None:
    rig = Rig()
    assert not rig.run(1.0).any() and not rig.mixer["idle"].holding
    rig.sources.life.liveliness = 1.0
    assert rig.run(1.0).any() and rig.mixer["idle"].holding
    rig.sources.life.liveliness = 0.0
    assert not rig.run(3.0).any() and not rig.mixer["idle"].holding


def test_idle_motion_hears_speech_by_its_jaw(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, heard = Rig(), list[float]()
    rig.sources.life.liveliness = 1.0
    monkeypatch.setattr(rig.sources.life, "update", lambda *_, loudness, **__: heard.append(loudness))
    rig.run(0.02)
    rig.mixer["speech"].write([JAW], [0.7], rig.now_s)
    rig.run(0.02)
    assert heard == [0.0, pytest.approx(0.7)]


def test_blinks_come_back_as_an_expression_that_failed_fades_out(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, heard = Rig(), list[float]()
    rig.sources.life.liveliness = 1.0
    rig.sources.player.play(replace(VOCABULARY["surprise"], blink="block"), 1.0, None, rig.now_s)
    monkeypatch.setattr(rig.sources.life, "update", lambda *_, blink_block, **__: heard.append(blink_block))
    rig.run(2.0)
    assert heard[-1] == 1.0
    monkeypatch.setattr(rig.sources.player, "update", lambda now_s: np.full(len(P), np.nan))
    rig.run(0.4)
    fading = heard[-10:]
    assert fading == sorted(fading, reverse=True) and fading[-1] < 0.9


def test_values_that_are_no_numbers_are_refused() -> None:
    assert require_finite(np.array([0.0, -1.0])).tolist() == [0.0, -1.0]
    for bad in (np.nan, np.inf):
        with pytest.raises(ParameterError, match="finite"):
            require_finite(np.array([0.0, bad]))


def test_breath_and_pupils_go_with_life_and_do_not_jump() -> None:
    rig = Rig()
    rig.run(1.0)
    assert rig.sources.beside.now == (0.0, 0.0)
    rig.sources.life.liveliness, path = 1.0, []
    for k in range(500):
        rig.run(0.02)
        path.append(rig.sources.beside.now)
        if k == 300:
            assert rig.sources.beside.now == rig.sources.life.beside
        if k == 320:
            rig.sources.life.liveliness = 0.0
    assert path[-1] == (0.0, 0.0) and max(rise for rise, _ in path) > 2.9 and max(abs(p) for _, p in path) > 0.02
    assert (np.abs(np.diff(path, axis=0)).max(axis=0) < [0.2401, 0.01201]).all()
