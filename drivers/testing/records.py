"""Records what programs write to simulated servos and boards, how shafts move, and what passes over the wire.

A record holds a limited number of entries. What would be more is left out, and every assertion then fails and says so:
an assertion never passes on a part of what happened.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from drivers.packets.packet import ErrorNumber
from drivers.sim.boards.board import Board
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.motion import Trajectory
from drivers.sim.servos.plant import Plant
from drivers.sim.servos.registers import Change

MAX_ENTRIES = 1_000_000
"""Number of writes, of pieces of motion and of pieces of traffic that a record keeps, each."""


class Write(NamedTuple):
    """One register, or one output of a board, that a program wrote.

    time_s : since the record began.
    id : of the servo, or the board's channel.
    register : name in the control table, as ``"Goal Position"``; for boards ``"target_us"`` or ``"value"``.
    value : in the register's own unit; None for an output of a board that was switched off.
    refused : why the servo refused it, as ``"data limit"``; empty where it took it.
    """

    time_s: float
    id: int
    register: str
    value: float | None
    refused: str = ""


class Piece(NamedTuple):
    """Motion of a shaft from one moment until its next piece begins.

    start_s : time of the line's clock. trajectory : the motion that was commanded. jammed_at : place where the shaft is
    stuck, or None. powered : torque is on.
    """

    start_s: float
    trajectory: Trajectory
    jammed_at: float | None
    powered: bool


class Traffic(NamedTuple):
    """Bytes that passed: time of the line's clock, sent by the host, number."""

    time_s: float
    sent: bool
    size: int


class Record:
    """What happened on a line since ``start_s``, a time of its clock.

    writes, traffic : in order. left_out : whether there were more than :data:`MAX_ENTRIES` entries of a sort.
    """

    def __init__(self, start_s: float) -> None:
        self.start_s = start_s
        self.writes: list[Write] = []
        self.traffic: list[Traffic] = []
        self.left_out = False

    def keep(self, entries: list[Any], entry: Any) -> None:
        """Add an entry where there is room."""
        if len(entries) < MAX_ENTRIES:
            entries.append(entry)
        else:
            self.left_out = True

    def passed(self, sent: bool, size: int, now_s: float) -> None:
        """Bytes passed."""
        self.keep(self.traffic, Traffic(now_s, sent, size))

    def before(self, now_s: float) -> None:
        """A packet will be carried out."""

    def after(self, now_s: float) -> None:
        """A packet was carried out."""

    def notice(self, now_s: float) -> None:
        """Keep what happened by itself since the last packet."""


class ServoRecord(Record):
    """Record of a chain of servos, by what each is commanded and how each moves.

    pieces : motion of each servo, by its place in ``chain.servos``.
    """

    def __init__(self, chain: Chain, start_s: float) -> None:
        super().__init__(start_s)
        self.servos = chain.servos
        self.pieces: list[list[Piece]] = [[_piece(servo, start_s)] for servo in self.servos]
        for servo in self.servos:
            servo.on_write, servo.on_refusal = partial(self._written, servo), partial(self._refused, servo)

    def _written(self, servo: SimulatedServo, changes: list[Change], now_s: float) -> None:
        for item, value in changes:
            self.keep(self.writes, Write(now_s - self.start_s, servo.id, item.name, value))

    def _refused(self, servo: SimulatedServo, address: int, data: bytes, why: ErrorNumber, now_s: float) -> None:
        item = servo.table.by_address.get(address)
        name, value = f"address {address}", int.from_bytes(data, "little")
        if item is not None:
            name, value = item.name, item.decode(data) if len(data) >= item.size else value
        self.keep(self.writes, Write(now_s - self.start_s, servo.id, name, value, why.name.lower().replace("_", " ")))

    def after(self, now_s: float) -> None:
        """Keep what a packet has set in motion."""
        self.notice(now_s)

    def notice(self, now_s: float) -> None:
        """Keep the motion of each servo that has changed."""
        for servo, pieces in zip(self.servos, self.pieces, strict=True):
            plant, last = servo.plant, pieces[-1]
            if _seen(plant, last):
                continue
            # a bus watchdog is noticed late: its motion began before this packet
            late = plant.trajectory is not last.trajectory and plant.powered is last.powered
            start_s = max(last.start_s, plant.trajectory.start_s) if late else now_s
            self.keep(pieces, _piece(servo, min(start_s, now_s)))


def _seen(plant: Plant, last: Piece) -> bool:
    same = plant.trajectory is last.trajectory and plant.powered is last.powered
    return same and plant.jammed_at == last.jammed_at


def _piece(servo: SimulatedServo, start_s: float) -> Piece:
    plant = servo.plant
    return Piece(start_s, plant.trajectory, plant.jammed_at, plant.powered)


class Output(NamedTuple):
    """One output of a board at a moment.

    id : channel. key : name of its value. target : the commanded value, None for off. value : what it puts out.
    """

    id: int
    key: str
    target: float | None
    value: float | None


class Step(NamedTuple):
    """A change of a board's output by one packet: the write, and what was put out just before and after it."""

    write: Write
    before: float | None
    after: float | None


class BoardRecord(Record):
    """Record of a board: each output whose target a packet changed. One that is set again to the same is no change.

    steps : the changes with what was put out before and after.
    """

    def __init__(self, board: Board, start_s: float) -> None:
        super().__init__(start_s)
        self.board = board
        self.steps: list[Step] = []
        self._was: list[Output] = []

    def before(self, now_s: float) -> None:
        """Keep what the outputs are."""
        self._was = outputs(self.board, now_s)

    def after(self, now_s: float) -> None:
        """Keep what has changed."""
        for was, now in zip(self._was, outputs(self.board, now_s), strict=False):
            if now.target != was.target:
                write = Write(now_s - self.start_s, now.id, now.key, now.target)
                self.keep(self.writes, write)
                self.keep(self.steps, Step(write, was.value, now.value))


def outputs(board: Board, now_s: float) -> list[Output]:
    """The outputs of a board; a pulse of 0 counts as off."""
    found = []
    for row in board.describe(now_s):
        if "target_us" in row:
            found.append(Output(row["id"], "target_us", row["target_us"] or None, row["pulse_us"] or None))
        else:
            key = next(key for key in reversed(row) if key not in ("id", "name"))
            found.append(Output(row["id"], key, row[key], row[key]))
    return found
