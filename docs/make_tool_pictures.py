"""Draws docs/pictures/calibrate.svg: the screen of ``omote calibrate`` half way through a head of 24 servos."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from rich.console import Console

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.robot import load_robot
from controller.tools.calibrate_screen import CalibrationScreen

CHANNELS = 8


def screen() -> CalibrationScreen:
    """Some channels captured, one marked, the extremes being followed."""
    channels = load_robot(find_config("robots", "head24"), PARAMETERS).channels[:CHANNELS]
    low, high = np.array([channel.limit_deg for channel in channels]).T
    state = CalibrationScreen(channels)
    rest = 0.1 * (low + high)
    state.set_angles(rest)
    state.handle_key("N")
    state.handle_key("t")
    for share in np.linspace(-0.8, 0.7, 7):
        angles = np.where(share < 0, -share * low, share * high)
        angles[CHANNELS // 2 :] = rest[CHANNELS // 2 :]
        state.set_angles(angles)
    for _ in range(CHANNELS // 2):
        state.handle_key("down")
    return state


if __name__ == "__main__":
    console = Console(record=True, width=112, file=io.StringIO())
    console.print(screen().picture("head24, calibration 'desk'"))
    target = Path(__file__).parent / "pictures/calibrate.svg"
    svg = console.export_svg(title="omote calibrate head24 --name desk")
    target.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL))  # nothing is fetched to show it
