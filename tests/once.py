"""What several test files need and what takes long to make: made once in a run, by the worker that needs it first."""

from __future__ import annotations

import fcntl
import os
import pickle
from collections.abc import Callable
from typing import TypeVar

import pytest

T = TypeVar("T")


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[], T]) -> T:
    """What ``make`` returns; other workers of pytest-xdist wait for it and get a copy, from a folder of this run."""
    folder = factory.getbasetemp()
    if os.environ.get("PYTEST_XDIST_WORKER"):
        folder = folder.parent
    file = folder / f"{name}.pickle"
    with open(folder / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not file.exists():
            made = make()
            file.with_suffix(".part").write_bytes(pickle.dumps(made))
            file.with_suffix(".part").replace(file)
        return pickle.loads(file.read_bytes())  # type: ignore[no-any-return]
