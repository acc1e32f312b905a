"""Fits with few control points in few steps: on a simple mesh they show what many do."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from surface.fit.features import generic


@contextmanager
def fewer_points(count: int = 700) -> Iterator[None]:
    """Fit faces with ``count`` control points, in a third of the usual solves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generic, "POINTS", count)
        patch.setattr(generic, "GROWTH", 1.3)
        yield
