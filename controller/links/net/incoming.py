"""Receives the faces of one source and shows them on a layer; only the newest counts, and nothing queues."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError
from controller.formats.frame import Frame, Refusals
from controller.layers.sink import Directory
from controller.links.net.decoding import Arrived, Decoding
from controller.links.net.meter import Meter
from controller.links.net.receivers import Gate, Received, Receiver
from controller.links.net.settings import NetSettings
from controller.links.net.shown import LayerSink, Shown

MIN_READ_INTERVAL_S = 0.004
"""Shortest time from one read to the next."""
REST_FACTOR = 3.0
"""How long a link pauses after a read, in multiples of the time it took, so that a flood costs a quarter of a core."""
_WAIT_S = 0.1


class Incoming:
    """Receives in its own thread until it is stopped.

    name : of the link, for STOP and the thread. path : file in which the calibration is stored. gate : the receiver's,
    whose rejections are reported.

    Attributes
    ----------
    receiver : where the faces come from.

    Raises LinkError: that file is damaged.
    """

    def __init__(
        self, settings: NetSettings, receiver: Receiver, sink: LayerSink, name: str, path: Path | None = None,
        gate: Gate | None = None,
    ) -> None:  # fmt: skip
        self.name = name
        self._settings, self.receiver, self._sink = settings, receiver, sink
        address = settings.incoming
        streams = address is not None and address.transport != "udp"
        self._decoding = Decoding(settings.form, sink.parameters, streams=streams, newest=True)
        self._home = Shown(settings, sink, name, path)
        self._others: dict[str, Shown] = {}  # of heads and groups that messages named
        self._meter = Meter()
        self._turned_away = gate.turned_away if gate is not None else Refusals()
        self._sender, self._heard_s = "", -np.inf
        self._from, self._ended = "", False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"link {name}", daemon=True)

    def start(self) -> None:
        """Start receiving."""
        self._thread.start()

    def stop(self) -> None:
        """Stop receiving, close the receiver, and store learned ranges.

        Raises ControllerError: they cannot be stored.
        """
        self._stopping.set()
        if self._thread.ident is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self.receiver.close()
        if self._settings.ranges:
            self._home.conditioning.save()

    def report(self) -> dict[str, object]:
        """Return counts, rate, jitter, loss, age, the sender, and the last error."""
        now_s = time.monotonic()
        return {
            "accepted": self._meter.frames,
            "refused": {**self._decoding.refused, **self._turned_away},
            **self._meter.report(now_s),
            "sender": self._sender,
            "face": not self._home.lost or any(not shown.lost for shown in self._others.values()),
            "neutral_known": self._home.conditioning.neutral_known,
            "error": self.receiver.error,
        }

    def _run(self) -> None:
        next_s = 0.0
        while not self._stopping.is_set():
            self._stopping.wait(max(0.0, next_s - time.monotonic()))
            received = self.receiver.receive(_WAIT_S)
            now_s = time.monotonic()
            for newest in self._newest(self._decoding.feed(received), now_s).values():
                self._show(newest.frame, now_s)
            self._ended = self._has_ended(received)
            for shown in (self._home, *self._others.values()):
                shown.watch(now_s, self._heard_s, ended=self._ended)
            next_s = now_s + max(MIN_READ_INTERVAL_S, (1.0 + REST_FACTOR) * (time.monotonic() - now_s))

    def _has_ended(self, received: Received) -> bool:
        """Whether the stream of the accepted source has ended and no other source has been accepted since."""
        pieces = [data for sender, data in received if sender == self._from]
        return not pieces[-1] if pieces else self._ended

    def _newest(self, arrived: list[Arrived], now_s: float) -> dict[str, Arrived]:
        """Return the newest frame of the accepted source for each head that it names.

        Another source is accepted only when this one is silent.
        """
        newest = {}
        for each in arrived:
            if not self._accept(each, now_s):
                continue
            self._meter.note(now_s, each.frame.sequence, each.skipped)
            newest[each.frame.to] = each
        return newest

    def _accept(self, arrived: Arrived, now_s: float) -> bool:
        """Check the source of a frame, and note an accepted one as the current source."""
        wanted, host = self._settings.source, arrived.sender.rpartition(":")[0]
        if wanted is not None and wanted not in (arrived.sender, host, arrived.frame.subject):
            self._decoding.refused.add("another source than the one to take")
            return False
        who = f"{arrived.sender} {arrived.frame.subject}".strip()
        is_heard = not self._ended and now_s - self._heard_s <= min(self._settings.silence_s, 1.0)
        if who != self._sender and is_heard:
            self._decoding.refused.add("a second source while the first one sends")
            return False
        self._sender, self._from, self._heard_s, self._ended = who, arrived.sender, now_s, False
        return True

    def _show(self, frame: Frame, now_s: float) -> None:
        shown = self._home if not frame.to else self._shown_by(frame.to)
        if shown is not None:
            shown.show(frame, now_s)

    def _shown_by(self, name: str) -> Shown | None:
        """Return what shows the source on a head or group; None if there is no such head."""
        heads: Directory | None = getattr(self._sink, "heads", None)
        key = name.removeprefix("@").lower()
        if key not in self._others:
            try:
                if heads is None:
                    raise ParameterError(f"{name}: there are no heads here")
                self._others[key] = Shown(self._settings, heads.find(name), self.name)
            except ParameterError:
                self._decoding.refused.add("for a head that is not here")
                return None
        return self._others[key]
