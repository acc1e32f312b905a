"""All heads of a stage side by side in a window, with their names; a click chooses whom the panels move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from controller.base.parameters import Parameters
from controller.face.live_wall import LiveWall
from controller.face.wall import LoadedHead, load_heads
from controller.panels.session.jobs import Job, Jobs
from controller.panels.session.problems import Problems
from controller.panels.window.head_source import HeadSource
from surface.view.docks import PictureArea

if TYPE_CHECKING:
    import moderngl

_LOADING = "loading all heads"
_NAME_COLOUR, _CHOSEN_COLOUR = (0.85, 0.87, 0.9, 0.8), (1.0, 0.8, 0.3, 1.0)
"""RGBA, 0..1, of a head's name, and of the name of the head that the panels move."""


class WallView:
    """The wall of a window.

    sources : the heads, in the order of the stage. quality : "full" or "fast". area : where the picture is.
    jobs, problems : of the window; heads are loaded in a job.

    Attributes
    ----------
    on : whether the wall is wanted. chosen : the number of the head that the panels move. choose : moves another.
    """

    def __init__(
        self, sources: Sequence[HeadSource], parameters: Parameters, quality: str, area: PictureArea, jobs: Jobs,
        problems: Problems,
    ) -> None:  # fmt: skip
        self._sources, self._parameters, self._quality = sources, parameters, quality
        self._area, self._jobs, self._problems = area, jobs, problems
        self.on = False
        self.chosen: Callable[[], int] = lambda: 0
        self.choose: Callable[[int], None] = lambda number: None
        self._loaded: list[LoadedHead] | None = None
        self._wall: LiveWall | None = None

    @property
    def shown(self) -> bool:
        """Whether the wall is drawn: it is wanted, and its heads are loaded."""
        return self._area.instead is self

    def switch(self, on: bool) -> None:
        """Show all heads, or one."""
        self.on = on
        if not on:
            self._jobs.drop(_LOADING)
            self._end()
        elif self._loaded is not None:
            self._begin(self._loaded)
        else:
            self._jobs.start(_LOADING, self._load, self._begin, lambda: self.switch(False))

    def _load(self, job: Job) -> list[LoadedHead]:
        return load_heads([each.stage for each in self._sources], self._parameters, lambda: not job.cancelled)

    def _begin(self, loaded: list[LoadedHead]) -> None:
        self._loaded = loaded
        self._wall = LiveWall(loaded, self._parameters, [each.mailbox for each in self._sources], self._quality)
        self._area.instead = self

    def _end(self) -> None:
        if self._wall is not None:
            self._wall.release()
        self._wall = None
        if self.shown:
            self._area.instead = None

    def draw(self, ctx: moderngl.Context, size: tuple[int, int]) -> moderngl.Framebuffer | None:
        """The picture of all heads; where that fails the window shows one head again and says why."""
        if self._wall is None:
            return None
        try:
            return self._wall.draw(ctx, size)
        except Exception as error:  # noqa: BLE001  the window goes on
            self._problems.add(error)
            self.switch(False)
            return None

    def release(self) -> None:
        """Release the graphics memory, and load no further head."""
        self._jobs.drop(_LOADING)
        self._end()

    def __call__(self, imgui: Any) -> None:
        """Names over the picture, and clicks on heads; called once a frame."""
        if not self.shown or self._wall is None:
            return
        area, line = self._area, imgui.get_font_size()
        boxes = self._wall.boxes((area.width, area.height))
        sheet = imgui.get_background_draw_list()
        for i, (source, (left, top, width, height)) in enumerate(zip(self._sources, boxes, strict=True)):
            colour = imgui.get_color_u32(imgui.ImVec4(*(_CHOSEN_COLOUR if i == self.chosen() else _NAME_COLOUR)))
            middle = area.left + left + 0.5 * (width - imgui.calc_text_size(source.name).x)
            sheet.add_text(imgui.ImVec2(middle, area.top + top + height - 1.5 * line), colour, source.name)
        if not imgui.get_io().want_capture_mouse and imgui.is_mouse_clicked(imgui.MouseButton_.left):
            mouse = imgui.get_mouse_pos()
            number = tile_at(boxes, mouse.x - area.left, mouse.y - area.top)
            if number is not None:
                self.choose(number)
        if not imgui.get_io().want_capture_mouse and imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
            self.switch(False)


def tile_at(boxes: Sequence[tuple[float, float, float, float]], x: float, y: float) -> int | None:
    """The number of the box (left, top, width, height) that holds a point; None where no box does."""
    for i, (left, top, width, height) in enumerate(boxes):
        if left <= x < left + width and top <= y < top + height:
            return i
    return None
