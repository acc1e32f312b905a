"""One process among those that share the heads of a stage: the interface to its control loop.

Keys are ``<prefix>/<head>/parameters|commands|events|state|servos|configuration``; ``<prefix>/_/lease`` and
``<prefix>/_/clock`` are common to all heads, and ``<prefix>/_/faces`` carries the parameters of several heads in one
message, for processes with many heads.
"""

from __future__ import annotations

import logging
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from controller.base.parameters import Floats, Parameters
from controller.fleet.conducting import Conducting
from controller.fleet.follower import Follower
from controller.fleet.hearing import Hearing
from controller.fleet.lease import Lease
from controller.fleet.offset import Clocks
from controller.fleet.payload import Payloads
from controller.fleet.queries import ConductorQueries
from controller.fleet.recorder import Recording
from controller.fleet.rejoining import Rejoining
from controller.fleet.session import open_session
from controller.fleet.states import States, follower_report
from controller.fleet.wire import Wire
from controller.layers.commands import CommandState
from controller.stage.zenoh import ZenohSettings

log = logging.getLogger(__name__)

_STANDBY_TICKS = 5
"""A standby updates its layers at every tick of this number."""
_STATE_INTERVAL_S, _POLL_INTERVAL_S = 0.2, 0.05
_STARTUP_WAIT_S = 1.0
"""Additional time that a process which has just started waits before it conducts."""
_MARGIN_NS = 2_000_000
"""Time after a face is due at which a tick shows it. A conductor's tick may begin late, and a face that arrives just
after a tick would have to wait for the next one."""


