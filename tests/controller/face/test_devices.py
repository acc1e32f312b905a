"""The gamepad by a GLFW that is not there, and keys by events of imgui."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import Hold, PanelRequest, Show
from controller.face.controls import Controls
from controller.face.devices import Devices, Gamepad, gamepad_state
from controller.vocabulary.controls import BUTTONS, ControlsFile


def test_axes_and_buttons_have_names() -> None:
    axes, down = gamepad_state([0.5, -1.0, 0.0, 0.0, -1.0, 1.0], [1] + [0] * 13 + [1])
    assert axes == {"left_x": 0.5, "left_y": -1.0, "right_x": 0.0, "right_y": 0.0, "left_trigger": 0.0,
                    "right_trigger": 1.0}  # fmt: skip
    assert down == ["a", "dpad_left"] and len(BUTTONS) == 15


def test_a_gamepad_is_found_later_and_may_go(monkeypatch: pytest.MonkeyPatch) -> None:
    state: Any = SimpleNamespace(axes=[0.0, 1.0, 0.0, 0.0, -1.0, -1.0], buttons=[0] * 15)
    there: dict[int, Any] = {}
    pad, now_s = Gamepad(), [0.0]
    pad._glfw = SimpleNamespace(joystick_is_gamepad=lambda n: n in there, get_gamepad_state=there.get)
    monkeypatch.setattr("controller.face.devices.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    assert pad.read() is None
    there[2] = state
    assert pad.read() is None  # it is looked for once a second
    now_s[0] = 2.0
    found = pad.read()
    assert found is not None and found[0]["left_y"] == 1.0
    del there[2]
    assert pad.read() is None


def test_what_a_gamepad_asks_for_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[PanelRequest] = []
    file = ControlsFile.model_validate({"axes": {"right_trigger": {"jawOpen": 1.0}}})
    devices = Devices(Controls([file], PARAMETERS), sent.append, lambda: ({"right_trigger": 1.0}, []))
    monkeypatch.setattr(devices, "_keys", list)
    devices()
    assert sent == [Hold(PARAMETERS.index("jawOpen"), 1.0)]


def test_keys_hold_parameters_and_show_expressions() -> None:
    imgui, sent = pytest.importorskip("imgui_bundle").imgui, list[PanelRequest]()
    file = ControlsFile.model_validate({"keys": {"j": {"jawOpen": 0.5}, "3": "smile", "left_arrow": "anger"}})
    devices = Devices(Controls([file], PARAMETERS), sent.append, lambda: None)
    context = imgui.create_context()
    imgui.get_io().set_ini_filename("")  # else it leaves a file in the present folder
    try:
        io = imgui.get_io()
        io.display_size = imgui.ImVec2(100, 100)
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures.value
        steps = ((imgui.Key.j, True), (imgui.Key._3, True), (imgui.Key.j, False), (imgui.Key.left_arrow, True))
        for key, down in steps:
            io.add_key_event(key, down)
            imgui.new_frame()
            devices()
            imgui.end_frame()
        io.add_key_event(imgui.Key.mod_ctrl, True)
        io.add_key_event(imgui.Key.j, True)
        imgui.new_frame()
        devices()
        imgui.end_frame()
    finally:
        imgui.destroy_context(context)
    jaw = PARAMETERS.index("jawOpen")
    assert sent == [Hold(jaw, 0.5), Show("smile", 1.0), Hold(jaw, None), Show("anger", 1.0)]
