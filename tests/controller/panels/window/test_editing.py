"""controller.panels.window.editing: what the mouse and its keys do to the points of a face, tool by tool.

The editor of points stands in for a real one, which tests/controller/face tests; it notes what it is asked.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.body.messages import Hold, LookAt
from controller.face.skin_model import Screen
from controller.panels.session.commands import Commands
from controller.panels.window import editing as module
from controller.panels.window.editing import TOOLS, MouseEditing
from surface.head.model.light import LightPoints
from surface.view.docks import PictureArea
from surface.view.scene.camera import Camera

JAW = PARAMETERS.index("jawOpen")
ONE = LightPoints("face", np.arange(5.0)[None], np.arange(5.0)[None])
OWN = 4


class Editor:
    """Points of a face; ``asked`` : the calls, in order."""

    def __init__(self, head: Any, models: Any, light: Any = ()) -> None:
        self.head, self.models, self.light = head, models, tuple(light)
        self.ready, self.settled, self.dragging, self.own = True, True, False, OWN
        self.moves, self.asked = np.zeros((OWN, 3)), list[tuple[Any, ...]]()
        self.found: dict[str, Any] = {
            "take_light": None,
            "light_at": None,
            "point_at": ONE,
            "wrinkle": None,
            "drag": {},
        }
        self.pins: list[tuple[float, float]] = []
        self.lights: list[tuple[float, float]] = []

    def take(self, pixel: Any, screen: Screen, values: Any, **how: Any) -> bool:
        self.asked.append(("take", pixel, how))
        self.dragging = True
        return True

    def release(self) -> None:
        self.asked.append(("release",))
        self.dragging = False

    def pin(self, values: Any) -> None:
        self.asked.append(("pin", float(values[JAW])))

    def pin_pixels(self, screen: Screen, values: Any) -> list[tuple[float, float]]:
        return self.pins

    def light_pixels(self, screen: Screen, values: Any) -> list[tuple[float, float]]:
        return self.lights

    def convert_moves(self, moves: Any, light: Any) -> Any:
        return moves

    def set_moves(self, moves: Any) -> None:
        self.asked.append(("set_moves", moves))

    def prepare(self) -> None:
        self.asked.append(("prepare",))

    def __getattr__(self, name: str) -> Any:
        def ask(*given: Any, **how: Any) -> Any:
            self.asked.append((name, given[0], *(each for each in given[3:]), how))
            return self.found[name]

        return ask

    def named(self, *names: str) -> list[tuple[Any, ...]]:
        """What calls of these names were given."""
        return [call for call in self.asked if call[0] in names]


class Imgui:
    """The part of ImGui that the mouse needs. drawn : circles and lines; captured : frames that kept the mouse."""

    HoveredFlags_ = SimpleNamespace(any_window=4)
    MouseButton_ = SimpleNamespace(left=0)
    ImVec2 = staticmethod(lambda x, y: SimpleNamespace(x=x, y=y))

    def __init__(self) -> None:
        self.io = SimpleNamespace(
            mouse_pos=SimpleNamespace(x=0.0, y=0.0), key_ctrl=False, key_shift=False, key_alt=False
        )
        self.over_window = self.down = self.clicked = False
        self.drawn, self.tips, self.captured = list[tuple[Any, ...]](), list[str](), 0

    def get_io(self) -> Any:
        return self.io

    def is_window_hovered(self, flags: int) -> bool:
        assert flags == self.HoveredFlags_.any_window
        return self.over_window

    def is_mouse_clicked(self, button: int) -> bool:
        return self.clicked

    def is_mouse_down(self, button: int) -> bool:
        return self.down

    def set_next_frame_want_capture_mouse(self, wanted: bool) -> None:
        self.captured += wanted

    def set_tooltip(self, text: str) -> None:
        self.tips.append(text)

    def get_foreground_draw_list(self) -> Imgui:
        return self

    get_background_draw_list = get_foreground_draw_list

    def __getattr__(self, name: str) -> Any:
        return lambda *given: self.drawn.append((name, *given))


class Rig:
    """Editing of a face whose picture is 400 x 300 pixels, from (100, 50) of the window on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(module, "PointEditor", Editor)
        self.imgui = Imgui()
        monkeypatch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=self.imgui))
        self.sent, self.values = list[Any](), PARAMETERS.neutral()
        self.commands = Commands(self.sent.append)
        self.head: Any = SimpleNamespace(data=SimpleNamespace(eyes=np.array([[30.0, 10.0, 80.0], [-30.0, 10.0, 80.0]])))
        area = PictureArea()
        area.left, area.top, area.width, area.height = 100.0, 50.0, 400.0, 300.0
        self.mouse = MouseEditing(self.head, lambda: self.head, lambda: self.values, self.commands, area)
        self.mouse.can_add = True

    @property
    def editor(self) -> Any:
        """The points of the head that is shown now."""
        return self.mouse.editor

    def frame(self, x: float, y: float, *, click: bool = False, down: bool | None = None, keys: str = "ctrl") -> None:
        """A frame with the mouse at a pixel of the picture."""
        imgui = self.imgui
        imgui.io.mouse_pos = SimpleNamespace(x=100.0 + x, y=50.0 + y)
        imgui.clicked, imgui.down = click, click if down is None else down
        for key in ("ctrl", "shift", "alt"):
            setattr(imgui.io, f"key_{key}", key in keys)
        self.mouse(Camera.front())


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    return Rig(monkeypatch)


