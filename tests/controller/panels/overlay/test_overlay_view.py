"""What overlays draw on the picture, without a window: where, in which colours, within which rectangle."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.face.overlays import KINDS, Marks
from controller.panels.overlay import overlay_view
from controller.panels.overlay.overlay_view import OverlayView, nearest

AREA = SimpleNamespace(left=100, top=20, width=640, height=480)


class Draw:
    """A list of what is drawn."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.calls.append((name, *arguments))


class Imgui:
    """The part of ImGui that overlays use; ``clicked`` and ``io`` are what the user does."""

    ImVec2 = staticmethod(lambda x, y: (x, y))
    ImVec4 = staticmethod(lambda *rgba: rgba)
    MouseButton_ = SimpleNamespace(left=0)

    def __init__(self) -> None:
        self.draw, self.clicked = Draw(), False
        self.io = SimpleNamespace(key_shift=True, key_ctrl=False, mouse_pos=SimpleNamespace(x=0.0, y=0.0))

    def get_background_draw_list(self) -> Draw:
        return self.draw

    def get_io(self) -> Any:
        return self.io

    def is_mouse_clicked(self, button: int) -> bool:
        return self.clicked and button == 0

    def color_convert_float4_to_u32(self, rgba: tuple[float, ...]) -> int:
        return round(100 * rgba[3]) + 1000 * round(100 * rgba[0])


class FakeScreen:
    """Shows places from above: x and y in pixels, z as depth."""

    def __init__(self, camera: Any, size: tuple[float, float]) -> None:
        self.size = size

    def project(self, places: np.ndarray) -> np.ndarray:
        return places


class FakeOverlays:
    """Two control points, and two lines that no part of another kind has."""

    def __init__(self) -> None:
        self.posed: list[tuple[np.ndarray, np.ndarray | None]] = []
        self.chosen: list[np.ndarray] = []

    def pose(self, values: np.ndarray, measured: np.ndarray | None) -> None:
        self.posed.append((values, measured))

    def choose(self, place: np.ndarray) -> None:
        self.chosen.append(place)

    def marks(self, kind: str) -> Marks:
        if kind == "control points":
            return Marks(points=np.array([[10.0, 20, 5], [30, 40, 6]]), shades=np.array([0.0, 1.0]),
                         families=np.array([1, 10]), labels={1: "brow"})  # fmt: skip
        return Marks(lines=np.array([[[1.0, 2, 0], [3, 4, 0]], [[5, 6, 0], [7, 9, 0]]]), shades=np.array([0.5, 1.0]))


@pytest.fixture
def imgui(monkeypatch: pytest.MonkeyPatch) -> Imgui:
    fake = Imgui()
    monkeypatch.setitem(sys.modules, "imgui_bundle", SimpleNamespace(imgui=fake))
    monkeypatch.setattr(overlay_view, "Screen", FakeScreen)
    return fake


def view(state: Any = None) -> tuple[OverlayView, FakeOverlays]:
    made = OverlayView(lambda: None, P.neutral, AREA, None, state=state)  # type: ignore[arg-type, return-value]
    fake = FakeOverlays()
    made._set_overlays(fake)  # type: ignore[arg-type]
    made._order = np.arange(len(P) + 1)
    return made, fake


def test_points_are_squares_within_the_picture_and_some_have_a_name(imgui: Imgui) -> None:
    made, fake = view()
    made(None)  # type: ignore[arg-type]
    assert not imgui.draw.calls and not fake.posed  # nothing is on
    made.switch("control points", on=True)
    made(None)  # type: ignore[arg-type]
    assert imgui.draw.calls == [
        ("push_clip_rect", (100, 20), (740, 500)),
        ("add_rect_filled", (108.5, 38.5), (111.5, 41.5), 95_025),
        ("add_rect_filled", (128.5, 58.5), (131.5, 61.5), 95_100),  # families beyond the colours begin again
        ("add_text", (135.0, 55.0), 75_100, "brow"),
        ("pop_clip_rect",),
    ]
    assert len(fake.posed) == 1 and len(fake.posed[0][0]) == len(P) + 1 and fake.posed[0][1] is None


