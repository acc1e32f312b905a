"""Shows the frames of a source on a layer of one face, and reacts when the source is lost."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.base.stop_latch import StopLatch
from controller.formats.frame import Frame
from controller.links.net.conditioning import Conditioning
from controller.links.net.settings import NetSettings

GONE_S = 0.5
"""How long a face is still shown after its source reported no face or its stream ended, if silence alone is no loss."""
_RENEW_INTERVAL_S = 0.3
"""How often a held face is written again, so that the time-out of its layer does not release it."""


class LayerSink(Protocol):
    """The face that values are written to; see :class:`controller.layers.commands.CommandSink`."""

    parameters: Parameters
    stop_latch: StopLatch

    def write_layer(self, name: str, values: Floats, mask: Flags, now_ns: int, stamp_ns: int = 0) -> None:
        """Set the values of a layer where the mask is set, and release the others."""

    def release_layer(self, name: str) -> None:
        """Fade out a layer."""


class Shown:
    """One face that shows a source.

    name : of the link, which a STOP reports. path : file in which the calibration is stored.

    Attributes
    ----------
    lost : whether the source is lost, or has not sent a face yet.

    Raises LinkError: that file is damaged.
    """

    def __init__(self, settings: NetSettings, sink: LayerSink, name: str, path: Path | None = None) -> None:
        self._settings, self._sink, self._name = settings, sink, name
        self.conditioning = Conditioning(settings, sink.parameters, path)
        self.lost = True  # nothing has come yet, so there is nothing to release
        self._face_s = self._written_s = -np.inf
        self._gone = self._may_stop = False
        self._values, self._mask = sink.parameters.neutral(), np.zeros(len(sink.parameters), dtype=bool)

    def show(self, frame: Frame, now_s: float) -> None:
        """Show the face of a frame; a frame without a face keeps the last face for a while."""
        self._gone = not frame.face or not frame.mask.any()
        if self._gone:
            return
        self._face_s, self.lost, self._may_stop = now_s, False, True
        self._values, self._mask = self.conditioning.apply(frame, now_s)
        self._write(now_s)

    def watch(self, now_s: float, heard_s: float, *, ended: bool = False) -> None:
        """Keep showing the face of a slow source, and apply the option ``lost`` when the source is lost.

        heard_s : when the source last sent anything. ended : whether its stream has ended.
        """
        if not self.lost and now_s - self._face_s > self._patience_s(ended or self._gone):
            self.lost = True
            self.conditioning.reset()
            self._lose(now_s)
        if self._may_stop and self._settings.lost == "stop" and now_s - heard_s > self._patience_s(ended):
            self._may_stop = False  # the connection is lost, not only the face
            self._sink.stop_latch.stop(self._name, int(now_s * 1e9))
        holds = self._settings.lost in ("hold", "neutral") or not self.lost
        if self._mask.any() and holds and now_s - self._written_s > _RENEW_INTERVAL_S:
            self._write(now_s)

    def _patience_s(self, gone: bool) -> float:
        """Return how long to wait until a source counts as lost (s)."""
        return GONE_S if gone and math.isinf(self._settings.silence_s) else self._settings.silence_s

    def _write(self, now_s: float) -> None:
        stamp_ns = int(now_s * 1e9)
        self._sink.write_layer(self._settings.layer, self._values, self._mask, stamp_ns, stamp_ns)
        self._written_s = now_s

    def _lose(self, now_s: float) -> None:
        reaction = self._settings.lost
        if reaction == "neutral":
            self._values = self._sink.parameters.neutral()
            self._write(now_s)
        elif reaction in ("fade", "stop"):
            self._sink.release_layer(self._settings.layer)
