"""Set the id of a servo of either protocol.

Nothing is written before the servo has answered, the new id has proved free and the motor is off.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from drivers.base.bus import ServoInfo
from drivers.base.errors import BusError, NoReply, ServoRefused
from drivers.dynamixel.registers import Registers as Registers2
from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import MAX_ID, Instruction
from drivers.protocol1.registers import Registers as Registers1
from drivers.servos.port import Port
from drivers.servos.registers import Registers
from drivers.tables.tables import FEETECH, load_table
from drivers.tools.scan_protocol1 import identity, registers_on

SETTLE_S = 1.0
"""Time for which a servo may not answer while it writes its permanent memory."""
MAX_TRIES = 3
"""Number of tries to identify a servo before its id counts as free."""
REPLY_S = 0.02
"""Time for the reply to a write; it is not read, because it may carry the new id."""


@contextmanager
def _registers(port: str, baud: int, protocol: int) -> Iterator[Registers[Any]]:
    registers = Registers2(Packets(), Port(port, baud), ()) if protocol == 2 else registers_on(port, baud)
    registers.port.openPort()
    try:
        yield registers
    finally:
        registers.port.closePort()


def _find(registers: Registers[Any], servo: int) -> ServoInfo | None:
    """Identify a servo and read its torque; None where no servo answers. Raises CorruptReply where two answer."""
    found: tuple[int, int] | None
    if isinstance(registers, Registers1):
        found = identity(registers, servo)
    else:
        try:
            low, high, firmware = registers.hello(servo).params
            found = low | high << 8, firmware
        except NoReply:
            found = None
    if found is None:
        return None
    table = registers.tables[servo] = load_table(*found)
    registers.get(servo, "position")  # two servos that are alike in all else differ in this: the reply is damaged
    return ServoInfo(servo, table.number, table.model, found[1], torque=registers.get(servo, "torque") == 1)


def _find_with_retries(registers: Registers[Any], servo: int) -> ServoInfo | None:
    """Identify a servo; None where it does not answer several times, since one reply may be lost or late."""
    return next((found for _ in range(MAX_TRIES) if (found := _find(registers, servo)) is not None), None)


def _write(registers: Registers[Any], servo: int, name: str, value: int) -> None:
    """Write a register by the maker's name without reading the reply."""
    item, packets = registers.tables[servo][name], registers.packets
    params = packets.number(item.address) + item.encode(value)
    packets.send_only(registers.port, packets.encode(servo, Instruction.WRITE, params))
    registers.port.sleep(REPLY_S)


def set_id(port: str, baud: int, protocol: int | None, old: int, new: int, *, release: bool = False) -> ServoInfo:
    """Give the servo ``old`` the id ``new``; returns it under its new id.

    port, baud : where it is. protocol : 2, or 1 (AX, MX, Feetech); None tries both.
    release : switch its motor off where it is on.

    Raises ValueError: an id that no servo may have. NoReply, CorruptReply: no servo, or more than one, has the old id.
    ServoRefused: the new id is taken, the motor is on, servos of both protocols have the old id, or the servo kept its
    id. Nothing was changed.
    """
    for name, servo in (("old", old), ("new", new)):
        if not 0 <= servo <= MAX_ID:
            raise ValueError(f"{name}: an id is 0 to {MAX_ID}, got {servo}")
    with _registers(port, baud, protocol or _protocol_of(port, baud, old)) as registers:
        info = _find_with_retries(registers, old)
        if info is None:
            raise _nobody(port, baud, old)
        taken = _find_with_retries(registers, new) if new != old else None
        if taken is not None:
            raise _error(f"the id {new} on {port} is taken by another {taken.model}", "choose a free id", port, new)
        if info.torque:
            if not release:
                message = f"servo {old} on {port} holds with torque, and an id changes only while the motor is off"
                raise _error(message, "support what it carries, then add --release", port, old)
            _write(registers, old, "Torque Enable", 0)
            if registers.get(old, "torque"):
                message = f"servo {old} on {port} did not switch its motor off"
                raise _error(message, "try again, or switch its power off and on", port, old)
        with _unlocked(registers, old, new, info.model):
            _write(registers, old, "ID", new)
            changed = _await(registers, new)
        if changed is None or changed.model_number != info.model_number:
            message = f"servo {old} on {port} did not take the id {new}"
            raise _error(message, "`omote scan` lists the servos", port, old)
        return changed


@contextmanager
def _unlocked(registers: Registers[Any], old: int, new: int, model: str) -> Iterator[None]:
    """In this context a servo's permanent memory is unlocked; it is locked again under either id in the end."""
    table = registers.tables[old]
    if table.lock != "Lock":
        yield
        return
    try:
        _write(registers, old, "Lock", 0)
        yield
    finally:
        if model.startswith(FEETECH):  # an AX unlocks only when its power is switched off
            registers.tables.setdefault(new, table)
            for servo in dict.fromkeys((old, new)):
                if registers.tables[servo].model == table.model:
                    _write(registers, servo, "Lock", 1)


def _protocol_of(port: str, baud: int, servo: int) -> int:
    """Return the protocol in which a servo answers. Raises NoReply if in none, ServoRefused if in both."""
    found = []
    for protocol in (2, 1):
        with _registers(port, baud, protocol) as registers:
            found += [protocol] if _find_with_retries(registers, servo) is not None else []
    if len(found) > 1:
        message = f"a servo of Protocol 2.0 and one of Protocol 1.0 have the id {servo} on {port}"
        raise _error(message, "add --protocol 2 or --protocol 1", port, servo)
    if not found:
        raise _nobody(port, baud, servo)
    return found[0]


def _nobody(port: str, baud: int, servo: int) -> NoReply:
    message = f"no servo has the id {servo} on {port} at {baud} baud"
    return NoReply(message, hint=f"omote scan {port}", port=port, servo_ids=(servo,))


def _await(registers: Registers[Any], servo: int) -> ServoInfo | None:
    """Wait until a servo answers again, and return its description."""
    found, end_s = None, time.monotonic() + SETTLE_S
    while found is None and time.monotonic() < end_s:
        found = _find(registers, servo)
    return found


def _error(message: str, hint: str, port: str, servo: int) -> BusError:
    return ServoRefused(message, hint=hint, port=port, servo_ids=(servo,))
