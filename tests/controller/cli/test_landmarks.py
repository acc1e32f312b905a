"""``omote landmarks`` as a user types it: what is searched with which options, and what is said of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from controller.base.paths import find_config
from controller.cli.app import make_app
from controller.cli.console import console
from surface.fit.transfer import pick_landmarks

PICTURE = Path("/" + "long" * 30) / "landmarks.png"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What was asked of the search, on a terminal of 80 columns."""
    calls: list[Any] = []

    def search(mesh: Path, source: Path, out: Path, *, keep: bool, options: Any, progress: Any) -> Any:
        calls.append((mesh, source, out, keep, options.up, options.forward, options.without))
        progress("the face", 0.5)
        marks = {"chin": "found", "nose_tip": "kept", "mouth_left": "found"}
        return {name: SimpleNamespace(how=how) for name, how in marks.items()}, PICTURE

    monkeypatch.setattr(pick_landmarks, "pick_landmarks", search)
    monkeypatch.setattr(console, "width", 80)
    return calls


def test_landmarks_are_listed_by_how_they_were_found_and_paths_are_whole(asked: list[Any]) -> None:
    said = CliRunner().invoke(make_app(), ["landmarks", "scan.ply", "-o", "marks.toml"])
    assert said.exit_code == 0, said.output
    assert asked == [(Path("scan.ply"), find_config("heads", "ict"), Path("marks.toml"), False, None, None, ())]
    assert said.output.splitlines()[-3:] == [
        "found: chin, mouth_left",
        "kept: nose_tip",
        f"wrote marks.toml and {PICTURE}: check the landmarks in the picture",  # in one line, to be copied
    ]


def test_options_reach_the_search(asked: list[Any]) -> None:
    words = ["--keep", "--up", "z", "--forward", "-y", "--without", "hair", "--without", "glasses", "--like", "ict"]
    said = CliRunner().invoke(make_app(), ["landmarks", "scan.ply", "--out", "marks.toml", *words])
    assert said.exit_code == 0, said.output
    assert asked[0][3:] == (True, "z", "-y", ("hair", "glasses"))
