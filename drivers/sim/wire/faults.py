"""Faults of a simulated bus by name: what can go wrong, when, and how a reply is spoilt.

A fault is written ``kind[:ids][:value][:key=value ...]``, for example::

    mute:7                 servo 7 neither hears nor answers (loose cable)
    late:7:45ms            its replies come 45 ms late
    crc:3:every=5          every fifth reply of servo 3 has a wrong CRC
    drop:*:p=0.01          one reply in a hundred is lost, of all servos
    hw:4:0x20:at=2s        servo 4 latches an overload two seconds after the start
    unplug:at=5s:for=1s    the port goes away for a second

ids: ``7``, ``1-5``, ``1,3,9`` or ``*``. Keys: ``every=K`` (each K-th reply), ``p=0.1`` (chance), ``count=N`` (at
most N times), ``at=T`` and ``for=T`` (time from when it was set). Times: ``45ms``, ``1.5s``; a bare number is
seconds.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from drivers.base.errors import DriverError
from drivers.packets.packet import encode_status

Encoder = Callable[[int, int, bytes], bytes]
"""Makes a status packet of (id, error byte, data)."""


@dataclass(frozen=True, slots=True)
class Kind:
    """One sort of fault.

    Attributes
    ----------
    scope : ``"reply"`` (spoils replies), ``"servo"`` (changes a servo) or ``"bus"``.
    value : how the value is read; None = it takes none.
    default : value when none is given; None with `value` set = it must be given.
    help : what it does, for the command line.
    """

    scope: str
    help: str
    value: Callable[[str], Any] | None = None
    default: Any = None


def _seconds(text: str) -> float:
    if text.endswith("ms"):
        return float(text[:-2]) * 1e-3
    return float(text.removesuffix("s"))


def _integer(text: str) -> int:
    return int(text, 0)


KINDS: dict[str, Kind] = {
    "mute": Kind("servo", "neither hears nor answers (loose cable)"),
    "silent": Kind("reply", "hears and obeys, but its answers are lost"),
    "late": Kind("reply", "answers late by VALUE", _seconds, 0.045),
    "drop": Kind("reply", "loses a reply (use every= or p=)"),
    "crc": Kind("reply", "answers with a wrong CRC"),
    "flip": Kind("reply", "one bit of the answer is flipped"),
    "short": Kind("reply", "answers with only VALUE data bytes", _integer, 1),
    "wrongid": Kind("reply", "answers under the id VALUE", _integer),
    "noise": Kind("reply", "VALUE random bytes before the answer", _integer, 5),
    "alert": Kind("servo", "alert bit set, data valid, no hardware error"),
    "hw": Kind("servo", "latches the hardware error bits VALUE", _integer, 0x20),
    "volts": Kind("servo", "supply at VALUE volts", float),
    "temp": Kind("servo", "motor at VALUE degrees", float),
    "stall": Kind("servo", "shaft stuck where it is"),
    "watchdog-ignored": Kind("servo", "keeps turning when its bus watchdog trips"),
    "dup": Kind("servo", "a second servo has the same id; their replies collide"),
    "baud": Kind("servo", "listens at VALUE bits per second", _integer),
    "eeprom-busy": Kind("servo", "deaf for VALUE after each permanent write", _seconds, 0.02),
    "echo": Kind("bus", "the adapter gives back every byte it was sent"),
    "chain-stop": Kind("bus", "nobody answers behind a silent servo"),
    "slow-reader": Kind(
        "bus", "what comes back reaches the host in bursts, one every VALUE (a starved reader)", _seconds, 0.2
    ),
    "unplug": Kind("bus", "the port goes away; for= brings it back, as=PATH under another name"),
}


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault as it was asked for; `ids` None means every servo."""

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
        """Whether it is about this servo."""
        return self.ids is None or device_id in self.ids


def _bad(spec: str, why: str) -> DriverError:
    return DriverError(
        f"fault {spec!r}: {why}",
        hint="write kind:ids:value, as mute:7, late:7:45ms or crc:3:every=5; kinds: " + ", ".join(sorted(KINDS)),
    )


