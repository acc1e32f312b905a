"""Changes the appearance of the face while it is shown: theme, quality, person, another head.

A head is loaded in a thread of its own, then the window draws it; the servos notice nothing. Independent of the window
library, but for drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_args

from controller.base.paths import config_dir
from controller.panels.session.jobs import Jobs
from controller.panels.session.look import Look
from controller.stage.picture import PictureSettings
from controller.stage.stage import FaceSettings, with_picture

if TYPE_CHECKING:
    from controller.panels.session.commands import Commands
    from controller.stage.stage import Stage
    from surface.head import Head
    from surface.head.model.light import LightPoints

NOBODY, _CHANGING = "nobody", "changing control points"
_THEMES, _QUALITIES = (get_args(PictureSettings.model_fields[key].annotation) for key in ("theme", "quality"))


class Looks:
    """Changes the appearance (look) of a stage's face.

    swap : draws a head with settings from now on. jobs : loads it.

    Attributes
    ----------
    light : control points that were added to the face. shown_light : those of the head that was loaded last.
    only_light : whether that one differs in these alone from the head before.
    keep_light : makes these the added ones, where the user does not wait for others, or they cannot be loaded.
    """

    def __init__(self, stage: Stage, swap: Callable[[Head | None, FaceSettings], None], jobs: Jobs) -> None:
        self._swap, self._jobs = swap, jobs
        self.light: tuple[LightPoints, ...] = ()
        self.shown_light: tuple[LightPoints, ...] = ()
        self.keep_light: Callable[[], None] = lambda: None
        self.only_light = False
        self._begin(stage)
        self._drawn = (stage, self.first)

    def _begin(self, stage: Stage) -> None:
        face = stage.settings.face
        self.stage = stage
        self.first = Look(face.theme, face.quality, face.person if isinstance(face.person, str) else "")
        self._shown = self.first

    def turn_to(self, stage: Stage, look: Look | None) -> None:
        """Show another head of the stage, with a look that was chosen for it."""
        self._begin(stage)
        self._load(look or self.first, f"loading {stage.head.name}")
        self._shown = look or self.first

    def _load(self, look: Look, title: str) -> None:
        of, stage, asked = self.stage, self._stage(look), self.light
        face = stage.settings.face
        light = asked if stage.head == self.stage.head else ()

        def done(head: Head) -> None:
            if asked == self.light:  # else the next one is being loaded
                self.shown_light = light
                self.only_light = self._drawn[0] is of and self._drawn[1] == look
                self._drawn = of, look
                self._swap(head, face)

        given_up = self.keep_light if title == _CHANGING else lambda: None
        self._jobs.start(title, lambda _: stage.load_head(light), done, given_up)

    def show_light(self, light: tuple[LightPoints, ...]) -> None:
        """Show the face with control points that were added to it."""
        self.light = light
        if light != self.shown_light:
            self._load(self._shown, _CHANGING)
            return
        self._jobs.drop(_CHANGING)

    def show(self, look: Look | None) -> None:
        """Show a look, or the initial one for None. If it fails, that is reported and the face stays."""
        look = look or self.first
        before, self._shown = self._shown, look
        stage = self._stage(look)
        same_head = (before.person, before.head) == (look.person, look.head)
        if same_head and stage.settings.face.dressed == self._stage(before).settings.face.dressed:
            self._swap(None, stage.settings.face)
            return
        what = look.person or (look.head.name if look.head else "the head")
        self._load(look, f"loading {what}")

    def load_plain(self) -> Head:
        """Load the head that is shown again, without the control points that were added to it."""
        return self._stage(self._shown).load_head()

    def load(self) -> Head:
        """Load the head that is shown again, as it was."""
        return self._stage(self._shown).load_head(self.shown_light)

    def _stage(self, look: Look) -> Stage:
        """Return the stage with a look. Raises ConfigError: no such person, or one that does not fit the head."""
        stage = self.stage
        if look.head is not None:
            settings = stage.settings.model_copy(update={"identity": {}})
            stage = replace(stage, head=look.head, groups=(), own_groups={}, settings=settings)
        wanted: dict[str, object] = {"theme": look.theme, "quality": look.quality}
        if look.person != self.first.person or look.head is not None:
            wanted["person"] = look.person
        return with_picture(stage, wanted)


def person_names() -> list[str]:
    """Return names of the shipped persons."""
    return sorted(path.stem for path in (config_dir() / "persons").glob("*.toml"))


class LookControls:
    """Draws the choices; ``looks`` : carries them out, through ``commands``, so that they can be undone."""

    def __init__(self, looks: Looks, commands: Commands) -> None:
        self._looks, self._commands = looks, commands
        self._persons = [NOBODY, *person_names()]

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        look = self._commands.now.look or self._looks.first
        theme = _choose(imgui, "theme", _THEMES, look.theme)
        quality = _choose(imgui, "quality", _QUALITIES, look.quality)
        person = _choose(imgui, "person", self._persons, look.person or NOBODY)
        chosen = replace(look, theme=theme, quality=quality, person="" if person == NOBODY else person)
        if chosen != look:
            self.choose(chosen)
        if look.head is not None:
            imgui.text_wrapped(f"head: {look.head}")
            if imgui.button("the stage's own head"):
                self.choose(replace(look, head=None))

    def choose(self, look: Look) -> None:
        """Change to a look."""
        self._commands.set_look(look)


def _choose(imgui: Any, label: str, names: Sequence[str], chosen: str) -> str:
    """Return one of ``names`` from a list that opens; what was chosen by a file keeps its own line."""
    listed = list(names) if chosen in names else [chosen, *names]
    imgui.set_next_item_width(imgui.get_font_size() * 9)
    changed, at = imgui.combo(label, listed.index(chosen), listed)
    return listed[at] if changed else chosen
