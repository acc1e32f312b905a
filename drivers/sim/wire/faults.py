"""Parse, schedule and inject faults of a simulated bus: lost, late and corrupt replies, faulty servos and ports.

A fault is written ``kind[:ids][:value][:key=value ...]``, for example::

    mute:7                 servo 7 neither receives nor answers (loose cable)
    late:7:45ms            its replies come 45 ms late
    crc:3:every=5          every fifth reply of servo 3 has a wrong CRC
    drop:*:p=0.01          one reply in a hundred is lost, of all servos
    hw:4:0x20:at=2s        servo 4 latches an overload two seconds after the start
    unplug:at=5s:for=1s    the port disappears for a second

ids: ``7``, ``1-5``, ``1,3,9`` or ``*``. Keys: ``every=K`` (each K-th reply), ``p=0.1`` (chance), ``count=N`` (at
most N times), ``at=T`` and ``for=T`` (time from when it was set). Times: ``45ms``, ``1.5s``; a bare number is
seconds.
"""

from __future__ import annotations

import itertools
import math
import random
from bisect import insort
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from drivers.base.errors import DriverError
from drivers.packets.packet import MAX_ID

MAX_VALUE = 1e9
"""Greatest time (s), count, rate and number of steps in a fault."""


class Kind(NamedTuple):
    """One kind of fault.

    scope : ``"reply"`` (corrupts replies), ``"servo"`` (changes a servo) or ``"bus"``.
    value : how the value is read; None: it takes none.
    default : value where none is given; None with `value` set: it must be given.
    """

    scope: str
    value: Callable[[str], Any] | None = None
    default: Any = None


def _seconds(text: str) -> float:
    if text.endswith("ms"):
        return float(text[:-2]) * 1e-3
    return float(text.removesuffix("s"))


def _integer(text: str) -> int:
    return int(text, 0)


Read = Callable[[str], Any]


def _within(read: Read, low: float, high: float) -> Read:
    """A reader of values that refuses those outside of a range, and what is no number."""

    def checked(text: str) -> Any:
        value = read(text)
        if not low <= value <= high:
            raise ValueError(f"{low:g} to {high:g}")
        return value

    return checked


_duration = _within(_seconds, 0.0, MAX_VALUE)


def _span(text: str) -> tuple[float, float]:
    low, high = (float(end) for end in text.split(".."))
    if not -MAX_VALUE < low < high < MAX_VALUE:
        raise ValueError("LOW..HIGH, the lower end first")
    return low, high


def _share(text: str) -> float:
    share = float(text)
    if not -1.0 <= share <= 1.0:
        raise ValueError("a share of the stall torque, -1 to 1")
    return share


