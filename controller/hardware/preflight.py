"""``omote preflight``: moves each servo of a head a little, one at a time, and compares it with the robot file.

Before a servo moves, its model, supply voltage, errors, limits, direction and position are read and compared. A servo
that differs is not moved. No servo moves on a bus where the torque of another one is on. A movement stops at the first
sign of load or error, or when the port fails, and the servo is switched off; if it does not confirm that, the preflight
ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from controller.base.parameters import Parameters
from controller.hardware.moving import NotMoved, Sampler, move_a_little
from controller.hardware.ports import BusPort, serve_bus
from controller.hardware.preflight_report import BusFindings, ChannelFindings, Preflight
from controller.robot.calibration import calibration_path
from controller.robot.channels import build_table, servo_specs
from controller.robot.settings import ChannelSettings, RobotSettings
from drivers.base.bus import Bus, ServoInfo, ServoSpec
from drivers.base.errors import BusError, DriverError
from drivers.base.shutdown import stop_on_signals
from drivers.core.registry import FAMILIES
from drivers.servos.bus import OwnSettings, ServoBus
from drivers.tables.tables import ControlTable, load_table
from drivers.tools.find_stops import StillOn

BY_DEG = 3.0
"""How far a servo is moved to either side."""
SPEED_DEG_S = 10.0
LOAD = 0.4
"""Fraction of the stall torque (or current) above which a movement stops."""
LIMIT_SLACK_DEG = 0.5
"""How much narrower than the limits of the file a servo's own limits may be, because of rounding to steps."""
MIN_RANGE = 0.75
"""Least fraction of a small movement that a servo must make."""
MAX_LAG_S = 0.25
MAX_TRIES = 3
"""Number of pings before a servo counts as silent: one reply may be lost."""
MIN_REPLIES = 8
"""Number of replies that are needed to judge the delays of an adapter."""

Ask = Callable[[ChannelSettings, str], bool | None]
"""Asks a person whether a channel moved as the text describes; returns None if nobody was asked."""


@dataclass(frozen=True)
class Options:
    """How a preflight moves. by_deg : to either side. load : fraction of the stall torque above which it stops."""

    by_deg: float = BY_DEG
    load: float = LOAD


def run_preflight(
    robot: RobotSettings,
    channels: Sequence[ChannelSettings],
    preflight: Preflight,
    parameters: Parameters,
    ask: Ask = lambda channel, text: None,
    options: Options = Options(),
    progress: Callable[[str], object] = lambda text: None,
) -> Preflight:
    """Check channels, bus by bus and servo by servo, and add what was found to ``preflight``.

    Raises PortError where a port cannot be used, StillOn where a servo was not confirmed off, and KeyboardInterrupt,
    after which the motor that was on is off. The findings until then are in ``preflight``.
    """
    for settings in robot.buses:
        own = [channel for channel in channels if channel.bus == settings.name]
        if not own:
            continue
        servos = servo_specs(robot.on_bus(settings.name))
        with serve_bus(settings, servos) as port:
            bus = BusFindings(settings.name, port.family, settings.port, settings.baud)
            preflight.buses.append(bus)
            if on := port.holding(servos):
                bus.faults.append(f"the torque of {', '.join(on)} is on: stop the program that drives them")
            for channel in own:
                progress(channel.name)
                check = _ChannelCheck(port, bus, channel, options, moves=not on)
                preflight.channels.append(check.findings)
                check.run(lambda c: towards(c, parameters), ask)
    _find_swaps(preflight)
    return preflight


def new_preflight(robot: RobotSettings, path: Path) -> Preflight:
    """Create a preflight without findings; ``path`` : the robot file, which is hashed with its calibration."""
    files = [path] + ([calibration_path(robot.calibration, path)] if robot.calibration is not None else [])
    return Preflight(robot.name, path, tuple(files))


def towards(channel: ChannelSettings, parameters: Parameters) -> str:
    """Describe what an increasing angle does to the face, as ``"jawOpen grows"``; empty where that is not known."""
    table = build_table([channel], parameters)
    slopes = np.abs(table.linear[0])
    for best in np.argsort(-slopes, kind="stable")[: np.count_nonzero(slopes)]:
        for end in (parameters.high[best], parameters.low[best]):
            values = np.zeros(len(parameters.names))
            values[best] = end
            change = float((table.angles(values)[0] - table.neutral_rad)[0]) * end
            if change:
                return f"{parameters.names[best]} {'grows' if change > 0 else 'falls'}"
    return ""


