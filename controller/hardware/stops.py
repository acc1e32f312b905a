"""``omote calibrate --find-stops``: finds the end stops of servos and compares the robot file's limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.table import Table

from controller.hardware.ports import BusPort, serve_bus
from controller.robot.channels import servo_specs
from controller.robot.settings import ChannelSettings, RobotSettings
from drivers.base.errors import BusError, DriverError
from drivers.core.registry import FAMILIES
from drivers.tools.find_stops import TORQUE, Found, StillOn, find_stops, why_not

BEYOND_DEG = 15.0
"""How far beyond the limits of the file stops are searched."""
MAX_SPREAD_DEG = 1.0
"""Greatest difference between two approaches of one stop."""


@dataclass(frozen=True)
class ChannelStops:
    """The stops of one channel, in the degrees of the robot file.

    low_deg, high_deg : where the servo stopped; None where it met no stop.
    faults : what does not fit the file, or why nothing was found; empty if there is none.
    """

    channel: str
    low_deg: float | None = None
    high_deg: float | None = None
    peak_current_a: float = math.nan
    faults: tuple[str, ...] = ()

    def limit_deg(self, margin_deg: float) -> tuple[float, float] | None:
        """Limits inside both stops; None where one is not known or nothing lies between them."""
        if self.low_deg is None or self.high_deg is None:
            return None
        low, high = self.low_deg + margin_deg, self.high_deg - margin_deg
        return (round(low, 1), round(high, 1)) if low < high else None


def find_robot_stops(
    robot: RobotSettings,
    channels: Sequence[ChannelSettings],
    *,
    torque: float = TORQUE,
    beyond_deg: float = BEYOND_DEG,
    progress: Callable[[str], object] = lambda text: None,
) -> list[ChannelStops]:
    """Find the stops of channels one by one; the torque of each servo is switched off after its search.

    A bus on which the torque of any servo is on is left alone.

    torque : fraction of the full current. beyond_deg : how far beyond its limits in the file a servo is moved.

    Raises PortError, and StillOn where a servo was not confirmed off; other errors of a servo are in its ``faults``.
    """
    found: list[ChannelStops] = []
    for bus in robot.buses:
        on_bus = [channel for channel in channels if channel.bus == bus.name]
        if not on_bus:
            continue
        servos = servo_specs(robot.on_bus(bus.name))
        with serve_bus(bus, servos) as port:
            if on := port.holding(servos):
                why = f"not looked for: the torque of {', '.join(on)} is on; stop the program that drives them"
                found += [ChannelStops(channel.name, faults=(why,)) for channel in on_bus]
                continue
            found += [_channel_stops(port, channel, torque, beyond_deg, progress) for channel in on_bus]
    return found


def _channel_stops(
    port: BusPort, channel: ChannelSettings, torque: float, beyond_deg: float, progress: Callable[[str], object]
) -> ChannelStops:
    if FAMILIES.get(port.family).hobby:
        return ChannelStops(channel.name, faults=("a hobby servo measures neither its position nor its current",))
    try:
        if reason := why_not(channel.model):
            return ChannelStops(channel.name, faults=(reason,))
        (servo,) = servo_specs([channel])
        low, high = channel.limit_deg
        reach = math.radians(low - beyond_deg), math.radians(high + beyond_deg)
        margin_s = port.options.get("margin_s")
        found = find_stops(port.port, port.baud, servo, reach, torque=torque, progress=progress, margin_s=margin_s)
    except StillOn:
        raise
    except BusError as error:
        return ChannelStops(channel.name, faults=(f"{error}" + (f" ({error.hint})" if error.hint else ""),))
    except DriverError as error:
        if type(error) is not DriverError:
            raise
        return ChannelStops(channel.name, faults=(str(error),))
    return checked_stops(channel, found, beyond_deg)


def checked_stops(channel: ChannelSettings, found: Found, beyond_deg: float) -> ChannelStops:
    """Return the stops that were found, with faults where they do not fit the channel's limits."""
    ends = [None if angle is None else math.degrees(angle) for angle in (found.low_rad, found.high_rad)]
    low, high = ends
    faults = []
    if low is None or high is None:
        side = "either side" if low is high else "the low side" if low is None else "the high side"
        faults.append(f"no stop on {side}, up to {beyond_deg:g} degrees beyond limit_deg or the end of its turn")
    if math.degrees(found.spread_rad) > MAX_SPREAD_DEG:
        faults.append(f"two approaches of one stop differ by {math.degrees(found.spread_rad):.1f} degrees")
    if low is not None and high is not None and high - low < MAX_SPREAD_DEG:
        return ChannelStops(channel.name, None, None, found.peak_current_a, ("it is stuck: it moved to neither side",))
    if low is not None and channel.limit_deg[0] < low:
        faults.append(f"limit_deg begins at {channel.limit_deg[0]:g}, beyond the stop at {low:.1f}")
    if high is not None and channel.limit_deg[1] > high:
        faults.append(f"limit_deg ends at {channel.limit_deg[1]:g}, beyond the stop at {high:.1f}")
    return ChannelStops(channel.name, low, high, found.peak_current_a, tuple(faults))


def stops_table(found: Sequence[ChannelStops], channels: Sequence[ChannelSettings], margin_deg: float) -> Table:
    """Table of the stops, the limits of the file, and limits that keep a margin to the stops."""
    limits = {channel.name: channel.limit_deg for channel in channels}
    table = Table("channel", "low stop", "high stop", "limit_deg", "with margin", "current", "")
    for row in found:
        inside = row.limit_deg(margin_deg)
        table.add_row(
            row.channel,
            _degrees(row.low_deg),
            _degrees(row.high_deg),
            "[{:g}, {:g}]".format(*limits[row.channel]).replace("[", r"\["),
            "" if inside is None else "[{:g}, {:g}]".format(*inside).replace("[", r"\["),
            "" if math.isnan(row.peak_current_a) else f"{row.peak_current_a:.2f} A",
            "; ".join(row.faults) or "as the file says",
        )
    return table


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
