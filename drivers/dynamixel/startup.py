"""Bringing servos with Protocol 2.0 up without a movement: what start-up has of its own here.

They can be rebooted, latch hardware errors, and have a bus watchdog, which is armed before torque comes on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoRefused, merge_errors
from drivers.dynamixel.indirect import set_up
from drivers.dynamixel.registers import Registers
from drivers.servos import startup
from drivers.tables.tables import load_table, model_number

WATCHDOG_STEP_S = 0.02
INPUT_VOLTAGE = 0x01
REVERSE, TIME_PROFILE, TORQUE_BY_GOAL = 0x01, 0x04, 0x08
OUT_OF_TURN_TICKS = 64
BOOT_S = 1.0
EEPROM_TRIES = 10


@dataclass(frozen=True)
class Policy(startup.Policy):
    """What start-up may do.

    Attributes
    ----------
    watchdog_ms : a servo stops by itself when it hears nothing for so long; 0 switches that off.
    """

    watchdog_ms: int = 200

    @property
    def watchdog_steps(self) -> int:
        """The register's value, rounded up, at most 127."""
        return min(math.ceil(self.watchdog_ms / 1000.0 / WATCHDOG_STEP_S), 127)


class Startup(startup.Startup):
    """Start-up and stop; parameters as for :class:`~drivers.servos.startup.Startup`."""

    out_of_turn_hint = "clear its homing offset and turn count: switch its power off and on"
    not_on_hint = "switch their power off and on, or start with reboot_faulted=true"
    not_off_hint = "switch the servos' power off; their watchdog stops them when it is armed"

    registers: Registers
    policy: Policy

    def release(self, servo: int) -> None:
        """Switch one servo off and be sure of it."""
        self.registers.put(servo, "torque", 0)

    def slack(self, turn: int) -> float:
        """Steps that a position may lie outside of a turn."""
        return OUT_OF_TURN_TICKS

    def why_limp(self, ids: Sequence[int]) -> Mapping[int, str]:
        """Hardware errors of servos whose motor did not come on."""
        latched = self.registers.get_all(ids, "hardware")
        return {servo: f"hardware error 0x{latched.get(servo, 0):02X}" for servo in ids}

    def identify(self, servos: Sequence[ServoSpec]) -> None:
        """Ping every servo, compare its model and load its control table. Writes nothing.

        Raises
        ------
        NoReply, CorruptReply : some did not answer.
        WrongModel : one is not the configured model.
        """
        replies = self.registers.each([servo.id for servo in servos], self.registers.hello)
        wrong: dict[int, BusError] = {}
        for servo in servos:
            low, high, firmware = replies[servo.id].params
            number = low | high << 8
            if number == model_number(servo.model):
                self.registers.tables[servo.id] = load_table(number, firmware)
            else:
                wrong[servo.id] = self.wrong_model(servo, number)
        if wrong:
            raise merge_errors(wrong)

    def bring_up(self, servos: Sequence[ServoSpec], *, indirect: bool = False) -> startup.Started:
        """Start identified servos where they stand.

        Parameters
        ----------
        servos : who is on the wire.
        indirect : map registers side by side where the models have indirect addressing.

        Raises
        ------
        BusError : something is not as it must be; torque was switched off again where it had been switched on.
        """
        registers, ids = self.registers, [servo.id for servo in servos]
        registers.put_all(dict.fromkeys(ids, 2), "status_level")
        held = self.take_over(ids)
        self.wait_for_voltage(ids, registers.get_all(ids, "min_voltage"))
        rebooted = self._clear_faults(ids)
        for servo in ids:
            self._settings(servo, servo in held and servo not in rebooted)
        self.read_limits(ids)
        if indirect:
            self.started.mapped = set_up(registers, ids)
        self._prepare(servos)
        try:
            self.torque_on(ids)
        except BaseException:
            self.switch_off(ids)
            raise
        return self.started

    def _clear_faults(self, ids: Sequence[int]) -> list[int]:
        """Reboot servos with a latched error where that is allowed; input voltage alone is let pass."""
        registers = self.registers
        latched = registers.get_all(ids, "hardware")
        bad = {servo: bits for servo, bits in latched.items() if bits and not self._passable(servo, bits)}
        if not bad:
            return []
        if not self.policy.reboot_faulted:
            raise self.fault("latched", bad)
        for servo in bad:
            registers.packets.reboot(registers.port, servo)
        registers.port.sleep(BOOT_S / 4)
        patience = math.ceil(BOOT_S / registers.port.margin_s)
        registers.each(bad, lambda servo: registers.hello(servo, tries=patience))
        registers.put_all(dict.fromkeys(bad, 2), "status_level")  # all RAM is at its default again
        still = {servo: bits for servo, bits in registers.get_all(list(bad), "hardware").items() if bits}
        if still:
            raise self.fault("latched", still)
        return list(bad)

    def _passable(self, servo: int, bits: int) -> bool:
        """Input voltage alone, where it does not switch the motor off."""
        return bits == INPUT_VOLTAGE and not self.registers.get(servo, "shutdown") & INPUT_VOLTAGE

    def _settings(self, servo: int, held: bool) -> None:
        """Permanent registers this driver relies on: read, and written only where they differ."""
        registers, table = self.registers, self.registers.tables[servo]
        wanted: dict[str, int] = {"mode": 2 if table.model == "xl320" else 3}
        keep = {"drive_mode": ~(REVERSE | TIME_PROFILE | TORQUE_BY_GOAL)}
        if table.goal_torque:  # older firmware has no Startup Configuration and refuses to be asked
            keep["startup"] = ~1
        names = [name for name in ("mode", *keep) if registers.item(servo, name) is not None]
        present = {name: registers.get(servo, name) for name in names}
        wanted |= {name: present[name] & mask for name, mask in keep.items() if name in present}
        if not held:  # a delayed answer only costs time, so a servo that holds is left alone
            wanted["return_delay"] = 0
            present["return_delay"] = registers.get(servo, "return_delay")
        for name, value in wanted.items():
            if present[name] == value:
                continue
            if held:
                raise self.locked(servo, name, present[name], value)
            self._write_eeprom(servo, name, present[name], value)

    def _write_eeprom(self, servo: int, name: str, old: int, new: int) -> None:
        registers = self.registers
        registers.put(servo, "torque", 0)
        registers.put(servo, name, new, tries=EEPROM_TRIES)  # it is deaf for a while after
        if registers.get(servo, name, tries=EEPROM_TRIES) != new:
            message = f"servo {registers.label(servo)} did not keep {registers.called(servo, name)} = {new}"
            raise self.error(ServoRefused, message, "", servo)
        self.note(servo, name, old, new)

    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Speed and acceleration limits, and the bus watchdog: cleared, then armed, before torque."""
        for name, limit in (("speed_limit", "max_speed_rad_s"), ("accel_limit", "max_accel_rad_s2")):
            values = {}
            for servo in servos:
                item = self.registers.item(servo.id, name)
                if item is not None:  # 0 would mean no limit
                    steps = math.ceil(getattr(servo, limit) / item.scale)
                    values[servo.id] = min(max(steps, 1), 1023 if item.size == 2 else 32767)
            self.registers.set_all(values, name)
        self._arm_watchdog([servo.id for servo in servos])

    def _arm_watchdog(self, ids: Sequence[int]) -> None:
        """Clear a watchdog that may have tripped, and set its time."""
        ids = self.registers.having(ids, "watchdog")
        self.registers.put_all(dict.fromkeys(ids, 0), "watchdog")
        self.registers.set_all(dict.fromkeys(ids, self.policy.watchdog_steps), "watchdog")

    def disarm(self, ids: Sequence[int]) -> None:
        """Switch the watchdogs of servos that are off to off; not worth an error."""
        with suppress(NoReply, CorruptReply, ServoRefused):
            self.registers.set_all(dict.fromkeys(self.registers.having(ids, "watchdog"), 0), "watchdog")
