"""Format of OpenSeeFace, a webcam tracker that sends its own features of eyes, brows and mouth and the head's pose.

The layout is from facetracker.py and Unity/OpenSee.cs of emilianavt/OpenSeeFace. The signs of brows and mouth corners
are from the thresholds of its OpenSeeExpression.cs, where corners below zero are a smile and brows above zero are
surprise. The signs of the head's angles are inferred from the axes to which OpenSee.cs converts them; a link's option
``mirror`` reverses yaw and roll.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format
from controller.formats.frame import Frame, Refusals

POINTS = 68
_HEAD = struct.Struct("<di2f2fBf4f3f3f")  # time, face, size, eyes open, 3D, error, quaternion, euler, place
_FEATURES = struct.Struct("<14f")
_REST = 4 * (POINTS + 2 * POINTS + 3 * (POINTS + 2))
SIZES = (_HEAD.size + _REST, _HEAD.size + _REST + _FEATURES.size)
"""Length of a record in bytes, without and with features."""

# Indices into the unpacked header and into the features.
_LEFT_OPEN, _RIGHT_OPEN, _GOT_3D, _EULER = 5, 4, 6, 12
_UP = {"Left": 3, "Right": 6}
_CORNER = {"Left": 8, "Right": 10}
_MOUTH_OPEN, _MOUTH_WIDE = 12, 13
_ANGLES = ("headYaw", "headPitch", "headRoll")
_EXACT = ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen", *_ANGLES)
_PAIRS = ("browOuterUp", "browDown", "mouthSmile", "mouthFrown", "mouthStretch")
_ABOUT = ("browInnerUp", "mouthPucker", *(f"{name}{side}" for name in _PAIRS for side in ("Left", "Right")))


class OpenSeeFaceDecoder:
    """Decodes datagrams of one or more records; of several faces only the first is used."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame, or none if the datagram is not a whole number of records or has no valid value."""
        size = next((size for size in SIZES[::-1] if message and len(message) % size == 0), None)
        if size is None:
            self.refused.add("not a whole number of records")
            return []
        head = _HEAD.unpack_from(message)
        features = _FEATURES.unpack_from(message, SIZES[0]) if size == SIZES[1] else None
        values, mask = self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool)
        for name, value in self._values(head, features).items():
            if not np.isfinite(value):
                self.refused.add("values that are not numbers")
                continue
            index = self._parameters.index(name)
            values[index], mask[index] = value, True
        if not mask.any():
            return []
        return [Frame(values, mask, head[0] if np.isfinite(head[0]) else None, subject=f"face {head[1]}")]

    def _values(self, head: tuple[float, ...], features: tuple[float, ...] | None) -> dict[str, float]:
        found = {"eyeBlinkLeft": 1.0 - head[_LEFT_OPEN], "eyeBlinkRight": 1.0 - head[_RIGHT_OPEN]}
        if head[_GOT_3D]:
            x, y, z = (each if np.isfinite(each) else np.nan for each in head[_EULER : _EULER + 3])
            angles = np.radians([y, _wrap_degrees(-(x + 180.0)), _wrap_degrees(90.0 - z)])
            full = self._parameters.full_scale_rad[self._parameters.indices(_ANGLES)]
            found |= dict(zip(_ANGLES, (angles / full).tolist(), strict=True))
        return found | (_values_of(features) if features is not None else {})


class OpenSeeFaceEncoder:
    """Encodes a face as one record with features; its landmarks are zero, because parameters have none."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one datagram; none for a frame without a face, like the tracker."""
        if not frame.face:
            return []
        values = np.where(frame.mask, frame.values, 0.0)
        named = dict(zip(self._parameters.names, values.tolist(), strict=True))
        full = self._parameters.full_scale_rad[self._parameters.indices(_ANGLES)]
        yaw, pitch, roll = np.degrees(values[self._parameters.indices(_ANGLES)] * full)
        got_3d = int(frame.mask[self._parameters.indices(_ANGLES)].any())
        eyes = 1.0 - named["eyeBlinkRight"], 1.0 - named["eyeBlinkLeft"]
        euler = _wrap_degrees(-pitch - 180.0), yaw, 90.0 - roll
        head = _HEAD.pack(
            frame.time_s or 0.0, 0, 640.0, 480.0, *eyes, got_3d, 0.0, 0.0, 0.0, 0.0, 1.0, *euler, *[0.0] * 3
        )
        return [head + bytes(_REST) + _FEATURES.pack(*_features_of(named))]


def _values_of(features: tuple[float, ...]) -> dict[str, float]:
    """Return the parameter values of the tracker's features, most of which are -1 to 1 with 0 at rest."""
    found = {"jawOpen": features[_MOUTH_OPEN]}
    wide = features[_MOUTH_WIDE]
    for side in ("Left", "Right"):
        up, corner = features[_UP[side]], -features[_CORNER[side]]
        found |= {f"browOuterUp{side}": max(up, 0.0), f"browDown{side}": max(-up, 0.0)}
        found |= {f"mouthSmile{side}": max(corner, 0.0), f"mouthFrown{side}": max(-corner, 0.0)}
        found[f"mouthStretch{side}"] = max(wide, 0.0)
    found["browInnerUp"] = (found["browOuterUpLeft"] + found["browOuterUpRight"]) / 2
    found["mouthPucker"] = max(-wide, 0.0)
    return found


def _features_of(named: Mapping[str, float]) -> Floats:
    """Return the tracker's 14 features of a face."""
    found = np.zeros(14)
    found[0], found[1] = 1.0 - named["eyeBlinkLeft"], 1.0 - named["eyeBlinkRight"]
    for side in ("Left", "Right"):
        found[_UP[side]] = named[f"browOuterUp{side}"] - named[f"browDown{side}"]
        found[_CORNER[side]] = named[f"mouthFrown{side}"] - named[f"mouthSmile{side}"]
    found[_MOUTH_OPEN] = named["jawOpen"]
    found[_MOUTH_WIDE] = (named["mouthStretchLeft"] + named["mouthStretchRight"]) / 2 - named["mouthPucker"]
    return np.clip(found, -1e6, 1e6)


def _wrap_degrees(degrees: float) -> float:
    """Return the same angle in the range -180 to 180."""
    return (degrees + 180.0) % 360.0 - 180.0


def _flags(parameters: Parameters, names: tuple[str, ...]) -> Flags:
    mask = np.zeros(len(parameters), dtype=bool)
    mask[parameters.indices(names)] = True
    return mask


FORMAT = Format(
    api=API,
    kind="openseeface",
    title="OpenSeeFace",
    transports=("udp",),
    port=11573,
    decoder=OpenSeeFaceDecoder,
    encoder=OpenSeeFaceEncoder,
    carries=lambda parameters: _flags(parameters, _EXACT),
    about=lambda parameters: _flags(parameters, _ABOUT),
    note="of each opposite pair, such as smile and frown, only the difference",
)
