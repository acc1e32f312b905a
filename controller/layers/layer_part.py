"""Runs the source of a layer so that it can fail alone: the layer fades out, and a new source takes its place."""

from __future__ import annotations

from collections.abc import Callable

from controller.base.parts import Part, Parts
from controller.layers.mixer import Layer


class LayerPart:
    """One source of values and the layer that it writes.

    name : of the source, for messages. write : writes the layer for a time (s).
    renew : replaces a source that failed by a new one.
    """

    def __init__(
        self, name: str, layer: Layer, parts: Parts, write: Callable[[float], None], renew: Callable[[], None]
    ) -> None:
        self._layer, self._write, self._renew = layer, write, renew
        self._part = parts.add(Part(name, effect="its layer fades out", ended=self._end))

    @property
    def share(self) -> float:
        """1 while the source works; after a failure the level to which its layer has faded out so far."""
        return self._layer.level if self._part.failed else 1.0

    def update(self, now_s: float) -> None:
        """Let the source write; a source that failed restarts after a pause, once its layer has faded out."""
        if not self._part.failed or not self._layer.level:
            self._part.run(lambda: self._write(now_s), now_s)

    def _end(self) -> None:
        self._layer.release()
        self._renew()  # now, because other layers read the remaining values of this source
