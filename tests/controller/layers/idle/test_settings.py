"""Files of idle motion."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.idle.settings import MANNERS, IdleSettings, check_manner
from controller.stage.stage import StageSettings


def test_a_file_needs_only_what_differs_from_the_shipped_one(tmp_path: Path, settings: IdleSettings) -> None:
    path = tmp_path / "own.toml"
    path.write_text("[blink]\ninterval_s = [2.0, 6.0]\n[turn]\nshare = 0.0\n")
    own = IdleSettings.named(str(path), P)
    assert own.blink == settings.blink.model_copy(update={"interval_s": (2.0, 6.0)})
    assert own.turn.share == 0.0 and own.gaze == settings.gaze
    path.write_text("")
    assert IdleSettings.named(str(path), P) == settings


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    wrong_values = "breath = 3\n[blink]\ninterval_s = [6.0, 2.0]\n[head]\nrol_deg = 1.0\n[gaze.wander]\nweight = 1.0\n"
    wrong_names = ("[head]\nrol_deg = 1.0\n[blink]\nalong = { browDwn = 0.1 }\n[fidget]\nparameters = ['mouthPuker']\n"
                   "[smile.poses]\nwarm = { weights = { mouthSmle = 0.2 } }\n")  # fmt: skip
    told = ""
    for text in (wrong_values, wrong_names):
        path.write_text(text)
        with pytest.raises(ConfigError) as caught:
            IdleSettings.named(str(path), P)
        told += str(caught.value)
    for part in (
        "breath: must be a table", "must be [shortest, longest], not [6.0, 2.0]", "head.rol_deg: unknown key",
        "fidget.parameters[0]: unknown parameter 'mouthPuker', did you mean 'mouthPucker'",
        "blink.along.browDwn: unknown parameter, did you mean 'browDown", "gaze.wander.mean_deg: missing",
        "smile.poses.warm.weights.mouthSmle: unknown parameter, did you mean 'mouthSmile",
    ):  # fmt: skip
        assert part in told, part


def test_manners_are_named() -> None:
    assert [check_manner(name) for name in MANNERS] == list(MANNERS)
    assert check_manner("auto") is None and check_manner(None) is None
    with pytest.raises(ParameterError, match="unknown manner 'lisen', did you mean 'listen'"):
        check_manner("lisen")
    field = StageSettings.model_fields["manner"].annotation
    assert set(getattr(field, "__args__", ())) == {"auto", *MANNERS}  # a stage can choose each
