"""Permanent registers of servos with Protocol 1.0 framing: written only where they differ, and with torque off."""

from __future__ import annotations

from typing import Any

from drivers.base.errors import ServoRefused
from drivers.servos.registers import TRIES, Registers
from drivers.servos.startup import Startup

MULTI_TURN = 0x10
"""Feetech's Phase: present positions leave the turn."""
EEPROM_TRIES = 10


def apply_settings(startup: Startup, servo: int, held: bool) -> None:
    """Permanent registers this driver relies on: read, and written only where they differ, with torque off."""
    registers = startup.registers
    wanted = _wanted(registers, servo)
    if not held:  # a delayed answer only costs time, so a servo that holds is left alone
        wanted["return_delay"] = 0
    present = {name: registers.get(servo, name) for name in wanted}
    differing = {name: value for name, value in wanted.items() if present[name] != value}
    feetech = "Response Level" in registers.tables[servo]
    if differing:
        name, value = next(iter(differing.items()))
        if held:
            raise startup.locked(servo, name, present[name], value)
        write_surely(registers, servo, "torque", 0, TRIES)
    try:
        for name, value in differing.items():
            if feetech:
                write_surely(registers, servo, "lock", 0, TRIES)
            write_surely(registers, servo, name, value, EEPROM_TRIES)
            startup.note(servo, name, present[name], value)
    finally:
        if feetech:  # unlocked, its id and limits could be changed by a bad packet
            registers.tell(servo, "lock", 1)
    if feetech and registers.get(servo, "lock") != 1:
        write_surely(registers, servo, "lock", 1, TRIES)


def _wanted(registers: Registers[Any], servo: int) -> dict[str, int]:
    """Values of permanent registers by short name."""
    table = registers.tables[servo]
    last = table.ticks_per_turn - 1
    feetech = "Response Level" in table
    wanted = {"status_level": 1 if feetech else 2}
    low, high = registers.get(servo, "min_ticks"), registers.get(servo, "max_ticks")
    if low == high == 0:
        wanted["max_ticks"] = last  # it would turn for ever
    elif low == high == last:
        wanted["min_ticks"] = 0  # MX: several turns
    if registers.item(servo, "mode"):
        wanted["mode"] = 0
    if feetech and registers.get(servo, "phase") & MULTI_TURN and table.group_read:
        wanted["phase"] = registers.get(servo, "phase") & ~MULTI_TURN
    return wanted


def write_surely(registers: Registers[Any], servo: int, name: str, value: int, tries: int) -> None:
    """Write until it reads back, without relying on acknowledgements, which a servo may have been told not to send.

    Raises
    ------
    ServoRefused : it keeps another value. NoReply, CorruptReply
    """
    for _ in range(tries):
        registers.tell(servo, name, value)
        if registers.get(servo, name, tries) == value:  # it is deaf for a while after a permanent write
            return
    message = f"servo {registers.label(servo)} did not take {registers.called(servo, name)} = {value}"
    hint = "switch its power off and on: a locked servo opens only then"
    raise registers.error(ServoRefused, message, hint, servo)
