"""drivers.base.shutdown: one clean-up, exactly once, on every way out, proved in processes of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.base.shutdown import Closers, combine_with_context, stop_on_signals

PROGRAM = """
import os, signal, sys, time
from drivers.base.errors import DriverError, NoReply, PortLost
from drivers.base.shutdown import Closers, stop_on_signals, combine_with_context
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
    class Busy:
        def __del__(self):
            print("ready", flush=True)
            time.sleep(0.2)
    while sys.argv[1] == "destructor":
        Busy()
"""


def run(root: Path, how: str, send: int | None = None) -> tuple[int, str]:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, how],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=root,
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        if send is not None:
            child.send_signal(send)
        try:
            status = child.wait(timeout=20)
        finally:
            child.kill()
        return status, child.stdout.read()


@pytest.mark.parametrize(
    ("how", "send", "code"),
    [
        ("end", None, -signal.SIGINT),  # that of the clean-up, which nothing else ends the program for
        ("exit", None, 5),
        ("raise", None, 1),
        ("sleep", signal.SIGTERM, 143),
        ("sleep", signal.SIGHUP, 129),
        ("sleep", signal.SIGINT, -signal.SIGINT),
        ("destructor", signal.SIGTERM, 143),
        ("destructor", signal.SIGINT, -signal.SIGINT),
    ],
)
def test_every_way_out_stops_exactly_once(root: Path, how: str, send: int | None, code: int) -> None:
    status, out = run(root, how, send)
    assert (status, out.replace("ready\n", "")) == (code, "stopped 1\n")


def test_a_signal_at_the_ordinary_end_is_not_lost() -> None:
    with pytest.raises(SystemExit) as caught, stop_on_signals(lambda: signal.raise_signal(signal.SIGTERM)):
        pass
    assert caught.value.code == 128 + signal.SIGTERM


def test_an_error_that_ends_the_program_counts_more_than_a_signal_after_it() -> None:
    with pytest.raises(OSError, match="no"), stop_on_signals(lambda: signal.raise_signal(signal.SIGTERM)):
        raise OSError("no")


def test_a_hangup_that_is_ignored_stays_ignored() -> None:
    """As under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_on_signals(lambda: None):
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


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


def test_everything_runs_and_every_failure_is_told() -> None:
    calls: list[str] = []

    def fail(name: str, servo: int, hint: str) -> None:
        calls.append(name)
        raise NoReply(f"{name} not off", hint=hint, servo_ids=(servo,))

    closers = Closers()
    closers.callback(fail, "neck", 3, "switch the power off")
    closers.callback(calls.append, "link")
    closers.callback(fail, "jaw", 7, "switch the power off")
    with pytest.raises(DriverError, match="2 things failed: jaw not off; neck not off") as caught:
        closers.close()
    assert calls == ["jaw", "link", "neck"]
    assert (caught.value.hint, caught.value.servo_ids) == ("switch the power off", (7, 3))
    closers.close()  # it is done


def test_one_failure_is_told_as_it_is() -> None:
    closers = Closers()
    error = NoReply("jaw not off")

    def fail() -> None:
        raise error

    closers.callback(fail)
    with pytest.raises(NoReply) as caught:
        closers.close()
    assert caught.value is error


def test_an_error_on_the_way_out_does_not_hide_what_led_there() -> None:
    def stop() -> None:
        try:
            raise OSError("cable")
        except OSError as cause:
            raise PortLost("port lost: cable", hint="plug it in") from cause

    with pytest.raises(PortLost) as caught:
        try:
            raise NoReply("servo 3 is silent", hint="check its cable")
        finally:
            stop()
    told = combine_with_context(caught.value)
    assert str(told) == "2 things failed: servo 3 is silent; port lost: cable"
    assert isinstance(told, DriverError)
    assert told.hint == "check its cable; plug it in"


class Dropped:
    """Raises an error in its destructor, where Python drops it."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def __del__(self) -> None:
        raise self.error


def test_only_what_a_signal_raised_in_the_main_thread_is_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda dropped: told.append(dropped.exc_value))
    hook = sys.unraisablehook
    errors = [ValueError("no signal"), SystemExit(5), SystemExit("128"), SystemExit(128)]
    with stop_on_signals(lambda: None):
        for error in errors:
            Dropped(error)
        thread = threading.Thread(target=lambda: Dropped(KeyboardInterrupt()) and None)
        thread.start()
        thread.join()
    assert told[:4] == errors
    assert [type(error) for error in told[4:]] == [KeyboardInterrupt]
    assert sys.unraisablehook is hook


@pytest.mark.parametrize("code", [128 + signal.SIGTERM, 128 + signal.SIGHUP])
def test_an_exit_for_a_signal_that_was_dropped_is_raised_again(code: int) -> None:
    before = signal.getsignal(signal.SIGTERM)
    calls: list[int] = []
    with pytest.raises(SystemExit) as caught, stop_on_signals(lambda: calls.append(1)):
        Dropped(SystemExit(code))
        calls.append(0)
    assert (caught.value.code, calls) == (code, [1])
    assert signal.getsignal(signal.SIGTERM) is before
