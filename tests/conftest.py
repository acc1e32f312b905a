"""Fixtures every room's tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout's root folder."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the large reference data; a checkout without it skips the tests that need it."""
    if not (SHARED / "data").is_dir():
        pytest.skip("needs ../shared/data (reference meshes and takes), which this checkout does not have")
    return SHARED