class _ChannelCheck:
    """Checks one channel and fills in its findings."""

    def __init__(
        self, port: BusPort, bus: BusFindings, channel: ChannelSettings, options: Options, *, moves: bool
    ) -> None:
        self._port, self._bus, self._channel, self._options, self._moves = port, bus, channel, options, moves
        self._still_on: StillOn | None = None
        self.findings = ChannelFindings(
            channel.name, channel.bus, channel.id, channel.model, limit_deg=channel.limit_deg
        )

    def run(self, describe: Callable[[ChannelSettings], str], ask: Ask) -> None:
        """Read and compare the servo's state, and move the servo if that is safe."""
        if FAMILIES.get(self._port.family).hobby:
            self.findings.skipped = "its board measures nothing; look at it with omote calibrate"
            return
        (spec,) = servo_specs([self._channel])
        slow = replace(spec, max_speed_rad_s=min(spec.max_speed_rad_s, math.radians(2.0 * SPEED_DEG_S)))
        try:
            with self._port.bus([slow]) as bus, stop_on_signals(bus.close):
                if self._compare(bus, spec) and not self.findings.faults and self._moves:
                    self._move(bus, describe, ask)
                elif not self.findings.skipped:
                    self.findings.skipped = "not moved"
        except BusError as error:
            if self._still_on is not None:  # closing the bus has tried again and raised another error
                raise self._still_on from error
            self._fault(f"{error}" + (f" ({error.hint})" if error.hint else ""))

    def _fault(self, text: str) -> None:
        self.findings.faults.append(text)

    # ------------------------------------------------------------------ comparing

    def _compare(self, bus: Bus, spec: ServoSpec) -> bool:
        """Compare the servo's state with the file; return whether it is safe to move."""
        found = next((info for _ in range(MAX_TRIES) for info in bus.discover([spec.id])), None)
        if found is None:
            self._fault("does not answer")
            return False
        findings = self.findings
        findings.found_model, findings.firmware = found.model, found.firmware
        if not self._is_model(found):
            self._fault(f"is {found.model}, the file says {self._channel.model}")
            return False
        if not isinstance(bus, ServoBus):
            findings.skipped = "this kind of bus reports nothing of its servos; check them with omote calibrate"
            return False
        own = bus.own_settings(spec.id)
        self._compare_state(found, own)
        self._compare_position(bus, own)
        self._compare_answers(bus)
        return True

    def _is_model(self, found: ServoInfo) -> bool:
        wanted = load_table(self._channel.model)
        return found.model_number == wanted.number

    def _compare_state(self, found: ServoInfo, own: OwnSettings) -> None:
        """Compare supply voltage, temperature, errors and torque."""
        findings = self.findings
        if found.torque:
            self._fault("its torque is on: stop the program that drives it")
        if found.torque is None:
            self._fault("does not say whether its torque is on")
        if found.hardware_error:
            self._fault(f"reports hardware error 0x{found.hardware_error:02X}")
        findings.temperature_c = math.nan if found.temperature_c is None else found.temperature_c
        if found.voltage_v is None:
            return
        findings.voltage_v = found.voltage_v
        least, most = self._supply(own)
        if found.voltage_v < least:
            self._fault(f"its supply is {found.voltage_v:.1f} V, it needs {least:.1f} V")
        elif found.voltage_v > most:
            self._fault(f"its supply is {found.voltage_v:.1f} V, it takes {most:.1f} V at most")

    def _supply(self, own: OwnSettings) -> tuple[float, float]:
        """Lowest and highest supply voltage, V, that the file, the maker and the servo itself allow."""
        motor = load_table(self._channel.model).motor
        least = self._port.options.get("min_voltage_v") or (0.9 * motor.lowest_v if motor else 0.0)
        return max(float(least), own.least_voltage_v), 1.1 * motor.highest_v if motor else math.inf

    def _compare_position(self, bus: ServoBus, own: OwnSettings) -> None:
        """Compare its direction, its own limits and its position."""
        findings, (low, high) = self.findings, self._channel.limit_deg
        findings.homing_offset_ticks = own.offset_ticks
        findings.own_limit_deg = math.degrees(own.low_rad), math.degrees(own.high_rad)
        if own.reverse:
            self._fault("its own drive mode reverses it, which omote undoes at start: set reverse in the file instead")
        if own.low_rad > math.radians(low + LIMIT_SLACK_DEG) or own.high_rad < math.radians(high - LIMIT_SLACK_DEG):
            first, last = findings.own_limit_deg
            self._fault(f"its own limits are {first:.1f} to {last:.1f}, limit_deg is {low:g} to {high:g}")
        position = bus.read().position_rad[0]
        findings.position_deg = math.degrees(position)
        if math.isnan(position):
            self._fault("does not say where it is")
        elif not low - LIMIT_SLACK_DEG <= findings.position_deg <= high + LIMIT_SLACK_DEG:
            self._fault(f"stands at {findings.position_deg:.1f}, outside limit_deg {low:g} to {high:g}")

    def _compare_answers(self, bus: ServoBus) -> None:
        """Judge the adapter's delay, once for each bus."""
        if not math.isnan(self._bus.answer_ms):
            return
        for _ in range(MIN_REPLIES):
            bus.discover(list(bus.ids))
        if bus.reply_delay_s is not None:
            self._bus.answer_ms = 1e3 * bus.reply_delay_s
        message, hint = bus.slow_answers()
        if message:
            self._bus.faults.append(f"{message}; try: {hint}")

    # ------------------------------------------------------------------ moving

    def _move(self, bus: Bus, describe: Callable[[ChannelSettings], str], ask: Ask) -> None:
        findings, by = self.findings, math.radians(self._options.by_deg)
        low, high = (math.radians(deg) for deg in self._channel.limit_deg)
        bus.start()
        sampler = Sampler(bus, self._options.load, _full_current_a(load_table(self._channel.model)))
        try:
            moved = move_a_little(sampler, by, math.radians(SPEED_DEG_S), low, high)
        except NotMoved as error:
            self._fault(str(error))
            moved = error.moved
        finally:
            try:
                switch_off(bus)
            except StillOn as still_on:
                self._still_on = still_on
                raise
        findings.wanted_deg, findings.moved_deg = math.degrees(moved.wanted_rad), math.degrees(moved.moved_rad)
        findings.lag_ms, findings.least_voltage_v = 1e3 * moved.lag_s, moved.least_voltage_v
        findings.peak_current_a, findings.peak_load = moved.peak_current_a, moved.peak_load
        if findings.faults:
            return
        if moved.along < 0.0:
            self._fault("moves against its goals: its position and its motor have opposite directions")
        elif moved.moved_rad < MIN_RANGE * moved.wanted_rad:
            self._fault(f"went {findings.moved_deg:.1f} of {findings.wanted_deg:.1f} degrees")
        if moved.lag_s > MAX_LAG_S:
            self._fault(f"is {findings.lag_ms:.0f} ms behind its goals")
        self._ask(describe, ask)

    def _ask(self, describe: Callable[[ChannelSettings], str], ask: Ask) -> None:
        """Ask a person whether the right part moved in the right direction, which no servo can measure."""
        shows = describe(self._channel)
        text = f"first as if {shows.replace('grows', 'grew').replace('falls', 'fell')}" if shows else "to and fro"
        said = ask(self._channel, text)
        self.findings.seen = "not asked" if said is None else "right" if said else "wrong"
        if said is False:
            self._fault(
                "moves another part, or the wrong way, says who looked at it: swapped ids, or reverse in the file"
            )


