"""Panels docked beside the picture of a window, and where the picture is between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import moderngl

    from surface.view.draw.renderer import Renderer
    from surface.view.scene.choice import QualityChoice

Side = Literal["left", "right", "bottom"]
MAIN = "MainDockSpace"
_WIDEST, _WIDEST_OF_TWO = 0.6, 0.4  # share of the window that a column takes at most, and each of two
_SHARES: dict[Side, float] = {"left": 22.5, "right": 22.5, "bottom": 13.0}
"""Width of a column and height of a row, in heights of a line of text."""


@dataclass(frozen=True)
class Dock:
    """A panel that is docked at a side of the picture; panels of one side share it as tabs.

    title : of its tab. draw : draws its contents with ImGui, once a frame while its tab is in front.
    """

    title: str
    side: Side
    draw: Callable[[], None]


@dataclass(frozen=True)
class Remake:
    """Another head or look for a window that is open.

    make : makes a renderer for a context and a quality. quality : one, or a choice between them.
    done : called when it is drawn from now on, or with the error for which the picture stays as it was.
    """

    make: Callable[..., Renderer]
    quality: str | QualityChoice
    done: Callable[[Exception | None], None]


class Instead(Protocol):
    """What a window can show in place of its head."""

    def draw(self, ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Framebuffer | None:
        """The next picture of ``size``, pixels; None for the head, after all."""

    def release(self) -> None:
        """Release the graphics memory; called while the context exists."""


@dataclass
class PictureArea:
    """Where the picture is in a window, in ImGui's points from the window's top left corner.

    wanted : gets the next picture once, (height, width, 3) uint8. bare : the caller hides all docked panels.
    remake : drawn from the next frame on. dropped : gets files that are dropped on the window.
    instead : draws something else in place of the head; the mouse does not turn the head meanwhile.
    """

    left: float = 0.0
    top: float = 0.0
    width: float = 1.0
    height: float = 1.0
    wanted: Callable[[NDArray[np.uint8]], None] | None = None
    bare: bool = False
    remake: Remake | None = None
    dropped: Callable[[Sequence[Path]], None] | None = None
    instead: Instead | None = None


LINE = 16.0
"""Height of a line of the runner's text, points, before it is scaled."""


def text_scale(size: tuple[float, float], system: float, docks: Sequence[Dock] = ()) -> float:
    """Factor on the size of text, for a window of ``size`` points; ``system`` : the desktop's own factor.

    Text grows with the height of the window. Where that, or the desktop's factor, made it too large for the columns
    beside the picture, it is smaller, so that nothing in one column, or in two of usual
    width, is cut; never smaller than without a factor.
    """
    system = max(system, 1.0)
    wanted = max(1.0, size[1] / 1080.0 / system)
    columns = {dock.side for dock in docks} & {"left", "right"}
    most = min((size[0] * _widest(docks) / (_SHARES[side] * LINE * system) for side in columns), default=wanted)
    return max(1.0 / system, min(wanted, most))


def _widest(docks: Sequence[Dock]) -> float:
    return _WIDEST_OF_TWO if {"left", "right"} <= {dock.side for dock in docks} else _WIDEST


def add_docks(runner: Any, params: Any, docks: Sequence[Dock], size: tuple[float, float], line: float) -> None:
    """Make ImGui's runner dock the panels, in a window of ``size`` points whose text is ``line`` points high."""
    from imgui_bundle import imgui  # optional: the extra view

    places = {"left": imgui.Dir.left, "right": imgui.Dir.right, "bottom": imgui.Dir.down}
    window = params.imgui_window_params
    window.default_imgui_window_type = runner.DefaultImGuiWindowType.provide_full_screen_dock_space
    docking, rest = params.docking_params, 1.0
    docking.main_dock_space_node_flags = imgui.DockNodeFlags_.passthru_central_node
    sides = dict.fromkeys(dock.side for dock in docks)
    widest = _widest(docks)
    for side in sides:
        across = size[1] if side == "bottom" else size[0] * rest
        share = min(_SHARES[side] * line / across, widest)
        docking.docking_splits += [runner.DockingSplit(MAIN, side, places[side], share)]
        rest *= 1.0 if side == "bottom" else 1.0 - share
    windows = [_window(runner, dock) for dock in docks]
    windows[0].focus_window_at_next_frame = True
    docking.dockable_windows = windows


def _window(runner: Any, dock: Dock) -> Any:
    window = runner.DockableWindow(dock.title, dock.side, dock.draw)
    window.can_be_closed = False
    return window


def show_docks(params: Any, *, shown: bool) -> None:
    """Show or hide all docked panels; the picture takes the room of hidden ones."""
    docking = params.docking_params
    for window in list(docking.dockable_windows):
        docking.dockable_window_of_name(window.label).is_visible = shown


def find_area(imgui: Any, docking: Any, area: PictureArea) -> None:
    """Write where the middle of the docked panels is to ``area``."""
    dock_space = docking.dock_space_id_from_name(MAIN)
    node = imgui.internal.dock_builder_get_central_node(dock_space) if dock_space is not None else None
    if node is not None:
        area.left, area.top, area.width, area.height = node.pos.x, node.pos.y, node.size.x, node.size.y
