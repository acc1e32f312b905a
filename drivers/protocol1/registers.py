"""Named registers of servos with Protocol 1.0 framing, read and written with every answer checked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TypeVar

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoRefused, together
from drivers.packets.packet1 import Error1, Instruction1, Packet1
from drivers.protocol1 import WINDOW
from drivers.protocol1.exchange import Exchange, Exchanges, WirePort
from drivers.tables.tables import ControlTable, Item

TRIES = 4
T = TypeVar("T")

NAMES = {
    "position": ("Present Position",),
    "velocity": ("Present Speed", "Present Velocity"),
    "load": ("Present Load",),
    "voltage": ("Present Voltage",),
    "temperature": ("Present Temperature",),
    "hardware": ("Hardware Error Status",),
    "moving": ("Moving",),
    "current": ("Present Current",),
    "torque": ("Torque Enable",),
    "torque_limit": ("Torque Limit",),
    "goal": ("Goal Position",),
    "time": ("Goal Time",),
    "speed": ("Moving Speed", "Goal Velocity"),
    "accel": ("Goal Acceleration", "Acceleration"),
    "min_ticks": ("CW Angle Limit", "Min Position Limit"),
    "max_ticks": ("CCW Angle Limit", "Max Position Limit"),
    "min_voltage": ("Min Voltage Limit",),
    "status_level": ("Status Return Level", "Response Level"),
    "return_delay": ("Return Delay Time",),
    "shutdown": ("Shutdown",),
    "mode": ("Operating Mode",),
    "phase": ("Phase",),
    "lock": ("Lock",),
}
"""Short names -> the makers' names of a register, which differ by family."""


def item_of(table: ControlTable, name: str) -> Item | None:
    """Register of a table by its short name; None where the model has none."""
    return next((table[vendor] for vendor in NAMES[name] if vendor in table), None)