@pytest.mark.parametrize(("area", "used"), [((640.0, 480.0), (640.0, 480.0)), ((0.0, 0.5), (1.0, 1.0))])
def test_a_picture_without_room_counts_as_one_pixel(
    imgui: Imgui, monkeypatch: pytest.MonkeyPatch, area: tuple[float, float], used: tuple[float, float]
) -> None:
    seen: list[tuple[float, float]] = []
    monkeypatch.setattr(overlay_view, "Screen", lambda camera, size: seen.append(size) or FakeScreen(camera, size))
    made, _ = view()
    made._area = SimpleNamespace(left=100, top=20, width=area[0], height=area[1])  # type: ignore[assignment]
    made.switch("control points", on=True)
    made(None)  # type: ignore[arg-type]
    assert seen == [used]


def test_lines_run_between_their_ends(imgui: Imgui) -> None:
    made, _ = view()
    made.switch(next(kind for kind in KINDS if kind != "control points"), on=True)
    made(None)  # type: ignore[arg-type]
    assert imgui.draw.calls[1:-1] == [
        ("add_line", (101.0, 22.0), (103.0, 24.0), 95_062),
        ("add_line", (105.0, 26.0), (107.0, 29.0), 95_100),
    ]


@pytest.mark.parametrize(("shift", "ctrl", "clicked"), [(True, False, True), (False, False, True), (True, True, True)])
def test_a_click_with_shift_chooses_the_nearest_control_point(
    imgui: Imgui, shift: bool, ctrl: bool, clicked: bool
) -> None:
    made, fake = view()
    imgui.io.key_shift, imgui.io.key_ctrl, imgui.clicked = shift, ctrl, clicked
    imgui.io.mouse_pos = SimpleNamespace(x=128.0, y=58.0)  # 28, 38 of the picture
    made.on.add("control points")
    made(None)  # type: ignore[arg-type]
    assert not fake.chosen  # only where an influence is shown
    made.on.add("influence")
    made(None)  # type: ignore[arg-type]
    assert [place.tolist() for place in fake.chosen] == ([[30.0, 40.0, 6.0]] if shift and not ctrl else [])


def test_what_servos_show_takes_the_place_of_what_was_wanted_where_it_is_known(imgui: Imgui) -> None:
    made, fake = view(SimpleNamespace(measured=lambda i: 0.25 if i == 3 else None))
    made.on.add("control points")
    made(None)  # type: ignore[arg-type]
    made.on.add("measured")
    made(None)  # type: ignore[arg-type]
    (_, before), (wanted, measured) = fake.posed
    assert before is None and measured is not None and not wanted.any()
    assert np.flatnonzero(measured).tolist() == [3] and measured[3] == 0.25


def test_of_points_that_lie_over_each_other_the_one_in_front_is_taken() -> None:
    points = np.array([[10.0, 10, 9], [12.0, 10, 3], [17.5, 10, 1]])
    screen: Any = FakeScreen(None, (1, 1))
    assert nearest(points, (10.0, 10.0), screen).tolist() == [12, 10, 3]
    assert nearest(points, (14.0, 10.0), screen).tolist() == [17.5, 10, 1]
    assert nearest(points[:1], (500.0, 10.0), screen).tolist() == [10, 10, 9]


def test_the_first_that_is_switched_on_loads_a_head_and_another_head_again() -> None:
    jobs: list[str] = []
    made = OverlayView(lambda: None, P.neutral, AREA, SimpleNamespace(  # type: ignore[arg-type, return-value]
        start=lambda title, work, done: jobs.append(title)))  # type: ignore[arg-type]  # fmt: skip
    made.switch("influence", on=True)
    made.switch("control points", on=True)
    assert jobs == ["preparing overlays"] and made.on == {"influence", "control points"}
    made._set_overlays(FakeOverlays())  # type: ignore[arg-type]
    made.switch("control points", on=False)
    made.switch("control points", on=True)
    assert len(jobs) == 1
    made.reload()
    assert len(jobs) == 2 and made.on == {"influence", "control points"}
    made.switch("influence", on=False)
    assert made.on == {"control points"} and len(jobs) == 2
