"""Sends faces: each separately, and all of a tick together for processes with many heads.

If there are many heads, nothing is sent that has no known subscriber. But Zenoh may take a while to report a
subscriber, so a new conductor sends every face both ways at first, and single faces of few heads always.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from controller.base.parameters import Floats
from controller.fleet.batch import Batches, Gathering
from controller.fleet.payload import Header, Payloads
from controller.fleet.wire import Outlet

FEW = 3
"""Greatest number of heads whose single faces are sent without a known subscriber."""
FIRST_S = 3.0
"""Time after it began to conduct in which a process sends everything without a known subscriber."""
_STATUS_INTERVAL_NS = 50_000_000
"""Interval of asking Zenoh for subscribers, which takes a tenth of the time of mixing a face."""
Heading = Callable[[int, int, int], Header]
"""Function that makes a header from a sequence, a time and a stamp (ns)."""


class FaceSender:
    """Sends the faces of a conductor.

    outlets : publishers of single faces by head. together : publisher of the faces of a tick in one message.

    Attributes
    ----------
    sent : number of faces. sequences : of the last face of each head.
    """

    def __init__(self, outlets: Mapping[str, Outlet], together: Outlet, payloads: Payloads, heading: Heading) -> None:
        self._outlets, self._together, self._payloads, self._heading = outlets, together, payloads, heading
        self._listeners = {name: Listeners(outlet) for name, outlet in outlets.items()}
        self._listeners_to_all = Listeners(together)
        self._batches, self._gathering = Batches(payloads), Gathering(len(outlets))
        self.sequences = dict.fromkeys(outlets, 0)
        self.sent = 0
        self._all_until_ns = 0

    def begin(self, now_ns: int) -> None:
        """Begin to conduct: send everything for some time."""
        self._all_until_ns = now_ns + round(FIRST_S * 1e9)

    def send(self, head: str, now_ns: int, values: Floats, stamp_ns: int) -> None:
        """Send the face ``values`` : (P,) of one head, of the tick that was due at ``now_ns``."""
        self.sequences[head] += 1
        self.sent += 1
        sequence, data, outlet = self.sequences[head], self._payloads.encode(values), self._outlets[head]
        all_ways = now_ns < self._all_until_ns
        if all_ways or len(self._outlets) <= FEW or self._listeners[head].there(now_ns):
            header = self._heading(sequence, now_ns, stamp_ns).encode()
            outlet.put(data, encoding=self._payloads.encoding, attachment=header)
        if all_ways or self._listeners_to_all.there(now_ns):
            self._send(*self._gathering.begin(now_ns))
            if self._gathering.add(head, sequence, stamp_ns, data):
                self._send(now_ns, self._gathering.take())

    def _send(self, now_ns: int, faces: list[tuple[str, int, int, bytes]]) -> None:
        """Send gathered faces, of the tick that was due at ``now_ns``, if there are any."""
        if faces:
            header = self._heading(0, now_ns, 0).encode()
            self._together.put(self._batches.encode(faces), encoding=self._batches.encoding, attachment=header)


class Listeners:
    """Caches whether a publisher has subscribers."""

    def __init__(self, outlet: Outlet) -> None:
        self._outlet, self._asked_ns, self._there = outlet, -_STATUS_INTERVAL_NS, False

    def there(self, now_ns: int) -> bool:
        """Whether there is a subscriber; Zenoh is asked if the last answer is old at ``now_ns``."""
        if not 0 <= now_ns - self._asked_ns < _STATUS_INTERVAL_NS:
            self._asked_ns, self._there = now_ns, is_heard(self._outlet)
        return self._there


def is_heard(outlet: Outlet) -> bool:
    """Whether a publisher has subscribers."""
    status = outlet.matching_status
    return bool(getattr(status, "matching", status))  # some versions of the library wrap it
