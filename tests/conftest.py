"""Fixtures every room's tests share."""

from __future__ import annotations

import gc
import importlib.util
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

# Before numpy, which the conftest of a folder imports that is named on the command line: its threads
# would spin where the tests beside this one have work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"
SETTINGS = (
    "FORCE_COLOR",
    "NO_COLOR",
    "CLICOLOR",
    "CLICOLOR_FORCE",
    "COLUMNS",
    "LINES",
    "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
)
"""By these a user tells programs how to write; a test that is about one of them sets it."""
LONGEST = (
    "tests/test_docs_shell.py",
    "tests/surface/fit/transfer/test_transfer.py",
    "tests/test_wheel.py",
    "tests/surface/check/test_check_head.py",
    "tests/surface/fit/surfaces/test_api.py",
    "tests/surface/fit/eyes/test_drawn_lids.py",
    "tests/test_rooms.py",
    "tests/controller/tools/test_simulate.py",
    "tests/test_fuzz_files.py",
    "tests/surface/fit/surfaces/test_groupfile.py",
    "tests/surface/fit/wardrobe/test_main.py",
    "tests/test_extending.py",
    "tests/test_extras.py",
    "tests/controller/robot/test_anchors.py",
    "tests/surface/fit/test_round_trip.py",
    "tests/test_process_kill.py",
    "tests/surface/base/test_jit.py",
    "tests/surface/fit/eyes/test_search.py",
    "tests/surface/view/test_window.py",
    "tests/surface/view/draw/test_renderer.py",
    "tests/test_examples.py",
)
"""Files that take longest, in this order: they begin first, so that no worker is left alone with one at the end."""


def pytest_configure() -> None:
    """Make what programs here find the same for every user, before anything of omote is imported."""
    for name in SETTINGS:
        os.environ.pop(name, None)
    os.environ["TERM"] = "xterm-256color"
    os.environ["OMOTE_STATE"] = tempfile.mkdtemp(prefix="omote-state-")  # not the user's own
    gc.disable()  # until all tests are collected: nothing of that is garbage, and there is much of it to look through
    if hasattr(os, "setpriority"):
        os.setpriority = keeping_priority(os.setpriority)
    # a shell starts what runs in the background with Ctrl-C ignored, and nohup ignores the terminal's end
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)


def pytest_collection_finish() -> None:
    """Collect garbage from now on, but look no more through modules and tests, which stay until the end."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Workers of ``-n auto``: one more than there are processors, since many tests wait for processes and clocks."""
    return 1 + len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1 + (os.cpu_count() or 1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first, for a run with several workers."""
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(rank)))


def keeping_priority(change: Callable[[int, int, int], None]) -> Callable[[int, int, int], None]:
    """``os.setpriority`` that leaves the main thread of this process as it is: a test that runs a face in it would
    slow down all tests after it where the machine is busy."""
    own = os.getpid()

    def setpriority(which: int, who: int, priority: int) -> None:
        if os.getpid() != own or threading.current_thread() is not threading.main_thread():
            change(which, who, priority)

    return setpriority


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


@pytest.fixture(scope="session")
def benchmark() -> Callable[[str], ModuleType]:
    """Loads a program of the folder benchmarks, which is no package, by its name."""

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(name, ROOT / "benchmarks" / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load
