"""Format of the phone apps iFacialMocap and Facemotion3d: text with an entry for each blend shape.

``mouthSmile_R-50|...|=head#ex,ey,ez,px,py,pz|rightEye#ex,ey,ez|leftEye#ex,ey,ez|``: values are whole numbers from 0 to
100, and angles are in degrees. Facemotion3d has ``&`` between name and value. Yaw is positive to the subject's left, as
in omote (inferred from published frames). Sources: ifacialmocap.com/for-developer and facemotion3d.net/for-developer.
"""

from __future__ import annotations

import math
import re

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format, base_only
from controller.formats.frame import Frame, Refusals

_VALUE_SCALE = 100.0
_MAX_VALUE = 10.0  # times a full movement, so that a wrong value does not make the message too long
_MAX_VALUE_LENGTH = 24  # characters
_SHAPE_COUNT = 52
_ENTRY = re.compile(r"=?\s*([A-Za-z_][A-Za-z0-9_]*)\s*[-&]\s*(-?[0-9.]+(?:[eE]-?[0-9]+)?)\s*")
_IGNORED = re.compile(r"trackingStatus|hapihapi|FM_\w*")
_UNSUFFIXED = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
_ROTATIONS = {
    "head": ("headPitch", "headYaw", "headRoll"),
    "leftEye": ("leftEyePitch", "leftEyeYaw"),
    "rightEye": ("rightEyePitch", "rightEyeYaw"),
}


class IFacialMocapDecoder:
    """Decodes frames; an invalid entry is counted, and the other entries of the frame are used."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame, or none if no entry can be read."""
        values, mask = self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool)
        for entry in message.decode("utf-8", "replace").split("|"):
            self._take(entry.strip(), values, mask)
        if not mask.any():
            self.refused.add("no frame of iFacialMocap or Facemotion3d")
            return []
        return [Frame(values, mask)]

    def _take(self, entry: str, values: Floats, mask: Flags) -> None:
        if "#" in entry:
            self._take_rotation(entry, values, mask)
            return
        match = _ENTRY.fullmatch(entry)
        number = _number(match[2]) if match else None
        if match is None or number is None:
            if any(each.isalpha() for each in entry) and not _IGNORED.match(entry):
                self.refused.add("entries without a name and a number")
            return
        index = self._parameters.find(match[1])
        if index is not None:
            values[index], mask[index] = number / _VALUE_SCALE, True
        elif not _IGNORED.match(match[1]):
            self.refused.add("unknown names")

    def _take_rotation(self, entry: str, values: Floats, mask: Flags) -> None:
        """Store the angles of an entry ``head#1.5,-2,0,...``: pitch, yaw and roll in degrees."""
        name, _, rest = entry.partition("#")
        names = _ROTATIONS.get(name.lstrip("= "))
        numbers = [_number(text.strip()) for text in rest.split(",")[:3]]
        if names is None or len(numbers) < len(names):
            self.refused.add("invalid rotations")
            return
        for each, degrees in zip(names, numbers, strict=False):
            index = self._parameters.index(each)
            if degrees is not None:
                values[index] = math.radians(degrees) / self._parameters.full_scale_rad[index]
                mask[index] = True


class IFacialMocapEncoder:
    """Encodes frames as one of the two apps writes them.

    separator : text between name and value. suffixed : whether sides are written as ``_L`` and ``_R``.
    """

    def __init__(self, parameters: Parameters, separator: str = "-", *, suffixed: bool = True) -> None:
        self._parameters, self._separator = parameters, separator
        names = parameters.names[:_SHAPE_COUNT]
        self._names = [_suffixed(name) if suffixed else name for name in names]

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message; none for a frame without a face, which these apps do not send."""
        if not frame.face:
            return []
        values = np.clip(np.where(frame.mask, frame.values, 0.0), -_MAX_VALUE, _MAX_VALUE)
        whole = np.rint(values * _VALUE_SCALE).astype(int).tolist()
        entries = [f"{name}{self._separator}{number}" for name, number in zip(self._names, whole, strict=False)]
        parts = [self._rotation(bone, values) for bone in ("head", "rightEye", "leftEye")]
        return ["|".join([*entries, "=" + parts[0], *parts[1:], ""]).encode()]

    def _rotation(self, bone: str, values: Floats) -> str:
        indices = self._parameters.indices(_ROTATIONS[bone])
        degrees = [*np.degrees(values[indices] * self._parameters.full_scale_rad[indices]).tolist(), 0.0][:3]
        position = [0.0, 0.0, 0.0] if bone == "head" else []
        return f"{bone}#" + ",".join(f"{number:.5g}" for number in [*degrees, *position])


def _number(text: str) -> float | None:
    try:
        value = float(text) if len(text) <= _MAX_VALUE_LENGTH else math.nan
    except ValueError:
        return None
    return value if abs(value) < 1e6 else None


def _suffixed(name: str) -> str:
    """Return the app's spelling of a name; in the names of whole jaw and mouth movements the side is no suffix."""
    return name if name in _UNSUFFIXED else re.sub("Left$", "_L", re.sub("Right$", "_R", name))


FORMAT = Format(
    api=API,
    kind="ifacialmocap",
    title="iFacialMocap",
    transports=("udp", "tcp"),
    port=49983,
    decoder=IFacialMocapDecoder,
    encoder=IFacialMocapEncoder,
    carries=base_only,
    quantum=0.005,
    delimiter=b"___iFacialMocap",
    greeting=b"iFacialMocap_sahuasouryya9218sauhuiayeta91555dy3719",
    note="angles are not rounded",
)
