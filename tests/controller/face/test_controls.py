"""What sticks, buttons and keys ask for, with states that no device gave."""

from __future__ import annotations

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import config_dir
from controller.body.messages import Hold, PanelRequest, Show
from controller.face.controls import Controls
from controller.vocabulary.controls import ControlsFile, load_controls

JAW, YAW = P.index("jawOpen"), P.index("headYaw")


def asked(controls: Controls, *, buttons: tuple[str, ...] = (), keys: tuple[str, ...] = (), **axes: float
          ) -> list[PanelRequest]:  # fmt: skip
    return list(controls.update(axes, buttons, keys))


def of(**tables: object) -> Controls:
    return Controls([ControlsFile.model_validate(tables)], P)


def test_a_stick_holds_its_parameter_and_gives_it_back() -> None:
    controls = of(dead_zone=0.2, axes={"left_x": {"headYaw": -1.0}})
    assert asked(controls, left_x=0.1) == []
    assert asked(controls, left_x=0.6) == [Hold(YAW, pytest.approx(-0.5))]  # type: ignore[arg-type]
    assert asked(controls, left_x=0.6) == []
    assert asked(controls, left_x=-5.0) == [Hold(YAW, 1.0)]
    assert asked(controls, left_x=0.0) == [Hold(YAW, None)]
    assert asked(controls) == []


def test_what_moves_one_parameter_twice_is_added_and_kept_in_range() -> None:
    controls = of(axes={"right_trigger": {"jawOpen": 0.5}}, keys={"j": {"jawOpen": 0.75}})
    assert asked(controls, right_trigger=1.0) == [Hold(JAW, 0.5)]
    assert asked(controls, right_trigger=1.0, keys=("j",)) == [Hold(JAW, 1.0)]
    assert asked(controls, keys=("j",)) == [Hold(JAW, 0.75)]


def test_a_button_shows_an_expression_once_when_it_goes_down() -> None:
    controls = of(buttons={"a": "smile", "b": {"mouthPucker": 1.0}}, keys={"a": "anger"})
    assert asked(controls, buttons=("a",)) == [Show("smile", 1.0)]
    assert asked(controls, buttons=("a",)) == []
    assert asked(controls) == []
    assert asked(controls, buttons=("a", "b", "guide")) == [Show("smile", 1.0), Hold(P.index("mouthPucker"), 1.0)]
    assert asked(controls, keys=("a",)) == [Show("anger", 1.0), Hold(P.index("mouthPucker"), None)]


def test_a_name_without_a_side_means_both() -> None:
    held = asked(of(keys={"b": {"eyeBlink": 1.0}}), keys=("b",))
    assert held == [Hold(P.index("eyeBlinkLeft"), 1.0), Hold(P.index("eyeBlinkRight"), 1.0)]


def test_the_shipped_files_count_together() -> None:
    files = [load_controls(config_dir() / "controls" / f"{name}.toml", P) for name in ("gamepad", "keyboard")]
    controls = Controls(files, P)
    assert "left_arrow" in controls.keys
    assert asked(controls, keys=("h",), buttons=("b",)) == [Show("anger", 1.0), Show("happiness", 1.0)]