@pytest.mark.parametrize(
    ("size", "used"), [((400.0, 300.0), (400.0, 300.0)), ((0.0, 0.5), (1.0, 1.0)), ((1.5, 1.2), (1.5, 1.2))]
)
def test_a_picture_without_room_counts_as_one_pixel(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, size: tuple[float, float], used: tuple[float, float]
) -> None:
    seen, made = list[Any](), module.Screen
    monkeypatch.setattr(module, "Screen", lambda camera, size: seen.append(size) or made(camera, size))
    rig.mouse._area.width, rig.mouse._area.height = size
    rig.frame(0.0, 0.0, keys="")
    assert seen == [used]


def test_tools_are_those_of_the_panel() -> None:
    assert TOOLS == ("pull the face", "pull the skin", "wrinkle", "add points", "remove points")


@pytest.mark.parametrize(
    ("tool", "keys", "sculpts"),
    [("pull the face", "ctrl", False), ("pull the face", "ctrl shift", True), ("pull the skin", "ctrl", True),
     ("wrinkle", "ctrl shift", True), ("add points", "ctrl shift", True), ("remove points", "ctrl shift", True)],
)  # fmt: skip
def test_ctrl_and_the_mouse_take_a_point_where_they_are_in_the_picture(
    rig: Rig, tool: Any, keys: str, sculpts: bool
) -> None:
    rig.mouse.brush.tool, rig.mouse.brush.symmetric, rig.mouse.brush.falloff_mm = tool, True, 9.0
    rig.frame(20.0, 30.0, click=True, keys=keys)
    ((_, pixel, how),) = rig.editor.named("take")
    assert pixel == (20.0, 30.0) and how == {"sculpt": sculpts, "tied": True, "falloff_mm": 9.0}
    assert rig.editor.asked[0] == ("prepare",) and rig.imgui.captured == 1


@pytest.mark.parametrize("why", ["no ctrl", "over a window", "no click"])
def test_nothing_is_taken_otherwise(rig: Rig, why: str) -> None:
    rig.imgui.over_window = why == "over a window"
    rig.frame(20.0, 30.0, click=why != "no click", keys="" if why == "no ctrl" else "ctrl")
    assert rig.editor.named("take") == []
    assert rig.imgui.captured == (0 if why == "no ctrl" else 1)  # Ctrl keeps the mouse from turning the head


def test_a_drag_holds_parameters_as_one_step_until_it_is_let_go_and_settled(rig: Rig) -> None:
    rig.frame(20.0, 30.0, click=True)
    for k in (1, 2):
        rig.editor.found["drag"] = {JAW: 0.1 * k}
        rig.frame(20.0 + k, 30.0, down=True, keys="")
    assert rig.sent[-1] == Hold(JAW, 0.2) and rig.imgui.captured == 3
    rig.editor.settled = False
    rig.frame(60.0, 30.0, down=False, keys="")
    assert rig.editor.dragging  # it was not carried out yet
    assert rig.editor.named("drag")[-1][1] == (22.0, 30.0)  # where the mouse was let go
    rig.editor.settled = True
    rig.frame(90.0, 30.0, down=False, keys="")
    assert not rig.editor.dragging and rig.editor.named("release") == [("release",)]
    rig.commands.undo()
    assert rig.commands.now.held == {}
    rig.frame(90.0, 30.0, down=False, keys="")
    assert rig.imgui.captured == 4 and len(rig.editor.named("release")) == 1


def test_two_drags_are_two_steps(rig: Rig) -> None:
    for k in (1, 2):
        rig.editor.found["drag"] = {JAW: 0.1 * k}
        rig.frame(20.0, 30.0, click=True)
        rig.frame(20.0, 30.0, down=False)
    rig.commands.undo()
    assert rig.commands.now.held == {JAW: 0.1}


def test_while_points_get_ready_that_is_said(rig: Rig) -> None:
    rig.editor.ready = rig.editor.settled = False
    rig.frame(20.0, 30.0, click=True)
    assert rig.imgui.tips == ["preparing to drag points"]


