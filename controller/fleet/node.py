"""One process among those that share the heads of a stage: what it publishes, hears and answers over Zenoh.

Keys are ``<prefix>/<head>/parameters|commands|events|state|servos|configuration``; ``<prefix>/_/lease`` and
``<prefix>/_/clock`` belong to all heads, and ``<prefix>/_/faces`` has the parameters of many of them in one message,
for processes with many heads. Callbacks of Zenoh run in its own threads; each only decodes and hands over.
"""

from __future__ import annotations

import json
import logging
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.base.errors import OMOTE_ERRORS, LinkError
from controller.base.parameters import Floats, Parameters
from controller.fleet import journal
from controller.fleet.batch import Batches
from controller.fleet.follower import Follower
from controller.fleet.lease import Lease, Token
from controller.fleet.offset import ClockOffset
from controller.fleet.payload import Header, Payloads
from controller.fleet.recorder import Recording
from controller.fleet.sending import FaceSender, is_heard
from controller.fleet.session import open_session
from controller.layers.commands import CommandState
from controller.links.line.session import LineSession
from controller.stage.zenoh import ZenohSettings

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

log = logging.getLogger(__name__)

_STANDBY_TICKS = 5
_MANY = 4
"""A process with so many heads hears them all in one message; one with fewer only what is for its own."""
_BEATS = 5
"""Signs of life in the length of a lease."""
_STATE_S, _CLOCK_S = 0.2, 1.0
_REFUSED = 200
"""Kinds of refusals that are counted, at most."""


