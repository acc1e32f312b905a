"""controller.panels.window.wall_view: all heads of a stage in the window, their names, and clicks on them."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS
from controller.panels.session.jobs import Jobs
from controller.panels.session.problems import Problems
from controller.panels.window import wall_view
from controller.panels.window.head_source import HeadSource
from controller.panels.window.wall_view import WallView, tile_at
from surface.view.docks import PictureArea
from tests.controller.panels.window.screen import Screen
from tests.controller.panels.window.test_face import on_a_display, shown


class TwoTiles:
    """In place of a wall that draws: two tiles side by side."""

    fails, released = False, 0

    def __init__(self, *_: object) -> None: ...

    def boxes(self, size: tuple[float, float]) -> list[tuple[float, float, float, float]]:
        return [(0, 0, size[0] / 2, size[1]), (size[0] / 2, 0, size[0] / 2, size[1])]

    def draw(self, ctx: object, size: tuple[int, int]) -> str:
        if TwoTiles.fails:
            raise RuntimeError("no memory")
        return f"{ctx} {size}"

    def release(self) -> None:
        TwoTiles.released += 1


@pytest.fixture
def view(monkeypatch: pytest.MonkeyPatch) -> Iterator[WallView]:
    monkeypatch.setattr(wall_view, "LiveWall", TwoTiles)
    monkeypatch.setattr(wall_view, "load_heads", lambda stages, parameters, wanted: ["loaded", *stages])
    monkeypatch.setattr(TwoTiles, "fails", False)
    monkeypatch.setattr(TwoTiles, "released", 0)
    sources: Any = [HeadSource(name, name, name, name) for name in ("maple", "oak")]  # type: ignore[arg-type]
    area, problems = PictureArea(left=100.0, top=50.0, width=400.0, height=300.0), Problems()
    yield WallView(sources, PARAMETERS, "fast", area, Jobs(problems), problems)


def load(view: WallView) -> None:
    for job in view._jobs.running:
        job.join(30.0)
    view._jobs()


def test_the_wall_is_drawn_once_its_heads_are_loaded_and_again_without_loading(view: WallView) -> None:
    view.switch(True)
    assert view.on and not view.shown
    load(view)
    assert view.shown and view.draw("context", (4, 3)) == "context (4, 3)"  # type: ignore[arg-type, comparison-overlap]
    view.switch(False)
    assert not view.on and not view.shown and TwoTiles.released == 1
    view.switch(True)
    assert view.shown and view._jobs.running == []


def test_one_head_is_shown_again_where_loading_is_cancelled_or_drawing_fails(
    view: WallView, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = threading.Event()
    monkeypatch.setattr(wall_view, "load_heads", lambda *_: go.wait(30.0))
    view.switch(True)
    view._jobs.running[0].cancelled = True
    go.set()
    load(view)
    assert not view.on and not view.shown
    monkeypatch.setattr(wall_view, "load_heads", lambda *_: [])
    view.switch(True)
    load(view)
    TwoTiles.fails = True
    assert view.draw(None, (4, 3)) is None  # type: ignore[arg-type]
    assert not view.on and not view.shown and TwoTiles.released == 1
    assert ["no memory" in problem.text for problem in view._problems.unread] == [True]


def test_a_click_chooses_a_head_and_a_double_click_shows_it_alone(view: WallView) -> None:
    chosen: list[int] = []
    view.choose, view.chosen = chosen.append, lambda: 1
    view.switch(True)
    load(view)
    screen = Screen()
    try:

        def draw() -> None:
            view(screen.imgui)

        screen.click(draw, 420.0, 200.0)
        assert chosen == [1] and view.shown
        screen.click(draw, 20.0, 200.0)  # beside the picture
        assert chosen == [1]
        screen.click(draw, 150.0, 200.0)
        screen.click(draw, 150.0, 200.0)
        assert chosen == [1, 0, 0] and not view.shown
    finally:
        screen.imgui.destroy_context(screen.context)


def test_a_point_belongs_to_the_tile_that_holds_it() -> None:
    boxes = [(0.0, 0.0, 10.0, 10.0), (10.0, 0.0, 10.0, 10.0)]
    assert [tile_at(boxes, x, 5.0) for x in (0.0, 9.9, 10.0, 20.0)] == [0, 0, 1, None]
    assert tile_at(boxes, 5.0, 10.0) is None


STAGE = """
name = "three"
[face]
size = [600, 300]
[[heads]]
name = "maple"
[[heads]]
name = "oak"
person = "oak"
[[heads]]
name = "birch"
"""
WALL = """
import json
from controller.panels.window.face import WindowFace

drawn = []
gui = WindowFace._gui

def watch(self):
    gui(self)
    if self._wall.shown and self._wall._wall._groups:
        drawn.append(len(self._wall._wall._groups))
        self._ended = len(drawn) >= 4

WindowFace._gui = watch
from controller.cli.app import main
try:
    main()
finally:
    print(json.dumps(drawn))
"""


@pytest.mark.slow
@on_a_display
@pytest.mark.parametrize("words", [(), ("--kiosk",)])
def test_a_stage_with_several_heads_opens_as_a_wall(tmp_path: Path, words: tuple[str, ...]) -> None:
    stage = tmp_path / "three.toml"
    stage.write_text(STAGE)
    said = shown(WALL, "run", str(stage), "--seconds", "200", *words)
    assert json.loads(said.splitlines()[-1])[:4] == [1, 2, 2, 2]  # heads that look alike are drawn by one renderer
