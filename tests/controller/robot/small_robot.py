"""The text of a robot file with one simulated bus, for tests that add channels to it."""

from __future__ import annotations


def robot_text(name: str) -> str:
    """A robot without channels; its profile ``servo`` turns 40 degrees to either side."""
    return f"""
name = "{name}"
buses = [{{ name = "head", kind = "simulated", transport = "memory" }}]

[profiles.servo]
bus = "head"
model = "xl330-m288"
map = {{ at = [-1, 1], deg = [-40, 40] }}
limit_deg = [-45, 45]
max_speed_deg_s = 200
max_accel_deg_s2 = 2000
"""
