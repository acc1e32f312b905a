"""Shows what a source sends on a layer of one face, and does what is to be done when the source is lost."""

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
"""How long a face is still shown that is said to be gone, or whose stream ended, where silence is no loss."""
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


class Shown:
    """What one face shows of a source.

    name : of the link, for STOP. path : file in which a neutral face is kept.

    Attributes
    ----------
    lost : no face is seen, or none came yet.

    Raises LinkError: that file is damaged.
    """

    def __init__(self, settings: NetSettings, sink: LayerSink, name: str, path: Path | None = None) -> None:
        self._settings, self._sink, self._name = settings, sink, name
        self.conditioning = Conditioning(settings, sink.parameters, path)
        self.lost = True  # nothing came yet: nothing to give back
        self._face_s = self._written_s = -np.inf
        self._gone = self._may_stop = False
        self._values, self._mask = sink.parameters.neutral(), np.zeros(len(sink.parameters), dtype=bool)

    def show(self, frame: Frame, now_s: float) -> None:
        """Show a face; one that is none leaves what is shown as it is for a while."""
        self._gone = not frame.face or not frame.mask.any()
        if self._gone:
            return
        self._face_s, self.lost, self._may_stop = now_s, False, True
        self._values, self._mask = self.conditioning.apply(frame, now_s)
        self._write(now_s)

    def watch(self, now_s: float, heard_s: float, *, ended: bool = False) -> None:
        """Keep the face of a slow source, and do what is to be done when it is lost.

        heard_s : when anything came of it. ended : its stream did, so nothing comes until there is another one.
        """
        if not self.lost and now_s - self._face_s > self._patience_s(ended or self._gone):
            self.lost = True
            self.conditioning.reset()
            self._lose(now_s)
        if self._may_stop and self._settings.lost == "stop" and now_s - heard_s > self._patience_s(ended):
            self._may_stop = False  # the wire is lost, not only the face
            self._sink.stop_latch.stop(self._name, int(now_s * 1e9))
        holds = self._settings.lost in ("hold", "neutral") or not self.lost
        if self._mask.any() and holds and now_s - self._written_s > _RENEW_S:
            self._write(now_s)

    def _patience_s(self, gone: bool) -> float:
        """How long to wait until a source is lost."""
        return GONE_S if gone and math.isinf(self._settings.silence_s) else self._settings.silence_s

    def _write(self, now_s: float) -> None:
        stamp_ns = int(now_s * 1e9)
        self._sink.write_layer(self._settings.layer, self._values, self._mask, stamp_ns, stamp_ns)
        self._written_s = now_s

    def _lose(self, now_s: float) -> None:
        what = self._settings.lost
        if what == "neutral":
            self._values = self._sink.parameters.neutral()
            self._write(now_s)
        elif what in ("fade", "stop"):
            self._sink.release_layer(self._settings.layer)
