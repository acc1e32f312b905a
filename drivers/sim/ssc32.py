"""A simulated Lynxmotion SSC-32 servo controller: lines of text, one byte of pulse width back.

Source: SSC-32U guide, pages 24-33. `PO`, `STOP` and ESC are not modelled.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from drivers.sim.faults import Fault
from drivers.sim.line import Line
from drivers.sim.rc import RcChannel
from drivers.sim.replies import Reply

CHANNELS = 32
MIN_US, MAX_US = 500, 2500
VERSION = b"SSC32-V2.50USB\r"
MAX_LINE = 2048

_MOVE = re.compile(r"#(\d+)P(\d+)(?:S(\d+))?")
_GROUP = re.compile(r"(?:#\d+P\d+(?:S\d+)?)+(?:T(\d+))?")


class LineReader:
    """Cuts a byte stream into lines: CR ends one, spaces, tabs and LF are passed over, case does not count."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """A line waits for its end as long as it takes."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[str]:
        """Lines completed by these bytes, without blanks and in capitals; empty ones are left out."""
        self._buffer += bytes(byte for byte in data if byte not in b" \t\n")
        *lines, rest = bytes(self._buffer).split(b"\r")
        self._buffer = bytearray(rest if len(rest) <= MAX_LINE else b"")
        return [line.decode("latin-1").upper() for line in lines if line]

    def flush(self) -> list[str]:
        """Nothing is given up."""
        return []

    def take_pending(self) -> bytes:
        """Forget the incomplete line."""
        data = bytes(self._buffer)
        self._buffer.clear()
        return data


class Ssc32(Line):
    """An SSC-32 on one port.

    Parameters
    ----------
    now_s : time.
    faults : only ``echo`` and ``unplug``.

    Attributes
    ----------
    channels : the outputs, microseconds.
    refused : lines that were not understood; the board passes over them without a word.
    """

    def __init__(self, now_s: float = 0.0, faults: Iterable[str | Fault] = ()) -> None:
        super().__init__(kinds=("echo", "unplug"))
        self.channels = [RcChannel() for _ in range(CHANNELS)]
        self.refused = 0
        self.faults.add(faults, now_s)

    def make_reader(self) -> LineReader:
        """A reader of lines."""
        return LineReader()

    def size(self, packet: str) -> int:
        """Bytes of a line on the wire."""
        return len(packet) + 1

    def carry_out(self, packet: str, now_s: float) -> list[Reply]:
        """Do what a line says."""
        if packet == "Q":
            return [Reply(b"+" if any(channel.moving(now_s) for channel in self.channels) else b".", None)]
        if packet == "VER":
            return [Reply(VERSION, None)]
        if packet.startswith("QP") and packet[2:].isdecimal() and int(packet[2:]) < CHANNELS:
            pulse = self.channels[int(packet[2:])].position(now_s)
            return [Reply(bytes((round(pulse / 10),)), None)]
        if not self._move(packet, now_s):
            self.refused += 1
        return []

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """Pulse width in microseconds and target of each channel."""
        return [
            {"id": k, "pulse_us": channel.position(now_s), "target_us": channel.target}
            for k, channel in enumerate(self.channels)
        ]

    def _move(self, line: str, now_s: float) -> bool:
        """A group move: with T all channels arrive together, with S none is faster; False = not understood.

        A move of several channels takes as long as its slowest member, so that they arrive together.
        """
        group = _GROUP.fullmatch(line)
        if group is None:
            return False
        moves = [(int(number), int(pulse), int(speed or 0)) for number, pulse, speed in _MOVE.findall(line)]
        if any(number >= CHANNELS or not MIN_US <= pulse <= MAX_US for number, pulse, _ in moves):
            return False
        seconds = int(group[1] or 0) * 1e-3
        for number, pulse, speed in moves:
            if speed:
                seconds = max(seconds, abs(pulse - self.channels[number].position(now_s)) / speed)
        for number, pulse, _ in moves:
            self.channels[number].go_in(float(pulse), now_s, seconds)
        return True
