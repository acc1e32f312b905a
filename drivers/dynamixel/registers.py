"""Named registers of the servos on one port, read and written with every answer checked."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TypeVar

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoRefused, together
from drivers.dynamixel.layout import NAMES, item_of
from drivers.dynamixel.port import Port
from drivers.dynamixel.sdk import Exchange, Packets
from drivers.packets.packet import ErrorNumber, Instruction, StatusPacket, encode_instruction
from drivers.tables.tables import ControlTable, Item

TRIES = 4
T = TypeVar("T")


class Registers:
    """Registers by servo id and this driver's short names (see ``layout.NAMES``).

    Parameters
    ----------
    packets, port : the wire.
    servos : by id, for messages.
    """

    def __init__(self, packets: Packets, port: Port, servos: Iterable[ServoSpec]) -> None:
        self.packets, self.port = packets, port
        self.names = {servo.id: servo.name for servo in servos}
        self.tables: dict[int, ControlTable] = {}

    def label(self, servo: int) -> str:
        """How messages call a servo: ``"jaw" (id 3)``."""
        return f'"{self.names[servo]}" (id {servo})' if servo in self.names else f"id {servo}"

    def item(self, servo: int, name: str) -> Item | None:
        """Register of a servo; None where its model has none."""
        return item_of(self.tables[servo], name)

    def having(self, ids: Iterable[int], name: str) -> list[int]:
        """Those of the ids whose model has a register."""
        return [servo for servo in ids if self.item(servo, name) is not None]

    def hello(self, servo: int, tries: int = TRIES) -> StatusPacket:
        """A servo's answer to a ping.

        Raises
        ------
        NoReply, CorruptReply
        """
        ask = partial(self.packets.ask, self.port, servo, Instruction.PING, b"", 3)
        return self._insist(servo, "a ping", ask, tries)

    def get(self, servo: int, name: str, tries: int = TRIES) -> int:
        """One register.

        Raises
        ------
        NoReply, CorruptReply, ServoRefused
        """
        item = self._known(servo, name)
        params = struct.pack("<HH", item.address, item.size)
        ask = partial(self.packets.ask, self.port, servo, Instruction.READ, params, item.size)
        return item.decode(self._insist(servo, f"reading {NAMES[name][0]}", ask, tries).params)

    def put(self, servo: int, name: str, value: int, tries: int = TRIES) -> None:
        """Write one register and wait for the servo to agree.

        Raises
        ------
        NoReply, CorruptReply, ServoRefused
        """
        item = self._known(servo, name)
        params = struct.pack("<H", item.address) + item.encode(value)
        ask = partial(self.packets.ask, self.port, servo, Instruction.WRITE, params, 0)
        self._insist(servo, f"writing {NAMES[name][0]} = {value}", ask, tries)

    def tell(self, servo: int, name: str, value: int) -> None:
        """Write one register without waiting for an answer."""
        item = self._known(servo, name)
        params = struct.pack("<H", item.address) + item.encode(value)
        self.packets.tell(self.port, encode_instruction(servo, Instruction.WRITE, params))

    def get_all(self, ids: Sequence[int], name: str) -> dict[int, int]:
        """One register of many servos: a group read, then each missing one by itself.

        Returns
        -------
        dict : by id; ids whose model lacks the register are left out.

        Raises
        ------
        NoReply, CorruptReply : some did not answer; ``servo_ids`` are all of them.
        """
        values: dict[int, int] = {}
        for item, group in self._by_item(ids, name).items():
            got = self.packets.read_group(self.port, group, item.address, item.size)
            good = {i: reply for i, reply in got.replies.items() if len(reply.params) == item.size}
            values |= {servo: item.decode(reply.params) for servo, reply in good.items()}
        missing = [servo for servo in self.having(ids, name) if servo not in values]
        values |= self.each(missing, lambda servo: self.get(servo, name))
        return values

    def put_all(self, values: Mapping[int, int], name: str) -> None:
        """Write one register of many servos with one packet per address; nobody answers."""
        for item, group in self._by_item(values, name).items():
            rows = b"".join(bytes((servo,)) + item.encode(values[servo]) for servo in group)
            self.packets.write_group(self.port, item.address, item.size, rows)

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

    def _by_item(self, ids: Iterable[int], name: str) -> dict[Item, list[int]]:
        groups: dict[tuple[int, int], tuple[Item, list[int]]] = {}
        for servo in ids:
            item = self.item(servo, name)
            if item is not None:
                groups.setdefault((item.address, item.size), (item, []))[1].append(servo)
        return dict(groups.values())

    def _known(self, servo: int, name: str) -> Item:
        item = self.item(servo, name)
        if item is None:
            raise ServoRefused(f"{self.tables[servo].model} has no {NAMES[name][0]}", servo_ids=(servo,))
        return item

    def _insist(self, servo: int, doing: str, ask: Callable[[], Exchange], tries: int) -> StatusPacket:
        corrupt = False
        for _ in range(tries):
            got = ask()
            reply = got.replies.get(servo)
            if reply is not None:
                return self._agreed(servo, doing, reply)
            corrupt |= got.corrupt
        raise self._silent(servo, doing, corrupt)

    def _agreed(self, servo: int, doing: str, reply: StatusPacket) -> StatusPacket:
        if not reply.error_number:
            return reply
        names = {number.value: number.name.lower().replace("_", " ") for number in ErrorNumber}
        reason = names.get(reply.error_number, f"error {reply.error_number}")
        message = f"servo {self.label(servo)} on {self.port.port_name} refused {doing}: {reason}"
        raise self._error(ServoRefused, message, "`omote scan` shows its state", servo)

    def _silent(self, servo: int, doing: str, corrupt: bool) -> BusError:
        where = f"servo {self.label(servo)} on {self.port.port_name} at {self.port.baudrate} baud"
        if corrupt:
            hint = "two servos may have this id, or the baud rate is wrong: connect one alone, try `omote scan`"
            return self._error(CorruptReply, f"{where} gave a damaged answer to {doing}", hint, servo)
        hint = "check its power and cable; `omote scan` looks at every id and baud rate"
        return self._error(NoReply, f"{where} did not answer {doing}", hint, servo)

    def _error(self, kind: type[BusError], message: str, hint: str, servo: int) -> BusError:
        return kind(message, hint=hint, port=self.port.port_name, servo_ids=(servo,))
