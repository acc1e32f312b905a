"""Anchors that are made by pulling at the skin: what is written, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.config import read_toml
from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS
from controller.panels.session.own_anchors import save_anchor
from controller.robot.robot import load_robot

PLACE = np.array([20.123, -38.456, 81.987])


def test_a_pulled_point_becomes_the_landmark_and_anchor_of_a_servo(tmp_path: Path) -> None:
    path = tmp_path / "corner.toml"
    save_anchor(path, "corner", PLACE, np.array([0.0, 3.0, 4.0]), PARAMETERS)
    table = read_toml(path)
    assert table["landmarks"] == {"corner": [20.12, -38.46, 81.99]}
    (channel,) = table["channels"]
    assert channel["anchor"] == {"point": "corner", "direction": [0.0, 0.6, 0.8], "reach_mm": 25.0}
    assert channel["map"] == {"at": [0.0, 5.0], "deg": [0.0, 30.0]}  # pulled as far, it stands at its end
    assert channel["limit_deg"] == [-5.0, 35.0]
    assert [each.name for each in load_robot(path, PARAMETERS).channels] == ["corner"]
    assert path.read_text().startswith("# ")


@pytest.mark.parametrize(("far_mm", "pulled"), [(0.99, False), (1.0, True)])
def test_a_point_that_was_hardly_pulled_is_no_anchor(far_mm: float, pulled: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    if pulled:
        save_anchor(path, "a", PLACE, np.array([far_mm, 0.0, 0.0]), PARAMETERS)
    else:
        with pytest.raises(ParameterError, match="no point was pulled"):
            save_anchor(path, "a", PLACE, np.array([far_mm, 0.0, 0.0]), PARAMETERS)
    assert path.exists() == pulled


def test_a_file_that_is_there_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("mine")
    with pytest.raises(ParameterError, match="there is such a file"):
        save_anchor(path, "a", PLACE, np.array([5.0, 0.0, 0.0]), PARAMETERS)
    assert path.read_text() == "mine"
