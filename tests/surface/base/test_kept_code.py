"""Compiled code that was kept is loaded without what only compilations need, and another kernel can still call it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from surface.base import jit
from surface.base.kept_code import speed_up_loading

FILES = {
    "inner.py": (
        "import numpy as np\n\nfrom surface.base.jit import kernel\n\n\n"
        "@kernel\ndef halves(x):\n    return np.full(2, 0.5 * x)\n"
    ),
    "outer.py": (
        "from surface.base.jit import kernel\n\nfrom .inner import halves\n\n\n"
        "@kernel\ndef whole(x):\n    return halves(x).sum()\n"
    ),
}
INNER = """
from surface.trial.inner import halves
print(halves(3.0).tolist(), sum(halves.stats.cache_hits.values()), sum(halves.stats.cache_misses.values()))
from numba.core.registry import cpu_target
print(len(cpu_target.target_context._registries))
"""
OUTER = """
from surface.trial.outer import whole
print(whole(3.0), sum(whole.stats.cache_hits.values()), sum(whole.stats.cache_misses.values()))
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package's base with two kernels, of which one calls the other."""
    shutil.copytree(jit.PACKAGE / "base", tmp_path / "surface/base", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(jit.PACKAGE / "__init__.py", tmp_path / "surface")
    (tmp_path / "surface/trial").mkdir()
    for name, text in FILES.items():
        (tmp_path / "surface/trial" / name).write_text(text)
    return tmp_path


def printed(folder: Path, code: str) -> list[str]:
    """The lines that a process of its own writes."""
    env = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    env.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.slow
def test_loading_a_kernel_loads_none_of_the_registries(copy: Path) -> None:
    compiled, registries = printed(copy, INNER)
    assert compiled == "[1.5, 1.5] 0 1"
    assert int(registries) > 0  # what a compilation needs
    assert printed(copy, INNER) == ["[1.5, 1.5] 1 0", "0"]


@pytest.mark.slow
def test_a_kernel_that_is_compiled_later_calls_one_that_was_loaded(copy: Path) -> None:
    printed(copy, INNER)
    both = INNER + OUTER
    assert printed(copy, both)[-1] == "3.0 0 1"
    assert printed(copy, both)[-1] == "3.0 1 0"
    assert printed(copy, OUTER) == ["3.0 1 0"]


def test_a_version_of_numba_with_other_parts_loads_as_it_is() -> None:
    kept = SimpleNamespace(_load_overload=len)
    speed_up_loading(kept)
    assert vars(kept) == {"_load_overload": len}


def test_data_of_another_form_is_rebuilt_by_numba() -> None:
    given: list[tuple[object, object]] = []
    impl = SimpleNamespace(rebuild=lambda context, data: given.append((context, data)))
    kept = SimpleNamespace(_load_overload=len, _guard_against_spurious_io_errors=len, _impl=impl)
    speed_up_loading(kept)
    engine = SimpleNamespace(_defined_symbols=set())
    context = SimpleNamespace(codegen=lambda: SimpleNamespace(_engine=engine))
    data = (("name", "bitcode", b"..."), "described", "signature")
    kept._impl.rebuild(context, data)
    assert given == [(context, data)]
    without = SimpleNamespace(codegen=SimpleNamespace)  # an engine without a list of its symbols
    data = (("name", "object", (b"machine code", b"bitcode")), "described", "signature")
    kept._impl.rebuild(without, data)
    assert given[1] == (without, data)
