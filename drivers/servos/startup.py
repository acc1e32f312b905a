"""Start-up of servos without movement, and switching them off so that no reachable one keeps its torque.

Nothing is written before every servo has answered and is the configured model. Torque is switched on last, with each
goal at the position just read, and is read back. To stop, one packet switches all servos off; then each is switched
off and read back by itself, again later where it does not answer, so that a dead servo does not keep others on.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar, Generic

from drivers.base.bus import ServoSpec
from drivers.base.errors import (
    BusError,
    DriverError,
    NoReply,
    PortLost,
    ServoFault,
    ServoRefused,
    WrongModel,
    merge_errors,
)
from drivers.servos.exchange import R
from drivers.servos.layout import Block
from drivers.servos.registers import Registers
from drivers.tables.tables import ControlTable, load_table, model_name

log = logging.getLogger(__name__)

OFF_RETRIES = 5


@dataclass(frozen=True)
class Policy:
    """What start-up may do, in every family.

    takeover : servos whose torque is on already are kept holding (``"adopt"``), switched off first (``"release"``:
        what they carry may fall), or make start-up fail (``"refuse"``).
    reboot_faulted : reboot servos that had shut down for a hardware error; they have no torque meanwhile.
    min_voltage_v : wait until every servo has at least this supply; None takes each servo's own limit.
    voltage_wait_s : how long to wait for it.
    partly : where some servos do not come on, the others keep their torque.
    """

    takeover: str = "adopt"
    reboot_faulted: bool = False
    min_voltage_v: float | None = None
    voltage_wait_s: float = 30.0
    partly: bool = False

    def __post_init__(self) -> None:
        if self.takeover not in ("adopt", "release", "refuse"):
            raise ValueError(f'takeover: must be "adopt", "release" or "refuse", got {self.takeover!r}')


@dataclass
class Started:
    """What start-up found and did.

    ticks : present position by id, read after torque came on.
    limits : lowest and highest step by id that the servo's own registers allow.
    mapped : block that is read through pointers, by id.
    held : servos that held with torque before, and were not rebooted.
    eeprom : one line for every permanent register written.
    """

    ticks: dict[int, int] = field(default_factory=dict)
    limits: dict[int, tuple[int, int]] = field(default_factory=dict)
    mapped: dict[int, Block] = field(default_factory=dict)
    held: list[int] = field(default_factory=list)
    eeprom: list[str] = field(default_factory=list)


class Startup(ABC, Generic[R]):
    """The steps of start-up and stop; a protocol implements the hooks.

    started : what was found and done.
    left_on : servos that a failed start has switched on and that are not confirmed off.
    out_of_turn_hint, not_on_hint, not_off_hint : what a user can do where a position is not within one turn, or a
        motor does not switch on, or off.
    """

    out_of_turn_hint: ClassVar[str]
    not_on_hint: ClassVar[str]
    not_off_hint: ClassVar[str]

    def __init__(self, registers: Registers[R], policy: Policy) -> None:
        self.registers, self.policy = registers, policy
        self.started = Started()
        self.left_on: list[int] = []

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def _identity(self, reply: R, expected: ControlTable) -> tuple[int, int]:
        """Model number and firmware in a servo's reply to the greeting."""

    def _greet(self, servo: int) -> R:
        """A servo's reply to the greeting."""
        return self.registers.hello(servo)

    @abstractmethod
    def _release(self, servo: int) -> None:
        """Switch one servo off and verify it."""

    def _least_voltage(self, ids: Sequence[int]) -> Mapping[int, int]:
        """Least voltage that servos need by id, 0.1 V."""
        return self.registers.get_all(ids, "min_voltage")

    @abstractmethod
    def _clear_faults(self, ids: Sequence[int]) -> Sequence[int]:
        """Look at hardware errors; returns servos that were rebooted.

        Raises ServoFault where a servo has an error and the policy does not allow to reboot it.
        """

    @abstractmethod
    def _write_settings(self, servo: int, held: bool) -> None:
        """Permanent registers this driver depends on: read, and written only where they differ, with torque off."""

    @abstractmethod
    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Write the registers that must be right before torque comes on."""

    @abstractmethod
    def _slack(self, turn: int) -> float:
        """Steps that the position of a servo that holds may lie outside of a turn of so many."""

    def _first_steps(self, ids: Sequence[int]) -> Mapping[int, int]:
        """First step of the turn in which servos that are off count once they are on, by id; 0 where it is missing."""
        return {}

    @abstractmethod
    def _why_off(self, ids: Sequence[int]) -> Mapping[int, str]:
        """Why motors did not switch on, by id."""

    def _disarm(self, ids: Sequence[int]) -> None:
        """Switch off what watches servos whose motors are off."""

    # ------------------------------------------------------------------ up

    def identify(self, servos: Sequence[ServoSpec]) -> None:
        """Greet every servo, compare its model and load its control table.

        Raises WrongModel where one is not the configured model; NoReply or CorruptReply where some did not answer.
        """
        replies = self.registers.each([servo.id for servo in servos], self._greet)
        wrong: dict[int, BusError] = {}
        for servo in servos:
            expected = load_table(servo.model)
            number, firmware = self._identity(replies[servo.id], expected)
            if number == expected.number:
                self.registers.tables[servo.id] = load_table(expected.number, firmware)
                continue
            label = self.registers.label(servo.id)
            message = f"servo {label} is {model_name(number)}, configured is {servo.model}"
            hint = "correct the configuration, or the servo's id with `omote scan PORT`"
            wrong[servo.id] = self.registers.error(WrongModel, message, hint, servo.id)
        if wrong:
            raise merge_errors(wrong)

    def bring_up(self, servos: Sequence[ServoSpec]) -> Started:
        """Start identified servos where they are.

        Raises BusError where that is not safe. Torque was switched off again where this start had switched it on, with
        the policy ``partly`` only of the servos that the error names. Servos that held before go on holding, without a
        watchdog, or with the policy ``partly`` with it.
        """
        ids = [servo.id for servo in servos]
        held = self.take_over(ids)
        self.wait_for_voltage(ids)
        rebooted = self._clear_faults(ids)
        held = [servo for servo in held if servo not in rebooted]
        for servo in ids:
            self._write_settings(servo, servo in held)
        low, high = self.registers.get_all(ids, "min_ticks"), self.registers.get_all(ids, "max_ticks")
        self.started.limits = {servo: (low[servo], high[servo]) for servo in low}
        self.started.held = held
        try:
            self._prepare(servos)
            self._torque_on_or_back_out(ids, held)
        except BaseException:
            if not self.policy.partly:
                self._leave_holding(held)
            raise
        return self.started

    def _torque_on_or_back_out(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Switch torque on; after an error switch off again what was not on before."""
        self.left_on = [servo for servo in ids if servo not in held]
        try:
            self.torque_on(ids, held)
        except BaseException as error:
            self._back_out(self.left_on, error)
            self.left_on = []
            raise
        self.left_on = []

    def _leave_holding(self, held: Sequence[int]) -> None:
        """Leave servos on that held before a start that failed: nobody feeds their watchdogs now."""
        if held:
            with suppress(DriverError):  # the first error says more
                self._disarm(held)

    def _back_out(self, ids: Sequence[int], error: BaseException) -> None:
        """Switch off what was switched on before an error."""
        if not self.policy.partly or not isinstance(error, BusError):
            self.switch_off(ids)
            return
        named = error.servo_ids or ids
        with suppress(NoReply):  # the first error names them too
            self.switch_off([servo for servo in ids if servo in named])

    def take_over(self, ids: Sequence[int]) -> list[int]:
        """Servos whose torque is on and stays on. Raises ServoRefused: some hold, and that is not allowed."""
        held = [servo for servo, torque in self.registers.get_all(ids, "torque").items() if torque]
        if not held or self.policy.takeover == "adopt":
            return held
        if self.policy.takeover == "release":
            self.registers.each(held, self._release)
            return []
        message = f"servos hold with torque already: {', '.join(map(self.registers.label, held))}"
        hint = 'stop the program that drives them, or start with takeover="adopt" or "release"'
        raise self.registers.error(ServoRefused, message, hint, *held)

    def wait_for_voltage(self, ids: Sequence[int]) -> None:
        """Wait for the supply: switching torque on while it ramps up latches input-voltage errors.

        Raises ServoFault where it stays too low.
        """
        registers, least_v = self.registers, self.policy.min_voltage_v
        need = self._least_voltage(ids)
        if least_v is not None:
            need = dict.fromkeys(ids, round(least_v * 10))
        port = registers.port
        deadline = port.clock() + self.policy.voltage_wait_s
        while True:
            volts = {servo: self._tenths(servo, value) for servo, value in registers.get_all(ids, "voltage").items()}
            low = {servo: value for servo, value in volts.items() if value < need.get(servo, 0)}
            if not low:
                return
            if port.clock() > deadline:
                break
            port.sleep(0.1)
        worst = min(low, key=lambda servo: low[servo] - need[servo])
        message = (
            f"{len(low)} servos have too little supply voltage: {registers.label(worst)} reads "
            f"{low[worst] / 10:.1f} V, needs {need[worst] / 10:.1f} V"
        )
        raise self.registers.error(ServoFault, message, "check the power supply and its cable", *sorted(low))

    def _tenths(self, servo: int, value: int) -> float:
        """A supply that was read, in 0.1 V."""
        item = self.registers.item(servo, "voltage")
        return value if item is None else 10.0 * item.scale * value

    def fault(self, what: str, bad: Mapping[int, int]) -> BusError:
        """The error of servos with a hardware error; their bits by id."""
        label = self.registers.label
        which = ", ".join(f"{label(servo)} {self._error_text(servo, bits)}" for servo, bits in bad.items())
        hint = "support the head, then start with reboot_faulted=true, or switch the power off and on"
        return self.registers.error(ServoFault, f"servos {what} a hardware error: {which}", hint, *sorted(bad))

    def _error_text(self, servo: int, bits: int) -> str:
        return f"code {bits}" if self.registers.tables[servo].error_codes else f"0x{bits:02X}"

    def locked(self, servo: int, name: str, old: int, new: int) -> BusError:
        """The error of a permanent register that must change while the servo holds."""
        what = f"{self.registers.register_name(servo, name)} must change from {old} to {new}"
        message = f"servo {self.registers.label(servo)} holds with torque, and {what}"
        return self.registers.error(
            ServoRefused, message, 'support the head, then start with takeover="release"', servo
        )

    def note(self, servo: int, name: str, old: int, new: int) -> None:
        """Log that a permanent register was written."""
        line = f"servo {self.registers.label(servo)}: {self.registers.register_name(servo, name)} {old} -> {new}"
        self.started.eeprom.append(line)
        log.info("permanent setting written: %s", line)

    def torque_on(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Write goals at the present positions, right before torque; then switch torque on and read it back.

        ``held`` are the servos whose torque is on already. Raises ServoFault: a motor did not come on, or a position is
        not within one turn.
        """
        registers = self.registers
        registers.set_all(self.goals_at_present(ids, held), "goal")
        registers.put_all(dict.fromkeys(ids, 1), "torque")
        off = [servo for servo, torque in registers.get_all(ids, "torque").items() if torque != 1]
        if off:
            why = self._why_off(off)
            which = ", ".join(f"{registers.label(servo)} ({why[servo]})" for servo in off)
            raise self.registers.error(
                ServoFault, f"servos did not switch their motor on: {which}", self.not_on_hint, *off
            )
        self.started.ticks = registers.get_all(ids, "position")

    def goals_at_present(self, ids: Sequence[int], held: Sequence[int]) -> dict[int, int]:
        """The goal by id that keeps every servo where it is; ``held`` are those whose torque is on.

        Raises ServoFault: a position is not within one turn, so a goal there could spin the servo.
        """
        goals, far = {}, {}
        firsts = self._first_steps([servo for servo in ids if servo not in held])
        for servo, value in self.registers.get_all(ids, "position").items():
            table = self.registers.tables[servo]
            turn, begin = table.ticks_per_turn, table.first_step
            first, slack = (begin, self._slack(turn)) if servo in held else (begin + firsts.get(servo, 0), 0)
            if not first - slack <= value < first + turn + slack:
                far[servo] = self._out_of_turn(servo, value, turn)
            low, high = self.started.limits.get(servo, (begin, begin + turn - 1))
            goals[servo] = min(max(value, low), high)
        if far:
            raise merge_errors(far)
        return goals

    def _out_of_turn(self, servo: int, value: int, turn: int) -> BusError:
        message = f"servo {self.registers.label(servo)} reads position {value}, outside one turn of {turn} steps"
        return self.registers.error(ServoFault, message, self.out_of_turn_hint, servo)

    # ------------------------------------------------------------------ down

    def let_go(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Switch servos off as :meth:`switch_off`, and leave others on, without their watchdogs."""
        try:
            self.switch_off(ids)
        finally:
            self._leave_holding(held)

    def switch_off(self, ids: Sequence[int]) -> None:
        """Switch torque off for every servo that can be reached, each by itself.

        Raises PortLost, NoReply: after everything was tried; ``servo_ids`` are those not confirmed off.
        """
        registers = self.registers
        known = [servo for servo in ids if servo in registers.tables]
        open_ids, lost = list(known), None
        try:
            registers.put_all(dict.fromkeys(known, 0), "torque")
            for _ in range(1 + OFF_RETRIES):
                open_ids = [servo for servo in open_ids if not self._confirmed_off(servo)]
                if not open_ids:
                    break
            self._disarm([servo for servo in known if servo not in open_ids])
        except PortLost as error:
            lost = error
        if not open_ids:
            return
        which = ", ".join(map(registers.label, open_ids)) + (f" ({lost})" if lost else "")
        message = f"not confirmed off on {registers.port.port_name}: {which}"
        raise self.registers.error(
            NoReply if lost is None else PortLost, message, self.not_off_hint, *open_ids
        ) from lost

    def _confirmed_off(self, servo: int) -> bool:
        try:
            self.registers.put_unanswered(servo, "torque", 0)
            return self.registers.get(servo, "torque", tries=1) == 0
        except BusError:
            return False
