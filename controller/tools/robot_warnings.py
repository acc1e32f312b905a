"""Warns of robot settings that are valid but probably wrong: shared ports, rates and speeds that no hardware has."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence

from controller.robot.buses import BusSettings
from controller.robot.settings import RobotSettings
from drivers.base.errors import DriverError
from drivers.core.registry import SIMULATED
from drivers.tables.tables import ControlTable, load_table

_BAUD_TOLERANCE = 0.03  # relative difference of the baud rates at the two ends of a wire that still works
_CLOCK_HZ = 12_000_000  # baud rate of USB adapters with divisor 1 (FTDI AN120: divisors 1, 1.5, and eighths from 2 on)
_ROUNDING_FACTOR = 1.005  # speeds in files are rounded


def robot_warnings(robots: Sequence[RobotSettings]) -> list[str]:
    """Return the warnings about robots that run together, each with the robot's name and the key."""
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
                yield f"{where}: {bus.port} is also the port of {other.removesuffix('.port')}; a port has one bus"


def _rates(robot: RobotSettings) -> Iterator[str]:
    for i, bus in enumerate(robot.buses):
        where = f"{robot.name}: buses[{i}].baud"
        if bus.kind != SIMULATED and not _adapter_supports(bus.baud):
            yield f"{where}: no USB adapter has {bus.baud} bits per second"
        for model, rates in _model_rates(robot, bus).items():
            if not any(abs(rate - bus.baud) <= _BAUD_TOLERANCE * rate for rate in rates):
                known = ", ".join(map(str, sorted(rates)[-6:]))
                yield f"{where}: {model} cannot be set to {bus.baud} bits per second; its fastest are {known}"


def _adapter_supports(baud: int) -> bool:
    eighths = 8 * _CLOCK_HZ
    divisors = (8, 12, max(round(eighths / baud), 16))
    return any(abs(eighths / divisor - baud) <= _BAUD_TOLERANCE * baud for divisor in divisors)


def _model_rates(robot: RobotSettings, bus: BusSettings) -> dict[str, tuple[int, ...]]:
    """Return the baud rates of the models on a bus, for models whose control table is known."""
    tables = {channel.model: _table(channel.model) for channel in robot.on_bus(bus.name)}
    return {model: table.baud for model, table in tables.items() if table is not None}


def _speeds(robot: RobotSettings) -> Iterator[str]:
    for i, channel in enumerate(robot.channels):
        if (table := _table(channel.model)) is None:
            continue
        top = top_speed_deg_s(table)
        if channel.max_speed_deg_s > _ROUNDING_FACTOR * top:
            where = f"{robot.name}: channels[{i}].max_speed_deg_s"
            yield f"{where}: {channel.max_speed_deg_s:g} is above the {top:.0f} of {channel.model} without load"


def top_speed_deg_s(table: ControlTable) -> float:
    """Return the no-load speed of a model."""
    register = "Present Speed" if "Present Speed" in table.items_by_name else "Present Velocity"
    steps = table.top_speed or table["Velocity Limit"].initial
    return math.degrees(steps * table[register].scale)


def _table(model: str) -> ControlTable | None:
    """Return the control table of a model; None for hobby servos and models of other packages."""
    try:
        return load_table(model)
    except DriverError:
        return None
