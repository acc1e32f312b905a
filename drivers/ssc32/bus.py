"""Driver of hobby servos on a Lynxmotion SSC-32: one line moves all channels, each cycle polls the pulses of some.

Source: SSC-32U guide, pages 24-33. An answer is a single byte, the pulse in steps of 10 us, so each batch of requests
ends with VER, whose answer is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.boards.ordered_replies import OrderedBus
from drivers.text.bus import TextBus

MOVE, END, OFF = "#{ch}P{us}", "T{time_ms}\r", "STOP{ch}\r#{ch}P0\r"


class Ssc32Bus(OrderedBus, TextBus):
    """An SSC-32 on one port; a servo's ``id`` is the channel, options as :class:`~drivers.boards.bus.BoardBus`."""

    SLACK_US = 12.0
    tells_torque: ClassVar[bool] = True
    SILENT = "no SSC-32 answers on {path} at {baud} baud"
    SILENT_HINT = "check its power, its cable and the baud rate its jumpers or buttons are set to"

    def __init__(self, servos: Iterable[ServoSpec], **options: Any) -> None:
        super().__init__(servos, template=MOVE, end=END, off=OFF, **options)

    def far_end(self) -> dict[str, Any]:
        return {}

    def _probe(self) -> bytes:
        return b"VER\r"

    def _answers_probe(self, data: bytes) -> bool:
        return data.startswith(b"SSC32") and data.endswith(b"\r") and data.count(b"\r") == 1

    def _ask_pulses(self, group: Sequence[int], insist: bool = False) -> Floats | None:
        requests = "".join(f"QP{self.ids[index]}\r" for index in group).encode()
        data = self._request(requests, len(group), insist)
        return None if data is None else np.array(list(data), np.float64) * 10.0
