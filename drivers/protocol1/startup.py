"""Bringing servos with Protocol 1.0 framing up without a movement: what start-up has of its own here.

These servos have no bus watchdog: nothing but this program (or the power switch) ever tells them to let go.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, NoReply, merge_errors
from drivers.packets.packet1 import Error1, Packet1
from drivers.protocol1.registers import Registers
from drivers.protocol1.settings import EEPROM_TRIES, apply_settings, write_surely
from drivers.servos import startup
from drivers.servos.registers import TRIES
from drivers.tables.tables import ControlTable, known_models, load_table

OUT_OF_TURN = 1 / 64
"""Share of a turn that a position may lie outside of it."""
RELAPSE_S = 0.25
"""Time in which a servo that was in trouble shows whether it still is."""
UNNUMBERED = 0x10000
"""Model numbers from here on stand for models whose real number no source gives."""


@dataclass(frozen=True)
class Policy(startup.Policy):
    """What start-up may do.

    Attributes
    ----------
    torque_limit : share of the stall torque that motors may give, above 0 to 1; None leaves it as it is.
    """

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


def _accepts(expected: ControlTable, number: int) -> bool:
    """Whether a number is the configured model's. One that no source gives may be any that no other model has."""
    unknown = expected.number >= UNNUMBERED and number not in known_models()
    return number == expected.number or unknown


def speed_steps(servo: ServoSpec, registers: Registers) -> int:
    """A servo's top speed in steps of its speed register; never 0, which would mean no limit."""
    table, item = registers.tables[servo.id], registers.item(servo.id, "speed")
    scale, top = (item.scale, 1023 if item.name == "Moving Speed" else table.top_speed) if item else (1.0, 1)
    return min(max(math.ceil(servo.max_speed_rad_s / scale), 1), top)


class Startup(startup.Startup):
    """Start-up and stop; parameters as for :class:`~drivers.servos.startup.Startup`."""

    out_of_turn_hint = "clear its offset and turn count: switch its power off and on"
    not_on_hint = "switch their power off and on"
    not_off_hint = "switch the servos' power off: they have no watchdog that would"

    registers: Registers
    policy: Policy

    def release(self, servo: int) -> None:
        """Switch one servo off and be sure of it."""
        write_surely(self.registers, servo, "torque", 0, TRIES)

    def slack(self, turn: int) -> float:
        """Steps that a position may lie outside of a turn."""
        return OUT_OF_TURN * turn

    def is_on(self, torque: int) -> bool:
        """Whether the torque register says that the motor is on; Feetech's has other values, too."""
        return torque == 1

    def why_limp(self, ids: Sequence[int]) -> Mapping[int, str]:
        """Error flags of servos whose motor did not come on."""
        return {servo: f"error flags 0x{self.registers.flags.get(servo, 0):02X}" for servo in ids}

    def identify(self, servos: Sequence[ServoSpec]) -> None:
        """Greet every servo and compare its model. Writes only to those that keep quiet because they were told to.

        Raises
        ------
        NoReply, CorruptReply : some did not answer.
        WrongModel : one is not the configured model.
        """
        tables = {servo.id: load_table(servo.model) for servo in servos}
        self.registers.tables |= tables
        replies = self.registers.each([servo.id for servo in servos], self._greet)
        wrong: dict[int, BusError] = {}
        for servo in servos:
            expected = tables[servo.id]
            number, firmware = identity(replies[servo.id], [expected])
            if _accepts(expected, number):
                self.registers.tables[servo.id] = load_table(expected.number, firmware)
            else:
                wrong[servo.id] = self.wrong_model(servo, number)
        if wrong:
            raise merge_errors(wrong)

    def _greet(self, servo: int) -> Packet1:
        """A servo's first registers; one that answers pings only is told to answer everything."""
        registers = self.registers
        try:
            return registers.hello(servo)
        except NoReply:
            quiet = "Status Return Level" in registers.tables[servo]
            if not quiet or not registers.packets.pings(registers.port, servo):
                raise
        registers.tell(servo, "status_level", 2)
        reply = registers.hello(servo, tries=EEPROM_TRIES)
        self.note(servo, "status_level", 0, 2)
        return reply

    def bring_up(self, servos: Sequence[ServoSpec]) -> startup.Started:
        """Start identified servos where they stand.

        Raises
        ------
        BusError : something is not as it must be; torque was switched off again where it had been switched on.
        """
        registers, ids = self.registers, [servo.id for servo in servos]
        held = self.take_over(ids)
        need = registers.get_all(ids, "min_voltage") if self.policy.min_voltage_v is None else {}
        self.wait_for_voltage(ids, need)
        faulted = self._faults(ids)
        if faulted and not self.policy.reboot_faulted:
            raise self.fault("report", faulted)
        for servo in ids:
            apply_settings(self, servo, servo in held)
        self.read_limits(ids)
        self._prepare(servos)
        try:
            self.torque_on(ids)
            if faulted:
                registers.port.sleep(RELAPSE_S)  # a cause that is still there shuts it down again
                registers.get_all(ids, "voltage")
            if faulted := self._faults(ids):
                raise self.fault("report", faulted)
        except BaseException:
            self.switch_off(ids)
            raise
        return self.started

    def _faults(self, ids: Sequence[int]) -> dict[int, int]:
        """Hardware errors in the replies just had; input voltage alone is let pass where it switches nothing off."""
        registers, bad = self.registers, {}
        for servo in ids:
            bits = registers.causes(servo, registers.flags.get(servo, 0))
            if bits == Error1.INPUT_VOLTAGE and not registers.get(servo, "shutdown") & bits:
                continue
            if bits:
                bad[servo] = bits
        return bad

    def _prepare(self, servos: Sequence[ServoSpec]) -> None:
        """Limits of speed, acceleration and torque."""
        registers, ids = self.registers, [servo.id for servo in servos]
        registers.set_all({servo.id: speed_steps(servo, registers) for servo in servos}, "speed")
        registers.set_all(dict.fromkeys(registers.having(ids, "time"), 0), "time")
        accelerations = {}
        for servo in servos:
            item = registers.item(servo.id, "accel")
            if item is not None:
                steps = max(math.ceil(servo.max_accel_rad_s2 / item.scale), 1)
                accelerations[servo.id] = steps if steps <= (item.maximum or 0) else 0  # 0: as quick as it can
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
