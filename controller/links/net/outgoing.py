"""Sends the current face to another program at a steady rate."""

from __future__ import annotations

import time
from typing import Protocol

from controller.base.parameters import Floats, Parameters
from controller.formats.frame import Frame
from controller.links.net.senders import Sender
from controller.links.net.settings import NetSettings
from controller.links.net.steady import SteadyThread


class FaceSource(Protocol):
    """The source of the face; see :class:`controller.layers.commands.CommandSink`."""

    parameters: Parameters

    def snapshot(self, out: Floats) -> None:
        """Copy the current parameters to ``out`` : (P,)."""

    def measured(self, out: Floats) -> bool:
        """Copy the face that the servos show to ``out`` : (P,); return False if no servo reports its position."""


class Outgoing:
    """Sends in its own thread until it is stopped."""

    def __init__(self, settings: NetSettings, sender: Sender, source: FaceSource, name: str) -> None:
        self._sender, self._source = sender, source
        self._encoder = settings.form.encoder(source.parameters)
        form, parameters = settings.form, source.parameters
        self._mask, self._sends = form.carries(parameters) | form.about(parameters), settings.sends
        self.sent = self.dropped = 0
        self._start_s = 0.0
        self._thread = SteadyThread(
            f"link {name}, out", 1.0 / settings.rate_hz, lambda now_s: self._send(now_s - self._start_s)
        )

    def start(self) -> None:
        """Start sending."""
        self._start_s = time.monotonic()
        self._thread.start()

    def stop(self) -> None:
        """Stop sending and close the sender."""
        self._thread.stop()
        self._sender.close()

    def report(self) -> dict[str, object]:
        """Return the numbers of messages that were sent and dropped, and the last error."""
        return {"sent": self.sent, "dropped": self.dropped, "send_error": self._sender.error}

    def _send(self, time_s: float) -> None:
        frame = self._frame(time_s)
        for message in self._encoder.encode(frame) if frame is not None else ():
            if self._sender.send(message):
                self.sent += 1
            else:
                self.dropped += 1

    def _frame(self, time_s: float) -> Frame | None:
        """Return the frame to send now; None if only the servos' face is wanted and none reports its position."""
        face, servos = self._source.parameters.neutral(), self._source.parameters.neutral()
        self._source.snapshot(face)
        known = self._sends != "face" and self._source.measured(servos)
        if self._sends == "servos":
            return Frame(servos, self._mask, time_s) if known else None
        return Frame(face, self._mask, time_s, measured=servos if known else None)
