"""The settings that the user makes in the panel, with undo and redo; independent of the window library."""

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

_NEUTRAL_S = 0.6  # duration of the return to the neutral face
_NOTHING_SHOWN = Show("neutral", 1.0)


@dataclass(frozen=True)
class Settings:
    """Everything that the user has set in the panel at one moment.

    held : values at which parameters are held, by index. expression : the one that is shown.
    gaze : the point to look at, see :class:`controller.body.messages.LookAt`. life : amount of idle motion, 0..1.
    moves : (n, 3) displacements of the face's control points by hand, mm; None if nothing was moved.
    light : light control points, see :mod:`surface.head.model.light`, that were added; the last rows of ``moves``.
    look : appearance: theme, quality, person and head; None for those of the stage (the configuration file).
    timeline : key frames of a show, a scripted performance. take : the recorded performance that is edited.
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
    """The current settings, those to undo (the newest last), and those to redo (the next last)."""

    now: Settings
    past: tuple[Settings, ...] = ()
    future: tuple[Settings, ...] = ()


class Commands:
    """Changes the settings, sends them to the control process (body), and undoes changes without limit.

    send : sends requests to the body. life : initial amount of idle motion, 0..1.
    show_moves : draws the control points displaced by (n, 3) mm, or undisplaced for None.
    head_switches : grows with every :meth:`switch_head`.
    show_light : draws a face with added control points. show_look : draws a look, or the initial one for None. Both do
        nothing until the window replaces them.
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
        self.head_switches = 0

    @property
    def undoable(self) -> bool:
        """Whether there is a change to undo."""
        return bool(self._past)

    @property
    def redoable(self) -> bool:
        """Whether there is a change to redo."""
        return bool(self._future)

    @property
    def history(self) -> History:
        """Everything that another window needs to continue with these settings."""
        return History(self.now, tuple(self._past), tuple(self._future))

    def restore(self, history: History) -> None:
        """Continue with the history of another window: send its settings to the body, and undo and redo as there."""
        self._past, self._future = list(history.past), list(history.future)
        self._apply(history.now)
        self.end_step()

    def switch_head(self, before: str, name: str, life: float) -> None:
        """Switch to the settings of another head, which the body still has, and remember those of head ``before``.

        life : amount of idle motion of a head of which nothing was set yet.
        """
        self._others[before] = self.history
        self.head_switches += 1
        history = self._others.get(name, History(Settings(life=life)))
        self._past, self._future, self.now = list(history.past), list(history.future), history.now
        self.end_step()

    def hold(self, values: Mapping[int, float | None], step: Hashable = None) -> None:
        """Hold parameters at values; None releases one, also where another panel or a link holds it.

        ``step`` : see :meth:`change`.
        """
        others = [i for i, value in values.items() if value is None and i not in self.now.held]
        for i in others:
            self.send(Hold(i, None))
        if others and len(others) == len(values):
            return
        held = {**self.now.held, **values}
        self.change(replace(self.now, held={i: x for i, x in held.items() if x is not None}), step)

    def adopt(self, changes: Mapping[int, float | None]) -> None:
        """Take over values at which others hold what was held here, None for what they have released; nothing is sent.

        Undo and redo do not bring back what others have released, and not the value here that others have changed.
        """
        before = self.now.held
        self.now = _adopted(self.now, before, changes)
        for row in (self._past, self._future):
            row[:] = [_adopted(settings, before, changes) for settings in row]

    def show(self, name: str, intensity: float, step: Hashable = None) -> None:
        """Show an expression."""
        self.change(replace(self.now, expression=Show(name, intensity)), step)

    def set_gaze(self, point: tuple[float, float, float] | None, step: Hashable = None) -> None:
        """Look at a point, or at nothing in particular."""
        self.change(replace(self.now, gaze=point), step)

    def set_life(self, amount: float, step: Hashable = None) -> None:
        """Set the amount of idle motion, 0..1."""
        self.change(replace(self.now, life=amount), step)

    def set_moves(self, moves: Floats | None, step: Hashable = None) -> None:
        """Displace control points; None resets all of them and removes those that were added."""
        light = self.now.light if moves is not None else ()
        self.change(replace(self.now, moves=moves, light=light), step)

    def add_points(self, light: LightPoints, moves: Floats, own: int) -> None:
        """Add control points (k) to the face, moved by ``moves`` (k, 3), mm.

        own : number of control points without any added ones.
        """
        before = np.zeros((own, 3)) if self.now.moves is None else self.now.moves
        self.change(replace(self.now, moves=np.concatenate([before, moves]), light=(*self.now.light, light)))

    def remove_point(self, number: int) -> None:
        """Remove one of the added control points, by its number among them."""
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

    def set_look(self, look: Look | None) -> None:
        """Change the appearance."""
        self.change(replace(self.now, look=look))

    def set_timeline(self, timeline: Timeline, step: Hashable = None) -> None:
        """Change the timeline."""
        self.change(replace(self.now, timeline=timeline), step)

    def set_take(self, take: Take | None) -> None:
        """Change the take that is edited, or to another version of it."""
        self.change(replace(self.now, take=take))

    def return_to_neutral(self) -> None:
        """Release held parameters, expression and gaze, and return to the neutral face; all other settings stay."""
        self._remember()
        kept = {name: getattr(self.now, name) for name in ("life", "moves", "light", "look", "timeline", "take")}
        self.now = Settings(**kept)
        self.send(Neutral(_NEUTRAL_S))

    def change(self, to: Settings, step: Hashable = None) -> None:
        """Apply settings; consecutive changes with the same ``step``, such as those of one drag, are undone
        together.
        """
        if step is None or step != self._step:
            self._remember()
        self._step = step
        self._apply(to)

    def end_step(self) -> None:
        """End the current step: the next change is undone separately."""
        self._step = None

    def undo(self) -> None:
        """Undo the last change, if there is one."""
        if self._past:
            self._future.append(self.now)
            self._apply(self._past.pop())
        self.end_step()

    def redo(self) -> None:
        """Redo the change that was undone last, if there is one."""
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


def _adopted(settings: Settings, before: Mapping[int, float], changes: Mapping[int, float | None]) -> Settings:
    """Return settings without what ``changes`` release, and with their values in place of those ``before``."""
    held = dict(settings.held)
    for index, value in changes.items():
        if value is None:
            held.pop(index, None)
        elif index in held and held[index] == before.get(index):
            held[index] = value
    return replace(settings, held=held)


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
