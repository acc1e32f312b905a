"""Telemetry of a servo bus: stores the latest measurements of every servo and polls those that stopped answering."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, make_state, read_only
from drivers.base.rate_limited_log import RateLimitedLogger
from drivers.core.scale import Scale
from drivers.packets.packet import ALERT
from drivers.servos.exchange import Exchange
from drivers.servos.layout import Group, Layout, ReadRequest, slow_requests
from drivers.servos.registers import Registers

log = logging.getLogger(__name__)

PROBE_S = 1.0
"""Time between two greetings of servos that do not answer."""
FAILED_GREETINGS = 3
"""Greetings without an answer that one cycle may wait for."""

Octets = NDArray[np.uint8]
Values = Mapping[str, NDArray[np.int64]]
"""Values of k servos by short name, (k,) each."""


class Telemetry(ABC):
    """Reads the servos of a bus and stores what they measured. A protocol adds how they are read.

    ids : n servo ids in the order of all arrays.
    slow_group : servos from which a slow value is read at once; 0 reads only servos that raise an alert.

    Attributes
    ----------
    slow_s : every slow value of every servo is read within this time; 0: one request a cycle.
    checked_first : registers that are read out of turn after an alert or a silence.
    """

    slow_s: ClassVar[float] = 0.0
    """Every slow value of every servo is read within this time; 0: one request a cycle."""
    checked_first: ClassVar[frozenset[str]] = frozenset({"torque"})
    """Registers that are read out of turn after an alert or a silence."""

    def __init__(self, registers: Registers[Any], ids: Sequence[int], report: BusReport, slow_group: int) -> None:
        self._registers, self._packets, self._port = registers, registers.packets, registers.port
        self.ids, self.report = tuple(ids), report
        self._slow_group = max(slow_group, 0)
        n = len(self.ids)
        self._known = np.full((6, n), np.nan)
        self._ticks, self._speed, self._current, self._seen_s, self._volts, self._celsius = self._known
        self._stores = {"velocity": self._speed, "current": self._current}
        self._stores |= {"voltage": self._volts, "temperature": self._celsius}
        self._octets = np.zeros((4, n), np.uint8)
        self._error, self._hardware = self._octets[:2]
        self._torque, self._fresh = self._octets[2:].view(bool)
        self._alarmed = False
        self._slow_state: tuple[NDArray[Any], ...] | None = None
        self._place = {servo: index for index, servo in enumerate(self.ids)}
        self._missed: set[int] = set()
        self._log = RateLimitedLogger(log, self._port.clock)
        self._silent: deque[int] = deque()
        self._in_vain: Counter[int] = Counter()  # greetings of each silent servo without an answer
        self._probe_s = -np.inf
        self._urgent: deque[ReadRequest] = deque()

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _read_feedback(self, clock: Callable[[], float], running: bool, scale: Scale) -> BusState | None:
        """Read the feedback of the servos whose turn it is; returns the state where it is known already."""

    @abstractmethod
    def _read_requests(self, requests: list[ReadRequest], clock: Callable[[], float], running: bool) -> None:
        """Read blocks from servos and hand the replies to `_accept`."""

    # ------------------------------------------------------------------ every cycle

    def _regroup(self, layouts: Sequence[Layout]) -> None:
        """Group servos by their n layouts, and forget where they are: they may have been moved since."""
        members: dict[tuple[object, ...], list[int]] = {}
        for index, layout in enumerate(layouts):
            members.setdefault(layout.key, []).append(index)
        tables = [self._registers.tables[servo] for servo in self.ids]
        self._groups = [
            Group([self.ids[i] for i in places], places, [tables[i] for i in places], layouts[places[0]])
            for places in members.values()
        ]
        self._ticks[:] = np.nan
        self._seen_s[:] = -np.inf
        self._missed.clear()
        self._silent.clear()
        self._in_vain.clear()
        self._urgent.clear()
        self._turns = slow_requests(self._groups, self._slow_group)
        self._turn, self._turn_s = 0, -np.inf

    def started(self, ids: Sequence[int]) -> None:
        """Note that torque of these servos was read back as on."""
        self._slow_state = None
        self._torque[[self._place[servo] for servo in ids]] = True

    def cycle(self, clock: Callable[[], float], running: bool, scale: Scale) -> BusState:
        """Greet servos that missed a reply, read the feedback, and ask some servos for one slow value."""
        self._fresh[:] = False
        if self._port.suspects or self._silent:
            self._revive(clock())
        state = self._read_feedback(clock, running, scale)
        request = self._urgent.popleft() if self._urgent else self._next_turn(clock())
        if request is not None:
            self._read_requests([request], clock, running)
        elif state is not None:
            return state
        return self.state(scale, clock())

    def _next_turn(self, now: float) -> ReadRequest | None:
        """The next request for a slow value; None while none is due."""
        if not self._turns or now < self._turn_s:
            return None
        request = self._turns[self._turn % len(self._turns)]
        self._turn += 1
        if self._turn >= len(self._turns):  # the first round goes as fast as it can
            self._turn_s = max(self._turn_s + self.slow_s / len(self._turns), now)
        return request

    def _check_first(self, servo: int) -> None:
        """Ask one servo for its error and torque before the turn of the others."""
        group = next(group for group in self._groups if servo in group.ids)
        blocks = [block for block in group.layout.slow if self.checked_first & set(block.items)]
        self._urgent.extend(ReadRequest(group, block, (servo,)) for block in blocks)

    def silent_ids(self) -> tuple[int, ...]:
        """Servos that do not answer and are only greeted now and then."""
        return tuple(sorted(self._silent))

    def state(self, scale: Scale, now: float) -> BusState:
        """The latest measurements in SI units."""
        silent = np.isin(self.ids, self._silent) if self._silent else np.zeros(len(self.ids), bool)
        fresh = read_only(self._fresh.copy())
        return make_state(now, scale.measured(self._known, now), fresh, read_only(silent), self._slow_values())

    def _slow_values(self) -> tuple[NDArray[Any], ...]:
        """Error, supply, temperature, hardware error and torque, read-only; new arrays only where something changed."""
        if self._slow_state is None:
            slow = (self._error, self._volts, self._celsius, self._hardware, self._torque)
            self._slow_state = tuple(read_only(array.copy()) for array in slow)
        return self._slow_state

    # ------------------------------------------------------------------ silent servos

    def _revive(self, now: float) -> None:
        """Greet servos that missed a reply: at once the first time, then one silent servo a second."""
        suspects, failed = self._port.suspects, 0
        for servo in [i for i in self._silent if i not in suspects]:  # it answered another request, as in recover()
            self._silent.remove(servo)
            self._returned(servo)
        for servo in [i for i in self.ids if i in suspects and i not in self._silent]:
            if self._packets.revive(self._port, servo):
                self._missed.discard(servo)
                continue
            self._silent.append(servo)
            self._log("servo %s stopped answering", self._registers.label(servo))
            failed += 1
            if failed == FAILED_GREETINGS:
                return
        if failed:
            self._probe_s = now + PROBE_S
        if self._silent and now >= self._probe_s:
            self._probe(now)

    def _probe(self, now: float) -> None:
        """Greet silent servos until one does not answer, first those that were greeted least.

        What disturbs one servo often disturbs others for a moment; these do not wait for its turns.
        """
        self._probe_s = now + PROBE_S
        while self._silent:
            servo = min(self._silent, key=self._in_vain.__getitem__)
            if not self._packets.revive(self._port, servo):
                self._in_vain[servo] += 1
                return
            self._silent.remove(servo)
            self._returned(servo)

    def _returned(self, servo: int) -> None:
        self._missed.discard(servo)
        del self._in_vain[servo]
        self._check_first(servo)  # it may have lost its supply, and its torque with it
        self._log("servo %s answers again", self._registers.label(servo))

    # ------------------------------------------------------------------ replies

    def _accept(self, requests: Sequence[ReadRequest], got: Exchange[Any], now: float, running: bool) -> None:
        """Store the replies to requests, and count servos without one and replies without the requested data."""
        for servo in [servo for request in requests for servo in request.ids if servo in self._port.suspects]:
            if servo not in self._missed:
                self._missed.add(servo)
                self.report.count("corrupt" if got.corrupt else "no_reply", servo)
        for request in requests:
            replies = [got.replies[servo] for servo in request.ids if servo in got.replies]
            good = [reply for reply in replies if len(reply.params) == request.block.size]
            for reply in replies:
                if len(reply.params) != request.block.size:
                    self.report.count("refused", reply.id)
            if good:
                data = np.frombuffer(b"".join([reply.params for reply in good]), np.uint8).reshape(len(good), -1)
                errors = np.array([reply.error for reply in good], np.uint8)
                answered = request._replace(ids=tuple(reply.id for reply in good))
                self._store(answered, request.block.decode(data), errors, now, running)

    def _store(self, request: ReadRequest, values: Values, errors: Octets, now: float, running: bool) -> None:
        """Store values and error bytes (k,) of the servos of a request."""
        group, _, ids = request
        slots = group.slots(ids)
        where = group.index[slots]
        if "position" in values:
            self._ticks[where] = values["position"]
            self._fresh[where] = True
            self._seen_s[where] = now
        if errors.any() or self._alarmed:
            self._note_errors(ids, where, errors)
        for name in self._stores.keys() & values.keys():
            self._stores[name][where] = values[name] * group.scales[name][slots]
        if "hardware" in values:
            self._hardware[where] = values["hardware"]
        if not values.keys() <= {"position", "velocity", "current"}:
            self._slow_state = None
        if "torque" in values:
            self._note_torque(ids, where, values, running)

    def _note_errors(self, ids: Sequence[int], where: NDArray[np.intp], errors: Octets) -> None:
        """Keep the error bytes of k servos, and report alerts that are new."""
        rising = errors & ~self._error[where] & ALERT
        self._error[where] = errors
        self._alarmed, self._slow_state = bool(self._error.any()), None
        for servo in [servo for servo, new in zip(ids, rising, strict=True) if new]:
            self.report.count("alert", servo)
            self._log("servo %s reports a hardware error", self._registers.label(servo))
            self._check_first(servo)

    def _note_torque(self, ids: Sequence[int], where: NDArray[np.intp], values: Values, running: bool) -> None:
        """Keep whether motors are on, and report those that switched off by themselves."""
        now_on = values["torque"] == 1
        if "torque_limit" in values:  # a servo that shut down has 0 there
            now_on &= values["torque_limit"] != 0
        lost = self._torque[where] & ~now_on
        self._torque[where] = now_on
        for servo in [servo for servo, off in zip(ids, lost, strict=True) if off and running]:
            self.report.count("torque_lost", servo)
            self._log("servo %s switched its torque off by itself", self._registers.label(servo))
