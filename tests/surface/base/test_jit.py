"""Compiled code is kept until a file changes that it was made from."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from surface.base import jit

ROOT = jit.PACKAGE.parent
FILES = {
    "numbers.py": "AMOUNT = 3.0\n",
    "shared.py": (
        "from surface.base.jit import inlined\n\nfrom .numbers import AMOUNT\n\n\n"
        "@inlined\ndef add(x):\n    return x + AMOUNT\n"
    ),
    "user.py": (
        "from surface.base.jit import kernel\n\nfrom .shared import (\n    add,\n)\n\n\n"
        "@kernel\ndef twice(x):\n    return 2.0 * add(x)\n"
    ),
}
RUN = """
from surface.trial.user import twice
result = twice(1.0)
print(result, sum(twice.stats.cache_hits.values()))
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package's base with three files more: a number, a shared kernel, and one that uses it."""
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(jit.PACKAGE / "base", tmp_path / "surface" / "base", ignore=skipped)
    shutil.copy(jit.PACKAGE / "__init__.py", tmp_path / "surface")
    (tmp_path / "surface" / "trial").mkdir()
    for name, text in FILES.items():
        (tmp_path / "surface" / "trial" / name).write_text(text)
    return tmp_path


def run(folder: Path) -> list[float]:
    """What the kernel gives in a process of its own, and how often compiled code was found on disk."""
    env = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    env.pop("NUMBA_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", RUN], cwd=folder, env=env, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


@pytest.mark.slow
def test_an_edited_file_recompiles_the_kernels_that_depend_on_it(copy: Path) -> None:
    trial = copy / "surface" / "trial"
    assert run(copy) == [8.0, 0]
    assert run(copy) == [8.0, 1]
    (trial / "shared.py").write_text(FILES["shared.py"].replace("x + AMOUNT", "x - AMOUNT"))
    assert run(copy) == [-4.0, 0]
    assert run(copy) == [-4.0, 1]
    (trial / "numbers.py").write_text("AMOUNT = 5.0\n")
    assert run(copy) == [-8.0, 0]
    (copy / "surface" / "__init__.py").write_text("# nothing that a kernel depends on\n")
    assert run(copy) == [-8.0, 1]


def kernel_modules() -> list[str]:
    """Every module of the package that has compiled kernels."""
    paths = (p for p in sorted(jit.PACKAGE.rglob("*.py")) if p != Path(jit.__file__))
    return [".".join(p.relative_to(ROOT).with_suffix("").parts) for p in paths if "jit import" in p.read_text("utf-8")]


@pytest.mark.parametrize("name", kernel_modules())
def test_every_file_whose_kernels_a_file_calls_is_watched(name: str) -> None:
    module = importlib.import_module(name)
    watched = jit.dependencies(Path(str(module.__file__)))
    for value in vars(module).values():
        functions = [value] if isinstance(value, CPUDispatcher) else []
        if getattr(value, "__name__", "").startswith("surface."):  # a module, whose kernels may be called
            functions = [v for v in vars(value).values() if isinstance(v, CPUDispatcher)]
        for function in functions:
            assert Path(function.py_func.__code__.co_filename) in watched, function


