"""Files of controls: the shipped ones are right, and what is wrong in others is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import config_dir
from controller.tools.check import check_anything
from controller.vocabulary.controls import load_controls


def test_the_shipped_table_of_midi_has_every_parameter() -> None:
    found = load_controls(config_dir() / "controls" / "midi.toml", P)
    assert {*found.controllers} == {*P.names} and found.controllers["jawOpen"] == 1


@pytest.mark.parametrize(("name", "says"), [("midi", "59 controllers"), ("gamepad", "6 axes, 9 buttons"),
                                            ("keyboard", "15 keys")])  # fmt: skip
def test_omote_check_knows_them(name: str, says: str) -> None:
    assert check_anything(str(config_dir() / "controls" / f"{name}.toml")) == [f"controls {name}.toml: {says}: good"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[controllers]\njawOpn = 1", "controllers.jawOpn: unknown parameter, did you mean 'jawOpen'"),
        ("[controllers]\njawOpen = 1\ntongueOut = 1", "1 moves two parameters"),
        ("[controllers]\njawOpen = 120", "less than or equal to 119"),
        ("[axes]\nleft = { headYaw = 1 }", "axes.left: no axis; there are left_x"),
        ("[axes]\nleft_x = { headYaw = 2 }", "less than or equal to 1"),
        ('[buttons]\nz = "smile"', "buttons.z: no button"),
        ('[buttons]\na = "smil"', "did you mean 'smile'"),
        ("[keys]\na = { jawOpn = 1 }", "keys.a.jawOpn: unknown parameter"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_controls(path, P)
    assert told in str(caught.value)
