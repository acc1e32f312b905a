"""controller.stage.last: the stage that was shown in a window last."""

from __future__ import annotations

from pathlib import Path

import pytest

from controller.stage.last import VARIABLE, LastStage, last_stage, remember, state_dir


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


def test_the_last_stage_is_kept_with_its_vocabularies_that_are_still_there(tmp_path: Path) -> None:
    stage, mine, gone = (tmp_path / name for name in ("a.toml", "mine.toml", "gone.toml"))
    for path in (stage, mine, gone):
        path.touch()
    assert last_stage() is None
    remember(stage, (mine, gone))
    gone.unlink()
    assert last_stage() == LastStage(stage, (mine,))
    stage.unlink()
    assert last_stage() is None


@pytest.mark.parametrize("text", ["", "[]", '{"stage": 3, "vocabularies": []}', '{"stage": "a"}', "\udcff"])
def test_a_file_that_is_wrong_keeps_nothing(text: str, state: Path) -> None:
    state.mkdir()
    (state / "last.json").write_text(text, errors="surrogateescape")
    assert last_stage() is None


def test_a_folder_that_cannot_be_written_is_no_fault(state: Path, tmp_path: Path) -> None:
    state.touch()
    remember(tmp_path / "a.toml")
    assert last_stage() is None


def test_the_folder_is_the_users_by_the_custom_of_the_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    assert state_dir() == tmp_path / "omote"
