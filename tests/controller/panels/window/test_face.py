"""The window with its panel, under a virtual display: it draws, obeys its time and leaves the servos limp."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.body.messages import Hold, Neutral, Show
from controller.body.panel_state import PanelState
from controller.face.face import HeadValues
from controller.layers.commands import CommandState
from controller.panels.window.panel import Panel, PanelOptions
from controller.robot.channels import build_table
from controller.robot.following import FollowingStatistics, MeasuredFace
from controller.robot.robot import load_robot
from controller.stage.picture import LightSettings
from controller.stage.stage import FaceSettings, load_stage
from controller.vocabulary.vocabulary import Vocabulary
from drivers.base.bus import BusState
from surface.head import Head
from tests.controller.panels.window.screen import Places, Screen, drawn
from tests.surface.small_head import small_head

on_a_display = pytest.mark.skipif(
    shutil.which("xvfb-run") is None, reason="needs xvfb-run (apt-get install xvfb): a display to open a window on"
)


STAGE = """
name = "small"
robots = ["head24"]
[face]
size = [480, 240]
quality = "fast"
"""


def shown(program: str, *words: str, server: str = "-screen 0 1280x1024x24") -> str:
    """What a Python program writes that opens its window on a virtual display; ``server`` : the display's options."""
    command = ["xvfb-run", "-a", "-s", server, sys.executable, "-c", program, *words]
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1"}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def scaled(program: str, dpi: int, size: tuple[int, int]) -> str:
    """:func:`shown` on a display of a size whose desktop has ``dpi`` dots per inch; 96 is 100 %."""
    server = f"-screen 0 {size[0]}x{size[1]}x24 -noreset"  # else what xrdb has set is lost with it
    set_dpi = (
        f"import subprocess; subprocess.run(['xrdb', '-merge'], input='Xft.dpi: {dpi}\\n', text=True, check=True)\n"
    )
    return shown(set_dpi + program, server=server)


@pytest.mark.slow
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


