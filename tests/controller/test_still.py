"""What the words of ``omote render`` mean, and what is wrong with wrong ones."""

from __future__ import annotations

import numpy as np
import pytest

from controller.errors import ParameterError
from controller.parameters import PARAMETERS
from controller.still import for_head, parse_setting, parse_size, sheet_poses


def test_a_setting_names_a_parameter_in_any_spelling() -> None:
    jaw = PARAMETERS.index("jawOpen")
    assert parse_setting("jawOpen=0.8") == (jaw, 0.8)
    assert parse_setting("JawOpen=1") == (jaw, 1.0)
    assert parse_setting("headYaw=-1")[1] == -1.0


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("jawOpen", "expected NAME=VALUE"),
        ("jawOpn=1", "did you mean 'jawOpen'"),
        ("jawOpen=1.2", "jawOpen goes from 0 to 1"),
        ("headYaw=-1.1", "headYaw goes from -1 to 1"),
        ("jawOpen=wide", "'wide' is not a number"),
        ("jawOpen=nan", "'nan' is not a number"),
        ("jawOpen=", "'' is not a number"),
    ],
)
def test_a_wrong_setting_is_told(word: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        parse_setting(word)


def test_sizes() -> None:
    assert parse_size("1280x720") == (1280, 720)
    for wrong in ("800", "0x800", "800x", "axb", "8x8", "99999x100", "-1x5"):
        with pytest.raises(ParameterError, match="WIDTHxHEIGHT"):
            parse_size(wrong)


def test_the_sheet_shows_every_end_of_every_parameter() -> None:
    poses = sheet_poses()
    labels = [label for label, _ in poses]
    assert len(set(labels)) == len(labels)
    reached = np.array([values for _, values in poses])
    assert (reached.min(axis=0) == PARAMETERS.low).all()
    assert (reached.max(axis=0) == PARAMETERS.high).all()


def test_values_reach_a_head_in_its_own_order() -> None:
    values = np.arange(len(PARAMETERS.names), dtype=float)
    wanted = ("jawOpen", "somethingElse", "eyeBlinkLeft")
    assert for_head(values, wanted).tolist() == [PARAMETERS.index("jawOpen"), 0.0, PARAMETERS.index("eyeBlinkLeft")]
