"""controller.cli.streams: whatever the standard streams are, a command says what is wrong and ends normally."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = "from controller.cli.app import main; main()"
FULL = Path("/dev/full")
LOST = "error: standard output cannot be written: "


def omote(redirection: str, *words: str, **settings: str) -> tuple[int, str]:
    """Exit code and standard error of a command that a shell starts with redirections."""
    script = f'exec "$@" {redirection}'
    command = ["sh", "-c", script, "sh", sys.executable, "-c", PROGRAM, *words]
    env = {**os.environ, **settings}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=env)
    return done.returncode, done.stderr


needs_full = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full, which is always full")


@needs_full
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_an_output_that_is_full_is_one_message(unbuffered: str) -> None:
    assert omote(">/dev/full", "--version", PYTHONUNBUFFERED=unbuffered) == (1, f"{LOST}No space left on device\n")


@needs_full
def test_help_notices_it_too() -> None:
    assert omote(">/dev/full", "--help") == (1, f"{LOST}No space left on device\n")


def test_a_closed_output_is_one_message_and_no_port_takes_its_place() -> None:
    assert omote(">&-", "--version") == (1, f"{LOST}Bad file descriptor\n")


@pytest.mark.parametrize("redirection", ["2>&-", pytest.param("2>/dev/full", marks=needs_full)])
def test_an_error_that_cannot_be_written_is_still_an_exit_code(redirection: str) -> None:
    assert omote(redirection, "check", "nope") == (1, "")


def test_every_stream_may_be_closed() -> None:
    assert omote("<&- >/dev/null 2>&-", "--version") == (0, "")


def test_text_that_an_encoding_lacks_is_written_as_its_code(tmp_path: Path) -> None:
    name = "面.tsv".encode()  # as bytes: the encoding of whoever runs this may lack it, too
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name)).write_text("0.0\taa\n0.6\tsil\n")
    command = [sys.executable, "-c", PROGRAM, "check", name]
    env = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    env["PYTHONPATH"] = str(Path(__file__).resolve().parents[3])
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert r"\u9762.tsv" in done.stdout
