"""Plays scripts as shows: sends their lines directly to the face, with marks, pause, seek and loop."""

from __future__ import annotations

import bisect
import math
import threading
from collections.abc import Callable, Sequence
from functools import partial

from controller.base.errors import ParameterError
from controller.base.parameters import did_you_mean
from controller.layers.commands import CommandSink
from controller.links.line.commands import Command, Grammar
from controller.links.line.script import Script
from controller.links.line.session import LineSession

Note = Callable[[int, str, str], None]
"""Called with the time (monotonic clock, ns), ``mark`` or ``line``, and the name of the mark or the line."""


class Show:
    """Plays a script on the clock of the control loop.

    Parameters
    ----------
    script : the script to play. sink : the face. note : called for every mark and line.

    Attributes
    ----------
    playing : whether time passes; if not, the face stays as it is. position_s : time in the script.
    """

    def __init__(self, script: Script, sink: CommandSink, note: Note | None = None) -> None:
        self.script, self._note = script, note or _ignore_event
        self.playing = False
        self.position_s = 0.0
        self._sink = sink
        self._session = LineSession(sink, 0, name=f"show {script.name}", scripted=True)
        self._times = [at_s for at_s, _ in script.steps]
        self._marks = sorted((at_s, name) for name, at_s in script.marks.items())
        self._next = self._next_mark = 0
        self._last_ns: int | None = None

    @property
    def finished(self) -> bool:
        """Whether the last step has been played and the script does not loop."""
        return not self.script.loop_s and self._next >= len(self._times)

    def seek(self, to: str | float) -> None:
        """Go to a mark or a time (s). Earlier lines are not sent, so a script should have NEUTRAL there.

        Raises ParameterError: see :meth:`place`.
        """
        self.position_s = to_s = self.place(to)
        self._next = bisect.bisect_left(self._times, to_s)
        self._next_mark = bisect.bisect_left(self._marks, (to_s, ""))
        self._last_ns = None

    def place(self, to: str | float) -> float:
        """Return the time (s) of a mark, or ``to`` itself if it is a time.

        Raises ParameterError: there is no such mark, or it is not a time from 0 on.
        """
        if isinstance(to, str):
            if to not in self.script.marks:
                raise ParameterError(f"unknown mark {to!r}{did_you_mean(to, self.script.marks)}",
                                     hint=f"marks: {', '.join(self.script.marks) or 'none'}")  # fmt: skip
            to = self.script.marks[to]
        if not 0.0 <= to < math.inf:
            raise ParameterError(f"a time must be 0 s or later, not {to}", hint="seek to 0 for the beginning")
        return to

    def tick(self, now_ns: int) -> list[str]:
        """Send the lines that are due at ``now_ns`` (monotonic clock) to the face, and return them."""
        if not self.playing:
            self._last_ns = None
            return []
        if self._last_ns is not None:
            self.position_s += (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        sent = self._send_due(now_ns)
        if self.script.loop_s and self.position_s >= self.script.loop_s:
            self.position_s %= self.script.loop_s
            self._next = self._next_mark = 0
            sent += self._send_due(now_ns)
        return sent

    def release_face(self, now_ns: int) -> None:
        """Release everything that lines of the script hold, over the usual fades."""
        vocabulary = self._sink.vocabulary
        grammar = Grammar(self._sink.parameters, lambda name: vocabulary[name].name, scripted=True)
        requests = [grammar.parse(line.encode("ascii")) for _, line in self.script.steps]
        commands: dict[str, list[Command]] = {}
        target = ""
        for request in filter(None, requests):
            target = request.command.words[0] if request.command.name == "TO" else target
            commands.setdefault(request.to or target, []).append(request.command)
        for to, given in commands.items():
            sink = self._sink.heads.find(to) if to else self._sink
            _release_commands(sink, given, now_ns)

    def _send_due(self, now_ns: int) -> list[str]:
        sent = []
        while self._next_mark < len(self._marks) and self._marks[self._next_mark][0] <= self.position_s:
            self._note(now_ns, "mark", self._marks[self._next_mark][1])
            self._next_mark += 1
        while self._next < len(self._times) and self._times[self._next] <= self.position_s:
            line = self.script.steps[self._next][1]
            self._session.feed(line.encode("ascii") + b"\n", now_ns)
            self._note(now_ns, "line", line)
            sent.append(line)
            self._next += 1
        return sent


def _release_commands(sink: CommandSink, commands: list[Command], now_ns: int) -> None:
    sink.release(sorted({i for command in commands if command.name == "SET" for i in command.indices}), now_ns)
    if any(command.name == "EXPR" for command in commands):
        sink.expression("neutral", 1.0, None, now_ns)
    if any(command.name.startswith("GAZE") for command in commands):
        sink.gaze_off(now_ns)


def _ignore_event(now_ns: int, event: str, text: str) -> None:
    """Do nothing; the default of ``note``."""


class Shows:
    """The player of a face: links start and control shows from their threads, and the control loop ticks it.

    find : returns the script of a name, or raises ConfigError. sink : the face.
    names : returns the names that ``find`` knows. note : called for every mark and line of every show.
    """

    def __init__(
        self, find: Callable[[str], Script], sink: CommandSink, names: Callable[[], Sequence[str]] = tuple,
        note: Note | None = None,
    ) -> None:  # fmt: skip
        self._find, self._sink, self.names, self._note = find, sink, names, note
        self._show: Show | None = None
        self._lock = threading.RLock()  # a show may start another

    def start(self, name: str) -> None:
        """Play the script of a name from its beginning. Raises ConfigError."""
        self.prepare_start(name)()

    def prepare_start(self, name: str) -> Callable[[], None]:
        """Read the script, and return a function that plays it. Raises ConfigError."""
        return partial(self.play, self._find(name))

    def play(self, script: Script) -> None:
        """Play a script from its beginning."""
        show = Show(script, self._sink, self._note)
        show.playing = True
        with self._lock:
            self._show = show

    def control(self, what: str, to: str | float = 0.0) -> None:
        """Apply ``PLAY``, ``PAUSE``, ``STOP`` or ``SEEK``; ``to`` : a mark or a time (s).

        Raises ParameterError: there is no show, or no such mark or time.
        """
        self.prepare_control(what, to)()

    def prepare_control(self, what: str, to: str | float = 0.0) -> Callable[[], None]:
        """Check everything that :meth:`control` may refuse, and return a function that applies it.

        Raises ParameterError: see :meth:`control`.
        """
        show = self._show
        if show is None:
            raise ParameterError("no show plays", hint="begin one: SHOW name")
        return partial(self._control, show, what, show.place(to) if what == "SEEK" else 0.0)

    def _control(self, meant: Show, what: str, to_s: float) -> None:
        """Apply an action; if another show has started since the check, that one is controlled, but not moved."""
        with self._lock:
            show = self._show
            if show is None:
                return
            if what == "SEEK":
                if show is meant:  # a mark of one show has no meaning in another
                    show.seek(to_s)
            elif what == "STOP":
                self._show = None
            else:
                show.playing = what == "PLAY"

    def tick(self, now_ns: int) -> None:
        """Send the lines that are due."""
        with self._lock:
            if self._show is not None:
                self._show.tick(now_ns)

    @property
    def name(self) -> str | None:
        """Name of the script that was started last; None before any, and after STOP or a failure."""
        show = self._show
        return None if show is None else show.script.name or "without a name"

    def abandon(self, now_ns: int) -> None:
        """End a show that failed, and release what it moves."""
        with self._lock:
            show, self._show = self._show, None
        if show is not None:
            show.release_face(now_ns)

    def status(self) -> str:
        """Return ``off``, or the script's name, its position (s) and whether it is paused: ``tour@12.3,paused``."""
        with self._lock:
            show = self._show
            if show is None or show.finished:
                return "off"
            name = show.script.name.replace(" ", "_") or "show"
            return f"{name}@{show.position_s:.1f}" + ("" if show.playing else ",paused")
