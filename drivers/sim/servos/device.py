"""Instructions of one simulated servo: read, write, registered write, reboot, factory reset, clear.

Behaviour follows the ROBOTIS e-Manual (Protocol 2.0 and control tables); where firmware differs or was not
verified, the method's docstring names the choice.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from drivers.packets.packet import ErrorNumber
from drivers.sim.servos.drive import Sensing
from drivers.sim.servos.drive_x import CURRENT_POSITION, EXTENDED, GOAL_TORQUE
from drivers.sim.servos.registers import GOALS, Change
from drivers.sim.servos.state import INVERTER_OFF, RUNNING, TURNING_OFF, TURNING_ON, ServoState
from drivers.tables.tables import Item

CLEAR_MULTI_TURN = b"\x01\x44\x58\x4c\x22"
CLEAR_ERROR = b"\x02\x45\x52\x43\x4c"
"""Y-series."""
CALIBRATE = 128
"""Feetech: written to Torque Enable it sets the middle of the turn."""


class SimulatedServo(ServoState):
    """A servo that carries out instructions.

    device_id, model, settings : see :class:`~drivers.sim.servos.state.ServoState`.
    """

    def __init__(self, device_id: int, model: str | int = "xl330-m288", **settings: Any) -> None:
        super().__init__(device_id, model, **settings)
        self._effects = self._effects_by_name()
        self._sensing: dict[tuple[int, int], Sensing] = {}
        self.registers.on_remap = self._sensing.clear

    def force(self, name: str, value: int, now_s: float) -> None:
        """Set a register whatever its access, range and lock, with all effects of a write."""
        item = self.table[name]
        self._store(item, value, now_s)
        self.keep_permanent(item.address, min(item.end, self.table.eeprom_end))
        self._sensed_at = None

    # ------------------------------------------------------------ instructions
    def read(self, address: int, length: int, now_s: float) -> tuple[int, bytes]:
        """(error byte, data). A range that leaves the table gives Access (7) and no data."""
        registers = self.registers
        if not registers.readable(address, length):
            return self.alert | ErrorNumber.ACCESS, b""
        self.settle(now_s)
        if now_s != self._sensed_at:
            self._sense_for(address, length, now_s)
        return self.alert, registers.read(address, length)

    def _sense_for(self, address: int, length: int, now_s: float) -> None:
        """Bring the registers that a read shows up to date; what these need is worked out once."""
        sensing = self._sensing.get((address, length))
        if sensing is None:
            sensing = self.drive.sensing(self.registers.reached(address, length))
            self._sensing[address, length] = sensing
        if sensing is Sensing.ALL:
            self._sense(now_s)
        elif sensing is Sensing.QUICK:
            self.drive.sense_quickly(now_s)

    def write(self, address: int, data: bytes, now_s: float) -> int:
        """Carry out a write and return the error byte; nothing is changed unless all of it is allowed."""
        changes = self.registers.parse(address, data)
        if isinstance(changes, ErrorNumber):
            self.on_refusal(address, data, changes, now_s)
            return self.alert | changes
        if self.table.error_codes and self._cannot_now(changes, now_s):
            self.on_refusal(address, data, ErrorNumber.RESULT_FAIL, now_s)
            return self.alert | ErrorNumber.RESULT_FAIL
        self._apply(changes, now_s)
        return self.alert

    def _cannot_now(self, changes: list[Change], now_s: float) -> bool:
        """Y-series: goals and torque while the motor is switched on or off, and torque on with an error."""
        self.settle(now_s)
        busy = self.registers.get("Controller State") in (TURNING_ON, TURNING_OFF)
        return any(
            (busy and item.name in GOALS | {"Torque Enable"})
            or (self.shut_down and item.name == "Torque Enable" and value)
            for item, value in changes
        )

    def reg_write(self, address: int, data: bytes) -> int:
        """Store an allowed write for `action`; return the error byte."""
        changes = self.registers.parse(address, data)
        if isinstance(changes, ErrorNumber):
            self.on_refusal(address, data, changes, self.last_instruction.at_s)
            return self.alert | changes
        self._pending = changes
        self.registers.put("Registered Instruction", 1)
        return self.alert

    def action(self, now_s: float) -> int:
        """Carry out the registered write; return the error byte, Instruction (2) where there is none."""
        if not self.registers.get("Registered Instruction"):
            return self.alert | ErrorNumber.INSTRUCTION
        changes, self._pending = self._pending, []
        self.registers.put("Registered Instruction", 0)
        self._apply(changes, now_s)
        return self.alert

    def factory_reset(self, option: int, now_s: float) -> int:
        """Reset registers and return the error byte: 0xFF resets all, 1 keeps the id, 2 keeps id and baud rate."""
        kept = {0xFF: (), 0x01: ("ID",), 0x02: ("ID", "Baud Rate")}.get(option)
        if kept is None:
            return self.alert | ErrorNumber.DATA_RANGE
        values = {name: self.registers.get(name) for name in kept}
        self.registers.reset(0, self.table.eeprom_end)
        for name, value in values.items():
            self.registers.put(name, value)
        self.drive.configure()
        self.keep_permanent(0, self.table.eeprom_end)
        self.reboot(now_s)
        return 0

    def clear(self, params: bytes, now_s: float) -> int:
        """Error byte. Multi-turn clear: Present Position back into one turn, only at rest, else Result Fail."""
        if self.table.error_codes and params == CLEAR_ERROR:
            return self._clear_error(now_s)
        if params != CLEAR_MULTI_TURN:
            return self.alert | ErrorNumber.DATA_RANGE
        if self.plant.motion(now_s).velocity:
            return self.alert | ErrorNumber.RESULT_FAIL
        self._wrap_turns(now_s)
        return self.alert

    def _clear_error(self, now_s: float) -> int:
        """Error byte. Y-series: ends an error that can be cleared and whose cause has gone, else Result Fail."""
        code = self.hardware_error
        if code and (code not in self.table.clearable_codes or self.drive.hardware_errors(now_s, 0.0) == code):
            return self.alert | ErrorNumber.RESULT_FAIL
        self.hardware_error = 0
        self.shut_down = self.registers.goals_locked = False
        self.registers.put("Bus Watchdog", max(self.registers.get("Bus Watchdog"), 0))
        self.registers.put("Controller State", RUNNING if self.plant.powered else INVERTER_OFF)
        return self.alert

    # ------------------------------------------------------------ effects of writes
    def _effects_by_name(self) -> dict[str, Callable[[int, float], None]]:
        """Effects of writing a register beyond changing it, by register name."""
        effects: dict[str, Callable[[int, float], None]] = {
            "Torque Enable": self._write_torque,
            "Bus Watchdog": self._write_watchdog,
            "Operating Mode": self._write_mode,
        }
        for name in GOALS | {"Moving Speed", "Goal Time"}:
            effects[name] = partial(self._write_goal, name)
        if self.table.lock == "Lock":
            effects["Lock"] = self._write_lock
        effects |= dict.fromkeys(("ID", "Secondary(Shadow) ID", "Baud Rate"), lambda value, now_s: self.on_change())
        for name in self.table:
            if name.startswith("Indirect Address"):
                effects[name] = lambda value, now_s: self.registers.remap()
        return effects

    def _apply(self, changes: list[Change], now_s: float) -> None:
        self.on_write(changes, now_s)
        for item, value in changes:
            self._store(item, value, now_s)
        self._sensed_at = None

    def _store(self, item: Item, value: int, now_s: float) -> None:
        if item.name == "Torque Enable" and value and self.shut_down and not self._recover():
            return
        self.registers.store(item, value)
        if self.table.is_permanent(item.address):
            self._store_permanent(item, now_s)
        effect = self._effects.get(item.name)
        if effect is not None:
            effect(value, now_s)

    def _store_permanent(self, item: Item, now_s: float) -> None:
        """Count the write of a permanent register, begin its busy time, and apply what the register changes."""
        self.drive.configure()
        if self.keeps_writes:
            self.eeprom_writes[item.name] += 1
            self.deaf_until = max(self.deaf_until, now_s + self.eeprom_busy_s)
            self.keep_permanent(item.address, item.end)

    def _recover(self) -> bool:
        """Whether writing Torque Enable ends a shutdown; with Protocol 2.0 only a reboot does."""
        if self.table.protocol == 2:
            return False
        self.shut_down, self.hardware_error = False, 0
        if "Torque Limit" in self.table:
            self.registers.put("Torque Limit", self.table["Torque Limit"].initial)
        return True

    def _write_lock(self, value: int, now_s: float) -> None:
        """AX and MX: closes the permanent registers until the supply was off. Feetech: see `keeps_writes`."""
        closed = bool(value) or self.registers.locked
        self.registers.locked = closed and not self.is_feetech
        self.registers.put("Lock", int(closed))

    def _write_torque(self, value: int, now_s: float) -> None:
        if value == CALIBRATE:
            self._calibrate(now_s)
        elif bool(value) != self.plant.powered:
            keeps_turns = self.is_feetech or self.registers.extended or self.table.error_codes
            if value and "Homing Offset" in self.table and not keeps_turns:
                self._wrap_position(now_s)  # e-Manual, Present Position (132); the goal stays as it is
            self._set_power(bool(value), now_s)

    def _calibrate(self, now_s: float) -> None:
        """Feetech: the shaft's present position becomes the middle of the turn; torque stays as it was."""
        registers = self.registers
        shaft = round(self.plant.motion(now_s).position)
        registers.put("Homing Offset", shaft - self.table.center)
        offset = self.table["Homing Offset"]
        self.keep_permanent(offset.address, offset.end)
        registers.put("Torque Enable", int(self.plant.powered))
        self.drive.configure()

    def _write_goal(self, name: str, value: int, now_s: float) -> None:
        """A goal of the present mode moves a powered motor; with Drive Mode bit 3 any goal switches it on."""
        if self.plant.powered:
            if name in self.drive.goals:
                self.drive.plan(now_s)
        elif self.table.goal_torque and self.registers.get("Drive Mode") & GOAL_TORQUE and not self.shut_down:
            self.registers.put("Torque Enable", 1)
            self._set_power(True, now_s)

    def _write_watchdog(self, value: int, now_s: float) -> None:
        """0 clears a tripped watchdog. (A period written while tripped re-arms it as well.)"""
        self.registers.goals_locked = False
        if self.table.error_codes and self.hardware_error == self.table.error_codes["watchdog"]:
            self.hardware_error = 0

    def _write_mode(self, value: int, now_s: float) -> None:
        """Goals are reset to those of a servo at rest; Present Position back into one turn."""
        self.registers.extended = self.table.protocol == 2 and value in (EXTENDED, CURRENT_POSITION)
        if not self.table.error_codes:
            self._wrap_turns(now_s)
        self._reset_goals(now_s)
