"""All parts of the panel, and what its keys do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller.base.errors import OMOTE_ERRORS
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.body.messages import Details, PanelRequest, StartServos, StopServos
from controller.body.panel_state import PanelState
from controller.panels.overlay.colours import GREEN
from controller.panels.overlay.stop import StopButton
from controller.panels.session.capture import Capture
from controller.panels.session.commands import Commands
from controller.panels.session.feed import Feed
from controller.panels.session.jobs import Jobs
from controller.panels.session.look import Look
from controller.panels.session.playback import Playback
from controller.panels.session.problems import Problems
from controller.panels.session.servo_captures import ServoCaptures
from controller.panels.window.calibrating import Calibrating
from controller.panels.window.drops import Drops
from controller.panels.window.expressions import ExpressionButtons
from controller.panels.window.heads import HeadChoice
from controller.panels.window.keys import Keys
from controller.panels.window.link_list import LinkList
from controller.panels.window.looks import LookControls, Looks
from controller.panels.window.notices import draw_jobs, draw_problems
from controller.panels.window.saving import Saving, Words
from controller.panels.window.servos import ServoBars
from controller.panels.window.sliders import Sliders
from controller.panels.window.timeline_panel import TimelinePanel
from controller.panels.window.view import View
from controller.robot.settings import RobotSettings
from controller.vocabulary.vocabulary import Vocabulary
from surface.view.docks import Dock, PictureArea
from surface.view.fullscreen import FullScreen
from surface.view.scene.viewpoint import Viewpoint

_OWN = "mine.toml"


@dataclass(frozen=True)
class PanelOptions:
    """What a panel shows of its stage.

    vocabulary : its expressions. files : the vocabularies it names; saved expressions go into the last one, or into
    ``mine.toml`` in ``folder``. shows : names of its shows. life : its amount of idle motion.
    folder : for all that is saved. parameters : those of the stage. robots : those of the stage.
    """

    vocabulary: Vocabulary = field(default_factory=lambda: Vocabulary.load(PARAMETERS))
    files: Sequence[Path] = ()
    shows: Sequence[str] = ()
    life: float = 0.0
    folder: Path = field(default_factory=Path.cwd)
    parameters: Parameters = field(default_factory=lambda: PARAMETERS)
    robots: Sequence[RobotSettings] = ()

    @property
    def own_file(self) -> Path:
        """The vocabulary that everything is saved to."""
        return self.files[-1] if self.files else self.folder / _OWN


class Panel:
    """Draws the panel.

    newest : the newest parameters (P,). send : sends requests to the body.
    state : without it, neither the layer that holds a parameter nor what the servos show of it is drawn.
    details : the newest answer of the body about servos and links; without it neither is shown.

    Attributes
    ----------
    stop : the button that stops the servos. heads : the choice between several heads; None for one.
    sculpt : draws what the mouse does to the face; None for nothing.
    """

    def __init__(
        self, newest: Callable[[], Floats], send: Callable[[PanelRequest], None], state: PanelState | None = None,
        options: PanelOptions | None = None, viewpoint: Viewpoint | None = None, area: PictureArea | None = None,
        details: Callable[[], Details | None] | None = None,
    ) -> None:  # fmt: skip
        options = options or PanelOptions()
        self.area = area or PictureArea()
        self._send, self._state = send, state
        self._options, self.problems = options, Problems()
        self.jobs, self.full_screen = Jobs(self.problems), FullScreen()
        self.feed = Feed(send, details, self.problems) if details is not None else None
        self.commands = Commands(send, options.life)
        self.capture = Capture(self.area, newest, options.folder, parameters=options.parameters, jobs=self.jobs)
        own = options.own_file
        self.sliders = Sliders(newest, self.commands, state, options.parameters)
        words = Words(options.vocabulary, own, tuple(options.files[:-1]), options.parameters)
        self.saving = Saving(words, self.commands, newest, send)
        self.expressions = ExpressionButtons(options.vocabulary, self.commands, self.saving)
        self.view = View(self.commands, viewpoint or Viewpoint(), self.capture, options.shows, send)
        self.playback = Playback(self.commands, newest, send, parameters=options.parameters)
        self.timeline = TimelinePanel(
            self.playback, self.commands, self.capture, options.vocabulary, self.problems, options.folder
        )
        if self.feed is not None:
            self.calibrating = Calibrating(ServoCaptures(options.robots, options.folder), send, self.problems)
            self.servos, self.links = ServoBars(self.feed, self.calibrating), LinkList(self.feed)
        self.stop = StopButton(lambda: send(StopServos()))
        undoing = {"z": self.commands.undo, "y": self.commands.redo}
        self.keys = Keys(self._actions(), undoing, {"escape": lambda: send(StopServos())})
        self.sculpt: Callable[[], None] | None = None
        self.heads: HeadChoice | None = None

    def docks(self) -> list[Dock]:
        """Return the parts, as tabs beside the picture."""
        parts: dict[str, Callable[[], None]] = {
            "Faces": self.expressions,
            "Sliders": self.sliders,
            **({"Sculpt": self.sculpt} if self.sculpt is not None else {}),
            "View": self.view,
            "Time": self.timeline,
        }
        if self.feed is not None:
            parts |= {"Servos": self.servos, "Links": self.links}
        return [Dock(title, "left", self._below_top(part)) for title, part in parts.items()]

    def __call__(self) -> None:
        """Handle keys and recording, which belong to no tab; called once per frame."""
        from imgui_bundle import imgui  # optional

        if self._state is not None:
            self._state.refresh()
        self.sliders.listen()
        if not imgui.is_any_mouse_down():
            self.commands.end_step()
        self.keys(self.stop.box.bottom)
        self.capture()
        self.jobs()
        self.playback()
        if self.feed is not None:
            self.feed()
        if self.area.bare and self._stopped_by:
            self._start_over_the_picture(imgui)
        self.stop(imgui)

    def add_looks(self, looks: Looks, restart: Callable[[Path], None]) -> None:
        """Let the user change how the face looks, and drop files on the window.

        restart : called with the file of a stage that was dropped.
        """
        commands, folder = self.commands, self._options.folder

        def show(look: Look | None) -> None:
            try:
                looks.show(look)
            except OMOTE_ERRORS as error:
                self.problems.add(error)

        commands.show_look = show
        self.view.look = LookControls(looks, commands)
        self.area.dropped = Drops(looks, commands, self.jobs, self.problems, self._send, folder, restart)

    def _actions(self) -> dict[str, Callable[[], None]]:
        return {
            "space": self.view.toggle_show,
            "r": self.capture.toggle,
            "p": self.capture.take_picture,
            "c": self.capture.toggle_clip,
            "n": self._neutral,
            "f": self._toggle_bare,
        }

    def _neutral(self) -> None:
        """Release everything that is held, also servos that were turned by hand."""
        self.commands.return_to_neutral()
        if self.feed is not None:
            self.calibrating.forget()

    def _toggle_bare(self) -> None:
        """Show only the face on the whole screen, or return to the panel."""
        self.area.bare = not self.area.bare
        if self.area.bare != self.full_screen.on:
            self.full_screen.toggle()

    def _start_over_the_picture(self, imgui: Any) -> None:
        """Draw the button that ends a stop above the STOP button if only the picture is shown."""
        line, box = imgui.get_font_size(), self.stop.box
        imgui.set_next_window_pos(imgui.ImVec2(box.right, box.top - line), imgui.Cond_.always, imgui.ImVec2(1.0, 1.0))
        imgui.set_next_window_size(imgui.ImVec2(box.right - box.left + line, 0.0))
        flags = imgui.WindowFlags_
        hidden = flags.no_decoration | flags.no_docking | flags.no_background | flags.no_saved_settings | flags.no_move
        imgui.begin("##start", None, hidden)
        self._start(imgui)
        imgui.end()

    def _below_top(self, part: Callable[[], None]) -> Callable[[], None]:
        """Return a part below what every tab has on top."""

        def draw() -> None:
            from imgui_bundle import imgui  # optional

            self.stop.leave_room(imgui)
            if self._stopped_by:
                self._start(imgui)
            if self.heads is not None:
                self.heads.draw(self.commands)
            self._top(imgui)
            draw_problems(imgui, self.problems)
            draw_jobs(imgui, self.jobs)
            imgui.begin_child("##part")
            part()
            imgui.end_child()

        return draw

    @property
    def _stopped_by(self) -> str:
        """Return who stopped the servos; empty while they are not stopped."""
        return self._state.stopped_by if self._state is not None else ""

    def _start(self, imgui: Any) -> None:
        """Draw who stopped the servos and the button that ends it, away from STOP, which may be clicked twice."""
        imgui.text_wrapped(f"servos stopped by {self._stopped_by}")
        imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*GREEN))
        if imgui.button("START servos", imgui.ImVec2(-1, 0)):
            self._send(StartServos())
        imgui.pop_style_color()

    def _top(self, imgui: Any) -> None:
        commands = self.commands
        actions = {"undo": (commands.undo, commands.undoable), "redo": (commands.redo, commands.redoable),
                   "neutral": (self._neutral, True)}  # fmt: skip
        for name, (action, possible) in actions.items():
            imgui.begin_disabled(not possible)
            if imgui.button(f"{name}##top"):
                action()
            imgui.end_disabled()
            imgui.same_line()
        imgui.text_disabled(f"{imgui.get_io().framerate:.0f} frames/s   H: keys")
