"""Layers as data: what is shipped, and what a stage changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.layers.settings import NEEDED, default_layers, load_layers


def test_the_shipped_layers_are_those_omote_writes() -> None:
    layers = {layer.name: layer for layer in default_layers()}
    assert tuple(layers) == NEEDED
    assert layers["idle"].mode == "add" and layers["capture"].timeout_s == 1.0


def test_a_stage_changes_single_keys_and_adds_layers() -> None:
    changes = {"capture": {"gains": {"brows": 0.5}, "weight": 0.8}, "show": {"priority": 45, "mode": "max"}}
    layers = {layer.name: layer for layer in load_layers(changes)}
    assert layers["capture"].gains == {"brows": 0.5} and layers["capture"].fade_in_s == 0.2
    assert layers["show"].mode == "max"


def test_weights_and_gains_reach_their_limits() -> None:
    for weight, gain in ((0, 0), (1, 4)):
        layers = {layer.name: layer for layer in load_layers({"capture": {"weight": weight, "gains": {"brows": gain}}})}
        assert (layers["capture"].weight, layers["capture"].gains) == (weight, {"brows": gain})


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"capture": {"gain": {}}}, "layers.capture.gain: unknown key"),
        ({"capture": {"gains": {"brow": 0.5}}}, "no region called 'brow', did you mean 'brows'?"),
        ({"capture": {"weight": 2}}, "layers.capture.weight: "),
        ({"capture": {"weight": 1.01}}, "layers.capture.weight: "),
        ({"capture": {"weight": -0.01}}, "layers.capture.weight: "),
        ({"capture": {"gains": {"brows": 4.01}}}, "layers.capture.gains.brows: "),
        ({"capture": {"gains": {"brows": -0.01}}}, "layers.capture.gains.brows: "),
        ({"show": {}}, "layers.show.priority: missing"),
        ({"show": {"priority": 40}}, "layers.show.priority: 40 is that of speech"),
        ({"gaze": {"mode": "mix"}}, "layers.gaze.mode: "),
    ],
)
def test_faults_are_named(changes: dict[str, dict[str, object]], fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_layers(changes, where=Path("stage.toml"))
    assert fault in str(caught.value) and str(caught.value).startswith("stage.toml: 1 fault")
