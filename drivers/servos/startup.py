"""Start-up of servos without movement, and switching them off so that no reachable one keeps its torque.

Nothing is written before every servo has answered and is the configured model. Torque is enabled last, with each goal
at the position just read, and is read back. To stop, one packet disables the torque of all servos; then that is
repeated and read back for each servo separately, again later where one does not answer, so that a dead servo keeps no
other on.
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

MAX_OFF_RETRIES = 5


@dataclass(frozen=True)
class Policy:
    """What start-up may do, in every family.

    takeover : servos whose torque is on already keep it (``"adopt"``), are switched off first (``"release"``: what they
        carry may fall), or make start-up fail (``"refuse"``).
    reboot_faulted : reboot servos that had shut down for a hardware error; they have no torque meanwhile.
    min_voltage_v : wait until every servo has at least this supply voltage; None takes each servo's own limit.
    voltage_wait_s : longest wait for the supply voltage.
    partly : if some servos fail to start, the others keep their torque.
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
    """Result of a start-up; all dictionaries are by servo id.

    ticks : position after torque came on.
    limits : lowest and highest step that the servo's own registers allow.
    mapped : block that is read through indirect addresses.
    held : ids of servos whose torque was on before and that were not rebooted.
    eeprom : one line of text for every permanent register written.
    """

    ticks: dict[int, int] = field(default_factory=dict)
    limits: dict[int, tuple[int, int]] = field(default_factory=dict)
    mapped: dict[int, Block] = field(default_factory=dict)
    held: list[int] = field(default_factory=list)
    eeprom: list[str] = field(default_factory=list)