class Node:
    """A process with a role.

    settings : the stage's ``[zenoh]``. heads : the layers of its heads by name. beside : the stage's file.
    hurry : called when a face has arrived.

    Raises LinkError: an endpoint or a file cannot be used. MissingPackage: Zenoh is not installed.
    """

    def __init__(
        self, settings: ZenohSettings, parameters: Parameters, heads: Mapping[str, CommandState], beside: Path,
        hurry: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.settings, self._heads, self._hurry = settings, dict(heads), hurry
        lease_s = settings.lease_ms * 1e-3
        self.conducts = settings.role == "conductor"
        self.lease = Lease(random.getrandbits(62) | 1, lease_s, random.uniform(0.0, 0.2) * lease_s, time.monotonic())
        self._payloads, self._offset = Payloads(parameters, settings.payload), ClockOffset()
        self._batches = Batches(self._payloads)
        delay_ns = 0 if self.conducts else round(settings.delay_ms * 1e6)
        self.followers = {name: Follower(parameters, 2.0 * lease_s, delay_ns) for name in heads}
        self.refused: Counter[str] = Counter()
        self._rests = {name: i for i, name in enumerate(heads)}  # those who stand by take turns
        self._beat_s, self._stop_time = -1.0, ""
        self._restored: Token | None = None
        self._closers, self._stopping = ExitStack(), threading.Event()
        self._recordings = {}
        if settings.role == "recorder":
            self._recordings = {name: Recording(beside.parent, settings.record, name, parameters) for name in heads}
        self._sessions = {name: LineSession(state, 0, name=f"zenoh {name}") for name, state in self._heads.items()}
        self.session = open_session(settings, beside)
        self._closers.callback(self.session.close)
        try:
            self._declare()
        except BaseException:
            self._closers.close()
            raise
        self._thread = threading.Thread(target=self._keep_house, name="zenoh", daemon=True)
        self._thread.start()

    def key(self, head: str, what: str) -> str:
        """The key of something of a head; ``_`` : of all heads."""
        return f"{self.settings.prefix}/{head}/{what}"

    def relay(self, head: str, now_ns: int, step_s: float, values: Floats, stamp_ns: int) -> int:
        """Called once a tick with what the layers of a head made: publishes it, or writes to ``values`` : (P,) what the
        conductor wants. Returns the time of the newest command in it."""
        follower, conducting = self.followers[head], False
        if self.conducts:
            conducting = self.lease.tick(now_ns * 1e-9)
            if conducting:
                follower.lead(self.lease.token)
                self._beat(now_ns)
        theirs = follower.step(now_ns, step_s, values.copy(), values)
        if conducting:
            self._sender.send(head, now_ns, values, stamp_ns)
            return stamp_ns
        self._handle_stop(head, follower)
        return theirs if follower.conducted else stamp_ns

    def rests(self, head: str) -> bool:
        """Whether a head's own layers are not needed at this tick: it shows exactly what a conductor sends. One that
        stands by keeps them up to date at every fifth tick, to go on from there. Called once a tick."""
        follower = self.followers[head]
        if not (follower.conducted and follower.exact):
            return False
        self._rests[head] += 1
        return not self.conducts or self._rests[head] % _STANDBY_TICKS != 0

    def close(self) -> None:
        """Leave the others: a conductor's lease ends by itself."""
        self._stopping.set()
        self._thread.join(3.0)
        for state in self._heads.values():
            state.on_event = None
        self._closers.close()
        for recording in self._recordings.values():
            recording.close()

    @property
    def published(self) -> int:
        """How many faces were sent."""
        return self._sender.sent if self.conducts else 0

    def sequence(self, head: str) -> int:
        """The number of the last face that was sent of a head; 0 where none was."""
        return self._sender.sequences[head] if self.conducts else 0

    def report(self) -> dict[str, Any]:
        """Role, lease, and what each head took and refused."""
        lease = self.lease
        return {
            "role": self.settings.role,
            "conducting": lease.active,
            "fence": lease.highest.fence,
            "terms": lease.terms,
            "lost": lease.lost,
            "published": self.published,
            "refused": dict(self.refused),
            "clock_offset_ms": self._offset.offset_ns * 1e-6,
            "heads": {name: _follower_report(follower) for name, follower in self.followers.items()},
        }

    def _declare(self) -> None:
        session, here = self.session, f"{self.settings.role}/{self.session.zid()}"
        many = len(self._heads) >= _MANY
        if many:
            self._keep(
                session.declare_subscriber(self.key("_", "faces"), self._directly(self._heard(self._hear_faces)))
            )
        self._states = self._outlets_of("state")
        self._servos = self._outlets_of("servos") if self.settings.role == "head" else {}
        for name in self._heads:
            if not many:
                key, act = self.key(name, "parameters"), self._directly(self._face_of(name))
                self._keep(session.declare_subscriber(key, act))
            about = self._answer(lambda: self.settings.model_dump(mode="json", exclude={"tls"}))
            tail = "" if self.conducts else f"/{self.settings.role}"  # equal keys would be one answer
            for what, answer in (("state", self._answer(partial(self.state, name))), ("configuration", about)):
                self._keep(session.declare_queryable(self.key(name, what + tail), answer))
            self._keep(session.liveliness().declare_token(self.key(name, f"alive/{here}")))
            if self.conducts:
                self._keep(session.declare_subscriber(self.key(name, "commands"), self._command_of(name)))
                self._keep(session.declare_queryable(self.key(name, "commands"), self._question_of(name)))
                self._keep(session.declare_subscriber(self.key(name, "events"), self._event_of(name)))
        if self.conducts:
            self._keep(session.declare_subscriber(self.key("_", "lease"), self._heard(self._hear_lease)))
            self._keep(session.declare_subscriber(self.key("_", "state"), self._heard(self._hear_state)))
            self._keep(session.declare_queryable(self.key("_", "clock"), self._clock))
            together = session.declare_publisher(self.key("_", "faces"))
            self._keep(together)
            self._sender = FaceSender(self._outlets_of("parameters"), together, self._payloads, self._header)
            for name, state in self._heads.items():
                state.on_event = self._tell(name)

    def _directly(self, act: Callable[[zenoh.Sample], None]) -> zenoh.handlers.Callback[zenoh.Sample]:
        """A callback in Zenoh's receiving thread; others have a thread each, and waking that costs more than a face."""
        from zenoh.handlers import Callback  # optional

        return Callback(act, indirect=False)

    def _outlets_of(self, what: str) -> dict[str, zenoh.Publisher]:
        """What sends something of each head, and knows whether anybody listens."""
        found = {name: self.session.declare_publisher(self.key(name, what)) for name in self._heads}
        for outlet in found.values():
            self._keep(outlet)
        return found

    def _keep(self, declared: Any) -> None:
        self._closers.callback(declared.undeclare)

    def _heard(self, act: Callable[[zenoh.Sample], object]) -> Callable[[zenoh.Sample], None]:
        """A callback that counts what it refuses; nothing that arrives ends it."""

        def call(sample: zenoh.Sample) -> None:
            try:
                act(sample)
            except OMOTE_ERRORS as error:
                reason = str(error)
                self.refused[reason if reason in self.refused or len(self.refused) < _REFUSED else "other"] += 1
            except Exception as error:  # noqa: BLE001  as above
                log.error("zenoh %s: %s: %s", sample.key_expr, type(error).__name__, error)

        return call

    def _face_of(self, head: str) -> Callable[[zenoh.Sample], None]:
        def act(sample: zenoh.Sample) -> None:
            header = _header_of(sample)
            if self._is_for_us(header):
                values = self._payloads.decode(sample.payload.to_bytes(), str(sample.encoding))
                if self._take(head, header, values):
                    self._hurry()

        return self._heard(act)

    def _hear_faces(self, sample: zenoh.Sample) -> None:
        header, taken = _header_of(sample), False
        if self._is_for_us(header):
            for face in self._batches.decode(sample.payload.to_bytes(), str(sample.encoding)):
                if face.head in self.followers:
                    own = Header(header.token, face.sequence, header.time_ns, face.stamp_ns, header.stopped)
                    taken = self._take(face.head, own, face.values) or taken
        if taken:
            self._hurry()

    def _is_for_us(self, header: Header) -> bool:
        """Whether a face is of another conductor, of whom a lease takes note."""
        if header.token.holder == self.lease.holder:
            return False
        if self.conducts:
            self.lease.hear(header.token, time.monotonic())
        return True

    def _take(self, head: str, header: Header, values: Floats) -> bool:
        """Hand a face to its head; whether it takes it."""
        taken = self.followers[head].take(header, values)
        if taken and head in self._recordings:
            self._recordings[head].add(header.time_ns, values)
        return taken

    def _hear_lease(self, sample: zenoh.Sample) -> None:
        self.lease.hear(_header_of(sample).token, time.monotonic())

    def _hear_state(self, sample: zenoh.Sample) -> None:
        try:
            fence, holder = json.loads(sample.payload.to_bytes())["token"]
            token = Token(int(fence), int(holder))
        except (ValueError, TypeError, KeyError) as error:
            raise LinkError("a state that is not the JSON it should be") from error
        self.lease.hear(token, time.monotonic(), alive=False)

    def _command_of(self, head: str) -> Callable[[zenoh.Sample], None]:
        def act(sample: zenoh.Sample) -> None:
            self._do(head, sample.payload.to_bytes())

        return self._heard(act)

    def _do(self, head: str, data: bytes) -> bytes:
        """Carry out lines of a command for a head; only who conducts does. STOP works in any case."""
        line = data[:4096].rstrip(b"\r\n") + b"\n"
        if not self.lease.active and b"STOP" not in line.upper():
            return b""
        return self._sessions[head].feed(line, time.monotonic_ns())

    def _question_of(self, head: str) -> Callable[[zenoh.Query], None]:
        def call(query: zenoh.Query) -> None:
            if query.payload is not None and self.lease.active:
                query.reply(query.key_expr, self._do(head, query.payload.to_bytes()))

        return call

    def _event_of(self, head: str) -> Callable[[zenoh.Sample], None]:
        def act(sample: zenoh.Sample) -> None:
            header = _header_of(sample)
            if header.token.holder != self.lease.holder and header.token >= self.lease.highest:
                state, on_event = self._heads[head], self._heads[head].on_event
                state.on_event = None  # what another conductor said is not said again
                try:
                    journal.apply(sample.payload.to_bytes(), state, time.monotonic_ns())
                finally:
                    state.on_event = on_event

        return self._heard(act)

    def _tell(self, head: str) -> Callable[..., None]:
        key = self.key(head, "events")

        def tell(method: str, *arguments: Any) -> None:
            data = journal.encode(method, arguments) if self.lease.active else None
            if data is not None:
                self.session.put(key, data, encoding="application/json", attachment=self._header().encode())

        return tell

    def _header(self, sequence: int = 0, now_ns: int = 0, stamp_ns: int = 0) -> Header:
        stopped = any(state.stop_latch.stopped is not None for state in self._heads.values())
        return Header(self.lease.token, sequence, now_ns or time.monotonic_ns(), stamp_ns, stopped)

    def _beat(self, now_ns: int) -> None:
        if now_ns * 1e-9 - self._beat_s > self.settings.lease_ms * 1e-3 / _BEATS:
            self._beat_s = now_ns * 1e-9
            self.session.put(self.key("_", "lease"), b"", attachment=self._header(now_ns=now_ns).encode(), express=True)

    def _handle_stop(self, head: str, follower: Follower) -> None:
        """Stop where the conductor says so, and go on where it no longer does and nobody here has stopped."""
        latch, header = self._heads[head].stop_latch, follower.header
        if header is None or not follower.conducted:
            return
        stopped = latch.stopped
        if header.stopped and stopped is None:
            latch.stop("conductor", time.monotonic_ns())
        elif not header.stopped and stopped is not None and stopped.who == "conductor":
            latch.start()

    def _clock(self, query: zenoh.Query) -> None:
        received = time.monotonic_ns()
        if self.lease.active:
            query.reply(query.key_expr, json.dumps([received, time.monotonic_ns()]))

    def _answer(self, found: Callable[[], dict[str, Any]]) -> Callable[[zenoh.Query], None]:
        def call(query: zenoh.Query) -> None:
            if self.lease.active or not self.conducts:
                query.reply(query.key_expr, json.dumps(found()), encoding="application/json")

        return call

    def state(self, head: str) -> dict[str, Any]:
        """The full state of a head, as its queryable gives it."""
        state, follower = self._heads[head], self.followers[head]
        values = state.parameters.neutral()
        state.snapshot(values)
        return {
            "version": journal.VERSION,
            "head": head,
            "role": self.settings.role,
            "conducting": self.lease.active,
            "token": list(self.lease.token if self.lease.active else follower.highest),
            "stopped": state.stop_latch.stopped is not None,
            **_follower_report(follower),
            "parameters": dict(zip(state.parameters.names, values.tolist(), strict=True)),
            "commanded": journal.snapshot(state),
        }

    def _keep_house(self) -> None:
        clock_s = 0.0
        while not self._stopping.wait(_STATE_S):
            try:
                self._say_state()
                if time.monotonic() - clock_s > _CLOCK_S and not self.lease.active:
                    clock_s = time.monotonic()
                    self._ask_clock()
                    self._catch_up()
            except Exception as error:  # noqa: BLE001  it is tried again
                log.debug("zenoh: %s", error)

    def _say_state(self) -> None:
        """Tell conductors which one is obeyed here, once for all heads; and who listens to a head, how that is."""
        tokens = {name: self.lease.token if self.lease.active else f.highest for name, f in self.followers.items()}
        short = {"version": 1, "role": self.settings.role}
        self.session.put(self.key("_", "state"), json.dumps({**short, "token": list(max(tokens.values()))}))
        for name, outlet in self._states.items():
            if is_heard(outlet):
                own = {**short, "token": list(tokens[name]), **_follower_report(self.followers[name])}
                outlet.put(json.dumps(own), encoding="application/json")
        for name, outlet in self._servos.items():
            if is_heard(outlet) and (servos := self._heads[name].servo_records()):
                outlet.put(json.dumps({"version": 1, "servos": servos}), encoding="application/json")

    def _ask_clock(self) -> None:
        asked = time.monotonic_ns()

        def heard(reply: zenoh.Reply) -> None:
            arrived = time.monotonic_ns()
            if reply.ok is not None:
                received, answered = json.loads(reply.ok.payload.to_bytes())
                self._offset.add(asked, int(received), int(answered), arrived)
                for follower in self.followers.values():
                    follower.offset_ns = self._offset.offset_ns

        self.session.get(self.key("_", "clock"), heard, timeout=_CLOCK_S)

    def _catch_up(self) -> None:
        """Ask a conductor that was there before what was commanded, once."""
        highest = self.lease.highest
        if not self.conducts or self._restored == highest or not highest.fence:
            return
        self._restored = highest
        for name, state in self._heads.items():
            self.session.get(self.key(name, "state"), self._restorer(state), timeout=_CLOCK_S)

    def _restorer(self, state: CommandState) -> Callable[[zenoh.Reply], None]:
        def heard(reply: zenoh.Reply) -> None:
            if reply.ok is None or self.lease.active:
                return
            found = json.loads(reply.ok.payload.to_bytes())
            if found.get("conducting"):
                try:
                    journal.restore(found["commanded"], state, time.monotonic_ns())
                except LinkError as error:
                    self.refused[str(error)] += 1

        return heard


def _header_of(sample: zenoh.Sample) -> Header:
    """Raises LinkError: none, damaged, or of another version."""
    if sample.attachment is None:
        raise LinkError("a message without a header, which is of no conductor")
    return Header.decode(sample.attachment.to_bytes())


def _follower_report(follower: Follower) -> dict[str, Any]:
    return {
        "conducted": follower.conducted, "exact": follower.exact, "taken": follower.taken,
        "refused": dict(follower.refused),
    }  # fmt: skip
