"""Bringing servos up without a movement, and switching them off so that no reachable one stays on.

Nothing is written before every servo has answered and is the configured model, torque goes on last, with each
goal at the position just read, and is read back. Going down, one packet reaches everybody first; then each servo is
switched off and read back by itself, the silent ones last, so that one dead servo cannot cost the others theirs.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, NoReply, PortLost, ServoFault, ServoRefused, WrongModel
from drivers.servos.layout import Block
from drivers.servos.registers import E, Registers
from drivers.tables.tables import model_name

log = logging.getLogger(__name__)

OFF_RETRIES = 5


@dataclass(frozen=True)
class Policy:
    """What start-up may do, whatever the family.

    Attributes
    ----------
    takeover : servos found holding with torque are kept holding (``"adopt"``), switched off first
        (``"release"``: they may fall), or make start-up fail (``"refuse"``).
    reboot_faulted : bring servos back that had shut down for a hardware error; they let go while they reboot.
    min_voltage_v : wait until every servo has at least this supply; None takes each servo's own limit.
    voltage_wait_s : how long to wait for it.
    """

    takeover: str = "adopt"
    reboot_faulted: bool = False
    min_voltage_v: float | None = None
    voltage_wait_s: float = 30.0

    def __post_init__(self) -> None:
        if self.takeover not in ("adopt", "release", "refuse"):
            raise ValueError(f'takeover: must be "adopt", "release" or "refuse", got {self.takeover!r}')


@dataclass
class Started:
    """What start-up found and did.

    Attributes
    ----------
    ticks : present position by id, read after torque came on.
    limits : lowest and highest step by id that the servo's own registers allow.
    mapped : block that is read through pointers, by id.
    eeprom : one line for every permanent register written.
    """

    ticks: dict[int, int] = field(default_factory=dict)
    limits: dict[int, tuple[int, int]] = field(default_factory=dict)
    mapped: dict[int, Block] = field(default_factory=dict)
    eeprom: list[str] = field(default_factory=list)


class Startup(ABC):
    """The steps of start-up and stop; a family puts them in its order. Its hooks are the abstract methods.

    Parameters
    ----------
    registers : the wire, and who is on it.
    policy : what may be done.
    started : what was found and done, to add to.

    Attributes
    ----------
    out_of_turn_hint, not_on_hint, not_off_hint : what a user can do where a position is not within one turn, a motor
        does not come on, or does not go off.
    """

    out_of_turn_hint: ClassVar[str]
    not_on_hint: ClassVar[str]
    not_off_hint: ClassVar[str]

    def __init__(self, registers: Registers[Any], policy: Policy, started: Started | None = None) -> None:
        self.registers, self.policy = registers, policy
        self.started = Started() if started is None else started

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def release(self, servo: int) -> None:
        """Switch one servo off and be sure of it."""

    @abstractmethod
    def slack(self, turn: int) -> float:
        """Steps that a position may lie outside of a turn of so many."""

    @abstractmethod
    def why_limp(self, ids: Sequence[int]) -> Mapping[int, str]:
        """What servos say whose motor did not come on, by id."""

    def is_on(self, torque: int) -> bool:
        """Whether the torque register says that the motor is on."""
        return bool(torque)

    def disarm(self, ids: Sequence[int]) -> None:  # noqa: B027  most have nothing to disarm
        """Look after servos that were switched off."""

    # ------------------------------------------------------------------ up

    def error(self, kind: type[E], message: str, hint: str, *ids: int) -> E:
        """An error about servos on this port."""
        return self.registers.error(kind, message, hint, *ids)

    def wrong_model(self, servo: ServoSpec, number: int) -> BusError:
        """The error of a servo that is another model than the configured one."""
        message = f"servo {self.registers.label(servo.id)} is {model_name(number)}, configured is {servo.model}"
        hint = "correct the configuration, or the servo's id with `omote scan PORT`"
        return self.error(WrongModel, message, hint, servo.id)

    def take_over(self, ids: Sequence[int]) -> list[int]:
        """Servos that hold with torque and go on holding.

        Raises
        ------
        ServoRefused : some hold, and that is not allowed.
        """
        held = [servo for servo, torque in self.registers.get_all(ids, "torque").items() if torque]
        if not held or self.policy.takeover == "adopt":
            return held
        if self.policy.takeover == "release":
            self.registers.each(held, self.release)
            return []
        message = f"servos hold with torque already: {', '.join(map(self.registers.label, held))}"
        hint = 'stop the program that drives them, or start with takeover="adopt" or "release"'
        raise self.error(ServoRefused, message, hint, *held)

    def wait_for_voltage(self, ids: Sequence[int], need: Mapping[int, int]) -> None:
        """Wait for the supply: switching torque on while it ramps up latches input-voltage errors.

        Parameters
        ----------
        need : least voltage by id, 0.1 V; what the policy asks for goes before it.

        Raises
        ------
        ServoFault : it does not come.
        """
        registers, least_v = self.registers, self.policy.min_voltage_v
        if least_v is not None:
            need = dict.fromkeys(ids, round(least_v * 10))
        port = registers.port
        deadline = port.clock() + self.policy.voltage_wait_s
        while True:
            volts = registers.get_all(ids, "voltage")
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
        raise self.error(ServoFault, message, "check the power supply and its cable", *sorted(low))

    def fault(self, what: str, bad: Mapping[int, int]) -> BusError:
        """The error of servos with a hardware error; their bits by id."""
        which = ", ".join(f"{self.registers.label(servo)} 0x{bits:02X}" for servo, bits in bad.items())
        hint = "support the head, then start with reboot_faulted=true, or switch the power off and on"
        return self.error(ServoFault, f"servos {what} a hardware error: {which}", hint, *sorted(bad))

    def locked(self, servo: int, name: str, old: int, new: int) -> BusError:
        """The error of a permanent register that must change while the servo holds."""
        what = f"{self.registers.called(servo, name)} must change from {old} to {new}"
        message = f"servo {self.registers.label(servo)} holds with torque, and {what}"
        return self.error(ServoRefused, message, 'support the head, then start with takeover="release"', servo)

    def note(self, servo: int, name: str, old: int, new: int) -> None:
        """Tell that a permanent register was written."""
        line = f"servo {self.registers.label(servo)}: {self.registers.called(servo, name)} {old} -> {new}"
        self.started.eeprom.append(line)
        log.info("permanent setting written: %s", line)

    def read_limits(self, ids: Sequence[int]) -> None:
        """Keep the limits that the servos' own registers hold."""
        low, high = self.registers.get_all(ids, "min_ticks"), self.registers.get_all(ids, "max_ticks")
        self.started.limits = {servo: (low[servo], high[servo]) for servo in ids if servo in low and servo in high}

    def torque_on(self, ids: Sequence[int]) -> None:
        """Goals to where the servos are, as close before torque as can be, then torque, then read back.

        Raises
        ------
        ServoFault : a motor did not come on, or a position is not within one turn.
        """
        registers = self.registers
        registers.set_all(self.goals_at_present(ids), "goal")
        registers.put_all(dict.fromkeys(ids, 1), "torque")
        limp = [servo for servo, torque in registers.get_all(ids, "torque").items() if not self.is_on(torque)]
        if limp:
            why = self.why_limp(limp)
            which = ", ".join(f"{registers.label(servo)} ({why[servo]})" for servo in limp)
            raise self.error(ServoFault, f"servos did not switch their motor on: {which}", self.not_on_hint, *limp)
        self.started.ticks = registers.get_all(ids, "position")

    def goals_at_present(self, ids: Sequence[int]) -> dict[int, int]:
        """The goal by id that keeps every servo where it is.

        Raises
        ------
        ServoFault : a position is not within one turn, so a goal there could spin the servo.
        """
        goals = {}
        for servo, value in self.registers.get_all(ids, "position").items():
            turn = self.registers.tables[servo].ticks_per_turn
            slack = self.slack(turn)
            if not -slack <= value < turn + slack:
                where = f"outside one turn of {turn} steps"
                message = f"servo {self.registers.label(servo)} reads position {value}, {where}"
                raise self.error(ServoFault, message, self.out_of_turn_hint, servo)
            low, high = self.started.limits.get(servo, (0, turn - 1))
            goals[servo] = min(max(value, low), high)
        return goals

    # ------------------------------------------------------------------ down

    def switch_off(self, ids: Sequence[int]) -> None:
        """Torque off for every servo that can be reached, each tried by itself.

        Raises
        ------
        PortLost, NoReply : after everything was tried; ``servo_ids`` are those not confirmed off.
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
            self.disarm([servo for servo in known if servo not in open_ids])
        except PortLost as error:
            lost = error
        if not open_ids:
            return
        which = ", ".join(map(registers.label, open_ids)) + (f" ({lost})" if lost else "")
        message = f"not confirmed off on {registers.port.port_name}: {which}"
        raise self.error(NoReply if lost is None else PortLost, message, self.not_off_hint, *open_ids) from lost

    def _confirmed_off(self, servo: int) -> bool:
        try:
            self.registers.tell(servo, "torque", 0)
            return self.registers.get(servo, "torque", tries=1) == 0
        except BusError:
            return False
