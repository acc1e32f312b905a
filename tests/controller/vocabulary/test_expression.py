"""Files of named expressions."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.expression import read_expressions


def test_a_later_file_mixes_those_before_it(tmp_path: Path) -> None:
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text('[a]\naliases = ["The A"]\nweights = { jawOpen = 0.8 }\n')
    second.write_text("[b]\nof = { a = 0.5 }\n")
    known, aliases = read_expressions(P, (first, second))
    assert list(known) == ["a", "b"] and list(aliases.values()) == ["a"]
    assert known["b"].weights == pytest.approx(known["a"].weights / 2)
    with pytest.raises(ConfigError, match="a"):
        read_expressions(P, (second, first))


def test_weights_cannot_be_written_over(tmp_path: Path) -> None:
    file = tmp_path / "one.toml"
    file.write_text("[a]\nweights = { jawOpen = 0.8 }\n")
    known, _ = read_expressions(P, (file,))
    with pytest.raises(ValueError):
        known["a"].weights[0] = 1.0
