"""Handles the messages of one client of the WebSocket API, without any I/O."""

from __future__ import annotations

import logging
import math
import os
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from pydantic import ValidationError

from controller.base.errors import OMOTE_ERRORS, ParameterError
from controller.base.mailboxes import Life
from controller.base.parameters import Indices, Parameters
from controller.base.version import package_version
from controller.layers.commands import CommandSink
from controller.links.websocket import messages as m
from controller.links.websocket.faults import explain, id_of

log = logging.getLogger(__name__)

AnyGaze = m.Gaze | m.GazeAt | m.GazeRoom | m.GazeHead | m.GazeOff


class Conversation:
    """The state of one client: it turns messages into answers, and gives states and overviews when they are due.

    Parameters
    ----------
    sink : receives accepted commands. who : name of the client, for people; a STOP is reported under it.
    start_ns : time zero of the states (monotonic clock, ns).

    Attributes
    ----------
    accepted : number of requests carried out. refused : number of requests refused, by code.
    """

    def __init__(self, sink: CommandSink, who: str, start_ns: int) -> None:
        self._home, self._who, self._start_ns = sink, who, start_ns
        self._sink = self._state_sink = self._watch_sink = sink  # of this request, of states and of overviews
        self._values, self._shown = sink.parameters.neutral(), sink.parameters.neutral()
        self._subscription: m.Subscribe | None = None
        self._chosen: Indices | None = None
        self._due_ns = 0
        self._watch_ns, self._watch_due_ns = 0, 0  # period of overviews, 0 for none, and when the next one is due
        self.accepted = 0
        self.refused: Counter[str] = Counter()

    def handle(self, text: str | bytes, now_ns: int) -> m.Reply | None:
        """Carry out a message that arrived at ``now_ns`` and return its answer; None if it gets none."""
        try:
            request = m.REQUESTS.validate_json(text)
        except ValidationError as error:
            return self._refuse(id_of(text), "message", *explain(error))
        try:
            self._sink = self._home if request.address is None else self._home.heads.find(request.address)
            reply = self._answer(request, now_ns)
        except ParameterError as error:
            return self._refuse(request.id, "name", str(error), error.hint)
        except OMOTE_ERRORS as error:
            return self._refuse(request.id, "busy", str(error), getattr(error, "hint", ""))
        except Exception as error:
            log.error("%s: %s: %s", self._who, type(error).__name__, error, exc_info=_debug(error))
            return self._refuse(request.id, "fault", f"an error in omote, see its log: {type(error).__name__}")
        self.accepted += 1
        if reply is not None:
            return reply.model_copy(update={"id": request.id})
        return m.Done(id=request.id) if request.id is not None else None

    def refuse_rate(self) -> m.Refused:
        """Return the answer to messages that come too fast, and count the refusal."""
        return self._refuse(
            None, "rate", "messages come too fast and some were dropped", "send at most a few hundred a second"
        )

    def due_ns(self) -> int | None:
        """Return when the next state or overview is due; None if the client wants none."""
        due = [self._due_ns] if self._subscription is not None else []
        return min([*due, *([self._watch_due_ns] if self._watch_ns else [])], default=None)

    def due(self, now_ns: int) -> list[m.Reply]:
        """Return the state and the overview that are due."""
        found: list[m.Reply] = []
        state = self.state_due(now_ns)
        if state is not None:
            found.append(state)
        if self._watch_ns and now_ns >= self._watch_due_ns:
            self._sink = self._watch_sink
            self._watch_due_ns += self._watch_ns * (1 + (now_ns - self._watch_due_ns) // self._watch_ns)
            found.append(self._overview(now_ns))
        return found

    def state_due(self, now_ns: int) -> m.State | m.Frame | None:
        """Return the newest state if one is due; missed ones are skipped."""
        wanted = self._subscription
        if wanted is None or now_ns < self._due_ns:
            return None
        period = round(1e9 / wanted.rate_hz)
        self._due_ns += period * (1 + (now_ns - self._due_ns) // period)
        self._sink = self._state_sink
        state = self._state(self._chosen, now_ns, status=False)
        return state if wanted.form == "names" else _as_numbers(state, self._sink.beside)

    def _refuse(self, request_id: Any, code: Any, message: str, hint: str = "") -> m.Refused:
        self.refused[code] += 1
        return m.Refused(id=request_id, code=code, message=message, hint=hint)

    def _answer(self, request: m.AnyRequest, now_ns: int) -> m.Reply | None:
        match request:
            case m.Hello():
                return self._welcome(request)
            case m.Get():
                return self._state(self._indices(request.parameters), now_ns, status=True)
            case m.List():
                return m.Names(what=request.what, names=self._names(request.what))
            case m.Subscribe():
                self._chosen = self._indices(request.parameters)
                self._require_one_head()
                self._subscription, self._due_ns, self._state_sink = request, now_ns, self._sink
            case m.Watch(rate_hz=rate):
                self._require_one_head()
                self._watch_sink = self._sink
                self._watch_ns, self._watch_due_ns = round(1e9 / rate) if rate > 0.0 else 0, now_ns
            case m.Unsubscribe():
                self._subscription = None
            case m.Ping():
                return m.Done()
            case m.Stop():
                self._sink.stop_latch.stop(self._who, now_ns)
            case m.Start():
                self._sink.stop_latch.start()
            case _:
                self._act(request, now_ns)
        return None

    def _act(self, request: m.AnyRequest, now_ns: int) -> None:
        """Pass a command that changes the face to the sink."""
        sink = self._sink
        match request:
            case m.Set(parameters=given):
                sink.set_parameters(*_check_values(sink.parameters, given), now_ns)
            case m.Release(parameters=names):
                chosen = range(len(sink.parameters)) if names is None else sink.parameters.indices(names).tolist()
                sink.release(list(chosen), now_ns)
            case m.Expression():
                sink.expression(request.name, request.intensity, request.duration_s, now_ns)
            case m.Emotion():
                sink.expression(_mood(request), request.intensity, None, now_ns)
            case m.Neutral():
                sink.neutral(request.seconds, now_ns)
            case m.Life():
                sink.live(request.amount, now_ns, *([request.manner] if request.manner else []))
            case m.Show():
                _play(sink, request)
            case m.Turn(head=name):
                _give_turn(sink, name, now_ns)
            case m.Gaze() | m.GazeAt() | m.GazeRoom() | m.GazeHead() | m.GazeOff():
                self._look(request, now_ns)

    def _require_one_head(self) -> None:
        """Raise ParameterError if the request is for several heads, which refuse every query."""
        self._sink.held()

    def _look(self, request: AnyGaze, now_ns: int) -> None:
        match request:
            case m.Gaze():
                self._sink.gaze(math.radians(request.yaw_deg), math.radians(request.pitch_deg), now_ns)
            case m.GazeAt(point_mm=point):
                if math.hypot(*point) < 1.0:
                    raise ParameterError("the point must be at least 1 mm from the middle between the eyes")
                self._sink.gaze_at(*point, now_ns)
            case m.GazeRoom(point_mm=point):
                self._sink.gaze_room(*point, now_ns)
            case m.GazeHead(head=name):
                self._sink.gaze_head(name, now_ns)
            case m.GazeOff():
                self._sink.gaze_off(now_ns)

    def _welcome(self, request: m.Hello) -> m.Welcome:
        if request.version != m.VERSION:
            raise ParameterError(
                f"version {request.version} of the messages is not spoken here", hint=f"use version {m.VERSION}"
            )
        p = self._sink.parameters
        return m.Welcome(
            omote=package_version(),
            parameters={name: _parameter(p, i) for i, name in enumerate(p.names)},
            expressions=list(self._sink.vocabulary.names),
            layers=list(self._sink.layer_names()),
            heads=list(self._sink.heads.names),
        )

    def _state(self, chosen: Indices | None, now_ns: int, *, status: bool) -> m.State:
        sink = self._sink
        sink.snapshot(self._values)
        stopped = sink.stop_latch.stopped
        return m.State(
            time_s=(now_ns - self._start_ns) * 1e-9,
            parameters=self._named(self._values, chosen),
            measured=self._named(self._shown, chosen) if sink.measured(self._shown) else None,
            stopped_by=stopped.who if stopped is not None else None,
            status=sink.status() if status else {},
        )

    def _overview(self, now_ns: int) -> m.Overview:
        sink, names = self._sink, self._sink.parameters.names
        stopped, found = sink.stop_latch.stopped, sink.overview()
        return m.Overview(
            time_s=(now_ns - self._start_ns) * 1e-9,
            stopped_by=stopped.who if stopped is not None else None,
            status=sink.status(),
            held={names[i]: round(value, 4) for i, value in sink.held().items()},
            holders={name: layer for i, name in enumerate(names) if (layer := sink.holder(i))},
            show=sink.shows.status() if sink.shows is not None else "off",
            servos=[m.Servo(**record) for record in found["servos"]],
            links=found["links"],
        )

    def _named(self, values: Any, chosen: Indices | None) -> dict[str, float]:
        names = self._sink.parameters.names
        which: Sequence[int] = range(len(names)) if chosen is None else chosen.tolist()
        return {names[i]: round(float(values[i]), 4) for i in which}

    def _indices(self, names: Sequence[str] | None) -> Indices | None:
        return None if names is None else self._sink.parameters.indices(names)

    def _names(self, what: str) -> list[str]:
        sink = self._sink
        kinds: dict[str, Callable[[], Sequence[str]]] = {
            "parameters": lambda: sink.parameters.names,
            "expressions": lambda: sink.vocabulary.names,
            "layers": sink.layer_names,
            "heads": lambda: sink.heads.names,
            "groups": lambda: sink.heads.groups,
            "shows": lambda: sink.shows.names() if sink.shows is not None else [],
        }
        return list(kinds[what]())


def _as_numbers(state: m.State, life: Life) -> m.Frame:
    measured = None if state.measured is None else list(state.measured.values())
    return m.Frame(
        time_s=state.time_s, values=list(state.parameters.values()), measured=measured, stopped_by=state.stopped_by,
        life=(round(life[0], 3), round(life[1], 4)),
    )  # fmt: skip


def _check_values(parameters: Parameters, given: dict[str, float]) -> tuple[list[int], list[float]]:
    """Return indices and values. Raises ParameterError: an unknown name, a repeated one, or a value out of range."""
    indices = parameters.indices(given).tolist()
    if len(set(indices)) < len(indices):
        raise ParameterError("a parameter is named twice, in two spellings")
    for i, (name, value) in zip(indices, given.items(), strict=True):
        low, high = float(parameters.low[i]), float(parameters.high[i])
        if not low <= value <= high:
            raise ParameterError(f"{name} must be {low:g} to {high:g}, not {value:g}")
    return indices, list(given.values())


def _parameter(p: Parameters, i: int) -> m.Parameter:
    full = math.degrees(p.full_scale_rad[i])
    angle = None if math.isnan(full) else round(full, 3)
    return m.Parameter(
        low=float(p.low[i]), high=float(p.high[i]), region=p.regions[i], full_scale_deg=angle, rest=float(p.rest[i]),
        description=p.descriptions.get(p.names[i], ""),
    )  # fmt: skip


def _mood(request: m.Emotion) -> str:
    """Return the formula of an emotion, as :class:`controller.vocabulary.vocabulary.Vocabulary` reads it."""
    point = [request.valence, request.arousal, *([] if request.dominance is None else [request.dominance])]
    return f"{'VA' if len(point) == 2 else 'VAD'}:{','.join(f'{value:.4f}' for value in point)}"


def _give_turn(sink: CommandSink, name: str | None, now_ns: int) -> None:
    if sink.heads.turns is None:
        raise ParameterError("there is one head here: nobody to take turns with", hint="add [[heads]] to the stage")
    sink.heads.turns.give(name, now_ns)


def _play(sink: CommandSink, request: m.Show) -> None:
    """Start or control a show.

    Raises ParameterError or ConfigError: there is no player, no such show or mark, or the request is incomplete.
    """
    if sink.shows is None:
        raise ParameterError("no shows can be played here", hint="omote run plays them")
    if (request.name is None) == (request.action is None):
        raise ParameterError("a show needs a name to begin it, or an action", hint='{"type": "show", "name": "tour"}')
    if (request.to is not None) != (request.action == "seek"):
        raise ParameterError("to is for the action seek, which needs it", hint='{"action": "seek", "to": 2.5}')
    if request.name is not None:
        sink.shows.start(request.name)
    elif request.action is not None:
        sink.shows.control(request.action.upper(), 0.0 if request.to is None else request.to)


def _debug(error: Exception) -> Exception | None:
    return error if os.environ.get("OMOTE_DEBUG") else None
