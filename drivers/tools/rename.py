"""Giving a servo another id, in any of the protocols: the one permanent change that a bus cannot be run without.

Nothing is written before the servo has answered, the new id has proved free and the motor is off.
"""

from __future__ import annotations

import struct
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.base.bus import ServoInfo
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoRefused
from drivers.dynamixel.port import Port
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import MAX_ID, Instruction, encode_instruction
from drivers.packets.packet1 import Instruction1, encode
from drivers.port.serialport import SerialPort
from drivers.tables.tables import ControlTable, load_table, model_name
from drivers.tools.probe1 import describe, read_item

SETTLE_S = 1.0
"""How long a servo may be deaf while it writes its permanent memory."""


class _Wire(ABC):
    """One protocol on an open port, as far as an id is concerned."""

    @abstractmethod
    def look(self, servo: int) -> ServoInfo | None:
        """What a servo is; None where nobody answers. Raises CorruptReply where two answer at once."""

    @abstractmethod
    def put(self, servo: int, table: ControlTable, name: str, value: int) -> None:
        """Write a register; whether it was taken is looked at afterwards."""


class _Wire2(_Wire):
    def __init__(self, port: Port) -> None:
        self._registers = Registers(Packets(), port, ())

    def look(self, servo: int) -> ServoInfo | None:
        try:
            low, high, firmware = self._registers.hello(servo).params
        except NoReply:
            return None
        number = low | high << 8
        self._registers.tables[servo] = load_table(number, firmware)
        self._registers.get(servo, "position")  # two servos that are alike in all else differ in this: it is damaged
        torque = bool(self._registers.get(servo, "torque"))
        return ServoInfo(servo, number, model_name(number), firmware, torque=torque)

    def put(self, servo: int, table: ControlTable, name: str, value: int) -> None:
        item = table[name]
        params = struct.pack("<H", item.address) + item.encode(value)
        registers = self._registers
        registers.packets.tell(registers.port, encode_instruction(servo, Instruction.WRITE, params))


class _Wire1(_Wire):
    def __init__(self, link: SerialPort) -> None:
        self._link = link

    def look(self, servo: int) -> ServoInfo | None:
        info = describe(self._link, servo)
        if info is None or not info.model or info.torque is None:
            return info
        if read_item(self._link, servo, load_table(info.model_number), "Present Position") is None:
            raise CorruptReply(
                f"the answers of id {servo} on {self._link.path} are damaged",
                hint="two servos may have this id: connect one alone",
                port=self._link.path,
                servo_ids=(servo,),
            )
        return info

    def put(self, servo: int, table: ControlTable, name: str, value: int) -> None:
        item = table[name]
        params = bytes((item.address,)) + item.encode(value)
        self._link.write(encode(servo, Instruction1.WRITE, params))
        time.sleep(0.02)  # its answer is not waited for: it may come from the new id
        self._link.drain()


@contextmanager
def _wire(port: str, baud: int, protocol: int) -> Iterator[_Wire]:
    if protocol == 2:
        handler = Port(port, baud)
        handler.openPort()
        try:
            yield _Wire2(handler)
        finally:
            handler.closePort()
        return
    link = SerialPort(port, baud)
    link.open()
    try:
        yield _Wire1(link)
    finally:
        link.close()


def set_id(port: str, baud: int, protocol: int, old: int, new: int, *, release: bool = False) -> ServoInfo:
    """Give the servo ``old`` the id ``new``.

    Parameters
    ----------
    port, baud, protocol : where it is; Protocol 2 or 1 (AX, MX, Feetech).
    release : switch its motor off where it is on.

    Returns
    -------
    ServoInfo : the servo under its new id.

    Raises
    ------
    ValueError : an id that no servo may have.
    NoReply, CorruptReply : nobody, or more than one, has the old id.
    ServoRefused : the new id is taken, the motor is on, or the servo kept its id. Nothing was changed.
    """
    for name, servo in (("old", old), ("new", new)):
        if not 0 <= servo <= MAX_ID:
            raise ValueError(f"{name}: an id is 0 to {MAX_ID}, got {servo}")
    with _wire(port, baud, protocol) as wire:
        info = _ready(wire, port, baud, old, new, release)
        table = load_table(info.model_number, info.firmware)
        if protocol == 1 and table.lock == "Lock" and info.torque is not None:
            wire.put(old, table, "Lock", 0)
        wire.put(old, table, "ID", new)
        changed = _await(wire, new)
        if changed is None or changed.model_number != info.model_number:
            raise _error(
                f"servo {old} on {port} did not take the id {new}", "`omote scan` shows who is there", port, old
            )
        if protocol == 1 and table.lock == "Lock" and _is_feetech(table):
            wire.put(new, table, "Lock", 1)
        return changed


def _ready(wire: _Wire, port: str, baud: int, old: int, new: int, release: bool) -> ServoInfo:
    """The servo with the old id, limp, after a look at the new id."""
    info = wire.look(old)
    if info is None:
        raise NoReply(
            f"nobody has the id {old} on {port} at {baud} baud",
            hint=f"omote scan {port}",
            port=port,
            servo_ids=(old,),
        )
    taken = wire.look(new) if new != old else None
    if taken is not None:
        raise _error(f"the id {new} on {port} is taken by another {taken.model}", "choose a free id", port, new)
    if info.torque and not release:
        message = f"servo {old} on {port} holds with torque, and an id changes only while the motor is off"
        raise _error(message, "support what it carries, then add --release", port, old)
    if info.torque:
        wire.put(old, load_table(info.model_number, info.firmware), "Torque Enable", 0)
    return info


def _await(wire: _Wire, servo: int) -> ServoInfo | None:
    """The servo as soon as it answers again."""
    end = time.monotonic() + SETTLE_S
    while time.monotonic() < end:
        found = wire.look(servo)
        if found is not None:
            return found
    return None


def _is_feetech(table: ControlTable) -> bool:
    """Feetech's lock opens and closes at any time; that of an AX opens only without power."""
    return table.model.startswith(("sts", "scs"))


def _error(message: str, hint: str, port: str, servo: int) -> BusError:
    return ServoRefused(message, hint=hint, port=port, servo_ids=(servo,))
