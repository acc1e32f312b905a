"""Files of named expressions."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path
from time import process_time

import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.expression import Expression, read_expressions


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


def test_faults_of_all_files_are_told_at_once(tmp_path: Path) -> None:
    files = [tmp_path / f"{name}.toml" for name in ("first", "good", "last")]
    for file, line in zip(files, ("jawOpn = 1", "jawOpen = 1", "mouthSmle = 1"), strict=True):
        file.write_text(f"[{file.stem}]\nweights = {{ {line} }}\n")
    with pytest.raises(ConfigError) as caught:
        read_expressions(P, files)
    for words in ("first.toml", "jawOpn", "last.toml", "mouthSmle"):
        assert words in str(caught.value)
    assert "good.toml" not in str(caught.value)
    with pytest.raises(ConfigError, match=r"first\.toml") as caught:
        read_expressions(P, files[:2])
    assert "last.toml" not in str(caught.value)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Expression).anything = 1


def test_expressions_that_all_mix_each_other_are_refused_at_once(tmp_path: Path) -> None:
    """160 kB of circles; without a limit to those that are looked for, this takes minutes."""
    names, file = [f"e{i}" for i in range(160)], tmp_path / "circles.toml"
    mixed = ", ".join(f"{name} = 1" for name in names)
    file.write_text("".join(f"[{name}]\nof = {{ {mixed} }}\n" for name in names))
    begin_s = process_time()
    with pytest.raises(ConfigError, match="goes in a circle"):
        read_expressions(P, (file,))
    assert process_time() - begin_s < 5.0


def test_ten_thousand_unknown_names_are_refused_at_once(tmp_path: Path) -> None:
    """Only the first faults are listed, so only theirs get a suggestion, which takes half a millisecond each."""
    file = tmp_path / "names.toml"
    file.write_text("[a]\nweights = { " + ", ".join(f"jawOpem{i} = 1" for i in range(20_000)) + " }\n")
    begin_s = process_time()
    with pytest.raises(ConfigError, match=r"20000 faults\n.*jawOpem0: unknown parameter, did you mean 'jawOpen'"):
        read_expressions(P, (file,))
    assert process_time() - begin_s < 4.0