def test_control_points_that_were_moved_become_a_step_and_unmoved_ones_do_not(rig: Rig) -> None:
    rig.frame(20.0, 30.0, click=True)
    rig.frame(20.0, 30.0, down=False)
    assert not rig.commands.undoable
    rig.frame(20.0, 30.0, click=True)
    rig.editor.moves = np.ones((OWN, 3))
    rig.frame(20.0, 30.0, down=False)
    assert rig.commands.now.moves is rig.editor.moves
    rig.frame(20.0, 30.0, click=True)
    rig.editor.moves = np.zeros((OWN, 3))  # put back by the mouse
    rig.frame(20.0, 30.0, down=False)
    assert rig.commands.now.moves is rig.editor.moves
    rig.commands.undo()
    assert (rig.commands.now.moves == 1.0).all()


def test_a_point_is_pinned_on_the_face_that_is_held_by_hand(rig: Rig) -> None:
    rig.commands.hold({JAW: 0.75})  # which the face is still on its way to
    for pinning in (False, True):
        rig.mouse.brush.pinning = pinning
        rig.frame(20.0, 30.0, click=True)
        rig.frame(20.0, 30.0, down=False)
    assert rig.editor.named("pin", "release") == [("release",), ("pin", 0.75), ("release",)]
    assert rig.values[JAW] == 0.0


def test_alt_and_the_mouse_make_the_face_look(rig: Rig) -> None:
    """Half-way between the eyes and the camera, under the pixel; the point is from between the eyes."""
    rig.frame(200.0, 150.0, down=True, keys="alt")
    camera, screen = Camera.front(), Screen(Camera.front(), (400.0, 300.0))
    eyes = rig.head.data.eyes.mean(axis=0)
    middle = eyes + 0.5 * (np.asarray(camera.eye) - eyes)
    assert len([each for each in rig.sent if isinstance(each, LookAt)]) == 1
    point = np.array(rig.commands.now.gaze) + eyes
    np.testing.assert_allclose(screen.project(point[None])[0, :2], [200.0, 150.0], atol=1e-6)
    np.testing.assert_allclose(screen.project(point[None])[0, 2], screen.project(middle[None])[0, 2], rtol=1e-6)
    rig.imgui.over_window = True
    rig.frame(10.0, 10.0, down=True, keys="alt")
    assert len([each for each in rig.sent if isinstance(each, LookAt)]) == 1 and rig.imgui.captured == 2


# ---------------------------------------------------------------- points that are added
def test_a_click_adds_a_point_or_takes_the_one_that_is_there(rig: Rig) -> None:
    rig.mouse.brush.tool, rig.mouse.brush.reach_mm, rig.mouse.brush.symmetric = "add points", 5.0, True
    rig.frame(20.0, 30.0, click=True)
    ((_, pixel, reach, how),) = rig.editor.named("point_at")
    assert pixel == (20.0, 30.0) and reach == 5.0 and how == {"tied": True}
    assert rig.commands.now.light == (ONE,) and np.array_equal(rig.commands.now.moves, np.zeros((OWN + 1, 3)))
    assert rig.mouse.message == "added: the skin is as it was. Ctrl and drag the point"
    rig.editor.found["take_light"] = 0
    rig.frame(20.0, 30.0, click=True)
    assert len(rig.editor.named("point_at")) == 1 and len(rig.commands.now.light) == 1


def test_beside_the_face_no_point_is_added(rig: Rig) -> None:
    rig.mouse.brush.tool, rig.editor.found["point_at"] = "add points", None
    rig.frame(20.0, 30.0, click=True)
    assert rig.mouse.message == "no skin there: click on the face" and not rig.commands.undoable


def test_a_point_that_was_added_is_taken_out(rig: Rig) -> None:
    rig.mouse.brush.tool = "remove points"
    rig.frame(20.0, 30.0, click=True)
    assert rig.mouse.message == "no added point there: only points that were added can be taken out"
    rig.commands.add_points(ONE, np.ones((1, 3)), OWN)
    rig.editor.light, rig.editor.found["light_at"] = (ONE,), 0
    rig.frame(20.0, 30.0, click=True)
    assert rig.commands.now.light == () and rig.mouse.message == ""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rig: setattr(rig.mouse, "can_add", False), "points cannot be added here: open a stage with omote edit"),
        (lambda rig: setattr(rig.editor, "ready", False), "preparing the face: try again in a moment"),
        (lambda rig: setattr(rig.editor, "light", (ONE,)), "the last change is on its way: try again in a moment"),
    ],
)
@pytest.mark.parametrize("tool", ["add points", "remove points", "wrinkle"])
def test_it_is_said_why_nothing_is_added_or_taken_out(rig: Rig, tool: Any, change: Any, said: str) -> None:
    rig.mouse.brush.tool, rig.editor.found["light_at"] = tool, 0
    change(rig)
    rig.frame(20.0, 30.0, click=True)
    assert rig.mouse.message == said and not rig.commands.undoable and rig.mouse._stroke == []


