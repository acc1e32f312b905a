"""controller.panels.session.own_expressions"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.panels.session.own_expressions import save_expression
from controller.vocabulary.vocabulary import Vocabulary


@pytest.fixture
def smirk() -> np.ndarray:
    values = PARAMETERS.neutral()
    values[PARAMETERS.index("mouthSmileLeft")] = 0.61239
    values[PARAMETERS.index("headYaw")] = -0.25
    values[PARAMETERS.index("jawOpen")] = 0.001
    return values


def test_an_expression_is_written_and_read_again(tmp_path: Path, smirk: np.ndarray) -> None:
    path, known = tmp_path / "mine.toml", Vocabulary.load(PARAMETERS)
    weights = save_expression(path, "smirk", smirk, known, PARAMETERS)
    assert weights[PARAMETERS.index("mouthSmileLeft")] == 0.612 and np.count_nonzero(weights) == 2
    assert (Vocabulary.load(PARAMETERS, more=[path])["smirk"].weights == weights).all()
    before = path.read_text() + "# a comment of the user\n"
    path.write_text(before)
    save_expression(path, "smirk2", smirk, known, PARAMETERS)
    assert path.read_text().startswith(before.rstrip())
    assert {"smirk", "smirk2"} <= set(Vocabulary.load(PARAMETERS, more=[path]).names)


@pytest.mark.parametrize("name", ["", "two words", "1st", "Anger", "a" * 65, "x]\n[y"])
def test_a_name_that_no_line_can_have_or_that_is_taken_is_refused(tmp_path: Path, smirk: np.ndarray, name: str) -> None:
    with pytest.raises(ParameterError, match=r"cannot be a name|already"):
        save_expression(tmp_path / "mine.toml", name, smirk, Vocabulary.load(PARAMETERS), PARAMETERS)
    assert not list(tmp_path.iterdir())


def test_a_neutral_face_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="neutral"):
        save_expression(tmp_path / "m.toml", "x", PARAMETERS.neutral(), Vocabulary.load(PARAMETERS), PARAMETERS)


def test_a_file_that_is_wrong_stays_as_it_is(tmp_path: Path, smirk: np.ndarray) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[odd]\nweights = { nose = 3 }\n")
    with pytest.raises(ConfigError, match=r"mine\.toml"):
        save_expression(path, "smirk", smirk, Vocabulary.load(PARAMETERS), PARAMETERS)
    assert path.read_text() == "[odd]\nweights = { nose = 3 }\n" and [p.name for p in tmp_path.iterdir()] == [
        "mine.toml"
    ]
