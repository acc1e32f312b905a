"""Receives the faces of conductors, single or all of a tick in one message, and passes them to their heads."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from controller.base.parameters import Floats
from controller.fleet.batch import Batches
from controller.fleet.follower import Follower
from controller.fleet.lease import Lease
from controller.fleet.offset import Clocks
from controller.fleet.payload import Header, Payloads
from controller.fleet.recorder import Recording
from controller.fleet.wire import ALL, Wire, header_of

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

MANY = 4
"""A process with at least this many heads receives all faces in one message; with fewer, those of its own heads."""


class Hearing:
    """Receives the faces for the heads of this process.

    lease : of this process, which notes who conducts; messages with its own number are ignored. clocks : of the
    conductors. recordings : by head, to which faces are written. hurry : called when a face was accepted.
    """

    def __init__(
        self, wire: Wire, followers: Mapping[str, Follower], payloads: Payloads, lease: Lease, clocks: Clocks,
        recordings: Mapping[str, Recording], hurry: Callable[[], None],
    ) -> None:  # fmt: skip
        self._followers, self._payloads, self._batches = followers, payloads, Batches(payloads)
        self._lease, self._clocks, self._recordings, self._hurry = lease, clocks, recordings, hurry
        self._heard_s: dict[str, float] = {}
        for name in [ALL] if len(followers) >= MANY else followers:
            self._heard_s[name] = time.monotonic()
            if name == ALL:
                wire.hear(ALL, "faces", self._hear_many, direct=True)
            else:
                wire.hear(name, "parameters", self._hear_one(name), direct=True)

    def silent(self) -> tuple[str, float]:
        """Return the head that has received nothing for the longest time, and since when (s).

        It is :data:`controller.fleet.wire.ALL` if the faces come in one message.
        """
        name = min(self._heard_s, key=self._heard_s.__getitem__)
        return name, self._heard_s[name]

    def _hear_one(self, head: str) -> Callable[[zenoh.Sample], None]:
        def act(sample: zenoh.Sample) -> None:
            header = header_of(sample)
            if self._is_for_us(header, head):
                values = self._payloads.decode(sample.payload.to_bytes(), str(sample.encoding))
                if self._take(head, header, values):
                    self._hurry()

        return act

    def _hear_many(self, sample: zenoh.Sample) -> None:
        header, taken = header_of(sample), False
        if self._is_for_us(header, ALL):
            for face in self._batches.decode(sample.payload.to_bytes(), str(sample.encoding)):
                if face.head in self._followers:
                    own = Header(header.token, face.sequence, header.time_ns, face.stamp_ns, header.stopped)
                    taken = self._take(face.head, own, face.values) or taken
        if taken:
            self._hurry()

    def _is_for_us(self, header: Header, whose: str) -> bool:
        """Note a message in the lease and the clocks; return False, noting nothing, if this process has sent it."""
        if header.token.holder == self._lease.holder:
            return False
        now_s = time.monotonic()
        self._heard_s[whose] = now_s
        self._lease.hear(header.token, now_s)
        self._clocks.hear(header.token.holder, header.time_ns, time.monotonic_ns())
        return True

    def _take(self, head: str, header: Header, values: Floats) -> bool:
        """Pass a face to its head, and to its recording if accepted; return whether it was accepted."""
        taken = self._followers[head].take(header, values)
        if taken and head in self._recordings:
            self._recordings[head].add(header.time_ns, values)
        return taken
