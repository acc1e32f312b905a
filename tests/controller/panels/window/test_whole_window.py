"""The window with all of its panel under a virtual display: clicks, keys and dropped files change the picture."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.controller.panels.window.test_face import on_a_display, shown

PROGRAM = """
import json, sys
from pathlib import Path

import numpy as np
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.messages import AskDetails, Details, HoldAll, PlayTake, StopServos
from controller.face.face import HeadValues
from controller.panels.window.face import WindowFace
from controller.panels.window.panel import PanelOptions
from controller.stage.stage import load_stage, with_picture
from controller.takes.timeline import Key
from imgui_bundle import imgui

folder, width, height, pictures = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), len(sys.argv) > 4
stage = with_picture(load_stage("demo", P), {"quality": "fast", "person": ""})
face_settings = stage.settings.face.model_copy(update={"size": (width, height)})
stage = type(stage)(**{**vars(stage), "settings": stage.settings.model_copy(update={"face": face_settings})})
servo = {"bus": "head", "name": "jawOpen", "model": "xl330-m288", "low_deg": -10.0, "high_deg": 30.0, "error": "",
         "temperature_c": 31.0, "torque": True}
details = Details([{**servo, "id": i, "name": f"servo{i}", "wanted_deg": i, "measured_deg": i - 1} for i in range(24)],
                  [{"name": "line /dev/ttyACM0", "connected": True, "rate_hz": 30.0, "jitter_ms": 1.2, "age_s": 0.02,
                    "accepted": 7}], [{"name": "head", "running": True, "fault": ""}])
sent, told = [], {}


def grab(name):
    if pictures:
        from PIL import ImageGrab
        ImageGrab.grab().save(folder / f"{name}.png")


def press(key, down):
    imgui.get_io().add_key_event(key, down)


def act():
    step, state = told.setdefault("frame", 0), face._panel
    told["frame"] += 1
    told["picture"] = [face._area.width, face._area.height]
    actions = {
        3: lambda: focus("Servos"), 4: lambda: state.servos.toggle("head/3 servo3"), 8: lambda: grab("servos"),
        9: lambda: focus("Links"), 12: lambda: grab("links"),
        13: lambda: keys(state), 14: lambda: focus("Time"), 17: lambda: grab("timeline"),
        18: lambda: state.playback.scrub(0.5), 19: lambda: state.playback.stop(),
        20: lambda: face._overlays.switch("control points", on=True), 21: lambda: wait(state),
        22: lambda: focus("View"), 25: lambda: grab("overlays"), 26: lambda: drop("a.tsv"), 27: lambda: wait(state),
        28: lambda: drop("nothing.doc"), 30: lambda: grab("problem"), 31: lambda: look(state, theme="robot"),
        32: lambda: wait(state), 34: lambda: look(state, person="oak", theme="skin"), 35: lambda: wait(state),
        38: lambda: grab("oak"), 39: lambda: press(imgui.Key.f, True), 40: lambda: press(imgui.Key.f, False),
        44: lambda: (told.update(bare=[face._area.width, face._area.height]), grab("bare")),
        45: lambda: press(imgui.Key.escape, True), 46: lambda: press(imgui.Key.escape, False),
        47: lambda: press(imgui.Key.f, True), 48: lambda: press(imgui.Key.f, False),
    }
    actions.get(step, lambda: None)()
    gui()


def focus(title):
    from imgui_bundle import hello_imgui
    docking = hello_imgui.get_runner_params().docking_params
    docking.dockable_window_of_name(title).focus_window_at_next_frame = True


def keys(state):
    state.playback.position_s = 0.0
    state.playback.add_key("smooth", "rest")
    state.playback.position_s = 1.0
    state.playback.add_key("smooth", "open", 0.8 * (np.arange(len(P)) == P.index("jawOpen")))


def drop(name):
    face._area.dropped([folder / name])


def wait(state):
    for job in list(state.jobs.running):
        job.join(120.0)


def look(state, **change):
    from dataclasses import replace
    now = state.commands.now.look or state.view.look._looks.first
    state.commands.set_look(replace(now, **change))
    wait(state)
    told.setdefault("heads", []).append(id(face._head))


with Mailbox.create(len(P)) as mailbox:
    head = stage.load_head()
    values = HeadValues(mailbox, P, head.parameters)
    options = PanelOptions(stage.vocabulary, [], ["tour"], 0.0, folder)
    face = WindowFace(head, face_settings, values, sent.append, None, stage.load_head, options, stage=stage,
                      details=lambda: details)
    gui, face._gui = face._gui, act
    face.run(lambda: told.get("frame", 0) < 52)
    told["theme"] = face._settings.theme
    told["person"] = face._settings.person
    told["swapped"] = face._head is not head
    told["problems"] = [each.text for each in face._panel.problems.unread]
    told["sent"] = sorted({type(each).__name__ for each in sent})
    told["overlays"] = face._overlays._overlays is not None
    told["full_screen"] = face._panel.full_screen.on
    print(json.dumps(told))
"""


@pytest.mark.slow
@on_a_display
def test_the_window_is_operated(tmp_path: Path) -> None:
    (tmp_path / "a.tsv").write_text("0.0\taa\n0.3\tsil\n")
    (tmp_path / "nothing.doc").write_text("nothing")
    told = json.loads(shown(PROGRAM, str(tmp_path), "640", "400").splitlines()[-1])
    assert {"AskDetails", "HoldAll", "PlayTake", "StopServos"} <= set(told["sent"])
    assert told["theme"] == "skin" and told["person"] == "oak" and told["swapped"] and told["overlays"]
    assert len(told["problems"]) == 1 and "nothing here reads such files" in told["problems"][0]
    assert told["bare"][0] >= 640 and told["picture"][0] < told["bare"][0] and not told["full_screen"]
