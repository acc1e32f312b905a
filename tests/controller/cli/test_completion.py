"""controller.cli.completion: what a shell is told when a person presses the tabulator key."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS
from controller.cli import completion
from controller.cli.check import checkable

PROGRAM = "import sys; sys.argv = ['omote']; from controller.cli.app import main; main()"


def completed(line: str) -> list[str]:
    """What bash is given for the last word of a line."""
    env = {**os.environ, "_OMOTE_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=env, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


@pytest.mark.slow
def test_a_shell_completes_commands_and_names() -> None:
    assert completed("omote simulate mae") == ["maestro"]
    assert completed("omote render --set jawO") == ["jawOpen="]


def test_the_script_for_a_shell_is_shown() -> None:
    command = [sys.executable, "-c", "from controller.cli.app import main; main()", "--show-completion", "zsh"]
    env = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}  # it asks for the tests' own shell
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "compdef" in done.stdout


def test_names_come_from_what_is_installed() -> None:
    assert completion.names_of("stages")("de") == ["demo"]
    assert completion.names_of("robots")("head24") == ["head24", "head24-anchors"]
    assert checkable("de") == ["demo"] and "ict" in checkable("")
    assert completion.settings("jawO") == ["jawOpen="]
    assert len(completion.settings("")) == len(PARAMETERS.names)
    assert completion.expressions("happ") == ["happiness"]
    assert completion.identities("br") == ["broad="]
    assert "xl330-m288" in completion.models("xl330")


def test_a_damaged_installation_completes_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("OMOTE_CONFIGS", str(tmp_path))
    assert completion.names_of("stages")("") == []
