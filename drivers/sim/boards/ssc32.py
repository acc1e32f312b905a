"""A simulated Lynxmotion SSC-32 servo controller: lines of text, one byte of pulse width back.

Source: SSC-32U guide, pages 24-33; a pulse of 0 stops the pulses, ``STOP n`` ends a move where it is, ESC forgets the
line that has begun. `PO` is not modelled.
"""

from __future__ import annotations

import re
from typing import Any

from drivers.sim.boards.board import Board, RcChannel
from drivers.sim.wire.line import BufferingReader
from drivers.sim.wire.simulator import BoardOptions, Simulator

CHANNELS = 32
MIN_US, MAX_US = 500, 2500
QUERY_US = 10
"""One step of a queried pulse width (SSC-32U guide, pages 24-33, Query Pulse Width: 10 us)."""
VERSION = b"SSC32-V2.50USB\r"
MAX_LINE = 2048

_NUMBER = r"\d{1,9}"
_MOVE = re.compile(rf"#({_NUMBER})P({_NUMBER})(?:S({_NUMBER}))?")
_ONE = re.compile(rf"(QP|STOP)({_NUMBER})")
_GROUP = re.compile(rf"(?:#{_NUMBER}P{_NUMBER}(?:S{_NUMBER})?)+(?:T({_NUMBER}))?")


class LineReader(BufferingReader):
    """Cuts a byte stream into lines: CR ends one, ESC forgets what has begun of one.

    Spaces, tabs and LF are passed over, case does not count.
    """

    def feed(self, data: bytes) -> list[str]:
        """Lines completed by these bytes, without blanks and in capitals; empty ones are left out."""
        data = (self._buffer + data).translate(None, b" \t\n")
        *lines, rest = (line.rpartition(b"\x1b")[2] for line in data.split(b"\r"))
        self._buffer = rest if len(rest) <= MAX_LINE else b""
        return [line.decode("latin-1").upper() for line in lines if line]


class Ssc32(Board):
    """An SSC-32 on one port.

    channels : the outputs, microseconds. refused : lines that were not understood; the board ignores them.
    """

    def reset(self, now_s: float) -> None:
        """The state after power-on: no pulses."""
        self.channels = [RcChannel() for _ in range(CHANNELS)]

    def make_reader(self) -> LineReader:
        return LineReader()

    def size(self, packet: str) -> int:
        return len(packet) + 1

    def answer(self, packet: str, now_s: float) -> list[tuple[int, bytes]]:
        if packet == "Q":
            return [(0, b"+" if any(channel.moving(now_s) for channel in self.channels) else b".")]
        if packet == "VER":
            return [(0, VERSION)]
        match = _ONE.fullmatch(packet)
        if match and int(match[2]) < CHANNELS:
            return self._one(match[1], int(match[2]), now_s)
        if not self._move(packet, now_s):
            self.refused += 1
        return []

    def _one(self, word: str, number: int, now_s: float) -> list[tuple[int, bytes]]:
        """A query or a stop of one channel."""
        pulse = self.channels[number].position(now_s)
        if word == "QP":
            return [(number, bytes((round(pulse / QUERY_US),)))]
        self.channels[number].go(pulse, now_s)
        return []

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """Pulse width in microseconds and target of each channel."""
        return [channel.describe(k, now_s) for k, channel in enumerate(self.channels)]

    def _move(self, line: str, now_s: float) -> bool:
        """A group move: with T all channels arrive together, with S none is faster; False = not understood.

        A move of several channels takes as long as its slowest member, so that they arrive together; a channel without
        pulses jumps to its target at once.
        """
        group = _GROUP.fullmatch(line)
        if group is None:
            return False
        moves = [(int(number), int(pulse), int(speed or 0)) for number, pulse, speed in _MOVE.findall(line)]
        if any(number >= CHANNELS or (pulse and not MIN_US <= pulse <= MAX_US) for number, pulse, _ in moves):
            return False
        seconds = int(group[1] or 0) * 1e-3
        for number, pulse, speed in moves:
            if speed and pulse and self.channels[number].target:
                seconds = max(seconds, abs(pulse - self.channels[number].position(now_s)) / speed)
        for number, pulse, _ in moves:
            self.channels[number].go_in(float(pulse), now_s, seconds)
        return True


SIMULATOR = Simulator(
    far_end=lambda servos, options, setting: Ssc32(setting.now_s, seed=setting.seed),
    alone=lambda options, setting: Ssc32(setting.now_s, seed=setting.seed),
    options=BoardOptions,
    help="""Serve a simulated Lynxmotion SSC-32 until interrupted; prints `ready PATH`.

    Example: omote simulate ssc32 --link /tmp/ssc32
    """,
)
