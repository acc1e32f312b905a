"""docs/testing-your-robot.md: its files are written as a reader would write them, and pytest runs them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import drivers.testing  # noqa: F401

pytest_plugins = ["pytester"]

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "testing-your-robot.md").read_text(encoding="utf-8")
FILES = {
    name: text for text, name in re.findall(r"```(?:python|cpp)\n((?:#|//) (\S+)\n[\s\S]*?)```", PAGE)
}  # fmt: skip
NAIVE = "test_my_robot.py"
ALONE = ("-p", "no:xdist", "-p", "no:hypothesispytest", "-p", "no:cacheprovider")
"""Plug-ins that the page's tests do without; hypothesis takes seconds."""


@pytest.fixture(autouse=True, scope="module")
def numba_is_whole() -> None:
    """numba loads a part of itself when it first compiles, and cannot load it twice: a run of pytest in this process
    forgets the modules that it has loaded.
    """
    import numba  # compiling is what other tests may not have done yet

    assert numba.njit(lambda x: x + 1)(1) == 2


@pytest.fixture
def folder(pytester: pytest.Pytester) -> Path:
    """A folder with all files of the page; the makers' SDKs wait longer than the 34 ms they grant a USB adapter."""
    for name, text in FILES.items():
        (pytester.path / name).write_text(text)
    (pytester.path / "conftest.py").write_text(
        "import dynamixel_sdk.port_handler, scservo_sdk.port_handler\n"
        "dynamixel_sdk.port_handler.LATENCY_TIMER = scservo_sdk.port_handler.LATENCY_TIMER = 2000\n"
    )
    return pytester.path


def test_every_block_of_the_page_is_a_file() -> None:
    assert len(FILES) == len(re.findall(r"```(?:python|cpp)\n", PAGE)) >= 12


def test_five_lines_find_the_jump_of_a_naive_program(pytester: pytest.Pytester, folder: Path) -> None:
    assert len([line for line in FILES[NAIVE].splitlines()[1:] if line.strip()]) == 5
    result = pytester.runpytest_inprocess(NAIVE, *ALONE)
    result.assert_outcomes(failed=1)
    shown = re.search(
        r"```text\n([\s\S]*?) at [\d.]+ s, and its torque", PAGE
    )  # a busy machine may be too late for that
    assert shown is not None
    said = " ".join(re.sub(r"\nE +", " ", "\n".join(result.outlines)).split())
    pattern = re.sub(r"\d+(?:\\\.\d+)?", r"[\\d.]+", re.escape(" ".join(shown[1].split())))
    assert re.search(pattern, said), said


@pytest.mark.slow
def test_all_other_tests_of_the_page_pass(pytester: pytest.Pytester, folder: Path) -> None:
    result = pytester.runpytest_inprocess("--ignore", NAIVE, "-rs", *ALONE)
    outcomes = result.parseoutcomes()
    assert set(outcomes) <= {"passed", "skipped"} and outcomes["passed"] >= 8, outcomes


def test_it_works_without_pytest(folder: Path) -> None:
    done = subprocess.run([sys.executable, "plain.py"], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout.split()[1] == "2048"
