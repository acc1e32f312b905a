"""The window with its panel, under a virtual display: it draws, obeys its time and leaves the servos limp."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    shutil.which("xvfb-run") is None, reason="needs xvfb-run (apt-get install xvfb): a display to open a window on"
)


STAGE = """
name = "small"
robots = ["head24"]
[face]
size = [320, 240]
quality = "fast"
"""


def shown(program: str, *words: str) -> str:
    """What a Python program writes that opens its window on a virtual display."""
    command = ["xvfb-run", "-a", sys.executable, "-c", program, *words]
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_a_run_with_a_window_draws_and_reports(tmp_path: Path) -> None:
    report, stage = tmp_path / "r.json", tmp_path / "small.toml"
    stage.write_text(STAGE)
    program = "from controller.cli.app import main; main()"
    shown(program, "run", str(stage), "--seconds", "1", "--report", str(report))
    measured = json.loads(report.read_text())
    assert measured["face"]["renderer"] == "window"
    assert measured["face"]["frames"] > 0
    assert measured["buses"][0]["bus"]["writes"] > 0


DRAG = """
import json

import numpy as np
from controller.face.face import HeadValues
from controller.face.point_editing import Screen
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.stage.stage import FaceSettings, load_stage
from controller.face.window import WindowFace
from surface.view.scene.camera import Camera

CORNER, BY = np.array([[28.6, -34.0, 102.0]]), -2.0  # the left corner of the mouth
stage = load_stage("demo", P)
head = stage.load_head()
told, frames = {}, [0]


def send(request):
    told[P.names[request.index]] = request.value


with Mailbox.create(len(P)) as mailbox:
    values = HeadValues(mailbox, P, head.parameters)
    face = WindowFace(head, FaceSettings(size=(320, 240), quality="fast"), values, send, None, stage.load_head)
    face._mouse.editor.prepare()
    face._mouse.editor._thread.join(60.0)
    assert face._mouse.editor.ready
    panel = face._panel

    def act():
        panel()
        from imgui_bundle import imgui

        io = imgui.get_io()
        n = frames[0] = frames[0] + 1
        n %= 24  # twice: parameters, then with Shift control points
        io.add_key_event(imgui.Key.mod_ctrl, 2 <= n < 22)
        io.add_key_event(imgui.Key.mod_shift, frames[0] >= 24)
        screen = Screen(Camera.front(), (io.display_size.x, io.display_size.y))
        x, y, _ = screen.project(CORNER)[0].tolist()
        io.mouse_pos = imgui.ImVec2(x, y + BY * max(0, min(n - 8, 8)))
        io.add_mouse_button_event(0, 6 <= n < 20)

    face._panel = act
    face.run(lambda: frames[0] < 46)
    print(json.dumps({**told, "reshaped": face._mouse.editor.sculpted}))
"""


def test_points_are_dragged_with_the_mouse() -> None:
    told = json.loads(shown(DRAG))
    assert told["mouthSmileLeft"] > 0.1 and told["mouthSmileLeft"] > 3 * told.get("mouthSmileRight", 0.0)
    assert told["reshaped"] is True