def parse_fault(spec: str) -> Fault:
    """Read one fault.

    Raises
    ------
    DriverError : the message names the spec and what is wrong with it; the hint lists the kinds.
    """
    name, *parts = spec.strip().split(":")
    kind = KINDS.get(name)
    if kind is None:
        raise _bad(spec, f"there is no fault {name!r}")
    fault = Fault(name, value=kind.default, spec=spec)
    words = [part for part in parts if "=" not in part]
    if kind.scope != "bus":
        if not words:
            raise _bad(spec, "the servo ids are missing (use * for all)")
        fault = replace(fault, ids=_parse_ids(spec, words.pop(0)))
    fault = _parse_value(spec, kind, fault, words)
    for part in parts:
        if "=" in part:
            fault = _parse_option(spec, fault, part)
    return fault


def _parse_ids(spec: str, text: str) -> frozenset[int] | None:
    if text == "*":
        return None
    ids: set[int] = set()
    for part in text.split(","):
        first, _, last = part.partition("-")
        try:
            ids.update(range(int(first), int(last or first) + 1))
        except ValueError:
            raise _bad(spec, f"{part!r} is not an id, a range 1-5 or *") from None
    if not ids or min(ids) < 0 or max(ids) > 252:
        raise _bad(spec, f"ids {text!r} must be 0 to 252")
    return frozenset(ids)


def _parse_value(spec: str, kind: Kind, fault: Fault, words: list[str]) -> Fault:
    if words and kind.value is not None:
        text = words.pop(0)
        try:
            fault = replace(fault, value=kind.value(text))
        except ValueError:
            raise _bad(spec, f"{text!r} is not a value for {fault.kind}") from None
    if words:
        raise _bad(spec, f"{words[0]!r} is one word too many")
    if kind.value is not None and fault.value is None:
        raise _bad(spec, f"{fault.kind} needs a value")
    return fault


_OPTIONS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "every": ("every", int),
    "p": ("chance", float),
    "count": ("count", int),
    "at": ("at_s", _seconds),
    "for": ("for_s", _seconds),
    "as": ("alias", str),
}


def _parse_option(spec: str, fault: Fault, part: str) -> Fault:
    key, _, text = part.partition("=")
    if key not in _OPTIONS:
        raise _bad(spec, f"there is no option {key!r} (there are {', '.join(_OPTIONS)})")
    attribute, read = _OPTIONS[key]
    try:
        changes: dict[str, Any] = {attribute: read(text)}
    except ValueError:
        raise _bad(spec, f"{text!r} is not a value for {key}") from None
    fault = replace(fault, **changes)
    if fault.every < 1 or not 0.0 <= fault.chance <= 1.0 or fault.at_s < 0.0:
        raise _bad(spec, f"{part!r} is out of range")
    return fault


class Spoiler:
    """Decides when a reply fault strikes, and spoils the bytes.

    Parameters
    ----------
    fault : a fault of scope ``"reply"``.
    rng : source of chance, shared by the bus so that a run can be repeated.

    Attributes
    ----------
    struck : replies it has hit.
    late_s : by how much it delays a reply it hits.
    """

    def __init__(self, fault: Fault, rng: random.Random) -> None:
        self.fault, self._rng = fault, rng
        self._seen: dict[int, int] = {}
        self.struck = 0
        self.late_s: float = fault.value if fault.kind == "late" else 0.0

    def strikes(self, device_id: int) -> bool:
        """Whether it hits this reply of this servo; counts it."""
        fault = self.fault
        if not fault.concerns(device_id) or (fault.count is not None and self.struck >= fault.count):
            return False
        seen = self._seen[device_id] = self._seen.get(device_id, 0) + 1
        if seen % fault.every or (fault.chance < 1.0 and self._rng.random() >= fault.chance):
            return False
        self.struck += 1
        return True

    def status(
        self, frame: bytes, device_id: int, error: int, data: bytes, encode: Encoder = encode_status
    ) -> bytes | None:
        """A status packet spoilt; None = it never arrives. `encode` makes one of the wire's protocol."""
        kind, value = self.fault.kind, self.fault.value
        if kind in ("silent", "drop"):
            return None
        if kind == "short":
            return encode(device_id, error, data[:value])
        if kind == "wrongid":
            return encode(value, error, data)
        return self._bytes(frame, 4)

    def part(self, frame: bytes) -> bytes | None:
        """A device's part of a joint reply (ERR, ID, data, CRC) spoilt; None = it never arrives."""
        kind, value = self.fault.kind, self.fault.value
        if kind in ("silent", "drop"):
            return None
        if kind == "short":
            return frame[: 2 + value] + frame[-2:]
        if kind == "wrongid":
            return frame[:1] + bytes((value,)) + frame[2:]
        return self._bytes(frame, 0)

    def _bytes(self, frame: bytes, first: int) -> bytes:
        kind = self.fault.kind
        if kind == "crc":
            return frame[:-1] + bytes((frame[-1] ^ 0x55,))
        if kind == "flip":
            at = self._rng.randrange(first, len(frame))
            return frame[:at] + bytes((frame[at] ^ 1 << self._rng.randrange(8),)) + frame[at + 1 :]
        if kind == "noise":
            return self._rng.randbytes(self.fault.value) + frame
        return frame


