"""Reads robot files, checks references between their tables, and applies the calibration that they name."""

from __future__ import annotations

from pathlib import Path

from controller.base.config import load
from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import Parameters, did_you_mean
from controller.base.paths import find_config
from controller.robot.calibration import calibrated, calibration_path
from controller.robot.formulas import formula_faults
from controller.robot.linkages.checks import linkage_faults, with_files
from controller.robot.settings import RobotSettings
from drivers import check_model
from drivers.base.errors import DriverError
from drivers.core.registry import FAMILIES


def load_robot(path: Path, parameters: Parameters) -> RobotSettings:
    """Read and cross-check a robot file, with its calibration; :func:`robot_parameters` gives what its mixes name.

    Raises ConfigError that lists every fault: unknown keys and parameters, repeated names and ids, missing buses.
    """

    def faults(read: RobotSettings) -> list[str]:
        try:
            known = robot_parameters(read, path, parameters)
        except ConfigError as error:
            return [f"vocabularies: {error}".replace("\n", "\n  "), *_repeated(read), *_rules(read)]
        found = _repeated(read) + _references(read, known) + _rules(read)
        return found + linkage_faults(with_files(read, path), known)

    robot = with_files(load(path, RobotSettings, faults), path)
    if robot.calibration is None:
        return robot
    return calibrated(robot, calibration_path(robot.calibration, path))


def robot_parameters(robot: RobotSettings, path: Path, parameters: Parameters) -> Parameters:
    """Return ``parameters``, followed by the parameters that the vocabularies of the robot file ``path`` add.

    Raises ConfigError: a vocabulary cannot be found, or it is wrong.
    """
    return parameters.with_files(find_config("vocabularies", name, beside=path) for name in robot.vocabularies)


def _repeated(robot: RobotSettings) -> list[str]:
    faults = []
    seen: dict[tuple[str, object], int] = {}
    for i, channel in enumerate(robot.channels):
        for key in (("name", channel.name), ("id", (channel.bus, channel.id))):
            first = seen.setdefault(key, i)
            if first != i:
                faults.append(f"channels[{i}].{key[0]}: {getattr(channel, key[0])!r} is taken by channels[{first}]")
    names = [bus.name for bus in robot.buses]
    faults += [f"buses[{i}].name: {n!r} is taken" for i, n in enumerate(names) if n in names[:i]]
    return faults


def _models(robot: RobotSettings) -> list[str]:
    """List faults: servo models that their bus does not drive, and ``pulse`` of servos that are not hobby servos."""
    faults = []
    buses = {bus.name: bus for bus in robot.buses}
    for i, channel in enumerate(robot.channels):
        if (bus := buses.get(channel.bus)) is None:
            continue
        try:
            check_model(bus.family, channel.model)
        except DriverError as error:
            faults.append(f"channels[{i}].model: {error}" + (f" ({error.hint})" if error.hint else ""))
        if channel.pulse is not None and not FAMILIES.get(bus.family).hobby:
            faults.append(f"channels[{i}].pulse: is for hobby servos; {bus.name!r} is a {bus.family} bus")
    return faults


def _references(robot: RobotSettings, parameters: Parameters) -> list[str]:
    buses = {bus.name for bus in robot.buses}
    used = {channel.bus for channel in robot.channels}
    faults = [f"buses[{i}]: no channel is on {b.name!r}" for i, b in enumerate(robot.buses) if b.name not in used]
    faults += _models(robot)
    for i, channel in enumerate(robot.channels):
        if channel.profile is not None and channel.profile not in robot.profiles:
            known = did_you_mean(channel.profile, robot.profiles)
            faults.append(f"channels[{i}].profile: no profile called {channel.profile!r}{known}")
        if channel.bus not in buses:
            faults.append(f"channels[{i}].bus: no bus called {channel.bus!r} (buses: {', '.join(sorted(buses))})")
        named = [(f"mix.{name}", name) for name in channel.mix]
        if channel.formula is not None:
            faults += [f"channels[{i}].formula: {fault}" for fault in formula_faults(channel.formula, parameters)]
        if (anchor := channel.anchor) is not None:
            named += [("anchor.like", anchor.like)] if anchor.like is not None else []
            if isinstance(point := anchor.point, str) and point not in robot.landmarks:
                known = did_you_mean(point, robot.landmarks)
                faults.append(f"channels[{i}].anchor.point: no landmark called {point!r}{known}")
        for key, name in named:
            try:
                parameters.index(name)
            except ParameterError as error:
                faults.append(f"channels[{i}].{key}: {error}")
        low, high = channel.limit_deg
        faults += [
            f"channels[{i}].map.deg: {deg:g} lies outside limit_deg [{low:g}, {high:g}]"
            for deg in channel.map.deg
            if not low <= deg <= high
        ]
    return faults


def _rules(robot: RobotSettings) -> list[str]:
    """List faults: rules that name unknown channels, or pairs of channels on different buses."""
    bus = {channel.name: channel.bus for channel in robot.channels}
    faults = [
        f"{key}: no channel called {name!r}{did_you_mean(name, bus)}"
        for key, name in robot.rules.mentions()
        if name not in bus
    ]
    for i, rule in enumerate(robot.rules.prevent):
        if rule.channel == rule.other:
            faults.append(f"rules.prevent[{i}].other: is the channel itself")
        elif bus.get(rule.channel) != bus.get(rule.other) and {rule.channel, rule.other} <= set(bus):
            faults.append(f"rules.prevent[{i}].other: {rule.other!r} is on another bus than {rule.channel!r}")
    return faults
