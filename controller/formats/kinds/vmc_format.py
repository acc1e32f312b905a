"""Format VMC, the protocol of VTuber programs: blend shapes and bones as OSC messages.

Addresses and arguments are from protocol.vmc.info/specification. Values are collected until the message Apply; a blend
shape that is not named keeps its value. Names are those of ARKit ("Perfect Sync") and the presets of VRM 0 and 1, in
upper or lower case.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.formats.format import API, Format, base_only
from controller.formats.frame import Frame, Held, Refusals
from controller.formats.osc import Argument, bundle, message, read_packet
from controller.formats.rotations import IDENTITY, Quaternion, from_unity, product, to_unity
from controller.vocabulary.presets import Preset, Presets

_VALUE, _APPLY, _BONE, _TIME = "/VMC/Ext/Blend/Val", "/VMC/Ext/Blend/Apply", "/VMC/Ext/Bone/Pos", "/VMC/Ext/T"
_HEAD = ("headYaw", "headPitch", "headRoll")
_EYES = {"lefteye": ("leftEyeYaw", "leftEyePitch"), "righteye": ("rightEyeYaw", "rightEyePitch")}
_BONES = {"head", "neck", *_EYES}
_MAX_NAMES = 4096
_SHAPE_COUNT = 52


class VmcDecoder:
    """Collects values and bones, and returns a frame at every Apply.

    From a sender that never sends Apply, a name that comes again ends a frame. If only bones come, the next time
    message ends it.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters = parameters
        self._held = Held(parameters)
        self._names: dict[str, int | Preset | None] = {}
        self._levels: dict[str, tuple[Preset, float]] = {}
        self._pending: dict[str, float] = {}
        self._bones: dict[str, Quaternion] = {}
        self._has_new_bones = False
        self._sends_apply = False
        self._has_arkit_shapes = False
        self._time_s: float | None = None

    def feed(self, message: bytes) -> list[Frame]:
        """Return the frames that a datagram completes."""
        frames: list[Frame] = []
        for address, arguments in read_packet(message, self.refused):
            if address == _VALUE:
                self._take_value(arguments, frames)
            elif address == _APPLY:
                self._sends_apply = True
                frames.append(self._finish_frame())
            elif address == _BONE:
                self._take_bone(arguments)
            elif address == _TIME:
                self._take_time(arguments, frames)
        return frames

    def _take_value(self, arguments: list[Argument], frames: list[Frame]) -> None:
        if len(arguments) < 2 or not isinstance(arguments[0], str) or not _is_number(arguments[1]):
            self.refused.add("Blend/Val without a name and a number")
            return
        name = arguments[0]
        if name in self._pending and not self._sends_apply:
            frames.append(self._finish_frame())
        if name in self._pending or len(self._pending) < _MAX_NAMES:
            self._pending[name] = float(arguments[1])  # type: ignore[arg-type]

    def _take_bone(self, arguments: list[Argument]) -> None:
        name = arguments[0].lower() if arguments and isinstance(arguments[0], str) else ""
        numbers = arguments[4:8]
        if not name or len(numbers) < 4 or not all(map(_is_number, numbers)):
            self.refused.add("Bone/Pos without a name and seven numbers")
        elif name in _BONES:
            try:
                x, y, z, w = (float(each) for each in numbers)  # type: ignore[arg-type]
                from_unity((x, y, z, w))
            except ValueError as error:
                self.refused.add(str(error))
            else:
                self._bones[name] = (x, y, z, w)
                self._has_new_bones = True

    def _take_time(self, arguments: list[Argument], frames: list[Frame]) -> None:
        if self._has_new_bones and not self._pending:
            frames.append(self._finish_frame())
        if arguments and _is_number(arguments[0]):
            self._time_s = float(arguments[0])  # type: ignore[arg-type]

    def _finish_frame(self) -> Frame:
        for name, value in self._pending.items():
            self._store(name, value)
        self._pending.clear()
        if self._has_new_bones:
            self._store_rotations()
        frame = self._held.frame(time_s=self._time_s)
        for preset, level in self._levels.values():
            if level and not (preset.tracked and self._has_arkit_shapes):
                _add_preset(frame, preset.weights * level)
        return frame

    def _store(self, name: str, value: float) -> None:
        found = self._lookup(name)
        if isinstance(found, Preset):
            self._levels[found.name] = found, value
        elif found is not None:
            self._held.values[found] = value
            self._held.mask[found] = self._has_arkit_shapes = True

    def _lookup(self, name: str) -> int | Preset | None:
        """Return the parameter index or preset that a name means; None for an avatar's own blend shape."""
        if name not in self._names and len(self._names) < _MAX_NAMES:
            found = self._parameters.find(name)
            self._names[name] = _presets(self._parameters).find(name) if found is None else found
        return self._names.get(name)

    def _store_rotations(self) -> None:
        """Convert the rotations of the bones to angles of head and eyes."""
        self._has_new_bones = False
        if "head" in self._bones or "neck" in self._bones:
            whole = product(self._bones.get("neck", IDENTITY), self._bones.get("head", IDENTITY))
            self._store_angles(_HEAD, from_unity(whole))
        for bone, names in _EYES.items():
            if bone in self._bones:
                self._store_angles(names, from_unity(self._bones[bone]))

    def _store_angles(self, names: Sequence[str], angles: Sequence[float]) -> None:
        for index, angle in zip(self._parameters.indices(names), angles, strict=False):
            self._held.values[index] = angle / self._parameters.full_scale_rad[index]
            self._held.mask[index] = True


class VmcEncoder:
    """Encodes each frame as one bundle: time, bones of head and eyes, ARKit's 52 blend shapes, Apply."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._names = [name[0].upper() + name[1:] for name in parameters.names[:_SHAPE_COUNT]]
        self._sent = 0

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one datagram; for a frame without a face it has no values and reports that nothing is tracked."""
        time_s = self._sent / 60.0 if frame.time_s is None else frame.time_s
        self._sent += 1
        messages = [message("/VMC/Ext/OK", 1, 3, 0, int(frame.face)), message(_TIME, float(time_s))]
        if frame.face:
            messages += self._bones(frame)
            messages += [
                message(_VALUE, name, float(frame.values[i])) for i, name in enumerate(self._names) if frame.mask[i]
            ]
            messages.append(message(_APPLY))
        return [bundle(messages)]

    def _bones(self, frame: Frame) -> list[bytes]:
        bones = {"Head": _HEAD, "LeftEye": _EYES["lefteye"], "RightEye": _EYES["righteye"]}
        found = []
        for bone, names in bones.items():
            indices = self._parameters.indices(names)
            if frame.mask[indices].any():
                angles = np.where(frame.mask, frame.values, 0.0)[indices] * self._parameters.full_scale_rad[indices]
                yaw, pitch, roll = (*map(float, angles), 0.0)[:3]
                found.append(message(_BONE, bone, 0.0, 0.0, 0.0, *to_unity(yaw, pitch, roll)))
        return found


def _is_number(value: Argument) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def _add_preset(frame: Frame, weights: Floats) -> None:
    """Replace the values of a frame by those of a preset where the preset is further from neutral; in place."""
    further = np.abs(weights) > np.abs(frame.values)
    np.copyto(frame.values, weights, where=further)
    frame.mask[weights != 0.0] = True


_presets = cache(Presets.load)


FORMAT = Format(
    api=API,
    kind="vmc",
    title="VMC over OSC",
    transports=("udp",),
    port=39539,
    decoder=VmcDecoder,
    encoder=VmcEncoder,
    carries=base_only,
)
