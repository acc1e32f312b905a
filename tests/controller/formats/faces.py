"""Faces to encode, and what comes back of them."""

from __future__ import annotations

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS, Format
from controller.formats.frame import Frame

KINDS = sorted(kind for kind in FORMATS.kinds() if not FORMATS.package_of(kind))


def face(seed: int, time_s: float | None = None) -> Frame:
    """A face in which every parameter has some value in its range."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(np.maximum(P.low, -0.95), P.high)
    return Frame(values, np.ones(len(P), dtype=bool), time_s)


def there_and_back(form: Format, frames: list[Frame]) -> list[Frame]:
    """What a decoder makes of the messages of some frames."""
    encoder, decoder = form.encoder(P), form.decoder(P)
    return [found for frame in frames for message in encoder.encode(frame) for found in decoder.feed(message)]


def tolerance(form: Format) -> float:
    """How far a value may be from what was sent."""
    return 1e-4 + form.quantum
