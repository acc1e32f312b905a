"""controller.panels.window.drops and looks"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import PlayTake
from controller.panels.session.commands import Commands
from controller.panels.session.jobs import Jobs
from controller.panels.session.problems import Problems
from controller.panels.window.drops import Drops, free_folder
from controller.panels.window.looks import Looks
from controller.stage.stage import FaceSettings, load_stage
from surface.head import Head
from surface.head.model.light import LightPoints


class Window:
    """What gets the files of one window, without the window."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = folder / "stage.toml"
        path.write_text('name = "here"\n[face]\nperson = "maple"\n')
        self.loaded: list[Path] = []
        monkeypatch.setattr("controller.stage.stage.load_head", self._load)
        self.sent: list[Any] = []
        self.problems = Problems()
        self.jobs, self.swapped, self.restarted = Jobs(self.problems), [], []
        self.commands = Commands(self.sent.append)
        self.looks = Looks(load_stage(str(path), PARAMETERS), self._swap, self.jobs)
        self.commands.show_look = self.looks.show
        self.drop = Drops(
            self.looks, self.commands, self.jobs, self.problems, self.sent.append, folder, self.restarted.append
        )

    def _load(self, folder: Path, *_: Any, **__: Any) -> str:
        self.loaded.append(folder)
        return f"the head in {folder.name}"

    def _swap(self, head: Head | None, settings: FaceSettings) -> None:
        self.swapped.append((head, settings.theme, settings.person))

    def take(self, *paths: Path) -> list[str]:
        """Drop files, wait for what they begin, and return what is told."""
        self.problems.dismiss_all()
        self.drop(paths)
        for job in list(self.jobs.running):
            job.join(60.0)
        self.jobs()
        return [problem.text for problem in self.problems.unread]


@pytest.fixture
def window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Window:
    return Window(tmp_path, monkeypatch)


def test_a_take_is_played_and_a_damaged_one_told(window: Window, tmp_path: Path) -> None:
    take, damaged = tmp_path / "a.tsv", tmp_path / "b.tsv"
    take.write_text("0.0\taa\n0.3\tsil\n")
    damaged.write_text("no time\tnothing\n")
    assert window.take(take) == [] and window.sent == [PlayTake(take)]
    (told,) = window.take(damaged)
    assert "b.tsv" in told and len(window.sent) == 1


def test_a_head_is_shown_and_taken_back(window: Window, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(find_config("heads", "ict"), other)
    assert window.take(other) == [] and window.loaded == [other]
    assert window.swapped == [("the head in other", "skin", "")]
    window.commands.undo()
    assert window.take() == [] and window.swapped[-1] == ("the head in ict", "skin", "maple")
    (told,) = window.take(tmp_path)
    assert "no head.toml" in told and "drop a head's folder" in told


def test_a_person_is_shown_and_a_stage_restarts_the_run(window: Window, tmp_path: Path) -> None:
    person = find_config("persons", "oak")
    assert window.take(person) == [] and window.swapped[-1][2] == str(person)
    stage = tmp_path / "next.toml"
    stage.write_text('name = "next"\n')
    assert window.take(stage) == [] and window.restarted == [stage]
    stage.write_text('name = "next"\nhead = "nobody"\n')
    (told,) = window.take(stage)
    assert "nobody" in told and window.restarted == [stage]
    script = tmp_path / "show.toml"
    script.write_text('steps = ["0 EXPR joy"]\n')
    (told,) = window.take(script)
    assert "copy it to" in told


def test_a_mesh_that_is_none_and_other_files_are_told(window: Window, tmp_path: Path) -> None:
    for name, why in (("x.obj", "fitting x.obj failed"), ("x.doc", "nothing here reads such files")):
        (tmp_path / name).write_text("nothing")
        (told,) = window.take(tmp_path / name)
        assert why in told, told
    assert window.swapped == []


def test_only_what_differs_is_loaded(window: Window) -> None:
    look = window.looks.first
    window.commands.set_look(type(look)("skin", "fast", "maple"))
    window.commands.set_look(type(look)("robot", "fast", "maple"))  # without hair
    window.take()
    assert window.swapped[0][0] is None and window.swapped[1] == ("the head in ict", "robot", "maple")
    assert len(window.loaded) == 1


def test_whether_only_added_points_differ_is_told(window: Window, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    monkeypatch.setattr(
        "controller.stage.stage.load_head", lambda *_, light=(), **__: given.append(len(light)) or "a head"
    )
    told: list[bool] = []
    monkeypatch.setattr(window.looks, "_swap", lambda head, face: told.append(window.looks.only_light))

    def wait() -> bool:
        for job in list(window.jobs.running):
            job.join(60.0)
        window.jobs()
        return told[-1]

    one, two = (LightPoints("face", np.arange(5.0)[None] + k, np.arange(5.0)[None]) for k in range(2))
    window.commands.show_light = window.looks.show_light
    window.commands.add_points(one, np.zeros((1, 3)), 10)
    assert wait() and window.looks.shown_light == (one,)
    window.commands.set_look(replace(window.looks.first, person="oak"))
    assert not wait()
    window.commands.add_points(two, np.zeros((1, 3)), 10)
    assert wait() and window.looks.shown_light == (one, two) and given == [1, 1, 2]
    window.looks.load_plain()
    assert given[-1] == 0


def test_a_head_of_a_mesh_has_the_first_number_that_is_free(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        folder = free_folder(tmp_path, "mask")
        assert folder == tmp_path / f"mask-head{number}"
        folder.mkdir()
    assert free_folder(tmp_path, "other") == tmp_path / "other-head1"