KINDS: dict[str, Kind] = {
    "mute": Kind("servo"),  # neither receives nor answers (loose cable)
    "silent": Kind("reply"),  # receives and executes instructions, but its answers are lost
    "late": Kind("reply", _duration, 0.045),  # answers late by the value
    "drop": Kind("reply"),  # loses a reply (use every= or p=)
    "crc": Kind("reply"),  # answers with a wrong CRC
    "flip": Kind("reply"),  # one bit of the answer is flipped
    "short": Kind("reply", _within(_integer, 0, 65_535), 1),  # answers with only so many data bytes
    "wrongid": Kind("reply", _within(_integer, 0, 252)),  # answers under this id
    "noise": Kind("reply", _within(_integer, 0, 65_535), 5),  # so many random bytes before the answer
    "alert": Kind("servo"),  # alert bit set, data valid, no hardware error
    "hw": Kind("servo", _within(_integer, 0, 0xFF), 0x20),  # latches these hardware error bits
    "volts": Kind("servo", _within(float, 0.0, 1000.0)),  # supply at so many volts
    "temp": Kind("servo", _within(float, -1000.0, 1000.0)),  # motor at so many degrees Celsius
    "stops": Kind("servo", _span),  # mechanical stops of the shaft, LOW..HIGH in steps
    "weight": Kind("servo", _share, 0.1),  # torque on the shaft towards lower steps, as a share of the stall torque
    "stall": Kind("servo"),  # shaft stuck where it is
    "watchdog-ignored": Kind("servo"),  # keeps turning when its bus watchdog trips
    "dup": Kind("servo"),  # a second servo has the same id; their replies collide
    "baud": Kind("servo", _within(_integer, 1, MAX_VALUE)),  # listens at so many bits per second
    "eeprom-busy": Kind("servo", _duration, 0.02),  # receives nothing for this time after each permanent write
    "echo": Kind("bus"),  # the adapter echoes every byte it was sent
    "chain-stop": Kind("bus"),  # no servo after a silent one answers
    "slow-reader": Kind("bus", _duration, 0.2),  # replies reach the host in bursts, one every so long
    "unplug": Kind("bus"),  # the port disappears; for= restores it, as=PATH under another name
}


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault as it was requested; `ids` None means every servo."""

    kind: str
    ids: frozenset[int] | None = None
    value: Any = None
    every: int = 1
    chance: float = 1.0
    count: int | None = None
    at_s: float = 0.0
    for_s: float | None = None
    alias: str | None = None
    spec: str = ""

    def concerns(self, device_id: int) -> bool:
        """Whether it applies to this servo."""
        return self.ids is None or device_id in self.ids


_OPTIONS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "every": ("every", int),
    "p": ("chance", float),
    "count": ("count", _within(int, 0, MAX_VALUE)),
    "at": ("at_s", _seconds),
    "for": ("for_s", _duration),
    "as": ("alias", str),
}
"""Attribute of `Fault` and type of each key."""


def _bad(spec: str, why: str) -> DriverError:
    return DriverError(
        f"fault {spec!r}: {why}",
        hint="write kind:ids:value, as mute:7, late:7:45ms or crc:3:every=5; kinds: " + ", ".join(sorted(KINDS)),
    )


def parse_fault(spec: str) -> Fault:
    """Read one fault.

    Raises DriverError: the message names the spec and what is wrong with it; the hint lists the kinds.
    """
    name, *parts = spec.strip().split(":")
    kind = KINDS.get(name)
    if kind is None:
        raise _bad(spec, f"there is no fault {name!r}")
    words = [part for part in parts if "=" not in part]
    ids, value = None, kind.default
    if kind.scope != "bus":
        if not words:
            raise _bad(spec, "the servo ids are missing (use * for all)")
        ids = _parse_ids(spec, words.pop(0))
    if words and kind.value is not None:
        value = _convert(spec, kind.value, words.pop(0), name)
    if words:
        raise _bad(spec, f"{words[0]!r} is one word too many")
    if kind.value is not None and value is None:
        raise _bad(spec, f"{name} needs a value")
    fault = Fault(name, ids, value, spec=spec)
    for part in parts:
        if "=" in part:
            fault = _with_option(fault, part)
    return fault


def _convert(spec: str, read: Callable[[str], Any], text: str, name: str) -> Any:
    try:
        return read(text)
    except ValueError:
        raise _bad(spec, f"{text!r} is not a value for {name}") from None


def _parse_ids(spec: str, text: str) -> frozenset[int] | None:
    if text == "*":
        return None
    ids: set[int] = set()
    for part in text.split(","):
        first, _, last = part.partition("-")
        try:
            ends = int(first), int(last or first)
        except ValueError:
            raise _bad(spec, f"{part!r} is not an id, a range 1-5 or *") from None
        if ends[0] < 0 or ends[1] > MAX_ID:
            raise _bad(spec, f"ids {text!r} must be 0 to {MAX_ID}")
        ids.update(range(ends[0], ends[1] + 1))
    if not ids:
        raise _bad(spec, f"{text!r} names no id: a range begins with its lower end")
    return frozenset(ids)


def _with_option(fault: Fault, part: str) -> Fault:
    key, _, text = part.partition("=")
    if key not in _OPTIONS:
        raise _bad(fault.spec, f"there is no option {key!r} (there are {', '.join(_OPTIONS)})")
    attribute, read = _OPTIONS[key]
    changes: dict[str, Any] = {attribute: _convert(fault.spec, read, text, key)}
    fault = replace(fault, **changes)
    if fault.every < 1 or not 0.0 <= fault.chance <= 1.0 or not 0.0 <= fault.at_s <= MAX_VALUE:
        raise _bad(fault.spec, f"{part!r} is out of range")
    return fault


class ReplyFault:
    """Decides which replies a fault of scope ``"reply"`` hits, and corrupts their bytes.

    rng : random numbers, shared by the bus so that a run can be repeated.
    """

    def __init__(self, fault: Fault, rng: random.Random) -> None:
        self.fault, self._rng = fault, rng
        self._seen: Counter[int] = Counter()
        self._hits = 0

    def hits(self, device_id: int) -> bool:
        """Whether it hits this reply of this servo; counts it."""
        fault = self.fault
        if not fault.concerns(device_id) or (fault.count is not None and self._hits >= fault.count):
            return False
        self._seen[device_id] += 1
        if self._seen[device_id] % fault.every or (fault.chance < 1.0 and self._rng.random() >= fault.chance):
            return False
        self._hits += 1
        return True

    def corrupt(
        self,
        frame: bytes,
        first: int,
        shorten: Callable[[bytes, int], bytes],
        readdress: Callable[[bytes, int], bytes],
    ) -> bytes | None:
        """A reply with this fault; None: it never arrives. For the parameters see :meth:`FaultSet.corrupt`."""
        kind, value = self.fault.kind, self.fault.value
        if kind in ("silent", "drop"):
            return None
        if kind == "short":
            return shorten(frame, value)
        if kind == "wrongid":
            return readdress(frame, value)
        if kind == "crc":
            return frame[:-1] + bytes((frame[-1] ^ 0x55,))
        if kind == "flip":
            at = self._rng.randrange(first, len(frame))
            return frame[:at] + bytes((frame[at] ^ 1 << self._rng.randrange(8),)) + frame[at + 1 :]
        if kind == "noise":
            return self._rng.randbytes(value) + frame
        return frame


class FaultSet:
    """The faults of one bus, with the times at which they begin and end.

    on_change : called with (fault, begins, time) when one begins or ends.
    seed : of the random numbers.
    kinds : faults that the bus can have.
    """

    def __init__(
        self,
        on_change: Callable[[Fault, bool, float], None],
        seed: int = 0,
        kinds: Iterable[str] = KINDS,
    ) -> None:
        self._kinds = frozenset(kinds)
        self.reply_faults: list[ReplyFault] = []
        self.active: list[Fault] = []
        self._on_change = on_change
        self._rng = random.Random(seed)
        self._due: list[tuple[float, int, bool, Fault]] = []
        self._order = itertools.count()

    @property
    def next_change_s(self) -> float:
        """When the next fault begins or ends; infinity: none does."""
        return self._due[0][0] if self._due else math.inf

    def add(self, faults: Iterable[str | Fault], now_s: float) -> None:
        """Set faults; their ``at`` counts from now.

        Raises DriverError: a spec cannot be read, or this bus has no such fault; then none of them is set.
        """
        wanted = [parse_fault(item) if isinstance(item, str) else item for item in faults]
        for fault in wanted:
            if fault.kind not in self._kinds:
                raise _bad(fault.spec, f"a bus of this kind has only {', '.join(sorted(self._kinds))}")
        for fault in wanted:
            insort(self._due, (now_s + fault.at_s, next(self._order), True, fault))
            if fault.for_s is not None:
                insort(self._due, (now_s + fault.at_s + fault.for_s, next(self._order), False, fault))
        self.advance(now_s)

    def clear(self, kind: str | None, now_s: float) -> None:
        """End the faults of a kind (None: all), also those that have not begun."""
        self._due = [due for due in self._due if kind is not None and due[3].kind != kind]
        for fault in [fault for fault in self.active if kind is None or fault.kind == kind]:
            self._end(fault, now_s)

    def advance(self, now_s: float) -> None:
        """Begin and end what is due, each at its own time."""
        while self._due and self._due[0][0] <= now_s:
            time_s, _, begins, fault = self._due.pop(0)
            (self._begin if begins else self._end)(fault, time_s)

    def corrupt(
        self,
        frame: bytes,
        device_id: int,
        *,
        first: int = 0,
        shorten: Callable[[bytes, int], bytes] = lambda frame, size: frame[:size],
        readdress: Callable[[bytes, int], bytes] = lambda frame, device_id: frame,
    ) -> tuple[bytes | None, float]:
        """A reply as it arrives (None: it does not), and how late it is, seconds.

        frame : the reply. device_id : who sends it.
        first : the first byte in which a bit may be flipped.
        shorten : gives a frame with only so many data bytes. readdress : gives a frame from another id.
        """
        late_s, arrived = 0.0, frame
        for reply_fault in self.reply_faults:
            if not reply_fault.hits(device_id):
                continue
            if reply_fault.fault.kind == "late":
                late_s += reply_fault.fault.value
            corrupted = reply_fault.corrupt(arrived, first, shorten, readdress)
            if corrupted is None:
                return None, late_s
            arrived = corrupted
        return arrived, late_s

    def _begin(self, fault: Fault, time_s: float) -> None:
        self.active.append(fault)
        if KINDS[fault.kind].scope == "reply":
            self.reply_faults.append(ReplyFault(fault, self._rng))
        self._on_change(fault, True, time_s)

    def _end(self, fault: Fault, time_s: float) -> None:
        if fault not in self.active:
            return
        self.active.remove(fault)
        self.reply_faults = [each for each in self.reply_faults if each.fault is not fault]
        self._on_change(fault, False, time_s)
