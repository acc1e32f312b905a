"""Format MIDI: each controller (control change) moves a parameter, by ``configs/controls/midi.toml``.

The bytes are those of the MIDI 1.0 Detailed Specification: status bytes from 0x80 on, data bytes below, running status,
and real-time messages of one byte that may come between any two bytes. A stream needs no delimiter. Channels are not
distinguished. A controller has 128 steps over the whole range of its parameter; an angle is 0 at step 64.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from controller.base.parameters import Flags, Parameters
from controller.base.paths import config_dir
from controller.formats.format import API, Format
from controller.formats.frame import Frame, Held, Refusals
from controller.vocabulary.controls import load_controls

_CONTROL_CHANGE = 0xB0
_REAL_TIME, _EXCLUSIVE, _SYSTEM = 0xF8, 0xF0, 0xF0
_MAX_STEP, _MIDDLE_STEP = 127, 64
_DATA_BYTES = {0x80: 2, 0x90: 2, 0xA0: 2, 0xB0: 2, 0xC0: 1, 0xD0: 1, 0xE0: 2}
"""Number of data bytes by the upper half of a status byte."""


class MidiDecoder:
    """Decodes pieces of a stream; messages other than the table's control changes have no effect."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused, self._held = Refusals(), Held(parameters)
        self._indices, self._parameters = _table(parameters), parameters
        self._status, self._data = 0, bytearray()

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame if the piece holds a control change of the table, else none."""
        changed = [self._take(byte) for byte in message]
        return [self._held.frame()] if any(changed) else []

    def _take(self, byte: int) -> bool:
        if byte >= _REAL_TIME:
            return False
        if byte >= 0x80:
            self._status, self._data = byte, bytearray()
            return False
        wanted = _DATA_BYTES.get(self._status & 0xF0)
        if wanted is None or self._status >= _SYSTEM:  # of a system message, or of one whose status byte was missed
            return False
        self._data.append(byte)
        if len(self._data) < wanted:
            return False
        (controller, value), self._data = (
            (*self._data, 0)[:2],
            bytearray(),
        )  # running status
        return self._status & 0xF0 == _CONTROL_CHANGE and self._change(controller, value)

    def _change(self, controller: int, value: int) -> bool:
        index = self._indices.get(controller)
        if index is None:
            self.refused.add("controllers that move nothing")
            return False
        self._held.update({index: _value(float(self._parameters.low[index]), value)})
        return True


class MidiEncoder:
    """Encodes the controllers that changed since the last frame, on channel 1, and repeats the others in turn."""

    def __init__(self, parameters: Parameters) -> None:
        self._numbers = {index: number for number, index in _table(parameters).items()}
        self._low = parameters.low
        self._sent: dict[int, int] = {}
        self._turn = 0

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message; none for a frame without a face."""
        if not frame.face or not frame.mask.any():
            return []
        found = {index: _step(float(self._low[index]), float(frame.values[index]))
                 for index in self._numbers if frame.mask[index]}  # fmt: skip
        self._turn = (self._turn + 1) % len(found)
        again = list(found)[self._turn]
        changed = {index: step for index, step in found.items() if self._sent.get(index) != step or index == again}
        self._sent |= changed
        return [b"".join(bytes((_CONTROL_CHANGE, self._numbers[index], step)) for index, step in changed.items())]


def _value(low: float, step: int) -> float:
    """Return the value of a step: 0 to 1, or -1 to 1 with 0 in the middle."""
    if low >= 0.0:
        return step / _MAX_STEP
    return (step - _MIDDLE_STEP) / (_MAX_STEP - _MIDDLE_STEP if step > _MIDDLE_STEP else _MIDDLE_STEP)


def _step(low: float, value: float) -> int:
    if low >= 0.0:
        return round(min(max(value, 0.0), 1.0) * _MAX_STEP)
    value = min(max(value, -1.0), 1.0)
    return _MIDDLE_STEP + round(value * (_MAX_STEP - _MIDDLE_STEP if value > 0.0 else _MIDDLE_STEP))


@cache
def _table(parameters: Parameters) -> dict[int, int]:
    """Return the parameter indices by controller number."""
    file = load_controls(config_dir() / "controls" / "midi.toml", parameters)
    return {number: parameters.index(name) for name, number in file.controllers.items()}


def _carries(parameters: Parameters) -> Flags:
    mask = np.zeros(len(parameters), dtype=bool)
    mask[list(_table(parameters).values())] = True
    return mask


FORMAT = Format(
    api=API,
    kind="midi",
    title="MIDI controllers",
    transports=("udp", "serial", "midi", "lines"),
    port=9407,
    decoder=MidiDecoder,
    encoder=MidiEncoder,
    carries=_carries,
    quantum=1 / 126,
    pieces=True,
    timeout_s=math.inf,
    note="128 steps",
)
