"""A port with pyserial's methods to a far end in stepped time: reads and pauses move the clock, nothing sleeps."""

from __future__ import annotations

import math
from typing import Any

import serial

from drivers.sim.serving.virtual import VirtualLink


class SteppedSerial(serial.SerialBase):  # type: ignore[misc]  # pyserial has no types
    """An open port; ``sleep`` lets time pass as ``time.sleep`` does on a real one.

    link : the wire. timeout : seconds that a read waits; None waits for ever.

    Reads raise TimeoutError where they would wait for ever.
    """

    def __init__(self, link: VirtualLink, timeout: float | None = None) -> None:
        self._link, self._arrived = link, b""
        super().__init__(baudrate=link.baud, timeout=timeout)
        self.port = "stepped"
        link.open()
        self.is_open = True

    def _reconfigure_port(self) -> None:
        self._link.set_baud(self._baudrate)

    def open(self) -> None:
        """It is open from the beginning; after `close` this opens it again."""
        if self.is_open:
            raise serial.SerialException("Port is already open.")
        self._link.open()
        self.is_open = True

    def close(self) -> None:
        """Close it."""
        if self.is_open:
            self._link.close()
            self.is_open = False

    def sleep(self, span_s: float) -> None:
        """Let time pass."""
        self._link.clock.sleep(span_s)
        self._link.advance()

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""
        self._take(self._link.clock())
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        """Up to ``size`` bytes; time passes until they have arrived, or until the time-out."""
        self._check_open()
        now_s = self._link.clock()
        end_s = math.inf if self._timeout is None else now_s + self._timeout
        while len(self._arrived) < size:
            if end_s == math.inf and self._link.due_s == math.inf:
                raise TimeoutError("this read has no time-out, and no byte is on its way")
            before = len(self._arrived)
            self._take(min(end_s, self._link.due_s))
            if len(self._arrived) == before and self._link.clock() >= end_s:
                break
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    def write(self, data: Any) -> int:
        """Send; a packet arrives when its last byte has passed the wire."""
        self._check_open()
        sent = bytes(serial.to_bytes(data))
        self._link.write(sent)
        return len(sent)

    def flush(self) -> None:
        """Nothing is kept back."""

    def reset_input_buffer(self) -> None:
        """Discard what has arrived."""
        self._take(self._link.clock())
        self._arrived = b""

    def reset_output_buffer(self) -> None:
        """Nothing is kept back."""

    def _take(self, until_s: float) -> None:
        self._arrived += self._link.read(until_s)

    def _check_open(self) -> None:
        if not self.is_open:
            raise serial.PortNotOpenError()

    def _update_rts_state(self) -> None:
        """There is no such line."""

    _update_dtr_state = _update_break_state = _update_rts_state
