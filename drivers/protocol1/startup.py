"""Start-up of servos with Protocol 1.0 framing: identification, permanent settings, limits, and shutdown errors.

These servos have no bus watchdog: only this program (or the power switch) ever switches them off.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drivers.base.bus import ServoSpec
from drivers.base.errors import NoReply, ServoRefused
from drivers.packets.packet1 import Error1, Packet1
from drivers.protocol1.registers import Registers
from drivers.servos import startup
from drivers.servos.registers import MAX_TRIES
from drivers.tables.tables import ControlTable, known_models

EEPROM_TRIES = 10
MULTI_TURN = 0x10
"""Bit of Feetech's register Phase: positions count over several turns."""
OUT_OF_TURN_FRACTION = 1 / 64
"""How far a position may lie outside its turn, as a fraction of the turn."""
RELAPSE_S = 0.25
"""Time within which a servo that had shut down shuts down again if the cause persists."""


@dataclass(frozen=True)
class Policy(startup.Policy):
    """What start-up may do.

    torque_limit : fraction of the stall torque, above 0, at most 1; None leaves the register as it is.
    """

    torque_limit: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.torque_limit is not None and not 0.0 < self.torque_limit <= 1.0:
            raise ValueError(f"torque_limit: must be above 0, up to 1, got {self.torque_limit}")


def identity(reply: Packet1, tables: Iterable[ControlTable]) -> tuple[int, int]:
    """Decode (model number, firmware) of a servo from ``reply``, which holds its first registers.

    Families keep them at different addresses and in different byte orders. The first of ``tables`` that decodes the
    number of a known model decides, or the first table if none does.
    """
    readings = []
    for table in tables:
        number, version = table["Model Number"], table["Firmware Version"]
        readings.append((number.decode(reply.params[number.address :]), reply.params[version.address]))
    return next((reading for reading in readings if reading[0] in known_models()), readings[0])


def speed_steps(servo: ServoSpec, registers: Registers) -> int:
    """Convert a servo's top speed to steps of its speed register; never 0, which would mean no limit."""
    table, item = registers.tables[servo.id], registers.item(servo.id, "speed")
    scale, top = (item.scale, 1023 if item.name == "Moving Speed" else table.top_speed) if item else (1.0, 1)
    return min(max(math.ceil(servo.max_speed_rad_s / scale), 1), top)