def switch_off(bus: Bus) -> None:
    """Stop a bus, trying twice. Raises StillOn where a servo was not confirmed off."""
    try:
        bus.stop()
    except DriverError:
        try:
            bus.stop()
        except DriverError as error:
            hint = error.hint or "switch the servos' power off"
            raise StillOn(str(error), hint=hint, servo_ids=getattr(error, "servo_ids", ())) from error


def _full_current_a(table: ControlTable) -> float:
    """Stall current, A; NaN where the maker gives none."""
    return table.motor.stall_a if table.motor else math.nan


def _find_swaps(preflight: Preflight) -> None:
    """Add a fault for pairs whose ids look swapped: each has the other's model, or fits only its limits."""
    rows = preflight.channels
    for i, one in enumerate(rows):
        for other in rows[i + 1 :]:
            if one.bus == other.bus and (_has_model_of(one, other) or _is_placed_as(one, other)):
                for row, named in ((one, other), (other, one)):
                    row.faults.append(f"its id and that of {named.name!r} ({named.id}) look swapped")


def _has_model_of(one: ChannelFindings, other: ChannelFindings) -> bool:
    wanted = [_usual_name(row.model) for row in (one, other)]
    found = [_usual_name(row.found_model) for row in (one, other)]
    return wanted[0] != wanted[1] and "" not in found and found == wanted[::-1]


def _usual_name(model: str) -> str:
    """Canonical name of a model; empty where it is unknown."""
    try:
        return load_table(model).model if model else ""
    except DriverError:
        return ""


def _is_placed_as(one: ChannelFindings, other: ChannelFindings) -> bool:
    """Whether each stands outside its own limits, but within those of the other."""

    def inside(position: float, limits: tuple[float, float]) -> bool:
        return limits[0] <= position <= limits[1]

    own = inside(one.position_deg, one.limit_deg) or inside(other.position_deg, other.limit_deg)
    return not own and inside(one.position_deg, other.limit_deg) and inside(other.position_deg, one.limit_deg)
