"""Hobby servos on a Lynxmotion SSC-32: one line moves all channels together, each cycle asks some for their pulse.

Source: SSC-32U guide, pages 24-33. An answer is one byte of tens of microseconds, so each batch of questions ends with
VER, whose answer is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import NoReply
from drivers.boards.ordered_replies import OrderedReplies
from drivers.text.bus import TextBus

CHANNELS = 32
MOVE, END, OFF = "#{ch}P{us}", "T{time_ms}\r", "STOP{ch}\r#{ch}P0\r"


class Ssc32Bus(TextBus):
    """An SSC-32 on one port.

    Parameters
    ----------
    servos : the servos; ``id`` is the channel.
    options : see :class:`~drivers.boards.bus.BoardBus`.
    """

    SLACK_US = 12.0
    tells_torque: ClassVar[bool] = True

    def __init__(self, servos: Iterable[ServoSpec], *, port: str, **options: Any) -> None:
        super().__init__(servos, port=port, template=MOVE, end=END, off=OFF, **options)
        self._talk = OrderedReplies(self._port, b"VER\r", _is_version, lambda: self._margin_s)

    def far_end(self) -> dict[str, Any]:
        """A simulated board needs no settings."""
        return {}

    def _open_link(self) -> None:
        super()._open_link()
        self._talk.reset()

    def _begin(self) -> Floats:
        seen = np.full(len(self.servos), math.nan)
        for group in self._groups():
            pulses = self._pulses(group, insist=True)
            if pulses is None:
                raise self._no_reply(group)
            seen[group] = pulses
        return self._present(seen)

    def _off_confirmed(self, index: int) -> bool:
        pulses = self._pulses([index], insist=True)
        return pulses is not None and not pulses[0]

    def _poll(self) -> None:
        group = self._turn()
        pulses = self._pulses(group)
        self._heard(pulses is not None)
        if pulses is None:
            self._report.count("no_reply")
            return
        self._take(group, pulses)

    def _doubt(self) -> None:
        self._talk.doubt()

    def _forget_input(self) -> None:
        """What it says is an answer, or looked at when the next question is asked."""

    def _pulses(self, group: Sequence[int], insist: bool = False) -> list[float] | None:
        """Pulses in us, in steps of 10, that the board puts out; None when it does not answer."""
        questions = "".join(f"QP{self.ids[index]}\r" for index in group).encode()
        data = self._talk.ask(questions, len(group), insist=insist)
        return None if data is None else [10.0 * byte for byte in data]

    def _no_reply(self, group: Sequence[int]) -> NoReply:
        return NoReply(
            f"no SSC-32 answers on {self.path} at {self._port.baud} baud",
            hint="check its power, its cable and the baud rate its jumpers or buttons are set to",
            port=self.path,
            servo_ids=tuple(self.ids[index] for index in group),
        )


def _is_version(data: bytes) -> bool:
    return data.startswith(b"SSC32") and data.endswith(b"\r") and data.count(b"\r") == 1