class Startup(startup.Startup[Packet1]):
    """Start-up and stop sequence; parameters as for :class:`~drivers.servos.startup.Startup`."""

    out_of_turn_hint = (
        "turn it back by hand; where that does not help, clear its offset and switch its power off and on"
    )
    not_on_hint = "switch their power off and on"
    not_off_hint = "switch the servos' power off: they have no watchdog that would"

    registers: Registers
    policy: Policy

    def _identity(self, reply: Packet1, expected: ControlTable) -> tuple[int, int]:
        return identity(reply, [expected])

    def _greet(self, servo: int) -> Packet1:
        """Read a servo's first registers; a servo that answers only pings is set to answer everything first."""
        registers = self.registers
        try:
            return registers.hello(servo)
        except NoReply:
            quiet = "Status Return Level" in registers.tables[servo]
            if not quiet or not registers.packets.pings(registers.port, servo):
                raise
        registers.put_unanswered(servo, "status_level", 2)
        reply = registers.hello(servo, tries=EEPROM_TRIES)
        self.note(servo, "status_level", 0, 2)
        return reply

    def _release(self, servo: int) -> None:
        self._write_until_kept(servo, "torque", 0, MAX_TRIES)

    def _slack(self, turn: int) -> float:
        return OUT_OF_TURN_FRACTION * turn

    def _why_off(self, ids: Sequence[int]) -> Mapping[int, str]:
        return {servo: f"error flags 0x{self.registers.flags.get(servo, 0):02X}" for servo in ids}

    def _least_voltage(self, ids: Sequence[int]) -> Mapping[int, int]:
        """Read the least supply voltage that servos need, in 0.1 V, by id; empty where the policy gives it."""
        return super()._least_voltage(ids) if self.policy.min_voltage_v is None else {}

    def _clear_faults(self, ids: Sequence[int]) -> Sequence[int]:
        """Raise ServoFault for hardware errors that the policy does not let `torque_on` clear; reboots nothing."""
        self._faulted = self._faults(ids)
        if self._faulted and not self.policy.reboot_faulted:
            raise self.fault("report", self._faulted)
        return ()

    def torque_on(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Enable torque, and check whether servos that had shut down stay on."""
        super().torque_on(ids, held)
        if self._faulted:
            self.registers.port.sleep(RELAPSE_S)  # a cause that persists shuts it down again
            self.registers.get_all(ids, "voltage")
        if faulted := self._faults(ids):
            raise self.fault("report", faulted)

    def _faults(self, ids: Sequence[int]) -> dict[int, int]:
        """Hardware error bits of the last replies, by id; an input-voltage error that leaves torque on is ignored."""
        registers, bad = self.registers, {}
        for servo in ids:
            bits = registers.causes(servo, registers.flags.get(servo, 0))
            if bits and (bits != Error1.INPUT_VOLTAGE or registers.get(servo, "shutdown") & bits):
                bad[servo] = bits
        return bad

    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Write the limits of speed, acceleration and torque."""
        registers, ids = self.registers, [servo.id for servo in servos]
        registers.set_all({servo.id: speed_steps(servo, registers) for servo in servos}, "speed")
        registers.set_all(dict.fromkeys(registers.having(ids, "time"), 0), "time")
        accelerations = {}
        for servo in servos:
            item = registers.item(servo.id, "accel")
            if item is not None:
                steps = max(math.ceil(servo.max_accel_rad_s2 / item.scale), 1)
                accelerations[servo.id] = steps if steps <= (item.maximum or 0) else 0  # 0: unlimited
        registers.set_all(accelerations, "accel")
        registers.set_all(self._torque_limits(ids), "torque_limit")

    def _torque_limits(self, ids: Sequence[int]) -> dict[int, int]:
        """Torque limits to write, by id; a servo that shut down has the limit 0 and gets its full torque again."""
        registers, fraction = self.registers, self.policy.torque_limit
        limits = registers.get_all(registers.having(ids, "torque_limit"), "torque_limit")
        for servo, value in limits.items():
            item = registers.item(servo, "torque_limit")
            full = (item.maximum if item else None) or 0
            limits[servo] = (value or full) if fraction is None else max(round(fraction * full), 1)
        return limits

    # ------------------------------------------------------------------ permanent registers

    def _write_settings(self, servo: int, held: bool) -> None:
        """Read the permanent registers that this driver depends on, and write those that differ, with torque off."""
        registers = self.registers
        wanted = self._wanted(servo)
        if not held:  # a delayed reply only costs time, so a servo that holds is left alone
            wanted["return_delay"] = 0
        present = {name: registers.get(servo, name) for name in wanted}
        differing = {name: value for name, value in wanted.items() if present[name] != value}
        feetech = "Response Level" in registers.tables[servo]
        if differing:
            name, value = next(iter(differing.items()))
            if held:
                raise self.locked(servo, name, present[name], value)
            self._write_until_kept(servo, "torque", 0, MAX_TRIES)
        try:
            for name, value in differing.items():
                if feetech:
                    self._write_until_kept(servo, "lock", 0, MAX_TRIES)
                self._write_until_kept(servo, name, value, EEPROM_TRIES)
                self.note(servo, name, present[name], value)
        finally:
            if feetech:  # a damaged packet could change the id and limits of an unlocked servo
                registers.put_unanswered(servo, "lock", 1)
        if feetech and registers.get(servo, "lock") != 1:
            self._write_until_kept(servo, "lock", 1, MAX_TRIES)

    def _wanted(self, servo: int) -> dict[str, int]:
        """Values that permanent registers must have, by short name."""
        registers, table = self.registers, self.registers.tables[servo]
        last = table.ticks_per_turn - 1
        feetech = "Response Level" in table
        wanted = {"status_level": 1 if feetech else 2}
        low, high = registers.get(servo, "min_ticks"), registers.get(servo, "max_ticks")
        if low == high == 0:
            wanted["max_ticks"] = last  # both limits 0 mean wheel mode, which turns without end
        elif low == high == last:
            wanted["min_ticks"] = 0  # both limits at the end mean multi-turn mode of MX servos
        if registers.item(servo, "mode"):
            wanted["mode"] = 0
        if feetech and registers.get(servo, "phase") & MULTI_TURN and table.group_read:
            wanted["phase"] = registers.get(servo, "phase") & ~MULTI_TURN
        return wanted

    def _write_until_kept(self, servo: int, name: str, value: int, tries: int) -> None:
        """Write a register until it reads back, without relying on replies to writes, which a servo may not send.

        Raises ServoRefused where it keeps another value.
        """
        registers = self.registers
        for _ in range(tries):
            registers.put_unanswered(servo, name, value)
            if registers.get(servo, name, tries) == value:  # it does not answer for a while after a permanent write
                return
        message = f"servo {registers.label(servo)} did not take {registers.register_name(servo, name)} = {value}"
        hint = "switch its power off and on: a locked servo opens only then"
        raise registers.error(ServoRefused, message, hint, servo)
