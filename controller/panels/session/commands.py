"""What the user has set in the panel, with undo and redo.

Independent of the window library.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from controller.base.parameters import Floats
from controller.body.messages import Hold, Live, LookAt, Neutral, PanelRequest, Show
from controller.panels.session.look import Look
from controller.takes.livelink import Take
from controller.takes.timeline import Timeline
from surface.head.model.light import LightPoints

_NEUTRAL_S = 0.6
_NOTHING_SHOWN = Show("neutral", 1.0)


@dataclass(frozen=True)
class Settings:
    """Everything that the user has set in the panel at one moment.

    held : parameters by index and the values they are held at. expression : the one that is shown.
    gaze : the point that is looked at, see :class:`controller.body.messages.LookAt`. life : amount of idle motion.
    moves : (n, 3) mm that the control points of the face were moved by hand; None for none.
    light : control points that were added to the face; they are the last of ``moves``.
    look : theme, quality, person and head; None for those of the stage.
    timeline : keys that become a show. take : the recording that is edited.
    """

    held: Mapping[int, float] = field(default_factory=dict)
    expression: Show = _NOTHING_SHOWN
    gaze: tuple[float, float, float] | None = None
    life: float = 0.0
    moves: Floats | None = None
    light: tuple[LightPoints, ...] = ()
    look: Look | None = None
    timeline: Timeline = field(default_factory=Timeline)
    take: Take | None = None


@dataclass(frozen=True)
class History:
    """What is set, what can be taken back (the newest last), and what can be done again (the next last)."""

    now: Settings
    past: tuple[Settings, ...] = ()
    future: tuple[Settings, ...] = ()


class Commands:
    """Changes what the user has set, sends it to the body, and undoes changes without limit.

    send : sends requests to the body. life : amount of idle motion at first.
    show_moves : draws the control points moved by (n, 3) mm, or where they were for None.
    show_light : draws a face with added control points; set by who can.
    show_look : shows a look, or the first one for None; set by who can.
    """

    def __init__(
        self,
        send: Callable[[PanelRequest], None],
        life: float = 0.0,
        show_moves: Callable[[Floats | None], None] = lambda moves: None,
    ) -> None:
        self.send, self.show_moves = send, show_moves
        self.show_light: Callable[[tuple[LightPoints, ...]], None] = lambda light: None
        self.show_look: Callable[[Look | None], None] = lambda look: None
        self.now = Settings(life=life)
        self._past: list[Settings] = []
        self._future: list[Settings] = []
        self._step: Hashable = None
        self._others: dict[str, History] = {}

    @property
    def undoable(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._past)

    @property
    def redoable(self) -> bool:
        """Whether there is something taken back to do again."""
        return bool(self._future)

    @property
    def history(self) -> History:
        """All that another window needs to go on with what was set here."""
        return History(self.now, tuple(self._past), tuple(self._future))

    def carry_on(self, history: History) -> None:
        """Continue with the history of another window: send its settings to the body; undo and redo work as there."""
        self._past, self._future = list(history.past), list(history.future)
        self._apply(history.now)
        self.end_step()

    def turn_to(self, before: str, name: str, life: float) -> None:
        """Go on with what was set of another head, which the body has kept; ``before`` is kept for later.

        ``life`` : its amount of idle motion, where nothing was set of it yet.
        """
        self._others[before] = self.history
        history = self._others.get(name, History(Settings(life=life)))
        self._past, self._future, self.now = list(history.past), list(history.future), history.now
        self.end_step()

    def hold(self, values: Mapping[int, float | None], step: Hashable = None) -> None:
        """Hold parameters at values; None gives one back to the layers. ``step`` : see :meth:`change`."""
        held = {**self.now.held, **values}
        self.change(replace(self.now, held={i: x for i, x in held.items() if x is not None}), step)

    def show(self, name: str, intensity: float, step: Hashable = None) -> None:
        """Show an expression."""
        self.change(replace(self.now, expression=Show(name, intensity)), step)

    def look(self, point: tuple[float, float, float] | None, step: Hashable = None) -> None:
        """Look at a point, or at nothing in particular."""
        self.change(replace(self.now, gaze=point), step)

    def live(self, amount: float, step: Hashable = None) -> None:
        """Set the amount of idle motion, 0..1."""
        self.change(replace(self.now, life=amount), step)

    def move(self, moves: Floats | None, step: Hashable = None) -> None:
        """Move control points; None puts all of them back, and takes those out that were added."""
        light = self.now.light if moves is not None else ()
        self.change(replace(self.now, moves=moves, light=light), step)

    def add_points(self, light: LightPoints, moves: Floats, own: int) -> None:
        """Add control points (k) to the face, moved by ``moves`` (k, 3); ``own`` : how many it has without any."""
        before = np.zeros((own, 3)) if self.now.moves is None else self.now.moves
        self.change(replace(self.now, moves=np.concatenate([before, moves]), light=(*self.now.light, light)))

    def remove_point(self, number: int) -> None:
        """Take out one of the control points that were added, by its number among them."""
        moves = self.now.moves
        if moves is None:
            return
        own, light = len(moves) - sum(map(len, self.now.light)), []
        first = 0
        for each in self.now.light:
            kept = np.arange(len(each)) != number - first
            light.append(each if kept.all() else each.take(np.flatnonzero(kept)))
            first += len(each)
        rest = np.delete(moves, own + number, axis=0)
        self.change(replace(self.now, moves=rest, light=tuple(each for each in light if len(each))))

    def appear(self, look: Look | None) -> None:
        """Change the look."""
        self.change(replace(self.now, look=look))

    def arrange(self, timeline: Timeline, step: Hashable = None) -> None:
        """Change the timeline."""
        self.change(replace(self.now, timeline=timeline), step)

    def retake(self, take: Take | None) -> None:
        """Edit a recording, or another version of it."""
        self.change(replace(self.now, take=take))

    def neutral(self) -> None:
        """Give everything back and return to the neutral face; idle motion, moved control points and the look stay."""
        self._remember()
        kept = {name: getattr(self.now, name) for name in ("life", "moves", "light", "look", "timeline", "take")}
        self.now = Settings(**kept)
        self.send(Neutral(_NEUTRAL_S))

    def change(self, to: Settings, step: Hashable = None) -> None:
        """Set everything that differs; changes with one ``step``, as of one drag, are taken back together."""
        if step is None or step != self._step:
            self._remember()
        self._step = step
        self._apply(to)

    def end_step(self) -> None:
        """The next change is one of its own."""
        self._step = None

    def undo(self) -> None:
        """Take the last change back; without one nothing happens."""
        if self._past:
            self._future.append(self.now)
            self._apply(self._past.pop())
        self.end_step()

    def redo(self) -> None:
        """Do again what was taken back last; without it nothing happens."""
        if self._future:
            self._past.append(self.now)
            self._apply(self._future.pop())
        self.end_step()

    def _remember(self) -> None:
        self._past.append(self.now)
        self._future.clear()
        self.end_step()

    def _apply(self, to: Settings) -> None:
        before, self.now = self.now, to
        for request in _differences(before, to):
            self.send(request)
        if before.light != to.light:
            self.show_light(to.light)
        if before.moves is not to.moves or before.light != to.light:
            self.show_moves(to.moves)
        if before.look != to.look:
            self.show_look(to.look)


def _differences(before: Settings, after: Settings) -> Iterator[PanelRequest]:
    """Return requests that change ``before`` to ``after``."""
    for index in before.held.keys() - after.held.keys():
        yield Hold(index, None)
    for index, value in after.held.items():
        if before.held.get(index) != value:
            yield Hold(index, value)
    if before.expression != after.expression:
        yield after.expression
    if before.gaze != after.gaze:
        yield LookAt(after.gaze)
    if before.life != after.life:
        yield Live(after.life)