class FaultSet:
    """The faults of one bus, with the times at which they begin and end.

    Parameters
    ----------
    on_change : called with (fault, begins, time) when one begins or ends.
    seed : of the chance.
    kinds : faults that the bus can have.
    """

    def __init__(
        self,
        on_change: Callable[[Fault, bool, float], None],
        seed: int = 0,
        kinds: Iterable[str] = KINDS,
    ) -> None:
        self._kinds = frozenset(kinds)
        self.spoilers: list[Spoiler] = []
        self.active: list[Fault] = []
        self.next_change_s = float("inf")
        self._on_change = on_change
        self._rng = random.Random(seed)
        self._due: list[tuple[float, int, bool, Fault]] = []
        self._order = 0

    def add(self, faults: Iterable[str | Fault], now_s: float) -> None:
        """Set faults; their ``at`` counts from now.

        Raises
        ------
        DriverError : a spec cannot be read, or this bus has no such fault; then none of them is set.
        """
        wanted = [parse_fault(item) if isinstance(item, str) else item for item in faults]
        for fault in wanted:
            if fault.kind not in self._kinds:
                raise _bad(fault.spec, f"a bus of this kind has only {', '.join(sorted(self._kinds))}")
        for fault in wanted:
            self._schedule(now_s + fault.at_s, True, fault)
            if fault.for_s is not None:
                self._schedule(now_s + fault.at_s + fault.for_s, False, fault)
        self.advance(now_s)

    def clear(self, kind: str | None, now_s: float) -> None:
        """End the faults of a kind (None: all), also those that have not begun."""
        self._due = [due for due in self._due if kind is not None and due[3].kind != kind]
        self._set_next()
        for fault in [fault for fault in self.active if kind is None or fault.kind == kind]:
            self._end(fault, now_s)

    def advance(self, now_s: float) -> None:
        """Begin and end what is due, each at its own time."""
        while self._due and self._due[0][0] <= now_s:
            time_s, _, begins, fault = self._due.pop(0)
            (self._begin if begins else self._end)(fault, time_s)
        self._set_next()

    def spoil_status(
        self, frame: bytes, device_id: int, error: int, data: bytes, encode: Encoder
    ) -> tuple[bytes | None, float]:
        """A status packet as it arrives (None: it does not) and how late it is."""
        late_s, spoilt = 0.0, frame
        for spoiler in self.spoilers:
            if not spoiler.strikes(device_id):
                continue
            late_s += spoiler.late_s
            result = spoiler.status(spoilt, device_id, error, data, encode)
            if result is None:
                return None, late_s
            spoilt = result
        return spoilt, late_s

    def spoil_part(self, part: bytes, device_id: int) -> tuple[bytes | None, float]:
        """A device's part of a joint reply as it arrives (None: it does not) and how late it is."""
        late_s, spoilt = 0.0, part
        for spoiler in self.spoilers:
            if not spoiler.strikes(device_id):
                continue
            late_s += spoiler.late_s
            result = spoiler.part(spoilt)
            if result is None:
                return None, late_s
            spoilt = result
        return spoilt, late_s

    def _schedule(self, time_s: float, begins: bool, fault: Fault) -> None:
        self._order += 1
        self._due.append((time_s, self._order, begins, fault))
        self._due.sort(key=lambda due: due[:2])

    def _set_next(self) -> None:
        self.next_change_s = self._due[0][0] if self._due else float("inf")

    def _begin(self, fault: Fault, time_s: float) -> None:
        self.active.append(fault)
        if KINDS[fault.kind].scope == "reply":
            self.spoilers.append(Spoiler(fault, self._rng))
        self._on_change(fault, True, time_s)

    def _end(self, fault: Fault, time_s: float) -> None:
        if fault not in self.active:
            return
        self.active.remove(fault)
        self.spoilers = [spoiler for spoiler in self.spoilers if spoiler.fault is not fault]
        self._on_change(fault, False, time_s)
