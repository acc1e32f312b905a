"""controller.body.panel_requests"""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body import messages
from controller.body.panel_requests import carry_out
from controller.layers.commands import CommandState


def test_a_learned_expression_is_a_word_of_every_link() -> None:
    state, out = CommandState(PARAMETERS), PARAMETERS.neutral()
    weights = PARAMETERS.neutral()
    weights[PARAMETERS.index("mouthSmileLeft")] = 0.5
    assert carry_out(messages.Learn("smirk", tuple(weights)), state, 1)
    assert "smirk" in state.vocabulary.names and state.vocabulary["Smirk"].name == "smirk"
    assert carry_out(messages.Show("smirk", 1.0), state, 1)
    for tick in range(1, 300):
        state.tick(tick * 10_000_000, 0.01, out)
    assert np.allclose(out, weights, atol=1e-3)


def test_gaze_and_life_are_passed_on() -> None:
    state, out = CommandState(PARAMETERS), PARAMETERS.neutral()
    assert carry_out(messages.LookAt((200.0, 0.0, 500.0)), state, 1)
    for tick in range(1, 100):
        state.tick(tick * 10_000_000, 0.01, out)
    assert out[PARAMETERS.index("leftEyeYaw")] > 0.05
    assert carry_out(messages.LookAt(None), state, 1) and carry_out(messages.Live(0.5), state, 1)
    assert state.status()["life"] == 0.5


def test_what_is_refused_is_logged_and_ends_nothing(caplog: pytest.LogCaptureFixture) -> None:
    state = CommandState(PARAMETERS)
    for request in (messages.Show("nobody", 1.0), messages.PlayShow("tour"), messages.Live(float("nan")),
                    messages.Learn("joy", tuple(PARAMETERS.neutral()))):  # fmt: skip
        caplog.clear()
        assert carry_out(request, state, 1)
        assert "panel: " in caplog.text


def test_servos_stop_and_start() -> None:
    state = CommandState(PARAMETERS)
    assert carry_out(messages.StopServos(), state, 1) and state.stop_latch.stopped is not None
    assert carry_out(messages.StartServos(), state, 1) and state.stop_latch.stopped is None
    assert not carry_out(messages.Stop(), state, 1)
