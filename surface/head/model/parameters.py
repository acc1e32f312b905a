"""Parameters of a head: their names, and how their values become a pose of shapes, jaw, gaze and head rotation.

Expression parameters run from 0 to 1, angles from -1 to 1. Gaze may be given as angles and as eyeLook shapes, which are
added; it turns the eyeball and moves the lids.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, hypot, isnan, sin
from typing import Any

import numpy as np

from surface.base.arrays import Floats

SIDES = ("Left", "Right")
_EYE = ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")
_LOWER = (
    "jawForward", "jawLeft", "jawRight", "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker", "mouthLeft",
    "mouthRight", "mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft", "mouthFrownRight", "mouthDimpleLeft",
    "mouthDimpleRight", "mouthStretchLeft", "mouthStretchRight", "mouthRollLower", "mouthRollUpper",
    "mouthShrugLower", "mouthShrugUpper", "mouthPressLeft", "mouthPressRight", "mouthLowerDownLeft",
    "mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight", "browDownLeft", "browDownRight", "browInnerUp",
    "browOuterUpLeft", "browOuterUpRight", "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft",
    "noseSneerRight", "tongueOut",
)  # fmt: skip
SHAPES = (*(f"eye{e}{s}" for s in SIDES for e in _EYE), *_LOWER)
ANGLES = ("headYaw", "headPitch", "headRoll", "leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch")
NAMES = SHAPES + ANGLES
HEAD_RAD = np.radians([60.0, 40.0, 30.0])  # yaw, pitch, roll at full scale
EYE_RAD = np.radians([35.0, 30.0])  # yaw, pitch at full scale
_HEAD, _EYE_AT = HEAD_RAD.tolist(), EYE_RAD.tolist()
_AT = {name: i for i, name in enumerate(NAMES)}
_LOOK = [[_AT[f"eyeLook{d}{s}"] for d in ("Down", "In", "Out", "Up")] for s in SIDES]
_BLINK = [_AT[f"eyeBlink{s}"] for s in SIDES]
_OPENERS = [[_AT[f"eye{e}{s}"] for e in ("LookUp", "Wide")] for s in SIDES]
_JAW, _CLOSE, _TONGUE = _AT["jawOpen"], _AT["mouthClose"], _AT["tongueOut"]
_BELOW = [_AT[n] for n in ("mouthRollLower", "mouthShrugLower", "mouthPressLeft", "mouthPressRight")]
LIP_YIELD = 0.75  # fraction by which a tongue that is out reduces what raises the lower lip
LIP_YIELD_AT = 0.5  # tongueOut from which on that is complete
TONGUE_JAW = 0.33  # minimum jawOpen for the whole tongue
TONGUE_JAW_LEAD = 1.7  # how much earlier the jaw opens than the tongue comes out
LID_SHARE = 0.72  # fraction of a blink by which the upper lid goes down at a full look down
_LOW = np.array([0.0] * len(SHAPES) + [-1.0] * len(ANGLES))
_NO_LIP, _NO_LAG, _NO_OWN = np.zeros((0, 3)), np.zeros(3), np.zeros(0)
for _nothing in (_NO_LIP, _NO_LAG, _NO_OWN):
    _nothing.flags.writeable = False  # poses share them


@dataclass
class Pose:
    """A parameter vector as amounts and angles.

    shapes : (52,) amount of each group; lids already follow the gaze.
    jaw : how far the jaw is open, 0..1; closed : share of it that mouthClose takes back, 0..1.
    head : (3,) yaw, pitch, roll in rad; gaze : (2, 2) rad, left and right eye, yaw and pitch.
    lip : (k, 3) samples of the lower lip where the contact left them, mm, for the tongue, which lies on them.
    lag : (3,) yaw, pitch and roll, rad, by which hair lies ahead of the head (:mod:`surface.head.model.sway`).
    rise_mm : by which a breath lifts the chest (:mod:`surface.head.model.sway`).
    own : (g,) amounts of a user's own groups.
    pushes : corrections at contacts by their names, mm, from :class:`surface.head.posing.contact.ContactSolver`; the
        part with the opening sets them for parts after it.
    found : what was computed of this pose for one part and serves others, by what it is.
    """

    shapes: Floats
    jaw: float
    closed: float
    head: Floats
    gaze: Floats
    pushes: dict[str, Floats] = field(default_factory=dict)
    lip: Floats = field(default_factory=lambda: _NO_LIP)
    lag: Floats = field(default_factory=lambda: _NO_LAG)
    rise_mm: float = 0.0
    own: Floats = field(default_factory=lambda: _NO_OWN)
    found: dict[tuple[object, ...], Any] = field(default_factory=dict, init=False, compare=False)


def head_angles(values: Floats) -> Floats:
    """Return (3,): yaw, pitch and roll of the head, rad, in parameter values (59,) in the order of NAMES."""
    angles: Floats = np.clip(values[len(SHAPES) : len(SHAPES) + 3], -1.0, 1.0) * HEAD_RAD
    return angles


def read_pose(values: Floats) -> Pose:
    """Return parameter values (59,) in the order of NAMES, clipped, as a pose.

    mouthClose brings the lips together over an open jaw and is therefore never larger than jawOpen; tongueOut
    opens the jaw as far as it needs, ahead of the tongue, and keeps the lips off it. Blink and look down do not add up:
    the lid goes as far as the greater of the two takes it (:func:`lid_down`).

    Raises ValueError: wrong shape, or a value that is not a number (names the parameter).
    """
    v = np.asarray(values, float)
    if v.shape != (len(NAMES),):
        raise ValueError(f"values has shape {v.shape}, expected ({len(NAMES)},)")
    given = np.minimum(np.maximum(v, _LOW), 1.0).tolist()
    if isnan(sum(given)):
        raise ValueError(f"values: {NAMES[int(np.argmax(np.isnan(v)))]} is not a number")
    shapes, angle = given[: len(SHAPES)], given[len(SHAPES) :]
    needed = 0.0
    if shapes[_TONGUE]:
        needed = TONGUE_JAW * min(1.0, TONGUE_JAW_LEAD * shapes[_TONGUE])
        yielded = 1.0 - LIP_YIELD * min(1.0, shapes[_TONGUE] / LIP_YIELD_AT)
        for i in _BELOW:  # the lower lip gives way to the tongue
            shapes[i] *= yielded
    jaw = shapes[_JAW] = max(shapes[_JAW], needed)
    gaze = _turn_eye(shapes, 0, angle[3], angle[4]), _turn_eye(shapes, 1, angle[5], angle[6])
    shapes[_CLOSE] = min(shapes[_CLOSE], jaw - needed)
    closed = shapes[_CLOSE] / jaw if jaw > 0 else 0.0
    (yaw, pitch, roll), (x, y) = _HEAD, _EYE_AT
    head = np.array([angle[0] * yaw, angle[1] * pitch, angle[2] * roll])
    (left, down), (right, low) = gaze
    return Pose(np.array(shapes), jaw, closed, head, np.array([[left * x, down * y], [right * x, low * y]]))


def _turn_eye(shapes: list[float], side: int, yaw: float, pitch: float) -> tuple[float, float]:
    """Return the yaw and pitch of one eye, -1..1, from its angles and its eyeLook shapes together; the shapes of its
    lids follow in ``shapes``."""
    down, inward, outward, up = _LOOK[side]
    blink = shapes[_BLINK[side]]
    if yaw or pitch or shapes[down] or shapes[inward] or shapes[outward] or shapes[up]:
        to_side = (shapes[outward] - shapes[inward]) * (1 - 2 * side)
        yaw = min(max(yaw + to_side, -1.0), 1.0)
        pitch = min(max(pitch + shapes[down] - shapes[up], -1.0), 1.0)
        away = yaw * (1 - 2 * side)
        shapes[down], shapes[inward] = lid_down(max(pitch, 0.0), blink), max(-away, 0.0)
        shapes[outward], shapes[up] = max(away, 0.0), max(-pitch, 0.0)
    if blink:
        for i in _OPENERS[side]:  # a closing lid ends closed, wherever it started
            shapes[i] *= 1.0 - blink
    return yaw, pitch


def lid_down(look: float, blink: float) -> float:
    """Return what a look down, 0..1, adds to a blink, 0..1, as a look down: how much further than the blink it takes
    the lid.

    The lid, in blinks, is at the greater of ``blink`` and LID_SHARE times ``look``, smooth where they are equal
    (a polynomial minimum; Quilez, "Smooth minimum", 2013); the width of that is none for an open and for a closed eye.
    """
    if look <= 0.0 or blink <= 0.0:
        return look
    width, apart = blink * (1.0 - blink), abs(LID_SHARE * look - blink)
    smooth = max(width - apart, 0.0) ** 2 / (4.0 * width) if width > 0.0 else 0.0
    return (max(LID_SHARE * look - blink, 0.0) + smooth) / LID_SHARE


def smoothstep(x: Floats, low: float = 0.0, high: float = 1.0) -> Floats:
    """Return the Hermite step 3 t^2 - 2 t^3 of ``x``, 0 at ``low`` and 1 at ``high``, constant beyond them."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def rotation(yaw: float, pitch: float, roll: float = 0.0) -> Floats:
    """Return (3, 3): roll about z first, then pitch about x, then yaw about y; rad, right-hand rule."""
    cy, cp, cr, sy, sp, sr = cos(yaw), cos(pitch), cos(roll), sin(yaw), sin(pitch), sin(roll)
    return np.array(
        [
            [cy * cr + sy * sp * sr, sy * sp * cr - cy * sr, sy * cp],
            [cp * sr, cp * cr, -sp],
            [cy * sp * sr - sy * cr, sy * sr + cy * sp * cr, cy * cp],
        ]
    )


def rotation_vector(matrix: Floats) -> Floats:
    """Return (3,): axis times angle of a rotation by less than 180 degrees."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    axis = (h - f, c - g, d - b)
    sine = 0.5 * hypot(*axis)
    if sine < 1e-9:
        return np.zeros(3)
    return np.array(axis) * (atan2(sine, 0.5 * (a + e + i - 1)) / (2 * sine))
