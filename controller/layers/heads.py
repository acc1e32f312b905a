"""Keeps the heads of a run by name, groups of heads, and turn-taking, and resolves which heads a command addresses.

Every head is a :class:`controller.layers.commands.CommandSink`. :meth:`Heads.find` returns the sink of a head, of a
group or of all heads, and links pass commands to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from controller.base.errors import ControllerError, ParameterError
from controller.base.mailboxes import REST, Life
from controller.base.parameters import Flags, Floats, did_you_mean
from controller.layers.sink import CommandSink, Directory, HeadSink, Player, StatusValue

EVERYBODY = "all"
"""The name that means every head."""


class Heads:
    """The heads of a run, which are registered with :meth:`add`; empty if there is one head without a name.

    groups : names of the heads in each group.

    Attributes
    ----------
    turns : turn-taking; None if the heads do not take turns.
    """

    def __init__(self, groups: Mapping[str, Sequence[str]] | None = None) -> None:
        self._members: dict[str, HeadSink] = {}
        self._groups = {name.lower(): (name, tuple(members)) for name, members in (groups or {}).items()}
        self.turns: Turns | None = None

    def add(self, state: HeadSink) -> None:
        """Register a head by its name."""
        self._members[state.name.lower()] = state

    @property
    def members(self) -> tuple[HeadSink, ...]:
        """Every head, in the order of the stage."""
        return tuple(self._members.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the heads, in the order of the stage."""
        return tuple(state.name for state in self._members.values())

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups."""
        return tuple(name for name, _ in self._groups.values())

    def find(self, name: str) -> CommandSink:
        """Return the head, the group or all heads that a name means; case and a leading ``@`` do not matter.

        Raises ParameterError: unknown name.
        """
        wanted = name.removeprefix("@").lower()
        if wanted in self._members:
            return self._members[wanted]
        if wanted == EVERYBODY and self._members:
            return Group(EVERYBODY, self.members)
        if wanted in self._groups:
            group, members = self._groups[wanted]
            return Group(group, tuple(self._members[member.lower()] for member in members))
        if not self._members:
            raise ParameterError(f"{name}: there is only one head, which has no name", hint="leave the name out")
        known = [*self.names, *self.groups, EVERYBODY]
        raise ParameterError(f"no head or group called {name!r}{did_you_mean(wanted, known)}",
                             hint=f"there are {', '.join(known)}")  # fmt: skip

    def head(self, name: str) -> HeadSink:
        """Return the head of a name. Raises ParameterError: no head has this name."""
        found = self._members.get(name.removeprefix("@").lower())
        if found is None:
            raise ParameterError(f"no head called {name!r}{did_you_mean(name, self.names)}",
                                 hint=f"there are {', '.join(self.names) or 'no heads with names'}")  # fmt: skip
        return found


class Group:
    """Several heads as one :class:`controller.layers.commands.CommandSink`, which passes every command to each of them.

    A command that the first head refuses reaches no other. Queries, which need one head, raise ParameterError.
    """

    def __init__(self, name: str, members: Sequence[HeadSink]) -> None:
        first = members[0]
        self.name, self.members = name, tuple(members)
        self.parameters, self.vocabulary, self.stop_latch = first.parameters, first.vocabulary, first.stop_latch
        self.heads: Directory = first.heads

    @property
    def shows(self) -> Player | None:
        """The players of all heads as one; None if no head has a player."""
        players = {state.name: state.shows for state in self.members if state.shows is not None}
        return _Players(players) if players else None

    @property
    def beside(self) -> Life:
        """Raises ParameterError: every head has its own."""
        self._refuse()
        return REST

    def set_parameters(self, indices: Sequence[int], values: Sequence[float], stamp_ns: int) -> None:
        self._each(lambda state: state.set_parameters(indices, values, stamp_ns))

    def release(self, indices: Sequence[int], stamp_ns: int) -> None:
        self._each(lambda state: state.release(indices, stamp_ns))

    def write_layer(self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        self._check_layer(name)
        self._each(lambda state: state.write_layer(name, values, mask, now_ns, stamp_ns))

    def release_layer(self, name: str) -> None:
        self._check_layer(name)
        self._each(lambda state: state.release_layer(name))

    def expression(self, name: str, intensity: float, duration_s: float | None, stamp_ns: int) -> None:
        self._each(lambda state: state.expression(name, intensity, duration_s, stamp_ns))

    def gaze(self, yaw_rad: float, pitch_rad: float, stamp_ns: int) -> None:
        self._each(lambda state: state.gaze(yaw_rad, pitch_rad, stamp_ns))

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        self._each(lambda state: state.gaze_at(x_mm, y_mm, z_mm, stamp_ns))

    def gaze_room(self, x_mm: float, y_mm: float, z_mm: float, stamp_ns: int) -> None:
        self._each(lambda state: state.gaze_room(x_mm, y_mm, z_mm, stamp_ns))

    def gaze_head(self, name: str, stamp_ns: int) -> None:
        target = self.heads.head(name)
        for state in self.members:
            if state is not target:  # no head can look at itself
                state.gaze_head(name, stamp_ns)

    def gaze_off(self, stamp_ns: int) -> None:
        self._each(lambda state: state.gaze_off(stamp_ns))

    def neutral(self, seconds: float, stamp_ns: int) -> None:
        self._each(lambda state: state.neutral(seconds, stamp_ns))

    def live(self, amount: float, stamp_ns: int, manner: str | None = None) -> None:
        self._each(lambda state: state.live(amount, stamp_ns, manner))

    def viseme(self, names: Sequence[str], weights: Sequence[float], stamp_ns: int) -> None:
        self._each(lambda state: state.viseme(names, weights, stamp_ns))

    def snapshot(self, out: Floats) -> None:
        self._refuse()

    def measured(self, out: Floats) -> bool:
        self._refuse()
        return False

    def holder(self, index: int) -> str | None:
        self._refuse()
        return None

    def layer_names(self) -> tuple[str, ...]:
        """Return the names of the layers that all heads have, in the order of the first head."""
        others = [set(state.layer_names()) for state in self.members]
        return tuple(name for name in self.members[0].layer_names() if all(name in each for each in others))

    def status(self) -> dict[str, StatusValue]:
        self._refuse()
        return {}

    def overview(self) -> Mapping[str, list[dict[str, Any]]]:
        self._refuse()
        return {}

    def held(self) -> dict[int, float]:
        self._refuse()
        return {}

    def _check_layer(self, name: str) -> None:
        """Raise ParameterError if a head has no layer of that name."""
        without = [state.name for state in self.members if name not in state.layer_names()]
        if without:
            raise ParameterError(f"{', '.join(without)}: no layer {name!r}; nothing has changed at {self._names}",
                                 hint=f"layers that all have: {', '.join(self.layer_names())}")  # fmt: skip

    def _each(self, command: Callable[[HeadSink], object]) -> None:
        """Pass a command to each head.

        Heads of a stage share parameters and expressions and so refuse the same commands: the first head does, before
        anything has changed.
        """
        for state in self.members:
            command(state)

    @property
    def _names(self) -> str:
        return ", ".join(state.name for state in self.members)

    def _refuse(self) -> None:
        raise ParameterError(f"@{self.name} addresses several heads; a query needs one of {self._names}",
                             hint=f"ask one: @{self.members[0].name}")  # fmt: skip


class _Players:
    """The players of several heads as one :class:`controller.layers.commands.Player`: all obey a command, or none.

    players : by the name of the head.
    """

    def __init__(self, players: Mapping[str, Player]) -> None:
        self._named, self._players = players, tuple(players.values())

    def start(self, name: str) -> None:
        self.prepare_start(name)()

    def prepare_start(self, name: str) -> Callable[[], None]:
        return self._prepare_all(self._named, lambda player: player.prepare_start(name))

    def names(self) -> Sequence[str]:
        return self._players[0].names()

    def control(self, what: str, to: str | float = 0.0) -> None:
        self.prepare_control(what, to)()

    def prepare_control(self, what: str, to: str | float = 0.0) -> Callable[[], None]:
        """Address the heads that play a show; if none does, all of them, which refuse."""
        playing = {head: player for head, player in self._named.items() if player.name is not None}
        return self._prepare_all(playing or self._named, lambda player: player.prepare_control(what, to))

    def _prepare_all(
        self, players: Mapping[str, Player], prepare: Callable[[Player], Callable[[], None]]
    ) -> Callable[[], None]:
        """Return a function that makes all players act, once none has refused.

        Raises the error of the first player that refuses, with the name of its head.
        """
        ready = []
        for head, player in players.items():
            try:
                ready.append(prepare(player))
            except ControllerError as error:
                text = f"{head}: {error}; nothing has changed at {', '.join(self._named)}"
                raise type(error)(text, hint=error.hint) from error

        def act() -> None:
            for each in ready:
                each()

        return act

    def tick(self, now_ns: int) -> None:
        """Do nothing: each head ticks its own player."""

    @property
    def name(self) -> str | None:
        return self._players[0].name

    def abandon(self, now_ns: int) -> None:
        for player in self._players:
            player.abandon(now_ns)

    def status(self) -> str:
        return self._players[0].status()


_SPEAKING_LOUDNESS = 0.04
"""A head counts as speaking if speech opens its jaw further than this."""
_PAUSE_S = 0.7
"""A speaker that is silent for this long can lose its turn; pauses within a sentence are shorter."""


class Turns:
    """Turn-taking: the head that has the turn behaves as a speaker, and the others listen to it and look at it.

    heads : all heads. auto : whether a head that begins to speak while no other does gets the turn.

    Attributes
    ----------
    speaker : the name of the head that has the turn; None if none has it.
    """

    def __init__(self, heads: Heads, *, auto: bool = False) -> None:
        self._heads, self._auto = heads, auto
        self.speaker: str | None = None
        self._manners: dict[str, str] = {}
        self._spoke_ns: dict[str, int] = {}
        self._must_pause: set[str] = set()  # spoke when the turn was withdrawn from all, and have not paused since

    def give(self, name: str | None, stamp_ns: int) -> None:
        """Give the turn to a head. None: withdraw it, so that all heads behave and look as before.

        A head that is speaking when the turn is withdrawn has to pause before it can get the turn automatically.

        Raises ParameterError: no head has this name.
        """
        speaker = None if name is None else self._heads.head(name)
        if speaker is None:
            self._must_pause = set(self._spoke_ns)
            self._end(stamp_ns)
            return
        for state in self._heads.members:
            self._manners.setdefault(state.name, state.manner)
            state.live(state.liveliness, stamp_ns, "speak" if state is speaker else "listen")
            if state is not speaker:
                state.gaze_head(speaker.name, stamp_ns)
        if self.speaker != speaker.name:
            speaker.gaze_off(stamp_ns)  # so that it no longer looks at the previous speaker
        self.speaker = speaker.name

    def tick(self, now_ns: int) -> None:
        """Detect which heads speak, and give the turn to one that begins; does nothing unless ``auto``."""
        if not self._auto:
            return
        for state in self._heads.members:
            if state.loudness > _SPEAKING_LOUDNESS:
                self._spoke_ns[state.name] = now_ns
        speaking = [name for name, time_ns in self._spoke_ns.items() if now_ns - time_ns < _PAUSE_S * 1e9]
        self._must_pause.intersection_update(speaking)
        speaking = [name for name in speaking if name not in self._must_pause]
        if self.speaker not in speaking and speaking:
            self.give(max(speaking, key=lambda name: self._spoke_ns[name]), now_ns)

    def _end(self, stamp_ns: int) -> None:
        if self.speaker is None:
            return
        for state in self._heads.members:
            state.live(state.liveliness, stamp_ns, self._manners.get(state.name, "auto"))
            if state.name != self.speaker:
                state.gaze_off(stamp_ns)
        self.speaker, self._manners = None, {}