class Startup(ABC, Generic[R]):
    """The steps of start-up and stop; a protocol implements the hooks.

    started : the result.
    left_on : servos whose torque a failed start has enabled and that are not confirmed off.
    out_of_turn_hint, not_on_hint, not_off_hint : what a user can do where a position is not within one turn, a motor
        does not switch on, or does not switch off.
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
        """Return model number and firmware from a servo's reply to the greeting."""

    def _greet(self, servo: int) -> R:
        """Greet a servo and return its reply."""
        return self.registers.hello(servo)

    @abstractmethod
    def _release(self, servo: int) -> None:
        """Disable the torque of one servo and verify it."""

    def _least_voltage(self, ids: Sequence[int]) -> Mapping[int, int]:
        """Read the least supply voltage that servos need, in 0.1 V, by id."""
        return self.registers.get_all(ids, "min_voltage")

    @abstractmethod
    def _clear_faults(self, ids: Sequence[int]) -> Sequence[int]:
        """Check hardware errors and clear those that may be cleared; return servos that were rebooted.

        Raises ServoFault where a servo has an error and the policy does not allow to reboot it.
        """

    @abstractmethod
    def _write_settings(self, servo: int, held: bool) -> None:
        """Read the permanent registers that this driver depends on, and write those that differ, with torque off."""

    @abstractmethod
    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Write the registers that must be right before torque comes on."""

    @abstractmethod
    def _slack(self, turn: int) -> float:
        """How many steps the position of a servo with torque may lie outside its turn of ``turn`` steps."""

    def _first_steps(self, ids: Sequence[int]) -> Mapping[int, int]:
        """First step, by id, of the turn in which a servo counts after its torque is enabled; 0 for missing ids."""
        return {}

    @abstractmethod
    def _why_off(self, ids: Sequence[int]) -> Mapping[int, str]:
        """Read why motors did not switch on, as text by id."""

    def _disarm(self, ids: Sequence[int]) -> None:
        """Switch off the bus watchdogs of servos; does nothing by default."""

    # ------------------------------------------------------------------ starting

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
        """Start identified servos at their present positions; return the result.

        Raises BusError where that is not safe. Then torque that this start had enabled is disabled again; with the
        policy ``partly`` only of the servos that the error names. Servos whose torque was on before keep it; their
        watchdog is switched off, unless the policy is ``partly``.
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
            self._enable_torque(ids, held)
        except BaseException:
            if not self.policy.partly:
                self._leave_holding(held)
            raise
        return self.started

    def _enable_torque(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Enable torque; after an error disable it again on servos where it was off before."""
        self.left_on = [servo for servo in ids if servo not in held]
        try:
            self.torque_on(ids, held)
        except BaseException as error:
            self._disable_after_error(self.left_on, error)
            self.left_on = []
            raise
        self.left_on = []

    def _leave_holding(self, held: Sequence[int]) -> None:
        """After a failed start, switch off the watchdogs of servos that keep their torque: no goals will be sent."""
        if held:
            with suppress(DriverError):  # the error of the start is raised instead
                self._disarm(held)

    def _disable_after_error(self, ids: Sequence[int], error: BaseException) -> None:
        """Disable torque that was enabled before an error; with the policy ``partly`` only where the error names it."""
        if not self.policy.partly or not isinstance(error, BusError):
            self.switch_off(ids)
            return
        named = error.servo_ids or ids
        with suppress(NoReply):  # the error that is raised names them too
            self.switch_off([servo for servo in ids if servo in named])

    def take_over(self, ids: Sequence[int]) -> list[int]:
        """Treat servos whose torque is on as the policy says; return the ids of those that keep it.

        Raises ServoRefused where torque is on and the policy refuses that.
        """
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
        """Wait for the supply voltage: enabling torque while it still rises latches input-voltage errors.

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
        """Convert a supply voltage that was read to 0.1 V."""
        item = self.registers.item(servo, "voltage")
        return value if item is None else 10.0 * item.scale * value

    def fault(self, verb: str, bad: Mapping[int, int]) -> BusError:
        """Return an error about servos that ``verb`` a hardware error; bad : their error bits or code by id."""
        label = self.registers.label
        which = ", ".join(f"{label(servo)} {self._error_text(servo, bits)}" for servo, bits in bad.items())
        hint = "support the head, then start with reboot_faulted=true, or switch the power off and on"
        return self.registers.error(ServoFault, f"servos {verb} a hardware error: {which}", hint, *sorted(bad))

    def _error_text(self, servo: int, bits: int) -> str:
        return f"code {bits}" if self.registers.tables[servo].error_codes else f"0x{bits:02X}"

    def locked(self, servo: int, name: str, old: int, new: int) -> BusError:
        """Return the error for a permanent register that must change while the torque of its servo is on."""
        change = f"{self.registers.register_name(servo, name)} must change from {old} to {new}"
        message = f"servo {self.registers.label(servo)} holds with torque, and {change}"
        return self.registers.error(
            ServoRefused, message, 'support the head, then start with takeover="release"', servo
        )

    def note(self, servo: int, name: str, old: int, new: int) -> None:
        """Log, and add to the result, that a permanent register was written."""
        line = f"servo {self.registers.label(servo)}: {self.registers.register_name(servo, name)} {old} -> {new}"
        self.started.eeprom.append(line)
        log.info("permanent setting written: %s", line)

    def torque_on(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Write goals at the present positions; right after that enable torque, and read it back.

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

    # ------------------------------------------------------------------ stopping

    def switch_off_started(self, ids: Sequence[int], held: Sequence[int]) -> None:
        """Switch servos off as :meth:`switch_off`, and leave the ``held`` ones on, without their watchdogs."""
        try:
            self.switch_off(ids)
        finally:
            self._leave_holding(held)

    def switch_off(self, ids: Sequence[int]) -> None:
        """Disable the torque of every servo that can be reached, each servo separately.

        Raises PortLost or NoReply after everything was tried; ``servo_ids`` are the servos not confirmed off.
        """
        registers = self.registers
        known = [servo for servo in ids if servo in registers.tables]
        unconfirmed, lost = list(known), None
        try:
            registers.put_all(dict.fromkeys(known, 0), "torque")
            for _ in range(1 + MAX_OFF_RETRIES):
                unconfirmed = [servo for servo in unconfirmed if not self._confirm_off(servo)]
                if not unconfirmed:
                    break
            self._disarm([servo for servo in known if servo not in unconfirmed])
        except PortLost as error:
            lost = error
        if not unconfirmed:
            return
        which = ", ".join(map(registers.label, unconfirmed)) + (f" ({lost})" if lost else "")
        message = f"not confirmed off on {registers.port.port_name}: {which}"
        raise self.registers.error(
            NoReply if lost is None else PortLost, message, self.not_off_hint, *unconfirmed
        ) from lost

    def _confirm_off(self, servo: int) -> bool:
        """Disable the torque of a servo once more; return whether it reads as off."""
        try:
            self.registers.put_unanswered(servo, "torque", 0)
            return self.registers.get(servo, "torque", tries=1) == 0
        except BusError:
            return False
