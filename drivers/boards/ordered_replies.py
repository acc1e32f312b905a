"""Requests to boards whose answers carry neither a name nor a checksum and are identified by their order alone.

One answer that is missed, late or one byte too long would shift every later one. So each batch of requests ends with a
probe whose answer is known; where that is not found at its place, the whole batch is discarded, and nothing is asked
before the board has answered the probe alone, followed by silence.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from drivers.base.bus import Floats
from drivers.base.errors import NoReply
from drivers.boards.pulses import PulseBus
from drivers.port.serialport import SerialPort

RETRY_S = 1.0
"""Interval of probes to a silent board."""


class OrderedReplies:
    """Sends batches of requests to one board.

    Parameters
    ----------
    port : the open port.
    probe : a request that every board of the family answers.
    known : whether bytes are a whole answer to it.
    margin_s : gives the longest wait for an answer beyond its time on the wire.
    """

    def __init__(
        self, port: SerialPort, probe: bytes, known: Callable[[bytes], bool], margin_s: Callable[[], float]
    ) -> None:
        self._port, self._probe, self._known, self._margin_s = port, probe, known, margin_s
        self._answer = b""
        self._settled = False
        self._next_s = 0.0

    def ask(self, questions: bytes, count: int, *, insist: bool = False) -> bytes | None:
        """The ``count`` bytes that answer requests; None where they do not come, or may be something else.

        ``insist`` probes a silent board now and not only every ``RETRY_S``.
        """
        if insist:
            self._next_s = 0.0
        if not self._settled and not self._settle():
            return None
        self._port.drain()
        self._port.write(questions + self._probe)
        whole = count + len(self._answer)
        data = self._receive(len(questions) + len(self._probe), whole)
        extra = self._port.drain()
        if len(data) == whole and not extra and data.endswith(self._answer):
            return data[:count]
        self.reset()
        return None

    def reset(self) -> None:
        """Probe the board again before the next batch, as after opening the port or after an implausible answer."""
        self._settled, self._next_s = False, 0.0

    def _settle(self) -> bool:
        """Probe the board until its answer comes alone."""
        if self._port.clock() < self._next_s:
            return False
        self._port.drain()
        self._port.write(self._probe)
        data = self._receive(len(self._probe), 1)
        if data:
            data += self._quiet()
        self._settled = self._known(data)
        if self._settled:
            self._answer = data
        else:
            self._next_s = self._port.clock() + RETRY_S
        return self._settled

    def _quiet(self) -> bytes:
        """What comes until nothing came for a margin."""
        data, end = b"", self._port.clock() + 10 * self._margin_s()
        while got := self._port.read(min(self._port.clock() + self._margin_s(), end)):
            data += got
            if self._port.clock() >= end:
                break
        return data

    def _receive(self, sent: int, count: int) -> bytes:
        end, data = self._port.clock() + 10.0 * (sent + count) / self._port.baud + self._margin_s(), b""
        while len(data) < count:
            got = self._port.read(end)
            data += got
            if not got and self._port.clock() >= end:
                break
        return data


class OrderedBus(PulseBus):
    """A board of hobby servos that answers requests for its pulses in order; subclasses set ``_talk``.

    Attributes
    ----------
    SILENT, SILENT_HINT : error where it does not answer at the start; may name ``path``, ``baud`` and ``channels``.
    """

    SILENT: ClassVar[str]
    SILENT_HINT: ClassVar[str]
    _talk: OrderedReplies

    @abstractmethod
    def _ask_pulses(self, group: Sequence[int], insist: bool = False) -> Floats | None:
        """Pulses (len(group),) us that the board puts out for some servos, 0 for none; None: no answer."""

    def _open_link(self) -> None:
        super()._open_link()
        self._talk.reset()

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

    def _doubt(self) -> None:
        self._talk.reset()
