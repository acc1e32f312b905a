"""Lets the surface tests import their helpers (`ball_head`)."""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def gl() -> None:
    """Skips where this machine can draw nothing at all (no OpenGL)."""
    from surface.base.errors import ViewError
    from surface.view.pictures.offscreen import open_context

    try:
        open_context().release()
    except ViewError as error:
        pytest.skip(f"{error}; try: {error.hint}")


@pytest.fixture
def full_disk() -> Iterator[Callable[[int], None]]:
    """Call it with a number of bytes: a file of this process can get no larger until the test ends."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda most: resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
