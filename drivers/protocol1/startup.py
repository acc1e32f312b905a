"""Bringing servos with Protocol 1.0 framing up without a movement, and switching every reachable one off.

The order is that of every driver here: nothing is written before all have answered and are the configured models;
torque goes on last, with each goal at the position just read, and is read back. These servos have no bus watchdog:
nothing but this program (or the power switch) ever tells them to let go.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, NoReply, PortLost, ServoFault, ServoRefused, WrongModel, together
from drivers.packets.packet1 import Error1, Packet1
from drivers.protocol1.registers import Registers
from drivers.protocol1.settings import EEPROM_TRIES, Started, apply_settings, note, write_surely
from drivers.servos.registers import TRIES
from drivers.tables.tables import ControlTable, known_models, load_table, model_name

OUT_OF_TURN = 1 / 64
"""Share of a turn that a position may lie outside of it."""
OFF_RETRIES = 5
RELAPSE_S = 0.25
"""Time in which a servo that was in trouble shows whether it still is."""
UNNUMBERED = 0x10000
"""Model numbers from here on stand for models whose real number no source gives."""


@dataclass(frozen=True)
class Policy:
    """What start-up may do.

    Attributes
    ----------
    takeover : servos found holding with torque are kept holding (``"adopt"``), switched off first
        (``"release"``: they may fall), or make start-up fail (``"refuse"``).
    reboot_faulted : switch servos on that had shut down for a hardware error, if its cause is gone.
    min_voltage_v : wait until every servo has at least this supply; None takes each servo's own limit.
    voltage_wait_s : how long to wait for it.
    torque_limit : share of the stall torque that motors may give, above 0 to 1; None leaves it as it is.
    """

    takeover: str = "adopt"
    reboot_faulted: bool = False
    min_voltage_v: float | None = None
    voltage_wait_s: float = 30.0
    torque_limit: float | None = None

    def __post_init__(self) -> None:
        if self.takeover not in ("adopt", "release", "refuse"):
            raise ValueError(f'takeover: must be "adopt", "release" or "refuse", got {self.takeover!r}')
        if self.torque_limit is not None and not 0.0 < self.torque_limit <= 1.0:
            raise ValueError(f"torque_limit: must be above 0, up to 1, got {self.torque_limit}")


# ---------------------------------------------------------------------- who is there


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


def identify(registers: Registers, servos: Sequence[ServoSpec], started: Started) -> None:
    """Greet every servo and compare its model. Writes only to those that keep quiet because they were told to.

    Raises
    ------
    NoReply, CorruptReply : some did not answer.
    WrongModel : one is not the configured model.
    """
    tables = {servo.id: load_table(servo.model) for servo in servos}
    registers.tables |= tables
    replies = registers.each([servo.id for servo in servos], lambda servo: _greet(registers, servo, started))
    wrong: dict[int, BusError] = {}
    for servo in servos:
        expected = tables[servo.id]
        number, firmware = identity(replies[servo.id], [expected])
        if _accepts(expected, number):
            registers.tables[servo.id] = load_table(expected.number, firmware)
            continue
        message = f"servo {registers.label(servo.id)} is {model_name(number)}, configured is {servo.model}"
        hint = "correct the configuration, or the servo's id with `omote scan PORT`"
        wrong[servo.id] = WrongModel(message, hint=hint, port=registers.port.link.path, servo_ids=(servo.id,))
    if wrong:
        raise together(wrong)


def _accepts(expected: ControlTable, number: int) -> bool:
    """Whether a number is the configured model's. One that no source gives may be any that no other model has."""
    unknown = expected.number >= UNNUMBERED and number not in known_models()
    return number == expected.number or unknown


def _greet(registers: Registers, servo: int, started: Started) -> Packet1:
    """A servo's first registers; one that answers pings only is told to answer everything."""
    try:
        return registers.hello(servo)
    except NoReply:
        if "Status Return Level" not in registers.tables[servo] or not registers.packets.pings(registers.port, servo):
            raise
    registers.tell(servo, "status_level", 2)
    reply = registers.hello(servo, tries=EEPROM_TRIES)
    note(registers, servo, "status_level", 0, 2, started)
    return reply


# ---------------------------------------------------------------------- up


def bring_up(
    registers: Registers,
    servos: Sequence[ServoSpec],
    policy: Policy,
    started: Started,
) -> Started:
    """Start identified servos where they stand; fills and returns `started`.

    Raises
    ------
    BusError : something is not as it must be; torque was switched off again where it had been switched on.
    """
    ids = [servo.id for servo in servos]
    held = [servo for servo, on in registers.get_all(ids, "torque").items() if on]
    held = _take_over(registers, held, policy)
    _wait_for_voltage(registers, ids, policy)
    faulted = _faults(registers, ids)
    if faulted and not policy.reboot_faulted:
        raise _fault(registers, faulted)
    for servo in ids:
        apply_settings(registers, servo, servo in held, started)
    low, high = registers.get_all(ids, "min_ticks"), registers.get_all(ids, "max_ticks")
    started.limits = {servo: (low[servo], high[servo]) for servo in ids}
    _prepare(registers, servos, policy)
    try:
        _torque_on(registers, ids, started)
        if faulted:
            registers.port.link.sleep(RELAPSE_S)  # a cause that is still there shuts it down again
            registers.get_all(ids, "voltage")
        if faulted := _faults(registers, ids):
            raise _fault(registers, faulted)
    except BaseException:
        switch_off(registers, ids)
        raise
    return started


