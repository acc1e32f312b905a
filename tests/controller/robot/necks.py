"""Necks whose linkages tests share, and the robot files of their servos."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.robot.linkages.rods import Rods

PLATE = np.array([[28.0, 0.0, -30.0], [-28.0, 0.0, -30.0]])
AXLE = np.array([[28.0, -70.0, -12.0], [-28.0, -70.0, -12.0]])
HORN = np.array([[0.0, 0.0, -18.0], [0.0, 0.0, -18.0]])
AXIS = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
NECK = f"""
[[linkages]]
name = "neck"
kind = "differential"
channels = ["left", "right"]
inputs.pitch = {{ headPitch = 40 }}
inputs.roll = "30 * headRoll"
plate = {PLATE.tolist()}
axle = {AXLE.tolist()}
horn = {HORN.tolist()}
axis = {AXIS.tolist()}
"""
ROBOT = """
name = "necks"
buses = [{ name = "neck", kind = "simulated", transport = "memory" }]
[profiles.servo]
bus = "neck"
model = "xl330-m288"
map = { at = [-90, 90], deg = [-90, 90] }
limit_deg = [-90, 90]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
[[channels]]
name = "left"
id = 1
profile = "servo"
[[channels]]
name = "right"
id = 2
profile = "servo"
"""


def face(**values: float) -> np.ndarray:
    vector = P.neutral()
    for name, value in values.items():
        vector[P.index(name)] = value
    return vector


def robot_file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def differential() -> Rods:
    return Rods.of(("pitch", "roll"), PLATE, AXLE, HORN, AXIS)


def stewart() -> Rods:
    """Six rods in pairs around a plate 60 mm above its servos, which lie in three pairs."""
    at = np.radians([50.0, 70.0, 170.0, 190.0, 290.0, 310.0])
    base = np.radians([10.0, 110.0, 130.0, 230.0, 250.0, 350.0])
    plate = np.stack([40 * np.cos(at), 0 * at, 40 * np.sin(at)], axis=1)
    axle = np.stack([50 * np.cos(base), 0 * base - 70.0, 50 * np.sin(base)], axis=1)
    axis = np.stack([np.cos(base), 0 * base, np.sin(base)], axis=1)
    side = np.array([1.0, -1.0] * 3)[:, None]
    horn = 18 * side * np.cross(axis, [0.0, 1.0, 0.0])
    return Rods.of(("x", "y", "z", "yaw", "pitch", "roll"), plate, axle, horn, axis)