def test_a_line_that_the_mouse_draws_is_a_wrinkle(rig: Rig) -> None:
    brush = rig.mouse.brush
    brush.tool, brush.depth_mm, brush.width_mm = "wrinkle", 2.0, 4.0
    rig.editor.found["wrinkle"] = ONE, np.full((1, 3), 0.5)
    rig.frame(20.0, 30.0, click=True)
    for x in (20.5, 21.5, 25.0):  # the first is less than a pixel on
        rig.frame(x, 30.0, down=True, keys="")
    lines = [each for each in rig.imgui.drawn if each[0] == "add_line"]
    assert len(lines) == 1 + 2 and all(each[3:] == (0xFFFFFFFF, 2.0) for each in lines)
    assert [(at.x, at.y) for at in lines[-1][1:3]] == [(121.5, 80.0), (125.0, 80.0)]
    assert rig.imgui.captured == 4
    rig.frame(70.0, 30.0, down=False, keys="")
    ((_, stroke, depth, width, how),) = rig.editor.named("wrinkle")
    assert stroke == [(20.0, 30.0), (21.5, 30.0), (25.0, 30.0)] and (depth, width, how) == (2.0, 4.0, {"tied": False})
    assert rig.commands.now.light == (ONE,) and (rig.commands.now.moves[-1] == 0.5).all() and rig.mouse.message == ""
    rig.frame(70.0, 30.0, down=False, keys="")
    assert len(rig.editor.named("wrinkle")) == 1


@pytest.mark.parametrize("places", [2, 3])
def test_a_line_that_is_too_short_is_no_wrinkle(rig: Rig, places: int) -> None:
    """Of two places the editor is not even asked; of three it finds none on the face."""
    rig.mouse.brush.tool = "wrinkle"
    rig.frame(20.0, 30.0, click=True)
    for k in range(1, places):
        rig.frame(20.0 + 5 * k, 30.0, down=True)
    rig.frame(20.0, 30.0, down=False)
    assert len(rig.editor.named("wrinkle")) == (places == 3)
    assert rig.mouse.message.startswith("too short for a wrinkle") and not rig.commands.undoable


# ---------------------------------------------------------------- what is drawn, and other heads
def test_pins_and_added_points_are_drawn_in_the_picture(rig: Rig) -> None:
    rig.editor.pins, rig.editor.lights = [(5.0, 6.0)], [(7.0, 8.0)]

    def places() -> list[tuple[float, float]]:
        rig.imgui.drawn.clear()
        rig.frame(0.0, 0.0, keys="")
        circles = [each for each in rig.imgui.drawn if each[0] in ("add_circle", "add_circle_filled")]
        assert [each[2:] for each in circles[:2]] == [(4.0, 0xFF3C78E6), (4.0, 0xFFFFFFFF)]  # a pin with its rim
        assert all(each[2:] == (3.0, 0xFF50D2F0) for each in circles[2:])
        return [(at.x, at.y) for name, at, *_ in circles if name == "add_circle_filled"]

    assert places() == [(105.0, 56.0)]
    for tool in ("add points", "remove points"):
        rig.mouse.brush.tool = tool  # type: ignore[assignment]
        assert places() == [(105.0, 56.0), (107.0, 58.0)]


def test_another_head_is_sampled_anew_and_the_same_with_other_points_is_not(rig: Rig) -> None:
    models = rig.editor.models
    moves = np.ones((OWN + 1, 3))
    rig.commands.set_moves(moves)
    rig.mouse.change(rig.head, [ONE], same=True)
    assert rig.editor.models is models and rig.editor.light == (ONE,)
    assert rig.editor.named("prepare") == [("prepare",)] and rig.editor.named("set_moves")[0][1] is moves
    rig.mouse.change(rig.head)
    assert rig.editor.models is not models and rig.editor.named("prepare") == []
    rig.mouse.brush.tool, rig.mouse._stroke = "wrinkle", [(1.0, 2.0)]
    rig.mouse.change(rig.head)
    assert rig.editor.named("prepare") == [("prepare",)] and rig.mouse._stroke == []
    assert rig.mouse.find_editor() is rig.editor


def test_points_of_the_shown_head_are_kept_where_a_change_is_cancelled(rig: Rig) -> None:
    rig.commands.add_points(ONE, np.ones((1, 3)), OWN)
    rig.editor.convert_moves = lambda moves, light: moves[:OWN]
    rig.mouse.keep_points()
    assert rig.commands.now.light == () and rig.commands.now.moves is not None
    assert rig.commands.now.moves.shape == (OWN, 3)
