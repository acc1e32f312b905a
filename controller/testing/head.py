"""Simulates all buses of a robot file, for tests of programs that drive a whole robot."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import tomli_w

from controller.base.config import read_toml
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.buses import SIMULATION
from controller.robot.calibration import calibration_path
from controller.robot.channels import servo_specs
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from controller.tools.simulate import far_end
from drivers.base.bus import ServoSpec
from drivers.boards.hobby import PulseScale
from drivers.core.scale import Scale
from drivers.sim.serving.simulated import ServoView
from drivers.tables.tables import load_table
from drivers.testing import ServoBoard, ServoBus
from drivers.testing.opening import open_line

Hardware = ServoBus | ServoBoard


class RobotHead:
    """The simulated hardware of a robot.

    buses : servos or board of each bus, by the bus's name in the robot file.
    file : a copy of the robot file with these ports, for ``omote run`` and other programs.
    """

    def __init__(self, robot: RobotSettings, buses: dict[str, Hardware], file: Path) -> None:
        self._robot, self.buses, self.file = robot, buses, file

    @property
    def port(self) -> str:
        """The port of its only bus, or of the first."""
        return next(iter(self.buses.values())).port

    def servo(self, channel: str) -> ServoView:
        """Return the state of a channel's servo. Raises KeyError: no such channel, or its board measures nothing."""
        for each in self._robot.channels:
            bus = self.buses[each.bus]
            if each.name == channel and isinstance(bus, ServoBus):
                return bus.servo(each.id)
        raise KeyError(f"robot {self._robot.name} has no servo {channel!r} whose state is known")

    def fault(self, *specs: str) -> None:
        """Set faults on all buses. Raises DriverError: one cannot be read."""
        for bus in self.buses.values():
            bus.fault(*specs)

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind on all buses; None: all."""
        for bus in self.buses.values():
            bus.clear(kind)

    def forget(self) -> None:
        """Clear the records."""
        for bus in self.buses.values():
            bus.forget()

    def never_beyond_limits(self) -> None:
        """Assert that no servo got a goal, or moved, beyond ``limit_deg`` of its channel.

        Outputs of a board that does not use pulses are not checked.
        """
        __tracebackhide__ = True
        for name, bus in self.buses.items():
            specs = servo_specs(self._robot.on_bus(name))
            if isinstance(bus, ServoBus):
                bus.never_beyond_limits(_ticks(specs))
            elif all(output.key == "target_us" for output in bus.channels.values()):
                bus.never_beyond_limits(_pulses(specs))

    def torque_off_at_exit(self) -> None:
        """Assert that the torque of every servo is off."""
        __tracebackhide__ = True
        for bus in self.buses.values():
            bus.torque_off_at_exit()

    def no_jump(self, deg: float = 5.0, deg_s: float = 200.0) -> None:
        """Assert that no servo jumped (:meth:`drivers.testing.ServoBus.no_jump`); for boards, 1 degree is 11.1 us."""
        __tracebackhide__ = True
        for bus in self.buses.values():
            if isinstance(bus, ServoBus):
                bus.no_jump(deg, deg_s)
            else:
                bus.no_jump(_US_PER_DEG * deg)

    def bus_load_below(self, share: float, over_s: float = 0.2) -> None:
        """Assert that no bus was busier than the fraction ``share`` in any ``over_s`` seconds."""
        __tracebackhide__ = True
        for bus in self.buses.values():
            bus.bus_load_below(share, over_s)

    def close(self) -> None:
        """Close and remove the ports."""
        for bus in self.buses.values():
            bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


_US_PER_DEG = 11.1
"""Pulse width per degree of a common hobby servo: 1000 us for 90 degrees."""


def _ticks(specs: Sequence[ServoSpec]) -> dict[int, tuple[float, float]]:
    scale = Scale(specs, [load_table(spec.model) for spec in specs])
    return {spec.id: (int(scale.low[i]), int(scale.high[i])) for i, spec in enumerate(specs)}


def _pulses(specs: Sequence[ServoSpec]) -> dict[int, tuple[float, float]]:
    scale = PulseScale(specs)
    return {spec.id: (scale.low_us[i] - 1e-3, scale.high_us[i] + 1e-3) for i, spec in enumerate(specs)}


def open_head(robot: str, *, folder: Path, faults: Iterable[str] = (), port: str = "", wire: bool = False) -> RobotHead:
    """Open the simulated hardware of a robot, each bus at its own port, with the settings the robot's drivers expect.

    robot : a name from configs/robots, or a file. folder : the changed robot file is written to a new folder in it.
    faults, port, wire : for all buses; see :func:`drivers.testing.open_servos`.

    Raises ConfigError: no such robot, or its file is wrong. DriverError: as ``open_servos``.
    """
    path = find_config("robots", robot)
    settings = load_robot(path, PARAMETERS)
    with ExitStack() as stack:
        buses: dict[str, Hardware] = {}
        for bus in settings.buses:
            line = far_end(bus, settings.on_bus(bus.name))
            opened = buses[bus.name] = open_line(line, bus.baud, faults=faults, port=port, wire=wire)
            stack.callback(opened.close)
        file = Path(tempfile.mkdtemp(dir=folder)) / f"{path.stem}.toml"
        file.write_text(tomli_w.dumps(_with_ports(path, settings, buses)), encoding="utf-8")
        stack.pop_all()
    return RobotHead(settings, buses, file)


def _with_ports(path: Path, settings: RobotSettings, buses: dict[str, Hardware]) -> dict[str, Any]:
    """Return the table of a robot file with real ports instead of simulated buses."""
    table = read_toml(path)
    for entry, bus in zip(table["buses"], settings.buses, strict=True):
        for key in SIMULATION:
            entry.pop(key, None)
        entry |= {"kind": bus.family, "port": buses[bus.name].port}
    if settings.vocabularies:
        named = (find_config("vocabularies", name, beside=path) for name in settings.vocabularies)
        table["vocabularies"] = [str(file.resolve()) for file in named]
    if settings.calibration is not None:
        table["calibration"] = str(calibration_path(settings.calibration, path).resolve())
    return table
