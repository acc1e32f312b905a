"""Bringing servos up without a movement, and switching them off so that no reachable one stays on.

Nothing is written before every servo has answered and is the configured model, torque goes on last, with each
goal at the position just read, and is read back. Going down, one packet reaches everybody first; then each servo is
switched off and read back by itself, the silent ones last, so that one dead servo cannot cost the others theirs.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.base.bus import ServoSpec
from drivers.base.errors import (
    BusError,
    CorruptReply,
    NoReply,
    PortLost,
    ServoFault,
    ServoRefused,
    WrongModel,
    together,
)
from drivers.dynamixel.indirect import set_up
from drivers.dynamixel.registers import Registers
from drivers.servos.layout import NAMES, Block
from drivers.tables.tables import load_table, model_name, model_number

log = logging.getLogger(__name__)

WATCHDOG_STEP_S = 0.02
INPUT_VOLTAGE = 0x01
REVERSE, TIME_PROFILE, TORQUE_BY_GOAL = 0x01, 0x04, 0x08
OUT_OF_TURN_TICKS = 64
BOOT_S = 1.0
EEPROM_TRIES = 10
OFF_RETRIES = 5


@dataclass(frozen=True)
class Policy:
    """What start-up may do.

    Attributes
    ----------
    watchdog_ms : a servo stops by itself when it hears nothing for so long; 0 switches that off.
    takeover : servos found holding with torque are kept holding (``"adopt"``), switched off first
        (``"release"``: they may fall), or make start-up fail (``"refuse"``).
    reboot_faulted : reboot servos with a latched hardware error; they let go while they do.
    min_voltage_v : wait until every servo has at least this supply; None takes each servo's own limit.
    voltage_wait_s : how long to wait for it.
    """

    watchdog_ms: int = 200
    takeover: str = "adopt"
    reboot_faulted: bool = False
    min_voltage_v: float | None = None
    voltage_wait_s: float = 30.0

    def __post_init__(self) -> None:
        if self.takeover not in ("adopt", "release", "refuse"):
            raise ValueError(f'takeover: must be "adopt", "release" or "refuse", got {self.takeover!r}')

    @property
    def watchdog_steps(self) -> int:
        """The register's value, rounded up, at most 127."""
        return min(math.ceil(self.watchdog_ms / 1000.0 / WATCHDOG_STEP_S), 127)


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


def identify(registers: Registers, servos: Sequence[ServoSpec]) -> None:
    """Ping every servo, compare its model and load its control table. Writes nothing.

    Raises
    ------
    NoReply, CorruptReply : some did not answer.
    WrongModel : one is not the configured model.
    """
    replies = registers.each([servo.id for servo in servos], registers.hello)
    wrong: dict[int, BusError] = {}
    for servo in servos:
        low, high, firmware = replies[servo.id].params
        number = low | high << 8
        if number == model_number(servo.model):
            registers.tables[servo.id] = load_table(number, firmware)
            continue
        message = f"servo {registers.label(servo.id)} is {model_name(number)}, configured is {servo.model}"
        hint = "correct the configuration, or the servo's id with `omote scan PORT`"
        wrong[servo.id] = WrongModel(message, hint=hint, port=registers.port.port_name, servo_ids=(servo.id,))
    if wrong:
        raise together(wrong)


def bring_up(
    registers: Registers,
    servos: Sequence[ServoSpec],
    policy: Policy,
    *,
    indirect: bool = False,
) -> Started:
    """Start identified servos where they stand.

    Parameters
    ----------
    registers, servos : the wire and who is on it.
    policy : what may be done.
    indirect : map registers side by side where the models have indirect addressing.

    Raises
    ------
    BusError : something is not as it must be; torque was switched off again where it had been switched on.
    """
    ids = [servo.id for servo in servos]
    started = Started()
    registers.put_all(dict.fromkeys(ids, 2), "status_level")
    held = [servo for servo, on in registers.get_all(ids, "torque").items() if on]
    _take_over(registers, held, policy)
    _wait_for_voltage(registers, ids, policy)
    rebooted = _clear_faults(registers, ids, policy)
    held = [servo for servo in held if policy.takeover == "adopt" and servo not in rebooted]
    for servo in ids:
        _settings(registers, servo, servo in held, started)
    started.limits = _limits(registers, ids)
    if indirect:
        started.mapped = set_up(registers, ids)
    _prepare(registers, servos, policy)
    try:
        _torque_on(registers, ids, started)
    except BaseException:
        switch_off(registers, ids)
        raise
    return started


def _take_over(registers: Registers, held: Sequence[int], policy: Policy) -> None:
    if not held or policy.takeover == "adopt":
        return
    if policy.takeover == "release":
        registers.each(held, lambda servo: registers.put(servo, "torque", 0))
        return
    ids = ", ".join(map(registers.label, held))
    raise ServoRefused(
        f"servos hold with torque already: {ids}",
        hint='stop the program that drives them, or start with takeover="adopt" or "release"',
        port=registers.port.port_name,
        servo_ids=tuple(held),
    )