@pytest.mark.slow
@on_a_display
def test_servos_that_cannot_be_started_close_the_window_with_their_error(tmp_path: Path) -> None:
    robot, stage = tmp_path / "absent.toml", tmp_path / "small.toml"
    shipped = (Path(__file__).parents[4] / "configs/robots/head24.toml").read_text()
    robot.write_text(shipped.replace('kind = "simulated"', 'kind = "dynamixel"\nport = "/dev/absent"', 1))
    stage.write_text(STAGE.replace("head24", "absent.toml"))
    program = "from controller.cli.app import main; main()"
    command = ["xvfb-run", "-a", sys.executable, "-c", program, "run", str(stage)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert ended.returncode == 1
    assert "no port /dev/absent" in ended.stderr and "Traceback" not in ended.stderr


DRAG = """
import json

import numpy as np
from controller.face.face import HeadValues
from controller.face.skin_model import Screen
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.messages import Hold
from controller.stage.stage import FaceSettings, load_stage
from controller.panels.window.face import WindowFace

CORNER, BY = np.array([[28.6, -34.0, 102.0]]), -0.6  # the left corner of the mouth
stage = load_stage("demo", P)
head = stage.load_head()
told, frames = {}, [0]


def send(request):
    if isinstance(request, Hold):  # the panel may lie under the mouse: its buttons are not what this tests
        told[P.names[request.index]] = request.value


with Mailbox.create(len(P)) as mailbox:
    values = HeadValues(mailbox, P, head.parameters)
    face = WindowFace(head, FaceSettings(size=(560, 240), quality="fast"), values, send, None, stage.load_head)
    face._mouse.editor.prepare()
    face._mouse.editor._thread.join(60.0)
    assert face._mouse.editor.ready
    gui = face._gui

    def act():
        from imgui_bundle import imgui

        io = imgui.get_io()
        n = frames[0] = frames[0] + 1
        n %= 24  # twice: parameters, then with Shift control points
        io.add_key_event(imgui.Key.mod_ctrl, 2 <= n < 22)
        io.add_key_event(imgui.Key.mod_shift, frames[0] >= 24)
        area = face._area
        screen = Screen(face._viewpoint.camera, (area.width, area.height))
        x, y, _ = screen.project(CORNER)[0].tolist()
        io.add_mouse_button_event(0, 6 <= n < 20)
        # Last, since the display's own pointer, which is elsewhere, has just been read.
        io.mouse_pos = imgui.ImVec2(area.left + x, area.top + y + BY * max(0, min(n - 8, 8)))
        gui()

    face._gui = act
    face.run(lambda: frames[0] < 46)
    print(json.dumps({**told, "reshaped": face._mouse.editor.sculpted}))
"""


@pytest.mark.slow
@on_a_display
def test_points_are_dragged_with_the_mouse() -> None:
    told = json.loads(shown(DRAG))
    assert told["mouthSmileLeft"] > 0.1 and told["mouthSmileLeft"] > 3 * told.get("mouthSmileRight", 0.0)
    assert told["reshaped"] is True


def test_the_panel_sends_what_its_widgets_ask_for(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    places, sent, values = Places(screen.imgui, monkeypatch), [], PARAMETERS.neutral()
    panel = Panel(lambda: values, sent.append)
    draw = drawn(panel, "Faces")
    for _ in range(3):
        screen.frame(draw)
    assert sent == []
    screen.click(draw, *places.at["happiness"])
    assert sent == [Show("happiness", 1.0)]
    screen.click(draw, *places.at["intensity"])
    assert sent[-1].name == "happiness" and 0.0 < sent[-1].intensity < 0.9
    draw = drawn(panel, "Sliders")
    for _ in range(3):
        screen.frame(draw)
    screen.click(draw, *places.at["jaw###jaw"])
    screen.frame(draw)
    screen.click(draw, *places.at["##jawOpen"])
    jaw = PARAMETERS.index("jawOpen")
    assert sent[-1].index == jaw and 0.0 < sent[-1].value < 0.9
    before = len(sent)
    screen.click(draw, *places.at["undo##top"])
    assert sent[before:] == [Hold(jaw, None)]
    screen.click(draw, *places.at["redo##top"])
    screen.click(draw, *places.at["jawOpen##hold"])
    assert sent[-1] == Hold(jaw, None)
    screen.click(draw, *places.at["neutral##top"])
    assert isinstance(sent[-1], Neutral) and sent[-1].seconds > 0.0


def test_one_slider_moves_both_sides_unless_they_are_apart() -> None:
    panel = Panel(PARAMETERS.neutral, lambda request: None)
    smile = tuple(PARAMETERS.indices(["mouthSmileLeft", "mouthSmileRight"]).tolist())
    assert smile in panel.sliders.rows("mouth")
    for region, names in {"eyes": ["leftEyeYaw", "rightEyeYaw"], "mouth": ["mouthLeft", "mouthRight"]}.items():
        assert all((i,) in panel.sliders.rows(region) for i in PARAMETERS.indices(names).tolist())
    panel.sliders._search = "smile"
    assert panel.sliders.rows("mouth") == [smile] and panel.sliders.rows("jaw") == []
    panel.sliders._linked = False
    assert panel.sliders.rows("mouth") == [(smile[0],), (smile[1],)]


def test_all_expressions_of_the_stage_have_buttons_that_show_their_names_whole(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    own = tmp_path / "own.toml"
    own.write_text("[a_smirk_with_a_long_name]\nweights = { mouthSmileLeft = 0.5 }\n")
    vocabulary = Vocabulary.load(PARAMETERS, more=[own])
    values, sent = PARAMETERS.neutral(), []
    values[PARAMETERS.index("jawOpen")] = 0.5
    panel = Panel(lambda: values, sent.append, options=PanelOptions(vocabulary, [own], folder=tmp_path))
    places, draw = Places(screen.imgui, monkeypatch), drawn(panel, "Faces")
    for _ in range(3):
        screen.frame(draw)
    assert set(vocabulary.names) <= set(places.at)
    for name in vocabulary.names:
        low, high = places.boxes[name]
        assert high >= low + 4.0 * len(name) and high <= 336.0
    panel.saving.save("agape")
    for _ in range(2):
        screen.frame(draw)
    assert sent[-1].name == "agape" and "[agape.weights]" in own.read_text()
    screen.click(draw, *places.at["agape"])
    assert sent[-1] == Show("agape", 1.0)
    panel.expressions.choose_mood(0.612, -0.2)
    assert sent[-1] == Show("VA:0.62,-0.2", 1.0)


def test_the_panel_shows_who_holds_a_parameter_and_how_far_the_servos_are(
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
        draw = drawn(panel, "Sliders")
        for _ in range(2):
            screen.frame(draw)
        screen.click(draw, *places.at["jaw   1 held   servos 3.0 deg away###jaw"])
        screen.frame(draw)
    assert places.formats["##jawOpen"] == "%.2f  manual"


def test_the_face_in_a_window_breathes_as_its_values_say(monkeypatch: pytest.MonkeyPatch) -> None:
    from controller.panels.window import face as module

    head, seen = Head(small_head()), []

    def run_window(shown: Head, source: Callable[[], np.ndarray], **_: object) -> None:
        for rise_mm in (0.0, 2.0):
            mailbox.publish(PARAMETERS.neutral(), 0, (rise_mm, rise_mm / 20))
            source()
            seen.append((shown.rise_mm, shown.pupil))

    monkeypatch.setattr(module, "run_window", run_window)
    with Mailbox.create(len(PARAMETERS)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, head.parameters)
        module.WindowFace(head, FaceSettings(kiosk=True), values, lambda request: None).run(lambda: True)
    assert seen == [(0.0, 0.0), (2.0, 0.1)]


def test_pupils_ease_to_the_light_of_another_theme(monkeypatch: pytest.MonkeyPatch) -> None:
    from controller.panels.window import face as module

    head, now_ns = Head(small_head()), 0
    dark = LightSettings(key=0.02, fill=0.02, ambient=0.02)
    stage = load_stage("demo", PARAMETERS)
    settings = FaceSettings(light=dark, kiosk=True)
    window: module.WindowFace
    seen: dict[str, np.ndarray] = {}

    def run_window(shown: Head, source: Callable[[], np.ndarray], **_: object) -> None:
        nonlocal now_ns
        mailbox.publish(PARAMETERS.neutral(), 0, (0.0, 0.1))
        for theme in ("skin", "mask", "skin"):
            if seen:  # the renderer is replaced
                window._swap(None, settings.model_copy(update={"theme": theme}))
                window._area.remake.done(None)
            steady = settings.model_copy(update={"theme": theme}).make_theme().pupil
            widths = []
            for _ in range(500):
                now_ns += 10_000_000
                source()
                widths.append(steady * (1.0 + shown.pupil))
            seen[theme + str(len(seen))] = np.array(widths)

    monkeypatch.setattr(module, "run_window", run_window)
    monkeypatch.setattr(module.time, "monotonic_ns", lambda: now_ns)
    with Mailbox.create(len(PARAMETERS)) as mailbox:
        values = HeadValues(mailbox, PARAMETERS, head.parameters)
        window = module.WindowFace(head, settings, values, lambda request: None, stage=stage)
        window.run(lambda: True)
    wide = 1.1 * settings.make_theme().pupil
    assert wide > 1.5 and (seen["skin0"] == pytest.approx(wide))
    narrows, widens = seen["mask1"], seen["skin2"]
    assert narrows[0] == pytest.approx(wide) and (np.diff(narrows) < 1e-12).all()
    assert narrows[120] == pytest.approx(1.1, abs=0.02) and narrows[-1] == pytest.approx(1.1)
    assert widens[0] == pytest.approx(1.1) and (np.diff(widens) > -1e-12).all()
    assert widens[120] < 0.7 * wide + 0.3 * 1.1 and widens[-1] == pytest.approx(wide)
