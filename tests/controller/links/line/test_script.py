"""Scripts of the simulated host."""

from __future__ import annotations

import json
import os
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.links.line import script
from controller.links.line.script import Script, Wave, load_named_script, load_script, script_names
from controller.vocabulary.vocabulary import Vocabulary
from surface.base.files import read_toml

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


def write(path: Path, command: str = "PING") -> Path:
    path.write_text(f'steps = ["0 {command}"]')
    return path


def test_a_robot_gets_scripts_of_the_stage_and_the_shipped_ones_by_name(tmp_path: Path) -> None:
    stage = tmp_path / "stage.toml"
    write(tmp_path / "own.toml")
    for name in ("own", "own.toml"):
        assert load_named_script(name, P, VOCABULARY, beside=stage).name == "own"
    assert load_named_script("tour", P, VOCABULARY, beside=stage).steps == load_script("tour", P).steps
    assert load_named_script("tour", P, VOCABULARY).steps
    write(tmp_path / "tour.toml")
    assert load_named_script("tour", P, VOCABULARY, beside=stage).steps == ((0.0, "PING"),)
    (tmp_path / "other.toml").symlink_to(tmp_path / "own.toml")
    assert load_named_script("other", P, VOCABULARY, beside=stage).steps


@pytest.mark.parametrize("name", ["/etc/voice.wav", "../voice.wav", "sub/../../voice.wav", "", "a\0b"])
def test_the_sound_of_a_script_lies_beside_it(tmp_path: Path, name: str) -> None:
    path = tmp_path / "s.toml"
    path.write_text(f'sound = {json.dumps(name)}\nsteps = ["0 NEUTRAL"]\n')
    with pytest.raises(ConfigError, match="sound: must be a file in the folder of the script or below"):
        load_script(str(path), P, VOCABULARY)


def test_a_robot_gets_no_other_file(tmp_path: Path) -> None:
    folder = tmp_path / "stage"
    folder.mkdir()
    (folder / "sub").mkdir()
    for path in (tmp_path / "outside.toml", folder / "sub" / "inside.toml", folder / ".hidden.toml"):
        write(path)
    (folder / "away.toml").symlink_to(tmp_path / "outside.toml")
    (folder / "folder.toml").mkdir()
    os.mkfifo(folder / "pipe.toml")
    names = [str(tmp_path / "outside.toml"), "/etc/passwd", "../outside", "../outside.toml", "sub/inside", "..", ".",
             ".hidden", "away", "away.toml", "folder", "pipe", "", "a" * 300, "a" * 101, "a\0b", "a\nb", "..\\outside",
             "~root", "nothing"]  # fmt: skip
    for name in names:
        with pytest.raises(ConfigError, match="no script"):
            load_named_script(name, P, VOCABULARY, beside=folder / "stage.toml")
    with pytest.raises(ConfigError, match="did you mean 'tour'"):
        load_named_script("tuor", P, VOCABULARY)


def test_in_a_wave_every_parameter_moves_every_frame_and_stays_in_range() -> None:
    wave = Wave(P)
    path = np.array([wave.at(i / 60) for i in range(1800)])
    assert np.all(path >= P.low) and np.all(path <= P.high)
    assert np.all(np.abs(np.diff(path, axis=0)).max(axis=0) > 0.003)
    assert np.mean(np.round(path[1:], 4) != np.round(path[:-1], 4)) > 0.98
    assert np.all(np.ptp(path, axis=0) > 0.45)


def test_a_wave_at_known_times() -> None:
    wave, yaw = Wave(P), P.index("headYaw")
    assert wave.at(0.0)[0] == 0.0  # every unit wave goes from 0 to 0.5
    assert wave.at(1.0)[0] == pytest.approx(0.25) and wave.at(2.0)[0] == pytest.approx(0.5)
    path = np.array([wave.at(i / 50) for i in range(4000)])
    assert path[:, 0].max() == pytest.approx(0.5, abs=1e-3) and path[:, 0].min() == pytest.approx(0.0, abs=1e-3)
    assert path[:, yaw].max() == pytest.approx(0.4, abs=1e-3) and path[:, yaw].min() == pytest.approx(-0.4, abs=1e-3)
    turns = np.count_nonzero(np.diff(np.sign(np.diff(path, axis=0)), axis=0), axis=0) / 2 / 80
    assert turns[0] == pytest.approx(0.25, abs=0.02)  # Hz
    assert turns[1] == pytest.approx(0.25 + 0.5 * 0.618, abs=0.02)
    assert np.all((turns > 0.23) & (turns < 0.77)) and len(set(np.round(turns, 2))) > 20
    assert wave.at(0.0)[1] == pytest.approx(0.25 - 0.25 * np.cos(2 * np.pi * 0.7548776662))