class Node:
    """A process with a role: conductor, head, face or recorder.

    settings : the stage's ``[zenoh]``. heads : the layers of its heads by name. beside : the stage's file.
    hurry : called when a face has arrived that is to be shown immediately. align : called with the local time (ns) at
        which a tick would show a face exactly when it is due, to synchronise the ticks of all processes.
    due : returns when the present tick was due (ns), however late it began; motion advances from one of these times to
        the next. Default: ticks are due when they begin.

    Raises LinkError: an endpoint or a file cannot be used. MissingPackage: Zenoh is not installed.
    """

    def __init__(
        self, settings: ZenohSettings, parameters: Parameters, heads: Mapping[str, CommandState], beside: Path,
        hurry: Callable[[], None] = lambda: None, align: Callable[[int], None] = lambda _: None,
        due: Callable[[], int] | None = None,
    ) -> None:  # fmt: skip
        self.settings, self._heads, self._align, self._due = settings, dict(heads), align, due
        lease_s = settings.lease_ms * 1e-3
        self.conducts = settings.role == "conductor"
        number, wait_s = random.getrandbits(62) | 1, random.uniform(0.0, 0.2) * lease_s
        self.lease = Lease(number, lease_s, wait_s, time.monotonic(), _STARTUP_WAIT_S)
        self._clocks, self._stopping = Clocks(), threading.Event()
        delay_ns = 0 if self.conducts else round(settings.delay_ms * 1e6)
        self.followers = {name: Follower(parameters, 2.0 * lease_s, delay_ns) for name in heads}
        self._rests = {name: i for i, name in enumerate(heads)}  # heads of a standby are updated at different ticks
        self._resting = dict.fromkeys(heads, False)
        self._recordings = {}
        if settings.role == "recorder":
            self._recordings = {name: Recording(beside.parent, settings.record, name, parameters) for name in heads}
        self._rejoins = not self.conducts and settings.way == "client" and bool(settings.connect)
        self._conducting: Conducting | None = None
        self._wire = Wire(open_session(settings, beside), settings.prefix)
        try:
            self._declare(
                beside, Payloads(parameters, settings.payload), lease_s, (lambda: None) if delay_ns else hurry
            )
        except BaseException:
            self._wire.close()
            raise
        self._thread = threading.Thread(target=self._poll_network, name="zenoh", daemon=True)
        self._thread.start()

    def _declare(self, beside: Path, payloads: Payloads, lease_s: float, hurry: Callable[[], None]) -> None:
        wire, heads, followers, lease, clocks = self._wire, self._heads, self.followers, self.lease, self._clocks
        self._hearing = Hearing(wire, followers, payloads, lease, clocks, self._recordings, hurry)
        self._states = States(wire, self.settings, heads, followers, lease)
        events = Counter[str]()
        self._queries = ConductorQueries(wire, clocks, lease, heads if self.conducts else {}, events)
        open_again = partial(open_session, self.settings, beside, again=True)
        self._rejoining = Rejoining(wire, self._hearing, clocks, open_again, time.monotonic())
        if self.conducts:
            self._conducting = Conducting(wire, heads, payloads, lease, lease_s, events)

    def relay(self, head: str, now_ns: int, step_s: float, values: Floats, stamp_ns: int) -> int:
        """Publish a head's mixed face if this process conducts, else replace it by what the conductor sends.

        Called once per tick. values : (P,) the mixed face, replaced in place. stamp_ns : time of the newest command in
        it. Returns the time (ns) of the newest command in the resulting values.
        """
        follower = self.followers[head]
        conducting = self._conducting if self._conducting is not None and self._conducting.tick(now_ns) else None
        if conducting is not None:
            if not self._resting[head]:  # otherwise its layers are not mixed yet, and it takes over at the next tick
                follower.lead(self.lease.token)
        else:
            follower.offset_ns = self._clocks.offset_ns(follower.highest.holder)
        theirs = follower.step(now_ns, step_s, values.copy(), values)
        if conducting is not None:
            conducting.send(head, now_ns if self._due is None else self._due(), values, stamp_ns)
            return stamp_ns
        due_ns = follower.due_ns
        if due_ns is not None:
            self._align(due_ns + _MARGIN_NS)
        self._handle_stop(head, follower)
        return theirs if follower.conducted else stamp_ns

    def rests(self, head: str) -> bool:
        """Whether a head's own layers are not needed at this tick, because it follows a conductor; call it every tick.

        A standby updates them at every fifth tick, so that it can take over.
        """
        follower = self.followers[head]
        self._resting[head] = follower.follows(time.monotonic()) and not self.lease.active
        if self._resting[head] and self.conducts:
            self._rests[head] += 1
            self._resting[head] = self._rests[head] % _STANDBY_TICKS != 0
        return self._resting[head]

    def close(self) -> None:
        """Disconnect; if this process conducts, its lease expires at the others."""
        self._stopping.set()
        self._thread.join(3.0)
        if self._conducting is not None:
            self._conducting.close()
        self._wire.close()
        self._thread.join(3.0)  # a thread that is inside Zenoh when Python exits aborts the process
        for recording in self._recordings.values():
            recording.close()

    @property
    def refused(self) -> Counter[str]:
        """How many messages were refused, by reason."""
        return self._wire.refused

    @property
    def published(self) -> int:
        """How many faces were sent."""
        return self._conducting.sender.sent if self._conducting is not None else 0

    def sequence(self, head: str) -> int:
        """Return the sequence number of the last face that was sent of a head; 0 if none was."""
        return self._conducting.sender.sequences[head] if self._conducting is not None else 0

    def report(self) -> dict[str, Any]:
        """Return role, lease, counts, and what each head accepted and refused."""
        lease = self.lease
        return {
            "role": self.settings.role,
            "conducting": lease.active,
            "fence": lease.highest.fence,
            "terms": lease.terms,
            "lost": lease.lost,
            "published": self.published,
            "refused": dict(self.refused),
            "clock_offset_ms": self._clocks.offset_ns(self._conductor()) * 1e-6,
            "heads": {name: follower_report(follower) for name, follower in self.followers.items()},
        }

    def _conductor(self) -> int:
        """Return the number of the conductor, as far as it is known here."""
        return max([self.lease.highest, *(follower.highest for follower in self.followers.values())]).holder

    def _handle_stop(self, head: str, follower: Follower) -> None:
        """Apply the conductor's STOP to the latch; release it with the conductor's unless someone else set it."""
        latch, header = self._heads[head].stop_latch, follower.header
        if header is None or not follower.conducted:
            return
        stopped = latch.stopped
        if header.stopped and stopped is None:
            latch.stop("conductor", time.monotonic_ns())
        elif not header.stopped and stopped is not None and stopped.who == "conductor":
            latch.start()

    def _poll_network(self) -> None:
        published_s = 0.0
        while not self._stopping.wait(_POLL_INTERVAL_S):
            try:
                now_s = time.monotonic()
                self._queries.poll(silent=self._rejoining.silent(now_s))
                if self._rejoins:
                    self._rejoining.check(now_s)
                if time.monotonic() - published_s >= _STATE_INTERVAL_S:
                    published_s = time.monotonic()
                    self._states.publish()
            except Exception as error:  # noqa: BLE001  the next iteration tries again
                log.debug("zenoh: %s", error)
