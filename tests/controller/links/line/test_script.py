"""Scripts of the simulated host."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.links.line.script import Wave, load_script
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)


def test_the_shipped_scripts_are_right(root: Path) -> None:
    paths = sorted((root / "configs" / "scripts").glob("*.toml"))
    scripts = {path.stem: load_script(str(path), P, VOCABULARY) for path in paths}
    assert {"tour", "everything"} <= set(scripts)
    tour = scripts["tour"]
    said = " ".join(line for _, line in tour.steps)
    assert all(
        word in said for word in ("happiness", "sadness", "anger", "surprise", "GAZE", "jawOpen", "NEUTRAL", "SUB")
    )
    assert scripts["everything"].frames_hz >= 60


def test_a_wrong_script_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        "loop = 3\nloop_s = 1.0\nframes_hz = -1\n"
        "marks = { a = 1.0, b = -1 }\n"
        'steps = ["0 PING", "x PING", "2 SET jawOpn 1", "2.5", "3 GAZE 0 0", "1 PING"]\n'
    )
    with pytest.raises(ConfigError) as caught:
        load_script(str(path), P, VOCABULARY)
    text = str(caught.value)
    for part in (
        "8 faults", "marks.b: input should be greater than or equal to 0 (is -1)",
        "loop: unknown key, did you mean 'loop_s'", "steps[1]: begins with a time",
        "steps[2]: unknown parameter 'jawOpn', did you mean 'jawOpen'", "steps[3]: no command",
        "steps[5]: times must rise", "frames_hz: input should be", "loop_s: 1 is before the last step at 3",
    ):  # fmt: skip
        assert part in text
    path.write_text('steps = "0 PING"')
    with pytest.raises(ConfigError, match="steps: input should be a valid list"):
        load_script(str(path), P, VOCABULARY)


def test_scripts_by_name_and_path(tmp_path: Path) -> None:
    assert load_script("tour", P).steps
    path = tmp_path / "own.toml"
    path.write_text('steps = ["0 PING"]')
    assert load_script(str(path), P).name == "own"
    with pytest.raises(ConfigError, match="did you mean 'tour'"):
        load_script("tuor", P)


def test_in_a_wave_every_parameter_moves_every_frame_and_stays_in_range() -> None:
    wave = Wave(P)
    path = np.array([wave.at(i / 60) for i in range(1800)])
    assert np.all(path >= P.low) and np.all(path <= P.high)
    assert np.all(np.abs(np.diff(path, axis=0)).max(axis=0) > 0.003)
    assert np.mean(np.round(path[1:], 4) != np.round(path[:-1], 4)) > 0.98
    assert np.all(np.ptp(path, axis=0) > 0.45)
