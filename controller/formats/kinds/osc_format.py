"""Format of OSC faders: ``/omote/jawOpen 0.5``, one address for each parameter.

The last part of an address names the parameter and the rest is ignored, so that addresses of other programs such as
``/avatar/parameters/JawOpen`` are accepted. Parameters that a packet does not name keep their value.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Parameters
from controller.formats.format import API, Format, everything
from controller.formats.frame import Frame, Held, Refusals
from controller.formats.osc import bundle, message, read_packet

_FACE, _TIME = "/omote/face", "/omote/time"


class OscDecoder:
    """Decodes messages and bundles; a datagram is one frame."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters, self._held = parameters, Held(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for a datagram that sets a parameter or reports that no face is seen, else none."""
        given: dict[int, float] = {}
        time_s: float | None = None
        for address, arguments in read_packet(message, self.refused):
            value = arguments[0] if arguments else None
            if not isinstance(value, (int, float)) or not math.isfinite(value):
                self.refused.add("a message without a number")
            elif address == _FACE and not value:
                return [Frame(self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool), face=False)]
            elif address == _TIME:
                time_s = float(value)
            elif (index := self._parameters.find(address.rpartition("/")[2])) is not None:
                given[index] = float(value)
            elif address != _FACE:
                self.refused.add("unknown names")
        if not given:
            return []
        self._held.update(given)
        return [self._held.frame(time_s=time_s)]


class OscEncoder:
    """Encodes each frame as one bundle, or as one message if no face is seen."""

    def __init__(self, parameters: Parameters) -> None:
        self._addresses = [f"/omote/{name}" for name in parameters.names]

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one datagram."""
        if not frame.face:
            return [message(_FACE, 0)]
        messages = [] if frame.time_s is None else [message(_TIME, float(frame.time_s))]
        messages += [message(self._addresses[i], float(frame.values[i])) for i in np.flatnonzero(frame.mask)]
        return [bundle(messages)]


FORMAT = Format(
    api=API,
    kind="osc",
    title="OSC, an address for each parameter",
    transports=("udp",),
    port=9000,
    decoder=OscDecoder,
    encoder=OscEncoder,
    carries=everything,
    timeout_s=math.inf,
)
