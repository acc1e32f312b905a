"""Warns of settings of robots that can be read but hardly be meant: ports, rates and speeds no hardware has."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence

from controller.robot.buses import BusSettings
from controller.robot.settings import RobotSettings
from drivers.base.errors import DriverError
from drivers.core.registry import SIMULATED
from drivers.tables.tables import ControlTable, load_table

_TOLERANCE = 0.03  # share by which two ends of a wire may differ in rate
_CLOCK_HZ = 12_000_000  # of the fastest chips of USB adapters (FTDI AN120: 12 MHz over 1, 1.5 or eighths from 2 on)
_SPARE = 1.005  # speeds are rounded in files


def robot_warnings(robots: Sequence[RobotSettings]) -> list[str]:
    """What is odd about robots that run together, each with its robot and key."""
    return [*_shared_ports(robots), *(line for robot in robots for line in (*_rates(robot), *_speeds(robot)))]


def _shared_ports(robots: Sequence[RobotSettings]) -> Iterator[str]:
    first: dict[str, str] = {}
    for robot in robots:
        for i, bus in enumerate(robot.buses):
            if bus.kind == SIMULATED:
                continue
            where = f"{robot.name}: buses[{i}].port"
            other = first.setdefault(os.path.realpath(bus.port), where)
            if other != where:
                yield f"{where}: {bus.port} is the port of {other.removesuffix('.port')}, too; a port has one bus"


def _rates(robot: RobotSettings) -> Iterator[str]:
    for i, bus in enumerate(robot.buses):
        where = f"{robot.name}: buses[{i}].baud"
        if bus.kind != SIMULATED and not _adapters_have(bus.baud):
            yield f"{where}: no USB adapter has {bus.baud} bits per second"
        for model, rates in _model_rates(robot, bus).items():
            if not any(abs(rate - bus.baud) <= _TOLERANCE * rate for rate in rates):
                known = ", ".join(map(str, sorted(rates)[-6:]))
                yield f"{where}: {model} cannot be set to {bus.baud} bits per second; its fastest are {known}"


def _adapters_have(baud: int) -> bool:
    eighths = 8 * _CLOCK_HZ
    divisors = (8, 12, max(round(eighths / baud), 16))
    return any(abs(eighths / divisor - baud) <= _TOLERANCE * baud for divisor in divisors)


def _model_rates(robot: RobotSettings, bus: BusSettings) -> dict[str, tuple[int, ...]]:
    """Rates of the models on a bus whose control tables are known."""
    tables = {channel.model: _table(channel.model) for channel in robot.on_bus(bus.name)}
    return {model: table.baud for model, table in tables.items() if table is not None}


def _speeds(robot: RobotSettings) -> Iterator[str]:
    for i, channel in enumerate(robot.channels):
        if (table := _table(channel.model)) is None:
            continue
        top = top_speed_deg_s(table)
        if channel.max_speed_deg_s > _SPARE * top:
            where = f"{robot.name}: channels[{i}].max_speed_deg_s"
            yield f"{where}: {channel.max_speed_deg_s:g} is beyond the {top:.0f} of {channel.model} without load"


def top_speed_deg_s(table: ControlTable) -> float:
    """No-load speed of a model."""
    register = "Present Speed" if "Present Speed" in table.items_by_name else "Present Velocity"
    steps = table.top_speed or table["Velocity Limit"].initial
    return math.degrees(steps * table[register].scale)


def _table(model: str) -> ControlTable | None:
    """The control table of a model; None for hobby servos and models of other packages."""
    try:
        return load_table(model)
    except DriverError:
        return None
