"""Converts angles of head and eyes to quaternions in Unity's axes, and back.

Unity is left-handed with y up and z forward; ``Quaternion.Euler`` rolls about z first, then pitches about x, then yaws
about y (the Unity manual, "Quaternion.Euler"). There a positive yaw is to the subject's right, a positive pitch is
down, and a positive roll raises the subject's right side. omote's yaw and roll have the opposite sign.
"""

from __future__ import annotations

import math

Quaternion = tuple[float, float, float, float]
"""Components x, y, z, w."""

IDENTITY: Quaternion = (0.0, 0.0, 0.0, 1.0)


def to_unity(yaw: float, pitch: float, roll: float) -> Quaternion:
    """Return the quaternion of a yaw, pitch and roll of omote (rad)."""
    sy, cy = math.sin(-yaw / 2), math.cos(-yaw / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sr, cr = math.sin(-roll / 2), math.cos(-roll / 2)
    return (
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * cp * cr + sy * sp * sr,
    )


def from_unity(quaternion: Quaternion) -> tuple[float, float, float]:
    """Return the yaw, pitch and roll of omote (rad) of a quaternion, which need not have the length 1.

    Raises ValueError: the quaternion is zero or not finite.
    """
    length = math.hypot(*quaternion)
    if not math.isfinite(length) or length < 1e-6:
        raise ValueError("a rotation that is zero or not finite")
    x, y, z, w = (each / length for each in quaternion)
    pitch = math.asin(min(1.0, max(-1.0, 2 * (w * x - y * z))))
    yaw = math.atan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y))
    roll = math.atan2(2 * (x * y + w * z), 1 - 2 * (x * x + z * z))
    return -yaw, pitch, -roll


def product(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation of a part that turns by ``second`` inside one that turns by ``first``."""
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
