"""A slider that a synthetic mouse drags in the real window changes the picture, and the servos on a simulated bus."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.controller.panels.window.test_face import on_a_display, shown

STAGE = """
name = "small"
robots = ["head24"]
[face]
size = [640, 480]
quality = "fast"
"""
PROGRAM = """
import json, sys

import numpy as np
from imgui_bundle import hello_imgui, imgui

from controller.body.messages import RunOptions
from controller.panels.window.face import WindowFace
from controller.tools.stage_run import StageRun

NAME, told, real = "##jawOpen", {"frames": 0}, WindowFace._gui
slide, header = imgui.slider_float, imgui.collapsing_header


def noting(label, *words):
    found = slide(label, *words)
    if label == NAME:
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        told["box"] = [low.x, high.x, (low.y + high.y) / 2]
    return found


def opened(label, *words):
    imgui.set_next_item_open(label.endswith("###jaw"))
    return header(label, *words)


imgui.slider_float, imgui.collapsing_header = noting, opened


def servos(panel):
    return {each["name"]: each.get("measured_deg") for each in panel.feed.details.servos}


def picture(face, name):
    face._area.wanted = lambda pixels: told.update({name: pixels.astype(int).copy()})


def act(face):
    panel, n = face._panel, told["frames"]
    io = imgui.get_io()
    if n == 0:
        docking = hello_imgui.get_runner_params().docking_params
        docking.dockable_window_of_name("Sliders").focus_window_at_next_frame = True
    before = servos(panel)
    if "drag" not in told and "box" in told and n > 5 and None not in before.values() and before:
        told["drag"], told["before"] = n, before
        picture(face, "first")
    if "drag" in told:
        low, high, y = told["box"]
        k = n - told["drag"]
        io.add_mouse_button_event(0, 3 <= k < 12)
        io.mouse_pos = imgui.ImVec2(low + (high - low) * (0.1 + 0.08 * min(max(k - 3, 0), 8)), y)
        jaw = face._values.full[panel.sliders._parameters.index("jawOpen")]
        if k > 14 and jaw > 0.5 and "second" not in told and face._area.wanted is None:
            picture(face, "second")
        moved = max(abs(before[each] - told["before"][each]) for each in before)
        if k > 14 and "second" in told and moved > 5.0:
            told["moved"], told["jaw"] = moved, float(jaw)
            face._ended = True
    told["frames"] += 1
    real(face)


WindowFace._gui = act
StageRun(sys.argv[1], RunOptions(), None, {}).run_window(90.0)
change = float(np.abs(told["second"] - told["first"]).mean()) if "second" in told else 0.0
print(json.dumps({"moved": told.get("moved", 0.0), "jaw": told.get("jaw", 0.0), "change": change}))
"""


@pytest.mark.slow
@on_a_display
def test_a_dragged_slider_changes_picture_and_bus(tmp_path: Path) -> None:
    stage = tmp_path / "small.toml"
    stage.write_text(STAGE)
    told = json.loads(shown(PROGRAM, str(stage)).splitlines()[-1])
    assert told["jaw"] > 0.5 and told["moved"] > 5.0 and told["change"] > 0.3
