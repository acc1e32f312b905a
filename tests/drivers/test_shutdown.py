"""drivers.shutdown: one clean-up, exactly once, on every way out, proved in processes of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from drivers.shutdown import stop_on_signals

PROGRAM = """
import os, signal, sys, time
from drivers.shutdown import stop_on_signals
calls = 0
def stop():
    global calls
    calls += 1
    os.kill(os.getpid(), signal.SIGINT)   # impatient: a second signal during the clean-up
    print("stopped", calls, flush=True)
with stop_on_signals(stop):
    print("ready", flush=True)
    if sys.argv[1] == "sleep":
        time.sleep(30)
    if sys.argv[1] == "raise":
        raise RuntimeError("in the loop")
    if sys.argv[1] == "exit":
        sys.exit(5)
"""


def run(root: Path, how: str, send: int | None = None) -> tuple[int, str]:
    child = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, how],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=root,
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    if send is not None:
        child.send_signal(send)
    with child.stdout as stream:
        out = stream.read()
    return child.wait(timeout=20), out


@pytest.mark.parametrize(
    ("how", "send", "code"),
    [
        ("end", None, 0),
        ("exit", None, 5),
        ("raise", None, 1),
        ("sleep", signal.SIGTERM, 143),
        ("sleep", signal.SIGHUP, 129),
        ("sleep", signal.SIGINT, -signal.SIGINT),
    ],
)
def test_every_way_out_stops_exactly_once(root: Path, how: str, send: int | None, code: int) -> None:
    assert run(root, how, send) == (code, "stopped 1\n")


def test_handlers_are_put_back() -> None:
    before = [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)]
    with stop_on_signals(lambda: None):
        assert signal.getsignal(signal.SIGTERM) is not before[1]
    assert [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)] == before


def test_an_error_of_the_clean_up_is_told_and_handlers_still_go_back() -> None:
    before = signal.getsignal(signal.SIGTERM)

    def fail() -> None:
        raise OSError("no")

    with pytest.raises(OSError, match="no"), stop_on_signals(fail):
        pass
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_thread_without_signals_still_stops_once() -> None:
    calls: list[int] = []

    def body() -> None:
        with stop_on_signals(lambda: calls.append(1)):
            pass

    thread = threading.Thread(target=body)
    thread.start()
    thread.join()
    assert calls == [1]
