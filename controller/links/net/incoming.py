"""Takes the faces of one source into a layer; only the newest counts, and nothing queues."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Protocol

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.base.stop_latch import StopLatch
from controller.formats.frame import Refusals
from controller.links.net.conditioning import Conditioning
from controller.links.net.decoding import Arrived, Decoding
from controller.links.net.meter import Meter
from controller.links.net.receivers import Gate, Receiver
from controller.links.net.settings import NetSettings

PASS_S = 0.004
"""Shortest time from one look at what has arrived to the next."""
REST = 3.0
"""How long a link rests after it has read, in multiples of that time: a flood costs about a quarter of a core."""
_WAIT_S = 0.1
_RENEW_S = 0.3
"""How often a face that holds is written again, so that its layer's own time-out does not release it."""


class LayerSink(Protocol):
    """Where values go; see :class:`controller.layers.commands.CommandSink`."""

    parameters: Parameters
    stop_latch: StopLatch

    def write_layer(self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        """Give a layer values where the mask is set, and release the rest."""

    def release_layer(self, name: str) -> None:
        """Let a layer fade out."""


class Incoming:
    """Listens in its own thread until it is stopped.

    name : of the link, for STOP and the thread. path : file in which a neutral face is kept. gate : the receiver's.

    Raises LinkError: that file is damaged.
    """

    def __init__(
        self, settings: NetSettings, receiver: Receiver, sink: LayerSink, name: str, path: Path | None = None,
        gate: Gate | None = None,
    ) -> None:  # fmt: skip
        self.name = name
        self._settings, self._receiver, self._sink = settings, receiver, sink
        address = settings.incoming
        streams = address is not None and address.transport != "udp"
        self._decoding = Decoding(settings.form, sink.parameters, streams=streams, newest=True)
        self._conditioning = Conditioning(settings, sink.parameters, path)
        self._meter = Meter()
        self._turned_away = gate.turned_away if gate is not None else Refusals()
        self._sender, self._heard_s, self._face_s = "", -np.inf, -np.inf
        self._lost = True  # nothing came yet: nothing to give back
        self._values, self._mask = sink.parameters.neutral(), np.zeros(len(sink.parameters), dtype=bool)
        self._written_s = -np.inf
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"link {name}", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def stop(self) -> None:
        """Stop listening, keep what was learned, and give back what was opened.

        Raises ControllerError: what was learned cannot be kept.
        """
        self._stopping.set()
        if self._thread.ident is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._receiver.close()
        if self._settings.ranges:
            self._conditioning.save()

    def report(self) -> dict[str, object]:
        """Counts, rate, jitter, loss, age, who sends, and the last error."""
        now_s = time.monotonic()
        return {
            "accepted": self._meter.frames,
            "refused": {**self._decoding.refused, **self._turned_away},
            **self._meter.report(now_s),
            "sender": self._sender,
            "face": not self._lost,
            "neutral_known": self._conditioning.neutral_known,
            "error": self._receiver.error,
        }

    def _run(self) -> None:
        next_s = 0.0
        while not self._stopping.is_set():
            self._stopping.wait(max(0.0, next_s - time.monotonic()))
            received = self._receiver.receive(_WAIT_S)
            now_s = time.monotonic()
            newest = self._newest(self._decoding.feed(received), now_s)
            if newest is not None:
                self._show(newest, now_s)
            self._watch(now_s)
            next_s = now_s + max(PASS_S, (1.0 + REST) * (time.monotonic() - now_s))

    def _newest(self, arrived: list[Arrived], now_s: float) -> Arrived | None:
        """The newest frame of the one source that counts; others are heard only when that one is silent."""
        newest = None
        for each in arrived:
            if not self._counts(each, now_s):
                continue
            self._meter.note(now_s, each.frame.sequence, each.skipped)
            newest = each
        return newest

    def _counts(self, arrived: Arrived, now_s: float) -> bool:
        wanted, host = self._settings.source, arrived.sender.rpartition(":")[0]
        if wanted is not None and wanted not in (arrived.sender, host, arrived.frame.subject):
            self._decoding.refused.add("another source than the one to take")
            return False
        who = f"{arrived.sender} {arrived.frame.subject}".strip()
        if who != self._sender and now_s - self._heard_s <= min(self._settings.silence_s, 1.0):
            self._decoding.refused.add("a second source while the first one sends")
            return False
        self._sender, self._heard_s = who, now_s
        return True

    def _show(self, arrived: Arrived, now_s: float) -> None:
        if not arrived.frame.face or not arrived.frame.mask.any():
            return
        self._face_s, self._lost = now_s, False
        self._values, self._mask = self._conditioning.apply(arrived.frame, now_s)
        self._write(now_s)

    def _write(self, now_s: float) -> None:
        stamp_ns = int(now_s * 1e9)
        self._sink.write_layer(self._settings.layer, self._values, self._mask, stamp_ns, stamp_ns)
        self._written_s = now_s

    def _watch(self, now_s: float) -> None:
        """Keep the face of a slow source, and do what is to be done when it is lost."""
        if not self._lost and now_s - self._face_s > self._settings.silence_s:
            self._lost = True
            self._conditioning.reset()
            self._lose(now_s)
        holds = self._settings.lost in ("hold", "neutral") or not self._lost
        if self._mask.any() and holds and now_s - self._written_s > _RENEW_S:
            self._write(now_s)

    def _lose(self, now_s: float) -> None:
        what = self._settings.lost
        if what == "neutral":
            self._values = np.zeros_like(self._values)
            self._write(now_s)
        elif what in ("fade", "stop"):
            self._sink.release_layer(self._settings.layer)
        if what == "stop" and now_s - self._heard_s > self._settings.silence_s:  # the wire is lost, not only the face
            self._sink.stop_latch.stop(self.name, int(now_s * 1e9))
