"""Cross-checks the linkages of a robot with its channels, and finds the files they name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import Parameters, did_you_mean
from controller.robot.formulas import formula_faults
from controller.robot.linkages.kind import LINKAGES, LinkageSettings
from controller.robot.linkages.linked_channels import LinkedChannels, input_names
from controller.robot.settings import ChannelSettings, RobotSettings
from drivers.base.errors import PluginError


def with_files(robot: RobotSettings, path: Path) -> RobotSettings:
    """Return the robot with absolute paths in its linkages; relative ones are relative to the robot file ``path``."""
    if not any(hasattr(linkage, "file") for linkage in robot.linkages):
        return robot
    linkages = [
        linkage.model_copy(update={"file": str(path.parent / file)})
        if (file := getattr(linkage, "file", None))
        else linkage
        for linkage in robot.linkages
    ]
    return robot.model_copy(update={"linkages": linkages})


def linkage_faults(robot: RobotSettings, parameters: Parameters) -> list[str]:
    """List faults: channels that follow nothing or two things, linkages of unknown channels, wrong inputs."""
    channels = {channel.name: channel for channel in robot.channels}
    linked = [name for linkage in robot.linkages for name in linkage.channels]
    faults = [
        f"channels[{i}]: {channel.name!r} needs one of mix, formula and anchor, or a linkage that names it"
        for i, channel in enumerate(robot.channels)
        if not channel.follows and channel.name not in linked
    ]
    names = [linkage.name for linkage in robot.linkages]
    for i, linkage in enumerate(robot.linkages):
        where = f"linkages[{i}]"
        if linkage.name in names[:i]:
            faults.append(f"{where}.name: {linkage.name!r} is taken")
        own = [*_channel_faults(where, linkage, channels, linked), *_input_faults(where, linkage, parameters)]
        faults += own or _making_faults(where, linkage, parameters)
    return faults


def _channel_faults(
    where: str, linkage: LinkageSettings, channels: dict[str, ChannelSettings], linked: list[str]
) -> Iterator[str]:
    for k, name in enumerate(linkage.channels):
        if name not in channels:
            yield f"{where}.channels[{k}]: no channel called {name!r}{did_you_mean(name, channels)}"
        elif channels[name].follows:
            yield f"{where}.channels[{k}]: {name!r} has a mix, formula or anchor of its own; remove it"
        elif linked.count(name) > 1:
            yield f"{where}.channels[{k}]: {name!r} is named twice"
    if len({channels[name].bus for name in linkage.channels if name in channels}) > 1:
        yield f"{where}.channels: lie on two buses; a linkage lies on one"


def _input_faults(where: str, linkage: LinkageSettings, parameters: Parameters) -> Iterator[str]:
    for key, name in input_names(linkage):
        try:
            parameters.index(name)
        except ParameterError as error:
            yield f"{where}.{key}: {error}"
    for key, each in linkage.inputs.items():
        if isinstance(each, str):
            yield from (f"{where}.inputs.{key}: {fault}" for fault in formula_faults(each, parameters)
                        if "unknown parameter" not in fault)  # fmt: skip


def _making_faults(where: str, linkage: LinkageSettings, parameters: Parameters) -> list[str]:
    """What is wrong with a linkage that only shows when it is made and at rest."""
    try:
        LINKAGES.get(linkage.kind)
    except PluginError:
        return []  # an unknown kind is reported elsewhere
    try:
        made = LinkedChannels.of(linkage, linkage.channels, parameters)
    except (ConfigError, ValueError) as error:
        return [f"{where}: {error}".replace("\n", "\n  ")]
    angles = made(parameters.neutral())
    if len(angles) != len(linkage.channels) or not np.isfinite(angles).all():
        return [f"{where}: gives {len(angles)} angles for {len(linkage.channels)} channels, or none at rest"]
    return [f"{where}: the neutral face is out of its reach"] if made.outside else []
