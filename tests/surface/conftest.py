"""Lets the surface tests import their helpers (`ball_head`)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def gl() -> None:
    """Skips where this machine can draw nothing at all (no OpenGL)."""
    from surface.errors import ViewError
    from surface.view.offscreen import open_context

    try:
        open_context().release()
    except ViewError as error:
        pytest.skip(f"{error}; try: {error.hint}")
