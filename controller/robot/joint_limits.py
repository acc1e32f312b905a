"""Computes joint limits for a robot description: how far and how fast servos turn the joints of a head."""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Parameters
from controller.robot.channels import ChannelTable, build_table
from controller.robot.settings import RobotSettings
from surface.head.model.joints import Joint, JointLimit

_STEPS = 401


def joint_limits(robot: RobotSettings, parameters: Parameters, joints: list[Joint]) -> dict[str, JointLimit]:
    """Return the limits of the joints that servos of the robot turn, by parameter.

    Each parameter is moved alone through its range. The joint's range ends where the servo that follows it furthest
    meets its own limit; its speed is that servo's speed at the steepest part of its curve.
    """
    found: dict[str, JointLimit] = {}
    for bus in robot.buses:
        channels = robot.on_bus(bus.name)
        table = build_table(channels, parameters)
        for joint in joints:
            limit = _limit(table, parameters, joint)
            if limit is not None:
                found[joint.name] = limit
    return found


def _limit(table: ChannelTable, parameters: Parameters, joint: Joint) -> JointLimit | None:
    index = parameters.index(joint.name)
    low, high = float(parameters.low[index]), float(parameters.high[index])
    amounts, values, rows = np.linspace(low, high, _STEPS), parameters.neutral(), []
    for amount in amounts:
        values[index] = amount
        rows.append(table.curves(table.mixed(values)).copy())
    angles = np.array(rows)
    slopes = np.abs(np.diff(angles, axis=0)) / (amounts[1] - amounts[0])
    servo = int(slopes.max(axis=0).argmax())
    steepest = float(slopes[:, servo].max())
    if steepest < 1e-6:
        return None
    follows = (angles[:, servo] >= table.low_rad[servo] - 1e-9) & (angles[:, servo] <= table.high_rad[servo] + 1e-9)
    follows[1:-1] &= (slopes[1:, servo] > 1e-6) | (slopes[:-1, servo] > 1e-6)
    follows[[0, -1]] &= slopes[[0, -1], servo] > 1e-6
    reached = amounts[follows]
    full_rad = joint.limit.high_rad / high
    speed = float(table.max_speed_rad_s[servo]) / steepest * full_rad
    return JointLimit(float(reached.min()) * full_rad, float(reached.max()) * full_rad, speed)
