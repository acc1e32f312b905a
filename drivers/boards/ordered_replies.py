"""Questions whose answers carry neither a name nor a checksum, and are told apart by their order alone.

One answer that is missed, late or one byte too long would shift every later one. So each batch of questions ends with
one whose answer is known; where that is not found at its place, nothing of the batch counts, and nothing is asked again
before the board has answered that question alone, into silence.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.port.serialport import SerialPort

RETRY_S = 1.0
"""A board that keeps silent is tried once in this time."""


class OrderedReplies:
    """Asks one board.

    Parameters
    ----------
    port : the open port.
    probe : a question that every board of the family answers.
    known : whether bytes are a whole answer to it.
    margin_s : gives the longest wait for an answer beyond its time on the wire.

    Attributes
    ----------
    stray : bytes thrown away because nobody asked for them.
    """

    def __init__(
        self, port: SerialPort, probe: bytes, known: Callable[[bytes], bool], margin_s: Callable[[], float]
    ) -> None:
        self._port, self._probe, self._known, self._margin_s = port, probe, known, margin_s
        self._answer = b""
        self._settled = False
        self._next_s = 0.0
        self.stray = 0

    def reset(self) -> None:
        """Begin anew, as after the port was opened."""
        self._settled, self._next_s = False, 0.0

    def ask(self, questions: bytes, count: int, *, insist: bool = False) -> bytes | None:
        """The ``count`` bytes that answer; None where they do not come, or may be something else.

        Parameters
        ----------
        insist : try to reach a silent board now, not only once in a while.
        """
        if insist:
            self._next_s = 0.0
        if not self._settled and not self._settle():
            return None
        self.stray += self._port.drain()
        self._port.write(questions + self._probe)
        whole = count + len(self._answer)
        data = self._receive(len(questions) + len(self._probe), whole)
        extra = self._port.drain()
        if len(data) == whole and not extra and data.endswith(self._answer):
            return data[:count]
        self.doubt()
        return None

    def doubt(self) -> None:
        """What came cannot be right: settle first before anything else is believed."""
        self._settled, self._next_s = False, 0.0

    def _settle(self) -> bool:
        """Bring the conversation back to a known place."""
        if self._port.clock() < self._next_s:
            return False
        self.stray += self._port.drain()
        self._port.write(self._probe)
        data = self._receive(len(self._probe), 1)
        if data:
            data += self._quiet()
        self._settled = self._known(data)
        if self._settled:
            self._answer = data
        else:
            self.stray += len(data)
            self._next_s = self._port.clock() + RETRY_S
        return self._settled

    def _quiet(self) -> bytes:
        """What else comes until nothing has come for a margin."""
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
