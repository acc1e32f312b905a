"""What a robot would be sent, without opening a port."""

from __future__ import annotations

import numpy as np

from controller.channels import build_table
from controller.parameters import Parameters
from controller.robot import ChannelSettings, RobotSettings


def plan_rows(robot: RobotSettings, parameters: Parameters) -> list[dict[str, str]]:
    """One row a channel: servo, mix, travel, limits, and the angle of the neutral face."""
    table = build_table(robot.channels, parameters)
    neutral, _ = table.angles(parameters.neutral())
    return [
        {
            "channel": channel.name,
            "servo": f"{channel.bus} id {channel.id}, {channel.model}",
            "mix": _mix(channel),
            "travel (deg)": f"{min(channel.map.deg):g} to {max(channel.map.deg):g}",
            "limits (deg)": f"{channel.limit_deg[0]:g} to {channel.limit_deg[1]:g}",
            "speed (deg/s)": f"{channel.max_speed_deg_s:g}",
            "neutral (deg)": f"{np.degrees(angle):.1f}",
        }
        for channel, angle in zip(robot.channels, neutral, strict=True)
    ]


def _mix(channel: ChannelSettings) -> str:
    if channel.anchor is not None:
        point = channel.anchor.point
        return "pulls at " + (point if isinstance(point, str) else ", ".join(f"{x:g}" for x in point))
    words = " ".join(term.words(name) for name, term in channel.mix.items()).removeprefix("+")
    return words if channel.join == "sum" else f"{channel.join} of {words}"