def test_a_script_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        "loop_s = 2\nframes_hz = 200\nmarks = { end = 2 }\ndescription = 'd'\n"
        "steps = ['0 PING', ' 1.5  SET jawOpen 1 ', '1.5 EXPR smirk', '2 NEUTRAL']\n"
    )
    more = tmp_path / "more.toml"
    more.write_text("[smirk]\nweights = { mouthSmileLeft = 0.7 }\n")
    script = load_script("own.toml", P, Vocabulary.load(P, more=[more]), beside=tmp_path / "stage.toml")
    assert script.steps == ((0.0, "PING"), (1.5, "SET jawOpen 1"), (1.5, "EXPR smirk"), (2.0, "NEUTRAL"))
    assert (script.loop_s, script.frames_hz, script.marks, script.name) == (2.0, 200.0, {"end": 2.0}, "own")
    path.write_text("name = 'other'\nsteps = ['0 PING']")
    script = load_script(str(path), P)
    assert (script.name, script.loop_s, script.frames_hz, script.marks) == ("other", 0.0, 0.0, {})


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("steps = ['inf PING']", "steps[0]: begins with a time in seconds"),
        ("steps = ['1_0 PING']", "steps[0]: begins with a time in seconds"),
        ("steps = ['0 START']", "steps[0]: START is not for scripts"),
        ("steps = ['-1 PING']", "steps[0]: times must rise from 0"),
        ("steps = ['0 EXPR smirk']", "steps[0]: unknown expression 'smirk'"),
        ("steps = [1]", "steps[0]: input should be a valid string (is 1)"),
        ("frames_hz = 201", "frames_hz: input should be less than or equal to 200 (is 201)"),
        ("loop_s = 86401", "loop_s: input should be less than or equal to 86400"),
        ("marks.a = 'x'", "marks.a: input should be a valid number (is 'x')"),
        ("marks = 3", "marks: must be a table (is 3)"),
        ("loop_s = 1\nsteps = ['1.01 PING']", "loop_s: 1 is before the last step at 1.01"),
    ],
)
def test_one_fault_is_named_with_its_place(tmp_path: Path, text: str, fault: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_script(str(path), P, VOCABULARY)
    assert fault in str(caught.value) and ": 1 fault" in str(caught.value)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Script).anything = 1


def test_the_names_that_a_robot_may_play_are_those_of_scripts(tmp_path: Path) -> None:
    for name, text in {"mine": 'steps = ["0 NEUTRAL"]', "stage": 'name = "s"', "broken": "steps = ["}.items():
        (tmp_path / f"{name}.toml").write_text(text)
    (tmp_path / "two words.toml").write_text('steps = ["0 NEUTRAL"]')
    (tmp_path / "away.toml").symlink_to("/etc/hostname")
    shipped = script_names()
    assert "tour" in shipped and script_names(tmp_path / "stage.toml") == sorted([*shipped, "mine"])
    assert all(load_named_script(name, P, beside=tmp_path / "stage.toml") for name in shipped)


def test_names_follow_files_that_change_and_read_no_others_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    monkeypatch.setattr(script, "read_toml", lambda path: read.append(path.name) or read_toml(path))
    beside, mine = tmp_path / "stage.toml", tmp_path / "mine.toml"
    mine.write_text('steps = ["0 NEUTRAL"]')
    (tmp_path / "other.toml").write_text('steps = ["0 NEUTRAL"]')
    assert {"mine", "other"} <= set(script_names(beside)) and {"mine.toml", "other.toml"} <= set(read)
    read.clear()
    assert "mine" in script_names(beside) and not read
    mine.write_text('name = "no script any more"')
    assert "mine" not in script_names(beside) and read == ["mine.toml"]
    mine.unlink()
    assert "mine" not in script_names(beside)


def test_a_robot_gets_a_script_as_its_file_is_now_and_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[Path] = []
    load = script._load
    monkeypatch.setattr(script, "_load", lambda path, *others: read.append(path) or load(path, *others))
    beside, own = tmp_path / "stage.toml", write(tmp_path / "own.toml")
    (tmp_path / "link.toml").symlink_to(own)
    for name in ("own", "link"):
        first = load_named_script(name, P, VOCABULARY, beside=beside)
        assert load_named_script(name, P, VOCABULARY, beside=beside) is first
    assert read == [own, tmp_path / "link.toml"]
    write(own, "STATUS now")
    for name in ("own", "link"):
        with pytest.raises(ConfigError, match="STATUS"):
            load_named_script(name, P, VOCABULARY, beside=beside)
    write(own, "NEUTRAL")
    assert load_named_script("link", P, VOCABULARY, beside=beside).steps == ((0.0, "NEUTRAL"),)
    own.rename(tmp_path.parent / "moved.toml")
    own.symlink_to(tmp_path.parent / "moved.toml")
    for name in ("own", "link"):
        with pytest.raises(ConfigError, match="no script"):
            load_named_script(name, P, VOCABULARY, beside=beside)