def said(folder: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """What a process of its own that uses the kernel writes."""
    env = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", **settings}
    return subprocess.run([sys.executable, "-c", RUN], cwd=folder, env=env, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_compiling_for_the_first_time_says_so_once(copy: Path) -> None:
    first, second = said(copy), said(copy)
    assert first.stderr == "compiling the kernels of surface for this machine: up to a minute, only once\n"
    assert (second.stdout, second.stderr) == ("8.0 1\n", "")


@pytest.mark.slow
def test_kernels_run_where_no_compiled_code_can_be_kept(copy: Path) -> None:
    nowhere = {"NUMBA_CACHE_DIR": "/dev/null/cache", "HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null"}
    for folder in copy.rglob("*.py"):
        (folder.parent / "__pycache__").unlink(missing_ok=True)
        if not (folder.parent / "__pycache__").exists():
            (folder.parent / "__pycache__").touch()  # a file, so that there is no such folder for root either
    result = said(copy, **nowhere)
    assert result.stdout == "8.0 0\n", result.stderr
    assert result.stderr.count("set NUMBA_CACHE_DIR") == 1  # for all kernels together


def test_kernels_run_on_a_full_disk(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    def refuse(self: object, signature: object, data: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.FunctionCache.save_overload", refuse)
    jit._log_once.cache_clear()

    @jit.kernel
    def double(x):
        return 2.0 * x

    assert double(2.0) == 4.0
    assert "No space left on device" in caplog.text


def test_a_nonallocating_kernel_counts_no_references() -> None:
    def shifted(array):  # type: ignore[no-untyped-def]
        rest = array[1:]
        return rest[0] + array[0]

    compiled = jit.nonallocating(shifted)
    assert compiled(np.array([1.0, 2.0])) == 3.0
    compiled.recompile()  # code that an earlier run has kept cannot be looked into
    assert not any("call void @NRT_incref" in text for text in compiled.inspect_llvm().values())


def test_a_nonallocating_kernel_may_call_one_that_allocates() -> None:
    @jit.kernel
    def allocating(array):  # type: ignore[no-untyped-def]
        return np.zeros(3).sum() + array[0]

    assert jit.nonallocating(lambda array: allocating(array[1:]) + array[0])(np.array([1.0, 2.0])) == 3.0


TOGETHER = """
import sys, time
from numba.core import event
from surface.base import jit

class Log(event.Listener):
    def on_start(self, event):
        print("compiles", flush=True)
        time.sleep(1.0)  # so that the other process comes to the same kernel meanwhile

    def on_end(self, event):
        pass

event.register("numba:compile", Log())
from surface.trial.user import twice
print("ready", flush=True)
sys.stdin.readline()
print(twice({}), len(twice.stats.cache_hits), flush=True)
"""


def start_together(copy: Path, *values: str) -> list[str]:
    """What processes write that use the kernel at the same time, each with a value of its own."""
    env = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", TOGETHER.format(value)],
            cwd=copy, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        for value in values
    ]  # fmt: skip
    for each in started:
        assert each.stdout is not None and each.stdout.readline() == "ready\n"
    for each in started:
        assert each.stdin is not None
        each.stdin.write("\n")
        each.stdin.flush()
    return [each.communicate(timeout=240)[0] for each in started]


@pytest.mark.slow
@pytest.mark.skipif(jit.fcntl is None, reason="files cannot be locked here")
def test_of_two_processes_one_compiles_and_the_other_loads(copy: Path) -> None:
    assert sorted(start_together(copy, "1.0", "1.0")) == ["8.0 1\n", "compiles\n8.0 0\n"]


@pytest.mark.slow
@pytest.mark.skipif(jit.fcntl is None, reason="files cannot be locked here")
def test_code_for_other_types_that_is_kept_at_once_is_not_overwritten(copy: Path) -> None:
    assert sorted(start_together(copy, "1.0", "2")) == ["compiles\n10.0 0\n", "compiles\n8.0 0\n"]
    assert sorted(start_together(copy, "1.0", "2")) == ["10.0 1\n", "8.0 1\n"]


@pytest.mark.slow
@pytest.mark.skipif(jit.fcntl is None, reason="files cannot be locked here")
def test_a_process_that_was_stopped_while_it_compiled_holds_up_no_other_for_ever(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    program = (
        "import sys; from surface.base import jit\n"
        "with jit._hold_lock('name'):\n    print('held', flush=True)\n    sys.stdin.readline()\n"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        monkeypatch.setattr(jit, "MAX_WAIT_S", 0.1)
        with jit._hold_lock("name"):
            assert other.poll() is None
        other.communicate("\n")
