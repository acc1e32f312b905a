"""Choice of the head that the window shows and controls, in a stage (configuration) with several heads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

from controller.body.messages import PanelRequest, StartServos, StopServos, ToHead
from controller.body.panel_state import PanelState
from controller.face.face import HeadValues
from controller.panels.session.commands import Commands
from controller.panels.window.head_source import HeadSource
from controller.panels.window.wall_view import WallView
from controller.stage.stage import Stage


class HeadChoice:
    """Switches between heads; each keeps its settings, with its own undo.

    sources : in the order of the stage; empty for a stage of one head. values, state : what the window reads.
    tell : sends requests to the body; a request that names no head is for the first one.

    Attributes
    ----------
    chosen : the number of the head that is shown. show : shows the head of a stage; set by who can.
    wall : shows all heads side by side; None where that is not possible.
    """

    def __init__(
        self, sources: Sequence[HeadSource], values: HeadValues, state: PanelState | None,
        tell: Callable[[PanelRequest | ToHead], None],
    ) -> None:  # fmt: skip
        self._sources = [HeadSource(each.name, each.stage, each.mailbox, copy(each.state)) for each in sources]
        self._values, self._state, self._tell = values, state, tell
        self.chosen = 0
        self.show: Callable[[Stage], None] = lambda stage: None
        self.wall: WallView | None = None

    @property
    def names(self) -> list[str]:
        """Names of the heads."""
        return [each.name for each in self._sources]

    def send(self, request: PanelRequest) -> None:
        """Send a request for the head that is shown; servos stop and start together."""
        whole = not self._sources or isinstance(request, StopServos | StartServos)
        self._tell(request if whole else ToHead(self._sources[self.chosen].name, request))

    def choose(self, number: int, commands: Commands) -> None:
        """Show and control another head from now on."""
        if number == self.chosen:
            return
        before, self.chosen = self._sources[self.chosen], number
        now = self._sources[number]
        self._values.listen(now.mailbox)
        if self._state is not None:
            self._state.turn_to(now.state)
        commands.switch_head(before.name, now.name, now.stage.settings.liveliness)
        self.show(now.stage)

    def draw(self, commands: Commands) -> None:
        """Draw the list of heads, if there are several; called once per frame."""
        if len(self._sources) < 2:
            return
        from imgui_bundle import imgui  # optional

        imgui.set_next_item_width(imgui.get_font_size() * 9)
        changed, number = imgui.combo("head", self.chosen, self.names)
        if changed:
            self.choose(number, commands)
        if self.wall is not None:
            imgui.same_line()
            changed, on = imgui.checkbox("all", self.wall.on)
            imgui.set_item_tooltip("Show all heads side by side. Click one to move it, double-click to see it alone.")
            if changed:
                self.wall.switch(on)
            if self.wall.shown:
                imgui.text_wrapped("looks, camera, overlays and pulling are seen on a head that is shown alone")
