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
from drivers.servos.registers import TRIES
from drivers.tables.tables import ControlTable, known_models

EEPROM_TRIES = 10
MULTI_TURN = 0x10
"""Feetech's Phase: present positions leave the turn."""
OUT_OF_TURN = 1 / 64
"""Share of a turn that a position may lie outside of it."""
RELAPSE_S = 0.25
"""Time in which a servo that had shut down shuts down again if the cause persists."""


@dataclass(frozen=True)
class Policy(startup.Policy):
    """What start-up may do. `torque_limit` is the share of the stall torque, above 0 to 1; None leaves it as it is."""

    torque_limit: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.torque_limit is not None and not 0.0 < self.torque_limit <= 1.0:
            raise ValueError(f"torque_limit: must be above 0, up to 1, got {self.torque_limit}")


def identity(reply: Packet1, tables: Iterable[ControlTable]) -> tuple[int, int]:
    """(model number, firmware) of a servo from its first registers, as the first of the tables that knows it reads it.

    Families keep them at different addresses and in different byte orders; where no table gives the number of a
    known model, the first table's reading counts.
    """
    readings = []
    for table in tables:
        number, version = table["Model Number"], table["Firmware Version"]
        readings.append((number.decode(reply.params[number.address :]), reply.params[version.address]))
    return next((reading for reading in readings if reading[0] in known_models()), readings[0])


def speed_steps(servo: ServoSpec, registers: Registers) -> int:
    """A servo's top speed in steps of its speed register; never 0, which would mean no limit."""
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
        """A servo's first registers; one that answers only pings is set to answer everything."""
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
        self._write_surely(servo, "torque", 0, TRIES)

    def _slack(self, turn: int) -> float:
        return OUT_OF_TURN * turn

    def _why_off(self, ids: Sequence[int]) -> Mapping[int, str]:
        return {servo: f"error flags 0x{self.registers.flags.get(servo, 0):02X}" for servo in ids}

    def _least_voltage(self, ids: Sequence[int]) -> Mapping[int, int]:
        """Least voltage that servos need by id, 0.1 V; not read where the policy has it."""
        return super()._least_voltage(ids) if self.policy.min_voltage_v is None else {}

    def _clear_faults(self, ids: Sequence[int]) -> Sequence[int]:
        """Check hardware errors; `torque_on` starts servos that shut down again, where the policy allows it."""
        self._faulted = self._faults(ids)
        if self._faulted and not self.policy.reboot_faulted:
            raise self.fault("report", self._faulted)
        return ()

    def torque_on(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Switch torque on, and see whether servos that had shut down stay on."""
        super().torque_on(ids, held)
        if self._faulted:
            self.registers.port.sleep(RELAPSE_S)  # a cause that persists shuts it down again
            self.registers.get_all(ids, "voltage")
        if faulted := self._faults(ids):
            raise self.fault("report", faulted)

    def _faults(self, ids: Sequence[int]) -> dict[int, int]:
        """Hardware errors in the last replies; input voltage alone is ignored where it switches nothing off."""
        registers, bad = self.registers, {}
        for servo in ids:
            bits = registers.causes(servo, registers.flags.get(servo, 0))
            if bits and (bits != Error1.INPUT_VOLTAGE or registers.get(servo, "shutdown") & bits):
                bad[servo] = bits
        return bad

    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Write limits of speed, acceleration and torque."""
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
        """Torque limits by id; a servo that shut down has 0 and gets all of its torque again."""
        registers, share = self.registers, self.policy.torque_limit
        limits = registers.get_all(registers.having(ids, "torque_limit"), "torque_limit")
        for servo, value in limits.items():
            item = registers.item(servo, "torque_limit")
            full = (item.maximum if item else None) or 0
            limits[servo] = (value or full) if share is None else max(round(share * full), 1)
        return limits

    # ------------------------------------------------------------------ permanent registers

    def _write_settings(self, servo: int, held: bool) -> None:
        """Permanent registers this driver depends on: read, and written only where they differ, with torque off."""
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
            self._write_surely(servo, "torque", 0, TRIES)
        try:
            for name, value in differing.items():
                if feetech:
                    self._write_surely(servo, "lock", 0, TRIES)
                self._write_surely(servo, name, value, EEPROM_TRIES)
                self.note(servo, name, present[name], value)
        finally:
            if feetech:  # unlocked, its id and limits could be changed by a bad packet
                registers.put_unanswered(servo, "lock", 1)
        if feetech and registers.get(servo, "lock") != 1:
            self._write_surely(servo, "lock", 1, TRIES)

    def _wanted(self, servo: int) -> dict[str, int]:
        """Values of permanent registers by short name."""
        registers, table = self.registers, self.registers.tables[servo]
        last = table.ticks_per_turn - 1
        feetech = "Response Level" in table
        wanted = {"status_level": 1 if feetech else 2}
        low, high = registers.get(servo, "min_ticks"), registers.get(servo, "max_ticks")
        if low == high == 0:
            wanted["max_ticks"] = last  # it would turn without end
        elif low == high == last:
            wanted["min_ticks"] = 0  # MX: several turns
        if registers.item(servo, "mode"):
            wanted["mode"] = 0
        if feetech and registers.get(servo, "phase") & MULTI_TURN and table.group_read:
            wanted["phase"] = registers.get(servo, "phase") & ~MULTI_TURN
        return wanted

    def _write_surely(self, servo: int, name: str, value: int, tries: int) -> None:
        """Write until it reads back, without depending on replies to writes, which a servo may not send.

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