class Registers:
    """Registers by servo id and short name (see ``NAMES``).

    Parameters
    ----------
    packets, port : the wire.
    servos : by id, for messages.

    Attributes
    ----------
    tables : control table by id.
    flags : error byte of the last reply by id.
    """

    def __init__(self, packets: Exchanges, port: WirePort, servos: Iterable[ServoSpec]) -> None:
        self.packets, self.port = packets, port
        self.names = {servo.id: servo.name for servo in servos}
        self.tables: dict[int, ControlTable] = {}
        self.flags: dict[int, int] = {}

    def label(self, servo: int) -> str:
        """How messages call a servo: ``"jaw" (id 3)``."""
        return f'"{self.names[servo]}" (id {servo})' if servo in self.names else f"id {servo}"

    def item(self, servo: int, name: str) -> Item | None:
        """Register of a servo; None where its model has none."""
        return item_of(self.tables[servo], name)

    def having(self, ids: Iterable[int], name: str) -> list[int]:
        """Those of the ids whose model has a register."""
        return [servo for servo in ids if self.item(servo, name) is not None]

    def causes(self, servo: int, flags: int) -> int:
        """Those of a reply's error flags that are about the servo's state: supply, heat, load."""
        return flags & sum(self.tables[servo].hardware_error.values())

    def hello(self, servo: int, tries: int = TRIES) -> Packet1:
        """The first registers of a servo.

        Raises
        ------
        NoReply, CorruptReply
        """
        return self._insist(servo, "a greeting", partial(self.packets.hello, self.port, servo), tries)

    def get(self, servo: int, name: str, tries: int = TRIES) -> int:
        """One register.

        Raises
        ------
        NoReply, CorruptReply, ServoRefused
        """
        item = self._known(servo, name)
        at, size = window(self.tables[servo], item)
        ask = partial(self.packets.ask, self.port, servo, Instruction1.READ, bytes((at, size)), size)
        reply = self._insist(servo, f"reading {item.name}", ask, tries)
        return item.decode(reply.params[item.address - at :])

    def put(self, servo: int, name: str, value: int, tries: int = TRIES) -> None:
        """Write one register and wait for the servo to agree.

        Raises
        ------
        NoReply, CorruptReply, ServoRefused
        """
        item = self._known(servo, name)
        params = bytes((item.address,)) + item.encode(value)
        ask = partial(self.packets.ask, self.port, servo, Instruction1.WRITE, params, 0)
        self._insist(servo, f"writing {item.name} = {value}", ask, tries)

    def tell(self, servo: int, name: str, value: int) -> None:
        """Write one register by a sync write of one, which is never answered: an answer that nobody waited for
        would collide with the next question."""
        self.put_all({servo: value}, name)

    def get_all(self, ids: Sequence[int], name: str) -> dict[int, int]:
        """One register of many servos: in groups where they can, then each missing one by itself.

        Returns
        -------
        dict : by id; ids whose model lacks the register are left out.

        Raises
        ------
        NoReply, CorruptReply : some did not answer; ``servo_ids`` are all of them.
        """
        values: dict[int, int] = {}
        for (at, size, manner), group in self._windows(ids, name).items():
            if not manner:
                continue
            got = self.packets.read_group(self.port, group, at, size, manner)
            for servo, reply in got.replies.items():
                if len(reply.params) == size:
                    self.flags[servo] = reply.code
                    item = self._known(servo, name)
                    values[servo] = item.decode(reply.params[item.address - at :])
        missing = [servo for servo in self.having(ids, name) if servo not in values]
        return values | self.each(missing, lambda servo: self.get(servo, name))

    def put_all(self, values: Mapping[int, int], name: str) -> None:
        """Write one register of many servos with one packet per address; nobody answers."""
        for frame in self.frames(values, name):
            self.packets.tell(self.port, frame)

    def frames(self, values: Mapping[int, int], name: str) -> list[bytes]:
        """The sync writes of :meth:`put_all`."""
        groups: dict[tuple[int, int], bytes] = {}
        for servo in self.having(values, name):
            item = self._known(servo, name)
            row = bytes((servo,)) + item.encode(values[servo])
            groups[item.address, item.size] = groups.get((item.address, item.size), b"") + row
        return [frame for key, rows in groups.items() for frame in self.packets.group_frames(*key, rows)]

    def set_all(self, values: Mapping[int, int], name: str) -> None:
        """Write one register of many servos and make sure that each has it.

        Raises
        ------
        NoReply, CorruptReply, ServoRefused
        """
        self.put_all(values, name)
        has = self.get_all(list(values), name)
        self.each(
            [servo for servo, value in has.items() if value != values[servo]],
            lambda servo: self.put(servo, name, values[servo]),
        )

    def each(self, ids: Iterable[int], do: Callable[[int], T]) -> dict[int, T]:
        """Do something with every servo, each by itself, and tell about all that failed.

        Raises
        ------
        BusError : of the kind of the first failure, naming every id that failed.
        """
        done: dict[int, T] = {}
        failed: dict[int, BusError] = {}
        for servo in ids:
            try:
                done[servo] = do(servo)
            except BusError as error:
                failed[servo] = error
        if failed:
            raise together(failed)
        return done

    def _windows(self, ids: Iterable[int], name: str) -> dict[tuple[int, int, str], list[int]]:
        groups: dict[tuple[int, int, str], list[int]] = {}
        for servo in self.having(ids, name):
            table = self.tables[servo]
            key = (*window(table, self._known(servo, name)), table.group_read)
            groups.setdefault(key, []).append(servo)
        return groups

    def _known(self, servo: int, name: str) -> Item:
        item = self.item(servo, name)
        if item is None:
            raise ServoRefused(f"{self.tables[servo].model} has no {NAMES[name][0]}", servo_ids=(servo,))
        return item

    def _insist(self, servo: int, doing: str, ask: Callable[[], Exchange], tries: int) -> Packet1:
        corrupt = False
        for _ in range(tries):
            got = ask()
            reply = got.replies.get(servo)
            if reply is not None and not reply.code & self.packets.refusals & Error1.CHECKSUM:
                self.flags[servo] = reply.code
                return self._agreed(servo, doing, reply)
            corrupt |= got.corrupt or reply is not None
        raise self._silent(servo, doing, corrupt)

    def _agreed(self, servo: int, doing: str, reply: Packet1) -> Packet1:
        refusal = Error1(reply.code & self.packets.refusals)
        if not refusal or reply.params:  # flags about an earlier instruction come with data that is good
            return reply
        reason = ", ".join(flag.name.lower().replace("_", " ") for flag in refusal if flag.name)
        message = f"servo {self.label(servo)} on {self.port.link.path} refused {doing}: {reason}"
        raise self._error(ServoRefused, message, "`omote scan` shows its state", servo)

    def _silent(self, servo: int, doing: str, corrupt: bool) -> BusError:
        where = f"servo {self.label(servo)} on {self.port.link.path} at {self.port.baudrate} baud"
        if corrupt:
            hint = "two servos may have this id, or the baud rate is wrong: connect one alone, try `omote scan`"
            return self._error(CorruptReply, f"{where} gave a damaged answer to {doing}", hint, servo)
        hint = "check its power and cable; `omote scan` looks at every id and baud rate"
        return self._error(NoReply, f"{where} did not answer {doing}", hint, servo)

    def _error(self, kind: type[BusError], message: str, hint: str, servo: int) -> BusError:
        return kind(message, hint=hint, port=self.port.link.path, servo_ids=(servo,))


def window(table: ControlTable, item: Item) -> tuple[int, int]:
    """(address, size) of the read that learns a register without looking like the question (see the package)."""
    if item.size == 1:
        return item.address, 1
    return min(item.address, table.size - WINDOW), WINDOW