def _wait_for_voltage(registers: Registers, ids: Sequence[int], policy: Policy) -> None:
    """Switching torque on while the supply ramps up latches input-voltage errors."""
    need = registers.get_all(ids, "min_voltage")
    if policy.min_voltage_v is not None:
        need = dict.fromkeys(ids, round(policy.min_voltage_v * 10))
    port = registers.port
    deadline = port.clock() + policy.voltage_wait_s
    while True:
        volts = registers.get_all(ids, "voltage")
        low = {servo: volts[servo] for servo in need if servo in volts and volts[servo] < need[servo]}
        if not low:
            return
        if port.clock() > deadline:
            break
        port.sleep(0.1)
    worst = min(low, key=lambda servo: low[servo] - need[servo])
    raise ServoFault(
        f"{len(low)} servos have too little supply voltage: {registers.label(worst)} reads "
        f"{low[worst] / 10:.1f} V, needs {need[worst] / 10:.1f} V",
        hint="check the power supply and its cable",
        port=registers.port.port_name,
        servo_ids=tuple(sorted(low)),
    )


def _clear_faults(registers: Registers, ids: Sequence[int], policy: Policy) -> list[int]:
    """Reboot servos with a latched error where that is allowed; input voltage alone is let pass."""
    latched = registers.get_all(ids, "hardware")
    bad = {servo: bits for servo, bits in latched.items() if bits and not _passable(registers, servo, bits)}
    if not bad:
        return []
    if not policy.reboot_faulted:
        raise _fault(registers, bad)
    for servo in bad:
        registers.packets.reboot(registers.port, servo)
    registers.port.sleep(BOOT_S / 4)
    patience = math.ceil(BOOT_S / registers.port.margin_s)
    registers.each(bad, lambda servo: registers.hello(servo, tries=patience))
    registers.put_all(dict.fromkeys(bad, 2), "status_level")  # all RAM is at its default again
    still = {servo: bits for servo, bits in registers.get_all(list(bad), "hardware").items() if bits}
    if still:
        raise _fault(registers, still)
    return list(bad)


def _passable(registers: Registers, servo: int, bits: int) -> bool:
    """Input voltage alone, where it does not switch the motor off."""
    return bits == INPUT_VOLTAGE and not registers.get(servo, "shutdown") & INPUT_VOLTAGE


def _fault(registers: Registers, bad: Mapping[int, int]) -> ServoFault:
    which = ", ".join(f"{registers.label(servo)} 0x{bits:02X}" for servo, bits in bad.items())
    return ServoFault(
        f"servos latched a hardware error: {which}",
        hint="support the head, then start with reboot_faulted=true, or switch the power off and on",
        port=registers.port.port_name,
        servo_ids=tuple(sorted(bad)),
    )


def _settings(registers: Registers, servo: int, held: bool, started: Started) -> None:
    """Permanent registers this driver relies on: read, and written only where they differ."""
    table = registers.tables[servo]
    wanted: dict[str, int] = {"mode": 2 if table.model == "xl320" else 3}
    keep = {"drive_mode": ~(REVERSE | TIME_PROFILE | TORQUE_BY_GOAL)}
    if table.goal_torque:  # older firmware has no Startup Configuration and refuses to be asked
        keep["startup"] = ~1
    present = {name: registers.get(servo, name) for name in ("mode", *registers_of(registers, servo, keep))}
    wanted |= {name: present[name] & mask for name, mask in keep.items() if name in present}
    if not held:  # a delayed answer only costs time, so a servo that holds is left alone
        wanted["return_delay"] = 0
        present["return_delay"] = registers.get(servo, "return_delay")
    for name, value in wanted.items():
        if present[name] == value:
            continue
        if held:
            raise _locked(registers, servo, name, present[name], value)
        _write_eeprom(registers, servo, name, present[name], value, started)


def registers_of(registers: Registers, servo: int, names: Iterable[str]) -> list[str]:
    """Those of the names that the servo's model has."""
    return [name for name in names if registers.item(servo, name) is not None]


def _locked(registers: Registers, servo: int, name: str, old: int, new: int) -> ServoRefused:
    return ServoRefused(
        f"servo {registers.label(servo)} holds with torque, and {NAMES[name][0]} must change from {old} to {new}",
        hint='support the head, then start with takeover="release"',
        port=registers.port.port_name,
        servo_ids=(servo,),
    )


def _write_eeprom(registers: Registers, servo: int, name: str, old: int, new: int, started: Started) -> None:
    registers.put(servo, "torque", 0)
    registers.put(servo, name, new, tries=EEPROM_TRIES)  # it is deaf for a while after
    if registers.get(servo, name, tries=EEPROM_TRIES) != new:
        message = f"servo {registers.label(servo)} did not keep {NAMES[name][0]} = {new}"
        raise ServoRefused(message, port=registers.port.port_name, servo_ids=(servo,))
    line = f"servo {registers.label(servo)}: {NAMES[name][0]} {old} -> {new}"
    started.eeprom.append(line)
    log.info("permanent setting written: %s", line)


