"""Presets of VRM avatars as parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.presets import Presets

VRM0 = "Neutral Joy Angry Sorrow Fun A I U E O Blink Blink_L Blink_R LookUp LookDown LookLeft LookRight"
VRM1 = "happy angry sad relaxed surprised aa ih ou ee oh blink blinkLeft blinkRight neutral lookUp lookDown"
"""The names in the specifications of VRM 0.x (BlendShapePresetName) and 1.0 (expressions)."""


@pytest.fixture(scope="module")
def presets() -> Presets:
    return Presets.load(P)


@pytest.mark.parametrize("name", [*VRM0.split(), *VRM1.split()])
def test_every_name_of_the_specifications_is_known_in_any_case(presets: Presets, name: str) -> None:
    for spelling in (name, name.lower(), name.upper()):
        assert presets.find(spelling) is not None


@pytest.mark.parametrize(("old", "new"), [("Joy", "happy"), ("Sorrow", "sad"), ("A", "aa"), ("Blink_L", "blinkLeft")])
def test_old_and_new_names_mean_the_same(presets: Presets, old: str, new: str) -> None:
    assert presets.find(old) is presets.find(new)


@pytest.mark.parametrize(
    ("name", "moved", "still"),
    [("Joy", "mouthSmileLeft", "browDownLeft"), ("Angry", "browDownLeft", "mouthSmileLeft"),
     ("Sorrow", "mouthFrownLeft", "mouthSmileLeft"), ("Surprised", "browInnerUp", "mouthFrownLeft"),
     ("A", "jawOpen", "mouthPucker"), ("O", "mouthFunnel", "mouthSmileLeft"), ("U", "mouthPucker", "mouthSmileLeft"),
     ("Blink", "eyeBlinkRight", "jawOpen"), ("Blink_L", "eyeBlinkLeft", "eyeBlinkRight"),
     ("LookLeft", "eyeLookOutLeft", "eyeLookInLeft"), ("LookRight", "eyeLookInLeft", "eyeLookOutLeft")],
)  # fmt: skip
def test_a_preset_moves_what_its_name_says(presets: Presets, name: str, moved: str, still: str) -> None:
    found = presets.find(name)
    assert found is not None
    assert found.weights[P.index(moved)] > 0.1 and found.weights[P.index(still)] < 0.05


def test_neutral_moves_nothing_and_names_of_an_avatar_are_unknown(presets: Presets) -> None:
    neutral = presets.find("Neutral")
    assert neutral is not None and not neutral.weights.any()
    assert presets.find("MTH_Fcl_A") is None


def test_lips_lids_and_looks_are_tracked_and_emotions_are_not(presets: Presets) -> None:
    tracked = {name for name in presets.names if (found := presets.find(name)) and found.tracked}
    assert {*presets.names} - tracked == {"Neutral", "Joy", "Angry", "Sorrow", "Fun", "Surprised"}


def test_every_fault_of_a_file_is_told(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        '[presets.a]\nexpression = "hapiness"\n[presets.b]\nviseme = "zz"\n[presets.c]\nweights = { jawOpn = 1 }\n'
        '[presets.d]\nviseme = "aa"\nexpression = "anger"\n'
    )
    with pytest.raises(ConfigError) as told:
        Presets.load(P, path)
    for part in (
        "presets.a: unknown expression",
        "presets.b: unknown viseme",
        "presets.c.weights.jawOpn",
        "presets.d: give one",
    ):
        assert part in str(told.value)


def test_weights_cannot_be_changed(presets: Presets) -> None:
    found = presets.find("Joy")
    assert found is not None
    with pytest.raises(ValueError, match="read-only"):
        np.add(found.weights, 1.0, out=found.weights)
