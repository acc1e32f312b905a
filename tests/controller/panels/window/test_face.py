"""The window with its panel, under a virtual display: it draws, obeys its time and leaves the servos limp."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import Hold, Neutral, Show, StartServos, StopServos
from controller.body.panel_state import PanelState
from controller.face.window import MouseEditing, Panel
from controller.layers.commands import CommandState
from controller.robot.channels import build_table
from controller.robot.following import FollowingStatistics, MeasuredFace
from controller.robot.robot import load_robot
from controller.stage.inverse import load_group
from controller.stage.stage import load_stage
from drivers.base.bus import BusState

on_a_display = pytest.mark.skipif(
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


@on_a_display
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
from controller.body.messages import Hold
from controller.stage.stage import FaceSettings, load_stage
from controller.face.window import WindowFace
from surface.view.scene.camera import Camera

CORNER, BY = np.array([[28.6, -34.0, 102.0]]), -2.0  # the left corner of the mouth
stage = load_stage("demo", P)
head = stage.load_head()
told, frames = {}, [0]


def send(request):
    if isinstance(request, Hold):  # the panel may lie under the mouse: its buttons are not what this tests
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


@on_a_display
def test_points_are_dragged_with_the_mouse() -> None:
    told = json.loads(shown(DRAG))
    assert told["mouthSmileLeft"] > 0.1 and told["mouthSmileLeft"] > 3 * told.get("mouthSmileRight", 0.0)
    assert told["reshaped"] is True


class Screen:
    """A real imgui context without a window: frames are laid out, and the mouse clicks where labels stand."""

    def __init__(self) -> None:
        self.imgui = pytest.importorskip("imgui_bundle").imgui
        self.context = self.imgui.create_context()
        self.io = self.imgui.get_io()
        self.io.display_size = self.imgui.ImVec2(900, 3000)
        self.io.backend_flags |= self.imgui.BackendFlags_.renderer_has_textures
        self.io.delta_time = 1 / 60
        self.io.set_ini_filename("")

    def frame(self, draw: Callable[[], None]) -> None:
        self.imgui.new_frame()
        draw()
        self.imgui.render()

    def click(self, draw: Callable[[], None], x: float, y: float) -> None:
        """Move there, press and release, a frame each."""
        self.io.add_mouse_pos_event(x, y)
        self.frame(draw)
        for down in (True, False):
            self.io.add_mouse_button_event(0, down)
            self.frame(draw)


@pytest.fixture
def screen() -> Iterator[Screen]:
    found = Screen()
    yield found
    found.imgui.destroy_context(found.context)


class Places:
    """Where the panel's widgets stand: imgui's own functions, each noting the place of what it drew."""

    def __init__(self, imgui: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
        self.at: dict[str, tuple[float, float]] = {}
        self.texts: list[str] = []
        for name in ("small_button", "button", "slider_float", "collapsing_header"):
            monkeypatch.setattr(imgui, name, self._noting(imgui, getattr(imgui, name)))
        for name in ("text", "text_disabled"):
            monkeypatch.setattr(imgui, name, self._telling(getattr(imgui, name)))

    def _noting(self, imgui: ModuleType, real: Callable[..., Any]) -> Callable[..., Any]:
        def widget(label: str, *words: Any) -> Any:
            found = real(label, *words)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            self.at[label] = (low.x + 0.25 * (high.x - low.x), (low.y + high.y) / 2)
            return found

        return widget

    def _telling(self, real: Callable[[str], None]) -> Callable[[str], None]:
        def text(words: str) -> None:
            self.texts.append(words)
            real(words)

        return text


def test_the_panel_sends_what_its_widgets_ask_for(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places, sent, values = Places(screen.imgui, monkeypatch), [], PARAMETERS.neutral()
    panel = Panel(lambda: values, sent.append)
    for _ in range(3):
        screen.frame(panel)
    assert sent == []
    screen.click(panel, *places.at["happiness"])
    assert sent == [Show("happiness", 1.0)]
    screen.click(panel, *places.at["intensity"])
    screen.click(panel, *places.at["happiness"])
    assert sent[1].name == "happiness" and 0.0 < sent[1].intensity < 0.9
    screen.click(panel, *places.at["jaw###jaw"])
    screen.frame(panel)
    screen.click(panel, *places.at["jawOpen"])
    jaw = PARAMETERS.index("jawOpen")
    assert sent[2].index == jaw and 0.0 < sent[2].value < 0.9
    values[jaw] = sent[2].value
    screen.frame(panel)
    before = len(sent)
    screen.click(panel, *places.at[f"x##{jaw}"])
    assert sent[before:] == [Hold(jaw, None)]
    places.at.clear()
    screen.frame(panel)
    assert f"x##{jaw}" not in places.at  # nothing is held any more
    screen.click(panel, *places.at["release all"])
    assert isinstance(sent[-1], Neutral) and sent[-1].seconds > 0.0


def test_three_buttons_fill_a_row(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    imgui, real = screen.imgui, screen.imgui.button
    seen: list[tuple[float, float, float, float]] = []

    def button(label: str, size: Any) -> bool:
        pressed = bool(real(label, size))
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        seen.append((low.x, high.x, low.y, imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x))
        return pressed

    monkeypatch.setattr(imgui, "button", button)
    panel = Panel(PARAMETERS.neutral, lambda request: None)
    for _ in range(3):
        seen.clear()
        screen.frame(panel)
    gap = imgui.get_style().item_spacing.x
    del seen[0]  # STOP has a row of its own
    rows = [seen[i : i + 3] for i in range(0, len(seen) - 2, 3)]
    assert len(rows) > 1 and all(len({y for _, _, y, _ in row}) == 1 for row in rows)
    assert rows[0][0][2] < rows[1][0][2]
    for (left, right, _, _), (next_left, next_right, _, _) in zip(rows[0], rows[0][1:], strict=False):
        assert right - left == pytest.approx(next_right - next_left, abs=1.0)
        assert next_left - right == pytest.approx(gap, abs=1.0)
    assert rows[0][2][1] == pytest.approx(rows[0][2][3], abs=1.5)


def test_the_panel_shows_who_holds_a_parameter_and_what_the_servos_show(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, state, out = Places(screen.imgui, monkeypatch), CommandState(PARAMETERS), PARAMETERS.neutral()
    jaw = PARAMETERS.index("jawOpen")
    state.set_parameters([jaw], [0.5], 0)
    state.tick(10_000_000, 0.01, out)
    table = build_table(load_robot(find_config("robots", "head24"), PARAMETERS).channels, PARAMETERS)
    flags, none = np.ones(24, bool), np.zeros(24)
    codes = np.zeros(24, np.uint8)
    there = BusState(0.0, table.angles(out)[0], none, none, flags, none, codes, ~flags, none, none, codes, ~flags)
    following = FollowingStatistics(table, PARAMETERS)
    following.add(there.position_rad - np.radians(3.0), there)
    face = MeasuredFace([table], [lambda: there], PARAMETERS, [following])
    with Mailbox.create(PanelState.size(PARAMETERS)) as mailbox:
        PanelState(mailbox, state.layer_names(), PARAMETERS).publish(state, face)
        panel = Panel(lambda: out, lambda request: None, PanelState(mailbox, state.layer_names(), PARAMETERS))
        for _ in range(2):
            screen.frame(panel)
        title = "jaw   servos 3.0 deg away###jaw"
        screen.click(panel, *places.at[title])
        screen.frame(panel)
    assert any(text.startswith("manual  servos 0.") for text in places.texts)
    assert "expression" in places.texts  # of a parameter without a servo nothing is measured


def test_the_panel_stops_and_starts_the_servos_and_says_who_stopped_them(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    places, sent, state = Places(screen.imgui, monkeypatch), [], CommandState(PARAMETERS)
    with Mailbox.create(PanelState.size(PARAMETERS)) as mailbox:
        body = PanelState(mailbox, state.layer_names(), PARAMETERS)
        panel = Panel(PARAMETERS.neutral, sent.append, PanelState(mailbox, state.layer_names(), PARAMETERS))
        body.publish(state, None)
        for _ in range(3):
            screen.frame(panel)
        assert "START servos" not in places.at and not any("stopped" in text for text in places.texts)
        screen.click(panel, *places.at["STOP servos"])
        assert sent == [StopServos()]
        state.stop_latch.stop("line /dev/ttyUSB0", 5)
        body.publish(state, None)
        for _ in range(2):
            screen.frame(panel)
        assert "servos stopped by line /dev/ttyUSB0" in places.texts
        screen.click(panel, *places.at["START servos"])
        assert sent == [StopServos(), StartServos()]


def test_without_the_state_of_the_body_the_panel_can_stop(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places, sent = Places(screen.imgui, monkeypatch), []
    panel = Panel(PARAMETERS.neutral, sent.append)
    for _ in range(3):
        screen.frame(panel)
    screen.click(panel, *places.at["STOP servos"])
    assert sent == [StopServos()]


def test_a_reshaped_face_is_saved_or_the_reason_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = load_stage("demo", PARAMETERS)
    head = stage.load_head()
    mouse = MouseEditing(head, stage.load_head, PARAMETERS.neutral, lambda hold: None)
    moves = np.zeros_like(mouse.editor._rest)
    moves[7] = [0.0, 0.0, 4.0]
    assert not mouse.editor.sculpted
    mouse.editor._set_moves(moves)
    assert mouse.editor.sculpted
    monkeypatch.chdir(tmp_path)
    mouse._save()
    assert mouse._message == f"wrote {tmp_path / 'mine.json'}"
    assert load_group(tmp_path / "mine.json", head.data)[1].ids.tolist() == [7]
    (tmp_path / "file").touch()
    mouse._name = "file/x"
    mouse._save()
    assert "cannot be written" in mouse._message