def _limits(registers: Registers, ids: Sequence[int]) -> dict[int, tuple[int, int]]:
    low, high = registers.get_all(ids, "min_ticks"), registers.get_all(ids, "max_ticks")
    return {servo: (low[servo], high[servo]) for servo in ids if servo in low and servo in high}


def _prepare(registers: Registers, servos: Sequence[ServoSpec], policy: Policy) -> None:
    """Speed and acceleration limits, and the bus watchdog: cleared, then armed, before torque."""
    for name, limit in (("speed_limit", "max_speed_rad_s"), ("accel_limit", "max_accel_rad_s2")):
        values = {}
        for servo in servos:
            item = registers.item(servo.id, name)
            if item is not None:  # 0 would mean no limit
                steps = math.ceil(getattr(servo, limit) / item.scale)
                values[servo.id] = min(max(steps, 1), 1023 if item.size == 2 else 32767)
        registers.set_all(values, name)
    arm_watchdog(registers, [servo.id for servo in servos], policy)


def arm_watchdog(registers: Registers, ids: Sequence[int], policy: Policy) -> None:
    """Clear a watchdog that may have tripped, and set its time."""
    ids = registers.having(ids, "watchdog")
    registers.put_all(dict.fromkeys(ids, 0), "watchdog")
    registers.set_all(dict.fromkeys(ids, policy.watchdog_steps), "watchdog")


def _torque_on(registers: Registers, ids: Sequence[int], started: Started) -> None:
    """Goals to where the servos are, as close before torque as can be, then torque, then read back."""
    registers.set_all(goals_at_present(registers, ids, started.limits), "goal")
    registers.put_all(dict.fromkeys(ids, 1), "torque")
    limp = [servo for servo, on in registers.get_all(ids, "torque").items() if not on]
    if limp:
        latched = registers.get_all(limp, "hardware")
        raise ServoFault(
            "servos did not switch their motor on: "
            + ", ".join(f"{registers.label(i)} (hardware error 0x{latched.get(i, 0):02X})" for i in limp),
            hint="switch their power off and on, or start with reboot_faulted=true",
            port=registers.port.port_name,
            servo_ids=tuple(limp),
        )
    started.ticks = registers.get_all(ids, "position")


def goals_at_present(registers: Registers, ids: Sequence[int], limits: Mapping[int, tuple[int, int]]) -> dict[int, int]:
    """The goal by id that keeps every servo where it is.

    Raises
    ------
    ServoFault : a position is not within one turn, so a goal there could spin the servo.
    """
    ticks = registers.get_all(ids, "position")
    for servo, value in ticks.items():
        turn = registers.tables[servo].ticks_per_turn
        if not -OUT_OF_TURN_TICKS <= value < turn + OUT_OF_TURN_TICKS:
            raise ServoFault(
                f"servo {registers.label(servo)} reads position {value}, outside one turn of {turn} steps",
                hint="clear its homing offset and turn count: switch its power off and on",
                port=registers.port.port_name,
                servo_ids=(servo,),
            )
    whole = {servo: (0, registers.tables[servo].ticks_per_turn - 1) for servo in ids} | dict(limits)
    return {servo: min(max(value, whole[servo][0]), whole[servo][1]) for servo, value in ticks.items()}


def switch_off(registers: Registers, ids: Sequence[int]) -> None:
    """Torque off for every servo that can be reached, each tried by itself.

    Raises
    ------
    PortLost, NoReply : after everything was tried; ``servo_ids`` are those not confirmed off.
    """
    known = [servo for servo in ids if servo in registers.tables]
    open_ids, lost = list(known), None
    try:
        registers.put_all(dict.fromkeys(known, 0), "torque")
        for _ in range(1 + OFF_RETRIES):
            open_ids = [servo for servo in open_ids if not _confirmed_off(registers, servo)]
            if not open_ids:
                break
        off = [servo for servo in registers.having(known, "watchdog") if servo not in open_ids]
        _disarm(registers, off)
    except PortLost as error:
        lost = error
    if not open_ids:
        return
    which = ", ".join(map(registers.label, open_ids))
    kind = NoReply if lost is None else PortLost
    raise kind(
        f"not confirmed off on {registers.port.port_name}: {which}" + (f" ({lost})" if lost else ""),
        hint="switch the servos' power off; their watchdog stops them when it is armed",
        port=registers.port.port_name,
        servo_ids=tuple(open_ids),
    ) from lost


def _disarm(registers: Registers, ids: Sequence[int]) -> None:
    """Switch the watchdogs of servos that are off to off; not worth an error."""
    with suppress(NoReply, CorruptReply, ServoRefused):
        registers.set_all(dict.fromkeys(ids, 0), "watchdog")


def _confirmed_off(registers: Registers, servo: int) -> bool:
    try:
        registers.tell(servo, "torque", 0)
        return registers.get(servo, "torque", tries=1) == 0
    except BusError:
        return False
