"""Files that another program drops on the window by the X protocol: a take, a head, a mesh, a stage, none of these."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from controller.base.paths import find_config
from tests.controller.panels.window.test_face import on_a_display, shown
from tests.hands import Hands, Steps, run_script

STAGE = 'name = "{name}"\n[face]\nsize = [640, 480]\nquality = "fast"\n'
PROGRAM = "from tests.controller.panels.window.test_real_drops import main; main()"


def drop(hands: Hands, path: Path) -> Steps:
    """Drag a file over the window and let it go, from another program."""
    program = subprocess.Popen([sys.executable, "-m", "tests.xdnd", str(path)], stderr=subprocess.PIPE, text=True)
    yield from hands.until(lambda: program.poll() is not None, f"{path.name} to be taken", 60.0)
    assert program.returncode == 0, program.communicate()[1]
    yield from hands.frames(3)


def script(hands: Hands) -> Steps:
    yield from hands.frames(10)
    panel, first, folder = hands.face._panel, hands.face._head, hands.folder
    jaw = panel._options.parameters.index("jawOpen")
    yield from drop(hands, folder / "a.tsv")
    yield from hands.until(lambda: hands.face._values.full[jaw] > 0.1, "the take on the face")
    yield from drop(hands, folder / "head")
    yield from hands.until(lambda: hands.face._head is not first, "the dropped head")
    hands.report["head"] = str(panel.commands.now.look.head)
    yield from drop(hands, folder / "m.obj")
    hands.report["jobs"] = [job.title for job in panel.jobs.running]
    yield from hands.click("cancel##fitting m.obj")
    yield from hands.until(lambda: not panel.jobs.running, "the end of the cancelled job")
    yield from drop(hands, folder / "nothing.doc")
    hands.report["problems"] = [each.text for each in panel.problems.unread]
    yield from drop(hands, folder / "other.toml")
    yield from hands.until(lambda: hands.report["windows"] == 2, "the dropped stage")
    yield from hands.frames(5)


def main() -> None:
    """Run in the process of the window."""
    run_script(script, "run", "stage.toml", "--seconds", "200")


@pytest.mark.slow
@on_a_display
def test_what_another_program_drops_on_the_window_is_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("stage", "other"):
        (tmp_path / f"{name}.toml").write_text(STAGE.format(name=name))
    (tmp_path / "a.tsv").write_text("0.0\taa\n60.0\tsil\n")
    (tmp_path / "nothing.doc").write_text("nothing")
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    shutil.copytree(find_config("heads", "ict"), tmp_path / "head")
    monkeypatch.setenv("OMOTE_TEST_FOLDER", str(tmp_path))
    monkeypatch.setenv("OMOTE_STATE", str(tmp_path / "state"))
    shown(PROGRAM)
    told = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert told["windows"] == 2 and told["head"] == str(tmp_path / "head")
    assert told["jobs"] == ["fitting m.obj"]
    (problem,) = told["problems"]  # of the last file alone: what is cancelled is no problem
    assert "nothing.doc: nothing here reads such files" in problem and "drop a head's folder" in problem
    kept = (tmp_path / "state" / "last.json").read_text(encoding="utf-8")
    assert "other.toml" in kept  # a run without a name goes on with it
