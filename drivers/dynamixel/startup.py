"""Start-up of servos with Protocol 2.0: reboot after hardware errors, permanent settings, limits, bus watchdog."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoFault, ServoRefused
from drivers.dynamixel.indirect import set_up_pointers
from drivers.dynamixel.registers import Registers
from drivers.packets.packet import Instruction, StatusPacket
from drivers.servos import startup
from drivers.tables.tables import ControlTable, Item

log = logging.getLogger(__name__)

WATCHDOG_STEP_S = 0.02
INPUT_VOLTAGE = 0x01
REVERSE, TIME_PROFILE, TORQUE_BY_GOAL = 0x01, 0x04, 0x08
OUT_OF_TURN_TICKS = 64
MAX_OFFSET = 1024
BOOT_S = 1.0
ERROR_CLEAR = b"\x02ERCL"
"""Parameters of the instruction Clear that clear an error (e-Manual, Y-series, Error Clear Packet)."""
TURNING_ON, RUNNING, TURNING_OFF = 4, 5, 6
"""Values of the register Controller State: the motor is being switched on, takes goals, is being switched off."""
NOT_OFF = (TURNING_ON, RUNNING, TURNING_OFF)
MAX_STATE_S = 3.0
"""Longest time to wait for a motor that opens or closes its brake, or stops before it is off."""
EEPROM_TRIES = 10


@dataclass(frozen=True)
class Policy(startup.Policy):
    """What start-up may do.

    watchdog_ms : bus watchdog, after which a servo that receives nothing stops; 0 switches the watchdog off.
    """

    watchdog_ms: int = 200

    @property
    def watchdog_steps(self) -> int:
        """Value of the register Bus Watchdog, in steps of 20 ms, rounded up, at most 127."""
        return min(math.ceil(self.watchdog_ms / 1000.0 / WATCHDOG_STEP_S), 127)


class Startup(startup.Startup[StatusPacket]):
    """Start-up and stop sequence; `indirect` sets indirect addresses where the models have them."""

    out_of_turn_hint = (
        "turn it back by hand; if that does not help, clear its homing offset, and switch its power off and on, which "
        "clears its turn count"
    )
    not_on_hint = "switch their power off and on, or start with reboot_faulted=true"
    not_off_hint = "switch the servos' power off; their watchdog stops them when it is armed"

    registers: Registers
    policy: Policy

    def __init__(self, registers: Registers, policy: Policy, indirect: bool) -> None:
        super().__init__(registers, policy)
        self._indirect = indirect

    def _identity(self, reply: StatusPacket, expected: ControlTable) -> tuple[int, int]:
        return reply.params[0] | reply.params[1] << 8, reply.params[2]

    def _release(self, servo: int) -> None:
        """Disable the torque of one servo, and wait until it has stopped and closed its brake."""
        self.registers.put(servo, "torque", 0)
        if self._await_state([servo], NOT_OFF.__contains__):
            message = (
                f"servo {self.registers.label(servo)} is not off {MAX_STATE_S:g} s after its torque was switched off"
            )
            raise self.registers.error(ServoFault, message, "look at its Controller State and Brake Delay", servo)

    def _slack(self, turn: int) -> float:
        return OUT_OF_TURN_TICKS

    def _first_steps(self, ids: Sequence[int]) -> Mapping[int, int]:
        """First step of the turn of each servo: its homing offset.

        With torque, a servo counts within the turn that begins there, however far it was turned before. So a servo that
        was turned to -30 without torque is at 4066 with it, and a goal at 0 would make it turn nearly once around.
        Source: e-Manual, Present Position (132). Offsets beyond `MAX_OFFSET` have no effect in position mode.
        """
        resetting = [
            servo for servo in ids if not self.registers.tables[servo].error_codes
        ]  # Y-series keep their turns
        offsets = self.registers.get_all(resetting, "offset")
        return {servo: offset for servo, offset in offsets.items() if abs(offset) <= MAX_OFFSET}

    def torque_on(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Enable torque, and wait for servos with a brake, which take goals only once it is open.

        Raises ServoFault: one does not run, or a motor did not come on.
        """
        super().torque_on(ids, held)
        waiting = self._await_state(ids, lambda state: state != RUNNING)
        if waiting:
            which = ", ".join(map(self.registers.label, waiting))
            hint = "look at its Controller State, Brake Delay and Goal Update Delay"
            message = f"servos do not run {MAX_STATE_S:g} s after torque: {which}"
            raise self.registers.error(ServoFault, message, hint, *waiting)
        self.started.ticks |= self.registers.get_all(self.registers.having(ids, "state"), "position")

    def _confirm_off(self, servo: int) -> bool:
        """Disable torque; return whether the servo is off, has stopped and has closed its brake."""
        registers = self.registers
        if not registers.having([servo], "state"):
            return super()._confirm_off(servo)
        try:
            self._await_state([servo], lambda state: state in (TURNING_ON, TURNING_OFF))
            if registers.get(servo, "torque", tries=1):
                registers.put(servo, "torque", 0, tries=1)
            stopped = not self._await_state([servo], NOT_OFF.__contains__)
            return stopped and registers.get(servo, "torque", tries=1) == 0
        except BusError:
            return False

    def _await_state(self, ids: Sequence[int], is_wrong: Callable[[int], bool]) -> list[int]:
        """Wait at most `MAX_STATE_S` until no Controller State is wrong; return the servos where it still is.

        Servos without that register are ignored.
        """
        registers = self.registers
        waiting, end_s = registers.having(ids, "state"), registers.port.clock() + MAX_STATE_S
        while waiting := [servo for servo, state in registers.get_all(waiting, "state").items() if is_wrong(state)]:
            if registers.port.clock() >= end_s:
                break
            registers.port.sleep(0.02)
        return waiting

    def _why_off(self, ids: Sequence[int]) -> Mapping[int, str]:
        latched = self.registers.get_all(ids, "hardware")
        return {servo: f"hardware error 0x{latched.get(servo, 0):02X}" for servo in ids}

    def bring_up(self, servos: Sequence[ServoSpec]) -> startup.Started:
        """Make identified servos answer writes, then start them at their present positions."""
        self._await_state([servo.id for servo in servos], lambda state: state in (TURNING_ON, TURNING_OFF))
        self.registers.put_all(dict.fromkeys([servo.id for servo in servos], 2), "status_level")
        return super().bring_up(servos)

    def _clear_faults(self, ids: Sequence[int]) -> list[int]:
        """Clear errors where that is allowed; return servos that were rebooted."""
        coded = [servo for servo in ids if self.registers.tables[servo].error_codes]
        self._clear_codes(coded)
        return self._reboot_faulted([servo for servo in ids if servo not in coded])

    def _clear_codes(self, ids: Sequence[int]) -> None:
        """Clear errors of Y-series servos with the instruction Clear, where that is allowed; none is rebooted.

        A tripped watchdog is cleared later through its register. A battery warning is only logged. An error of the
        supply voltage may always be cleared: the motor is off already, and the supply was found good.
        """
        registers = self.registers
        bad: dict[int, int] = {}
        refused: dict[int, int] = {}
        for servo, code in registers.get_all(ids, "hardware").items():
            table = registers.tables[servo]
            codes = table.error_codes
            if code in (0, codes["watchdog"]):
                continue
            if code == codes["battery"]:
                log.warning("servo %s: the battery that keeps its turns is low", registers.label(servo))
                continue
            of_supply = code in (codes["voltage"], codes["over_voltage"])
            allowed = code in table.clearable_codes and (of_supply or self.policy.reboot_faulted)
            (bad if allowed else refused)[servo] = code
        if refused:
            raise self.fault("latched", refused)
        for servo in bad:
            registers.packets.ask(registers.port, servo, Instruction.CLEAR, ERROR_CLEAR, 0)
        still = {servo: code for servo, code in registers.get_all(list(bad), "hardware").items() if code}
        if still:
            raise self.fault("latched", still)

    def _reboot_faulted(self, ids: Sequence[int]) -> list[int]:
        """Reboot servos with a latched error where that is allowed; return them.

        An input-voltage error alone is ignored where it does not switch the motor off. Where it does, the servo is
        always rebooted: its motor is off already, and the supply was found good.
        """
        registers = self.registers
        latched = registers.get_all(ids, "hardware")
        bad = {
            servo: bits
            for servo, bits in latched.items()
            if bits and (bits != INPUT_VOLTAGE or registers.get(servo, "shutdown") & INPUT_VOLTAGE)
        }
        if not bad:
            return []
        worse = {servo: bits for servo, bits in bad.items() if bits != INPUT_VOLTAGE}
        if worse and not self.policy.reboot_faulted:
            raise self.fault("latched", worse)
        for servo in bad:
            registers.packets.reboot(registers.port, servo)
        registers.port.sleep(BOOT_S / 4)
        registers.each(bad, self._await_boot)
        registers.put_all(dict.fromkeys(bad, 2), "status_level")  # all RAM is at its default again
        still = {servo: bits for servo, bits in registers.get_all(list(bad), "hardware").items() if bits}
        if still:
            raise self.fault("latched", still)
        return list(bad)

    def _await_boot(self, servo: int) -> StatusPacket:
        """Greet a rebooted servo until it answers; raises as :meth:`Registers.hello` where it does not in time."""
        port = self.registers.port
        end_s = port.clock() + BOOT_S
        while True:
            try:
                return self.registers.hello(servo)
            except (NoReply, CorruptReply):
                if port.clock() >= end_s:
                    raise

    def _write_settings(self, servo: int, held: bool) -> None:
        """Read operating mode, drive mode, startup configuration and return delay, and write those that differ.

        ``held`` : its torque is on, so nothing may be written; raises ServoRefused where a value differs.
        """
        registers, table = self.registers, self.registers.tables[servo]
        self._check_gear(servo)
        wanted: dict[str, int] = {"mode": 2 if table.model == "xl320" else 3}
        keep = {"drive_mode": ~(REVERSE | TIME_PROFILE | TORQUE_BY_GOAL)}
        if table.goal_torque or table.error_codes:  # older firmware has no Startup Configuration and refuses to read it
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

    def _check_gear(self, servo: int) -> None:
        """Raise ServoRefused for a Y-series servo whose electronic gear is not the default, which scales its steps."""
        registers = self.registers
        for name in ("gear_numerator", "gear_denominator"):
            item = registers.item(servo, name)
            if item is None or (value := registers.get(servo, name)) == item.initial:
                continue
            message = f"servo {registers.label(servo)} has {item.name} {value}, and its angles need {item.initial}"
            raise registers.error(ServoRefused, message, f"write {item.initial} to it, with torque off", servo)

    def _write_eeprom(self, servo: int, name: str, old: int, new: int) -> None:
        registers = self.registers
        registers.put(servo, "torque", 0)
        registers.put(servo, name, new, tries=EEPROM_TRIES)  # it does not answer for a while after
        if registers.get(servo, name, tries=EEPROM_TRIES) != new:
            message = f"servo {registers.label(servo)} did not keep {registers.register_name(servo, name)} = {new}"
            raise self.registers.error(ServoRefused, message, "", servo)
        self.note(servo, name, old, new)

    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Write indirect addresses and the limits of speed and acceleration; clear the bus watchdog, then arm it."""
        ids = [servo.id for servo in servos]
        if self._indirect:
            self.started.mapped = set_up_pointers(self.registers, ids)
        for name, limit in (("speed_limit", "max_speed_rad_s"), ("accel_limit", "max_accel_rad_s2")):
            values = {}
            for servo in servos:
                item = self.registers.item(servo.id, name)
                if item is not None:  # 0 would mean no limit
                    steps = math.ceil(getattr(servo, limit) / item.scale)
                    values[servo.id] = min(max(steps, 1), _max_profile_value(self.registers.tables[servo.id], item))
            self.registers.set_all(values, name)
        watched = self.registers.having(ids, "watchdog")
        self.registers.put_all(dict.fromkeys(watched, 0), "watchdog")
        self.registers.set_all(dict.fromkeys(watched, self.policy.watchdog_steps), "watchdog")

    def _disarm(self, ids: Sequence[int]) -> None:
        """Switch the watchdogs of servos off; a failure is ignored."""
        with suppress(NoReply, CorruptReply, ServoRefused):
            self.registers.set_all(dict.fromkeys(self.registers.having(ids, "watchdog"), 0), "watchdog")


def _max_profile_value(table: ControlTable, item: Item) -> int:
    """The largest value of a profile register; P-series bound it by the register that holds the limit."""
    if item.upper is not None:
        return table[item.upper].initial
    return 1023 if item.size == 2 else 32767
