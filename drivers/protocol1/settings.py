"""Permanent registers of servos with Protocol 1.0 framing: written only where they differ, and with torque off."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

from drivers.base.errors import ServoRefused
from drivers.protocol1.registers import Registers
from drivers.servos.registers import TRIES

log = logging.getLogger(__name__)

MULTI_TURN = 0x10
"""Feetech's Phase: present positions leave the turn."""
EEPROM_TRIES = 10


@dataclass
class Started:
    """What start-up found and did.

    Attributes
    ----------
    ticks : present position by id, read after torque came on.
    limits : lowest and highest step by id that the servo's own registers allow.
    eeprom : one line for every permanent register written.
    """

    ticks: dict[int, int] = field(default_factory=dict)
    limits: dict[int, tuple[int, int]] = field(default_factory=dict)
    eeprom: list[str] = field(default_factory=list)


def apply_settings(registers: Registers, servo: int, held: bool, started: Started) -> None:
    """Permanent registers this driver relies on: read, and written only where they differ, with torque off."""
    wanted = _wanted(registers, servo)
    if not held:  # a delayed answer only costs time, so a servo that holds is left alone
        wanted["return_delay"] = 0
    present = {name: registers.get(servo, name) for name in wanted}
    differing = {name: value for name, value in wanted.items() if present[name] != value}
    feetech = "Response Level" in registers.tables[servo]
    if differing:
        name, value = next(iter(differing.items()))
        if held:
            raise _locked(registers, servo, name, present[name], value)
        write_surely(registers, servo, "torque", 0, TRIES)
    try:
        for name, value in differing.items():
            if feetech:
                write_surely(registers, servo, "lock", 0, TRIES)
            write_surely(registers, servo, name, value, EEPROM_TRIES)
            note(registers, servo, name, present[name], value, started)
    finally:
        if feetech:  # unlocked, its id and limits could be changed by a bad packet
            registers.tell(servo, "lock", 1)
    if feetech and registers.get(servo, "lock") != 1:
        write_surely(registers, servo, "lock", 1, TRIES)


def _wanted(registers: Registers, servo: int) -> dict[str, int]:
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


def _locked(registers: Registers, servo: int, name: str, old: int, new: int) -> ServoRefused:
    return ServoRefused(
        f"servo {registers.label(servo)} holds with torque, and {_vendor(registers, servo, name)} must change "
        f"from {old} to {new}",
        hint='support the head, then start with takeover="release"',
        port=registers.port.link.path,
        servo_ids=(servo,),
    )


def _vendor(registers: Registers, servo: int, name: str) -> str:
    item = registers.item(servo, name)
    return name if item is None else item.name


def write_surely(registers: Registers, servo: int, name: str, value: int, tries: int) -> None:
    """Write until it reads back, without relying on acknowledgements, which a servo may have been told not to send.

    Raises
    ------
    ServoRefused : it keeps another value. NoReply, CorruptReply
    """
    for _ in range(tries):
        registers.tell(servo, name, value)
        if registers.get(servo, name, tries) == value:  # it is deaf for a while after a permanent write
            return
    what = f"{_vendor(registers, servo, name)} = {value}"
    raise ServoRefused(
        f"servo {registers.label(servo)} did not take {what}",
        hint="switch its power off and on: a locked servo opens only then",
        port=registers.port.link.path,
        servo_ids=(servo,),
    )


def note(registers: Registers, servo: int, name: str, old: int, new: int, started: Started) -> None:
    """Tell that a permanent register was written."""
    line = f"servo {registers.label(servo)}: {_vendor(registers, servo, name)} {old} -> {new}"
    started.eeprom.append(line)
    log.info("permanent setting written: %s", line)
