"""Base class of drivers for boards whose answers carry neither a name nor a checksum, only an order.

One answer that is missing, late or one byte too long would shift every later one. So each batch of requests ends with a
probe, a request whose answer is known. Where that is not at its place, the whole batch is discarded, and nothing is
requested until the board has answered a single probe, followed by silence.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import NoReply
from drivers.boards.pulses import PulseBus

RETRY_S = 1.0
"""Interval of probes to a silent board."""


class OrderedBus(PulseBus):
    """A board of hobby servos that answers requests for its pulses in order.

    SILENT, SILENT_HINT : error where it does not answer at the start; may name ``path``, ``baud`` and ``channels``.
    """

    SILENT: ClassVar[str]
    SILENT_HINT: ClassVar[str]

    def __init__(self, servos: Iterable[ServoSpec], **options: Any) -> None:
        super().__init__(servos, **options)
        self._probe_answer = b""
        self._doubt()

    @abstractmethod
    def _probe(self) -> bytes:
        """A request that every board of the family answers."""

    @abstractmethod
    def _answers_probe(self, data: bytes) -> bool:
        """Whether bytes are one whole answer to the probe."""

    @abstractmethod
    def _ask_pulses(self, group: Sequence[int], insist: bool = False) -> Floats | None:
        """Request the pulses (len(group),) us of some servos, 0 for no pulse; return None where no answer comes."""

    def _open_link(self) -> None:
        super()._open_link()
        self._doubt()

    def _begin(self) -> Floats:
        seen = np.full(len(self.servos), math.nan)
        for group in self._groups:
            pulses = self._ask_pulses(group, insist=True)
            if pulses is None:
                channels = ", ".join(str(self.ids[index]) for index in group)
                message = self.SILENT.format(path=self.path, baud=self._port.baud, channels=channels)
                raise self._error(NoReply, message, self.SILENT_HINT, group)
            seen[group] = pulses
        self._track.begin(seen)
        return self._scale.radians(seen)

    def _off_confirmed(self, index: int) -> bool:
        pulses = self._ask_pulses([index], insist=True)
        return pulses is not None and not pulses.any()

    def _poll(self) -> None:
        group = self._turn()
        pulses = self._ask_pulses(group)
        self._note_answer(pulses is not None)
        if pulses is None:
            self._report.count("no_reply")
        else:
            self._take(group, pulses.tolist())

    def _request(self, requests: bytes, count: int, insist: bool = False) -> bytes | None:
        """Send requests; return the ``count`` bytes of their answers, None where they do not come or are doubtful.

        ``insist`` probes a silent board now and not only every ``RETRY_S``.
        """
        if insist:
            self._next_s = 0.0
        if not self._synchronized and not self._synchronize():
            return None
        self._port.drain()
        probe, whole = self._probe(), count + len(self._probe_answer)
        self._port.write(requests + probe)
        data = self._receive(len(requests) + len(probe), whole)
        extra = self._port.drain()
        if len(data) == whole and not extra and data.endswith(self._probe_answer):
            return data[:count]
        self._doubt()
        return None

    def _doubt(self) -> None:
        """Probe the board again before the next requests, as after opening the port or after an implausible answer."""
        self._synchronized, self._next_s = False, 0.0

    def _synchronize(self) -> bool:
        """Probe the board; return whether its answer came, followed by silence."""
        if self._port.clock() < self._next_s:
            return False
        self._port.drain()
        probe = self._probe()
        self._port.write(probe)
        data = self._receive(len(probe), 1)
        if data:
            data += self._receive_until_quiet()
        self._synchronized = self._answers_probe(data)
        if self._synchronized:
            self._probe_answer = data
        else:
            self._next_s = self._port.clock() + RETRY_S
        return self._synchronized

    def _receive_until_quiet(self) -> bytes:
        data, end = b"", self._port.clock() + 10 * self._margin_s
        while got := self._port.read(min(self._port.clock() + self._margin_s, end)):
            data += got
            if self._port.clock() >= end:
                break
        return data

    def _receive(self, sent: int, count: int) -> bytes:
        end, data = self._port.clock() + 10.0 * (sent + count) / self._port.baud + self._margin_s, b""
        while len(data) < count:
            got = self._port.read(end)
            data += got
            if not got and self._port.clock() >= end:
                break
        return data