def _take_over(registers: Registers, held: list[int], policy: Policy) -> list[int]:
    """Servos that go on holding."""
    if not held or policy.takeover == "adopt":
        return held
    if policy.takeover == "release":
        registers.each(held, lambda servo: write_surely(registers, servo, "torque", 0, TRIES))
        return []
    ids = ", ".join(map(registers.label, held))
    raise ServoRefused(
        f"servos hold with torque already: {ids}",
        hint='stop the program that drives them, or start with takeover="adopt" or "release"',
        port=registers.port.link.path,
        servo_ids=tuple(held),
    )


def _wait_for_voltage(registers: Registers, ids: Sequence[int], policy: Policy) -> None:
    link = registers.port.link
    if policy.min_voltage_v is None:
        need = registers.get_all(ids, "min_voltage")
    else:
        need = dict.fromkeys(ids, round(10 * policy.min_voltage_v))
    deadline = link.clock() + policy.voltage_wait_s
    while low := {i: v for i, v in registers.get_all(ids, "voltage").items() if v < need[i]}:
        if link.clock() > deadline:
            break
        link.sleep(0.1)
    if not low:
        return
    worst = min(low, key=lambda servo: low[servo] - need[servo])
    raise ServoFault(
        f"{len(low)} servos have too little supply voltage: {registers.label(worst)} reads "
        f"{low[worst] / 10:.1f} V, needs {need[worst] / 10:.1f} V",
        hint="check the power supply and its cable",
        port=registers.port.link.path,
        servo_ids=tuple(sorted(low)),
    )


def _faults(registers: Registers, ids: Sequence[int]) -> dict[int, int]:
    """Hardware errors in the replies just had; input voltage alone is let pass where it switches nothing off."""
    bad = {}
    for servo in ids:
        bits = registers.causes(servo, registers.flags.get(servo, 0))
        if bits == Error1.INPUT_VOLTAGE and not registers.get(servo, "shutdown") & bits:
            continue
        if bits:
            bad[servo] = bits
    return bad


def _fault(registers: Registers, bad: Mapping[int, int]) -> ServoFault:
    which = ", ".join(f"{registers.label(servo)} 0x{bits:02X}" for servo, bits in bad.items())
    return ServoFault(
        f"servos report a hardware error: {which}",
        hint="support the head, then start with reboot_faulted=true, or switch the power off and on",
        port=registers.port.link.path,
        servo_ids=tuple(sorted(bad)),
    )


def speed_steps(servo: ServoSpec, registers: Registers) -> int:
    """A servo's top speed in steps of its speed register; never 0, which would mean no limit."""
    table, item = registers.tables[servo.id], registers.item(servo.id, "speed")
    scale, top = (item.scale, 1023 if item.name == "Moving Speed" else table.top_speed) if item else (1.0, 1)
    return min(max(math.ceil(servo.max_speed_rad_s / scale), 1), top)


def _prepare(registers: Registers, servos: Sequence[ServoSpec], policy: Policy) -> None:
    """Limits of speed, acceleration and torque."""
    ids = [servo.id for servo in servos]
    registers.set_all({servo.id: speed_steps(servo, registers) for servo in servos}, "speed")
    registers.set_all(dict.fromkeys(registers.having(ids, "time"), 0), "time")
    accelerations = {}
    for servo in servos:
        item = registers.item(servo.id, "accel")
        if item is not None:
            steps = max(math.ceil(servo.max_accel_rad_s2 / item.scale), 1)
            accelerations[servo.id] = steps if steps <= (item.maximum or 0) else 0  # 0: as quick as it can
    registers.set_all(accelerations, "accel")
    registers.set_all(_torque_limits(registers, ids, policy.torque_limit), "torque_limit")


def _torque_limits(registers: Registers, ids: Sequence[int], share: float | None) -> dict[int, int]:
    """Torque limits by id; a servo that shut down has 0 and gets all of its torque again."""
    limits = registers.get_all(registers.having(ids, "torque_limit"), "torque_limit")
    for servo, value in limits.items():
        item = registers.item(servo, "torque_limit")
        full = (item.maximum if item else None) or 0
        limits[servo] = (value or full) if share is None else max(round(share * full), 1)
    return limits


def _torque_on(registers: Registers, ids: Sequence[int], started: Started) -> None:
    """Goals to where the servos are, as close before torque as can be, then torque, then read back."""
    registers.set_all(goals_at_present(registers, ids, started.limits), "goal")
    registers.put_all(dict.fromkeys(ids, 1), "torque")
    limp = [servo for servo, on in registers.get_all(ids, "torque").items() if on != 1]
    if limp:
        raise ServoFault(
            "servos did not switch their motor on: "
            + ", ".join(f"{registers.label(i)} (error flags 0x{registers.flags.get(i, 0):02X})" for i in limp),
            hint="switch their power off and on",
            port=registers.port.link.path,
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
        if not -OUT_OF_TURN * turn <= value < (1 + OUT_OF_TURN) * turn:
            raise ServoFault(
                f"servo {registers.label(servo)} reads position {value}, outside one turn of {turn} steps",
                hint="clear its offset and turn count: switch its power off and on",
                port=registers.port.link.path,
                servo_ids=(servo,),
            )
    return {servo: min(max(value, limits[servo][0]), limits[servo][1]) for servo, value in ticks.items()}


# ---------------------------------------------------------------------- down


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
                return
    except PortLost as error:
        lost = error
    which = ", ".join(map(registers.label, open_ids))
    kind = NoReply if lost is None else PortLost
    raise kind(
        f"not confirmed off on {registers.port.link.path}: {which}" + (f" ({lost})" if lost else ""),
        hint="switch the servos' power off: they have no watchdog that would",
        port=registers.port.link.path,
        servo_ids=tuple(open_ids),
    ) from lost


def _confirmed_off(registers: Registers, servo: int) -> bool:
    try:
        registers.tell(servo, "torque", 0)
        return registers.get(servo, "torque", tries=1) == 0
    except BusError:
        return False
