"""iFacialMocap and Facemotion3d: text that phones send, an entry for each blend shape.

``mouthSmile_R-50|...|=head#ex,ey,ez,px,py,pz|rightEye#ex,ey,ez|leftEye#ex,ey,ez|``: whole numbers of 0 to 100, and
angles in degrees. Facemotion3d has ``&`` between name and value. Yaw is positive to the subject's left, as in omote
(inferred from published frames). Sources: ifacialmocap.com/for-developer and facemotion3d.net/for-developer.
"""

from __future__ import annotations

import math
import re

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format, base_only
from controller.formats.frame import Frame, Refusals

_FULL = 100.0
_MOST = 10.0  # times a whole movement; no face goes further, and text has no room for it
_LONGEST_VALUE = 24
_SHAPES = 52
_ENTRY = re.compile(r"=?\s*([A-Za-z_][A-Za-z0-9_]*)\s*[-&]\s*(-?[0-9.]+(?:[eE]-?[0-9]+)?)\s*")
_OPTIONAL = re.compile(r"trackingStatus|hapihapi|FM_\w*")
_WHOLE = ("jawLeft", "jawRight", "mouthLeft", "mouthRight")
_TURNS = {
    "head": ("headPitch", "headYaw", "headRoll"),
    "leftEye": ("leftEyePitch", "leftEyeYaw"),
    "rightEye": ("rightEyePitch", "rightEyeYaw"),
}


class IFacialMocapDecoder:
    """Reads frames; an entry that is broken is left out and counted, and the rest of the frame is taken."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters

    def feed(self, message: bytes) -> list[Frame]:
        """One frame, or none where no entry can be read."""
        values, mask = self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool)
        for entry in message.decode("utf-8", "replace").split("|"):
            self._take(entry.strip(), values, mask)
        if not mask.any():
            self.refused.add("no frame of iFacialMocap or Facemotion3d")
            return []
        return [Frame(values, mask)]

    def _take(self, entry: str, values: Floats, mask: Flags) -> None:
        if "#" in entry:
            self._turn(entry, values, mask)
            return
        match = _ENTRY.fullmatch(entry)
        number = _number(match[2]) if match else None
        if match is None or number is None:
            if any(each.isalpha() for each in entry) and not _OPTIONAL.match(entry):
                self.refused.add("entries without a name and a number")
            return
        at = self._parameters.find(match[1])
        if at is not None:
            values[at], mask[at] = number / _FULL, True
        elif not _OPTIONAL.match(match[1]):
            self.refused.add("unknown names")

    def _turn(self, entry: str, values: Floats, mask: Flags) -> None:
        """``head#1.5,-2,0,...``: pitch, yaw and roll in degrees."""
        name, _, rest = entry.partition("#")
        names = _TURNS.get(name.lstrip("= "))
        numbers = [_number(text.strip()) for text in rest.split(",")[:3]]
        if names is None or len(numbers) < len(names):
            self.refused.add("rotations that are none")
            return
        for each, degrees in zip(names, numbers, strict=False):
            at = self._parameters.index(each)
            if degrees is not None:
                values[at] = math.radians(degrees) / self._parameters.full_scale_rad[at]
                mask[at] = True


class IFacialMocapEncoder:
    """Writes frames in the spelling of one of the two apps.

    between : what stands between name and value. suffixed : sides as ``_L`` and ``_R``.
    """

    def __init__(self, parameters: Parameters, between: str = "-", *, suffixed: bool = True) -> None:
        self._parameters, self._between = parameters, between
        names = parameters.names[:_SHAPES]
        self._names = [_suffixed(name) if suffixed else name for name in names]

    def encode(self, frame: Frame) -> list[bytes]:
        """One message; none for a frame without a face, which these apps do not send."""
        if not frame.face:
            return []
        values = np.clip(np.where(frame.mask, frame.values, 0.0), -_MOST, _MOST)
        whole = np.rint(values * _FULL).astype(int).tolist()
        entries = [f"{name}{self._between}{number}" for name, number in zip(self._names, whole, strict=False)]
        parts = [self._rotation(bone, values) for bone in ("head", "rightEye", "leftEye")]
        return ["|".join([*entries, "=" + parts[0], *parts[1:], ""]).encode()]

    def _rotation(self, bone: str, values: Floats) -> str:
        at = self._parameters.indices(_TURNS[bone])
        degrees = [*np.degrees(values[at] * self._parameters.full_scale_rad[at]).tolist(), 0.0][:3]
        place = [0.0, 0.0, 0.0] if bone == "head" else []
        return f"{bone}#" + ",".join(f"{number:.5g}" for number in [*degrees, *place])


def _number(text: str) -> float | None:
    try:
        value = float(text) if len(text) <= _LONGEST_VALUE else math.nan
    except ValueError:
        return None
    return value if abs(value) < 1e6 else None


def _suffixed(name: str) -> str:
    """The app's spelling; of jaw and mouth as a whole the side is no suffix."""
    return name if name in _WHOLE else re.sub("Left$", "_L", re.sub("Right$", "_R", name))


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
