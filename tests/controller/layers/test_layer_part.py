"""Sources of layers that fail while a face is computed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.layers.settings import default_layers

STEP_NS = 10_000_000
SMILE, YAW, LID = P.index("mouthSmileLeft"), P.index("headYaw"), P.index("eyeBlinkLeft")


class Face:
    """A face that lives, looks aside and smiles, with its own clock."""

    def __init__(self) -> None:
        self.state, self.now, self.values = CommandState(P), 10**9, P.neutral()
        self.state.live(1.0, self.now)
        self.state.gaze(0.8, 0.1, self.now)
        self.state.expression("happiness", 1.0, None, self.now)
        self.run(2.0)

    def run(self, seconds: float) -> np.ndarray:
        """(n, P) every tick."""
        path = []
        for _ in range(round(seconds * 100)):
            self.now += STEP_NS
            self.state.tick(self.now, 0.01, self.values)
            path.append(self.values.copy())
        return np.array(path)


def fail(*_: Any, **__: Any) -> Any:
    raise ZeroDivisionError("division by zero")


def nan_values(*_: Any, **__: Any) -> Any:
    return np.full(6, math.nan)


CASES = [("idle motion", "life", "idle"), ("gaze", "gaze", "gaze"), ("expressions", "player", "expression")]


@pytest.mark.parametrize("how", [fail, nan_values])
@pytest.mark.parametrize(("name", "source", "layer"), CASES)
def test_a_source_that_fails_lets_its_layer_fade_and_begins_again(
    name: str, source: str, layer: str, how: Any, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    face = Face()
    old = getattr(face.state._sources, source)
    if how is nan_values and source == "life":
        monkeypatch.setattr(old._sway, "_phases", np.full((3, 3), math.nan))  # all that is computed of it is no number
    else:
        monkeypatch.setattr(old, "update", how)
    path = face.run(0.9)
    assert len(caplog.messages) == 1 and caplog.messages[0].startswith(f"{name} failed: ")
    assert "its layer fades out; it starts again in 1 s" in caplog.messages[0]
    assert np.isfinite(path).all()
    assert np.abs(np.diff(path, axis=0)).max() <= (P.max_speed * 0.01).max() * (1 + 1e-9)
    assert face.state.mixer[layer].level == 0.0
    assert face.state.status()["failed"] == name.replace(" ", "_")
    ticks = face.state.status()["ticks"]
    face.run(1.5)
    assert face.state.status()["ticks"] == ticks + 150
    assert getattr(face.state._sources, source) is not old
    assert face.state.status()["failed"] == "none" and caplog.messages[1:] == [f"{name} works again"]


def test_a_layer_fades_evenly_and_is_not_cut() -> None:
    face = Face()
    face.state._sources.player.update = fail  # type: ignore[method-assign]
    levels = []
    for _ in range(60):
        face.run(0.01)
        levels.append(face.state.mixer["expression"].level)
    steps = -np.diff(levels)
    assert levels[-1] == 0.0 and 0.0 < steps.max() < 0.05  # over 0.4 s


def test_what_an_expression_held_back_comes_back_as_it_fades(monkeypatch: pytest.MonkeyPatch) -> None:
    face = Face()
    face.state._sources._blocks = (0.0, 1.0, 1.0)
    monkeypatch.setattr(face.state._sources.player, "update", fail)
    held = []
    for _ in range(60):
        face.run(0.01)
        held.append(float(face.state._sources._looking._block[0]))
    assert held[0] < 0.1 and held[-1] == 1.0 and np.diff(held).max() < 0.05


@pytest.mark.slow
def test_a_source_that_never_works_is_switched_off_and_the_others_go_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    face = Face()
    monkeypatch.setattr("controller.layers.gaze.Gaze.update", fail)
    for _ in range(12):
        face.state.gaze(0.8, 0.1, face.now)
        face.run(4.0)
    assert len(caplog.messages) <= 11 and "switched off" in caplog.messages[-1]
    assert face.values[SMILE] > 0.8 and abs(face.values[YAW]) < 0.2
    assert face.run(8.0)[:, LID].max() > 0.3  # it blinks
    assert face.state.parts.report()[0]["state"] == "switched off"


def test_a_source_begins_again_only_when_its_layer_has_faded_out(monkeypatch: pytest.MonkeyPatch) -> None:
    face = Face()
    slow = [replace(each, fade_out_s=4.0) for each in default_layers()]
    face.state = CommandState(P, layers=slow)
    face.state.expression("happiness", 1.0, None, face.now)
    face.run(1.0)
    monkeypatch.setattr(face.state._sources.player, "update", fail)
    smiles = face.run(6.0)[:, SMILE]
    assert -np.diff(smiles).min() < 0.01 and smiles[-1] < 1e-6  # a new source would set it to neutral after 1 s
