"""A layer whose source can fail: the layer fades out then, and a new source begins from nothing."""

from __future__ import annotations

from collections.abc import Callable

from controller.base.parts import Part, Parts
from controller.layers.mixer import Layer


class LayerPart:
    """One source of values and the layer that it writes.

    name : of the source, for messages. write : writes what the layer shows at a time (s).
    renew : puts a new source in the place of one that failed.
    """

    def __init__(
        self, name: str, layer: Layer, parts: Parts, write: Callable[[float], None], renew: Callable[[], None]
    ) -> None:
        self._layer, self._write, self._renew = layer, write, renew
        self._part = parts.add(Part(name, effect="its layer fades out", ended=self._end))

    @property
    def share(self) -> float:
        """1 while the source is at work, and how far its layer has still to fade after a failure."""
        return self._layer.level if self._part.failed else 1.0

    def update(self, now_s: float) -> None:
        """Let the source write; one that failed begins again after its pause, once its layer has faded out."""
        if not self._part.failed or not self._layer.level:
            self._part.run(lambda: self._write(now_s), now_s)

    def _end(self) -> None:
        self._layer.release()
        self._renew()  # at once: other layers read the remaining values of this source
