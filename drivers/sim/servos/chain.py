"""Servos on one wire, whatever protocol they speak: who hears a packet, who answers, what faults do to it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable
from typing import Any

from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.state import WATCHDOG_STEP_S, Heard, same_rate
from drivers.sim.wire.faults import KINDS, Fault
from drivers.sim.wire.line import Line
from drivers.sim.wire.replies import Reply, collide


class Chain(Line):
    """Servos on one wire; what the packets mean is the subclass's.

    Parameters
    ----------
    servos : any number; two with one id collide, as they do on a real wire.
    now_s : time.
    faults : specs as in ``drivers.sim.wire.faults``.
    seed : of random faults.

    Attributes
    ----------
    servos : the servos, in the order given.
    by_id, twins : who hears the wire at its bit rate, by id; more servos of an id that is taken.
    chain_stop : in reads of several servos nobody answers behind a silent one; otherwise the next one does.
    """

    def __init__(
        self,
        servos: Iterable[SimulatedServo],
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        seed: int = 0,
    ) -> None:
        self.servos = list(servos)
        self.chain_stop = False
        self._heard = Heard(now_s)
        self._muted: frozenset[int] = frozenset()
        self.by_id: dict[int, SimulatedServo] = {}
        self.twins: dict[int, list[SimulatedServo]] = {}
        self._extra: dict[Fault, list[SimulatedServo]] = {}
        self._stale = True
        super().__init__(seed)
        for servo in self.servos:
            self._adopt(servo)
        self.faults.add(faults, now_s)

    def servo(self, device_id: int) -> SimulatedServo:
        """The first servo that has this id now.

        Raises
        ------
        KeyError : nobody has it.
        """
        for servo in self.servos:
            if servo.id == device_id:
                return servo
        raise KeyError(f"no simulated servo has id {device_id}")

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """Id, model, position, goal, torque and latched errors of each servo."""
        return [
            {
                "id": servo.id,
                "model": servo.table.model,
                "position": servo.position_ticks(now_s),
                "goal": servo.goal,
                "torque": servo.torque,
                "error": servo.hardware_error,
            }
            for servo in self.servos
        ]

    def place(self, device_id: int, position: float, now_s: float) -> None:
        """Move a limp shaft by hand.

        Raises
        ------
        KeyError : nobody has the id. ValueError : the motor holds the shaft.
        """
        self.servo(device_id).place(position, now_s)

    @abstractmethod
    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        """A status packet of the protocol."""

    def set_line_baud(self, baud: int | None) -> None:
        """The port's bit rate was changed."""
        if baud != self.line_baud:
            super().set_line_baud(baud)
            self._stale = True

    def _adopt(self, servo: SimulatedServo) -> None:
        servo.heard = self._heard
        servo.on_change = self._mark_stale
        self._stale = True

    def _mark_stale(self) -> None:
        self._stale = True

    def catch_up(self, now_s: float) -> None:
        """What happened on the wire since the last packet: faults that are due, watchdogs that tripped."""
        super().catch_up(now_s)
        if now_s - self._heard.at_s > WATCHDOG_STEP_S:
            for servo in self.servos:
                servo.watch(now_s)
        self._heard.at_s = now_s
        if self._stale:
            self._index()

    def _index(self) -> None:
        """Who hears the wire, by id. Servos at another bit rate do not."""
        self._stale = False
        self.by_id, self.twins = {}, {}
        everyone = self.servos + [twin for twins in self._extra.values() for twin in twins]
        for servo in everyone:
            if self.line_baud is not None and not same_rate(servo.baud, self.line_baud):
                continue
            if servo.id in self.by_id:
                self.twins.setdefault(servo.id, []).append(servo)
            else:
                self.by_id[servo.id] = servo
        muted = [fault for fault in self.faults.active if fault.kind == "mute"]
        self._muted = frozenset(i for i in self.by_id if any(fault.concerns(i) for fault in muted))

    # ------------------------------------------------------------ who is addressed
    def find(self, device_id: int, now_s: float) -> SimulatedServo | None:
        """The servo that hears this id now, caught up with the time."""
        servo = self.by_id.get(device_id)
        if servo is None or device_id in self._muted or now_s < servo.deaf_until:
            return None
        if now_s >= servo.next_health_s:
            servo.look(now_s)
        return servo

    def everyone(self, now_s: float) -> list[SimulatedServo]:
        """All servos that hear, in order of id, twins included."""
        heard = []
        for device_id in sorted(self.by_id):
            if self.find(device_id, now_s):
                heard += [self.by_id[device_id], *self.twins.get(device_id, ())]
        return heard

    def group(self, device_id: int, now_s: float) -> list[SimulatedServo]:
        """Servos that carry out a write to an id: its owner and twins, else those with that secondary id."""
        servo = self.find(device_id, now_s)
        if servo is not None:
            return [servo, *self.twins.get(device_id, ())]
        if device_id in self.by_id:
            return []
        return [other for other in self.everyone(now_s) if other.secondary_id == device_id]

    # ------------------------------------------------------------ answers
    def status(self, servo: SimulatedServo, device_id: int, error: int, data: bytes) -> Reply | None:
        """One status packet as it arrives at the host; None where nothing does."""
        frame = self.encode_status(device_id, error, data)
        if not self.faults.spoilers:
            return Reply(frame, servo)
        spoilt, late_s = self.faults.spoil_status(frame, device_id, error, data, self.encode_status)
        return None if spoilt is None else Reply(spoilt, servo, late_s)

    def answer(
        self, device_id: int, level: int, now_s: float, act: Callable[[SimulatedServo], tuple[int, bytes]]
    ) -> list[Reply]:
        """Let the servo (and its twins) act; the replies of twins collide on the wire."""
        group = self.group(device_id, now_s)
        replies = []
        for servo in group:
            answers = servo.id == device_id and servo.status_level >= level
            error, data = act(servo)
            if answers:
                replies.append(self.status(servo, device_id, error, data))
        return collide([reply for reply in replies if reply])

    # ------------------------------------------------------------ faults
    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault that is not about replies begins or ends."""
        super().fault_changed(fault, begins, now_s)
        if fault.kind == "chain-stop":
            self.chain_stop = begins
        elif fault.kind == "mute":
            self._stale = True
        elif KINDS[fault.kind].scope == "servo":
            for servo in self.servos:
                if fault.concerns(servo.id):
                    self._change_servo(servo, fault, begins, now_s)
            self._stale = True

    def _change_servo(self, servo: SimulatedServo, fault: Fault, begins: bool, now_s: float) -> None:
        if fault.kind == "baud":
            servo.force_baud(fault.value if begins else self.line_baud or 1_000_000)
        elif fault.kind == "dup" and begins:
            twin = SimulatedServo(
                servo.id, servo.table.number, now_s=now_s, baud=servo.baud, position=servo.table.center / 2
            )
            self._adopt(twin)
            self._extra.setdefault(fault, []).append(twin)
        elif fault.kind == "dup":
            self._extra.pop(fault, None)
        else:
            servo.suffer(fault.kind, fault.value, begins, now_s)
