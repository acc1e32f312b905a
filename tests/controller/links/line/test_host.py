"""The simulated robot host against a real link."""

from __future__ import annotations

import io
import itertools
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line import host as host_module
from controller.links.line.host import RobotHost, main
from controller.links.line.hostport import HostPort
from controller.links.line.link import LineLink
from controller.links.line.script import Script


@pytest.fixture
def port() -> Iterator[HostPort]:
    with HostPort() as port:
        yield port


def play(port: HostPort, script: Script, until: Callable[[RobotHost], bool]) -> tuple[RobotHost, CommandState]:
    """Play a script against a link until the host has seen enough."""
    state, host = CommandState(P), RobotHost(port, script, P)
    end = time.monotonic() + 10
    thread = threading.Thread(target=host.run, args=(lambda: time.monotonic() < end and not until(host),))
    with LineLink(port.path, 115200, state):
        thread.start()
        thread.join()
    return host, state


def test_it_greets_sends_its_steps_and_counts_the_answers(port: HostPort) -> None:
    script = Script(((0.0, "SUB 50 jawOpen"), (0.02, "SET jawOpen 0.5"), (0.04, "SET jawOpn 1"), (0.05, "EXPR anger")))
    host, state = play(port, script, lambda h: h.counts["accepted"] >= 4 and h.counts["streamed"] > 2)
    report = host.report()
    assert (report["accepted"], report["refused"], report["damaged"], report["unanswered"]) == (4, 1, 0, 0)
    assert host.refusals == ["SET jawOpn 1 -> ERR 23 unknown parameter 'jawOpn', did you mean 'jawOpen'?"]
    assert state.status()["manual"] == 1 and state.status()["expression"] == "anger"
    assert host.round_trip_ms.count == 5
    json.dumps(report)


def test_a_loop_begins_again(port: HostPort) -> None:
    host, _ = play(port, Script(((0.0, "PING"),), loop_s=0.03), lambda h: h.counts["accepted"] >= 6)
    assert host.counts["accepted"] >= 6 and not host.counts["refused"]


def test_frames_set_every_parameter(port: HostPort) -> None:
    host, state = play(port, Script((), frames_hz=100.0), lambda h: h.counts["accepted"] >= 20)
    assert state.status()["manual"] == 59 and not host.refusals


def test_without_a_controller_it_waits(port: HostPort) -> None:
    host = RobotHost(port, Script(((0.0, "PING"),)), P)
    end = time.monotonic() + 0.3
    host.run(lambda: time.monotonic() < end)
    assert host.counts["accepted"] == 0 and host.counts["unanswered"] == 0


def test_answers_that_are_late_damaged_or_unasked_are_counted(port: HostPort) -> None:
    now = [0.0]
    host = RobotHost(port, Script(()), P, now_s=lambda: now[0])
    host._greeted = True
    host.send("PING")
    for line in (b"#1 OK PONG*00", b"#99 OK", b"nonsense"):
        host._take(line)
    now[0] = 2.0
    host._forget(1.0)
    assert {kind: host.counts[kind] for kind in ("damaged", "unasked", "unanswered")} == {
        "damaged": 2, "unasked": 1, "unanswered": 1,
    }  # fmt: skip


def test_main_serves_until_its_input_ends(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                          monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    monkeypatch.setattr(host_module, "_stdin_open", itertools.chain([True], itertools.repeat(False)).__next__)
    monkeypatch.setattr(host_module.signal, "signal", lambda *_: None)
    assert main(["--script", "tour", "--link", str(tmp_path / "robot")]) == 0
    ready, report = capsys.readouterr().out.splitlines()
    assert ready.startswith("ready /dev/") and json.loads(report)["script"] == "tour"
    assert not (tmp_path / "robot").is_symlink()
    assert main(["--script", "nothing"]) == 1
    assert capsys.readouterr().out.startswith("failed ")


def test_input_that_ended_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with (tmp_path / "empty").open("w+") as file:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(file.buffer))
        assert not host_module._stdin_open()


def test_a_process_of_its_own_outlives_interrupts_and_ends_with_its_input(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "import sys; from controller.links.line.host import main; sys.exit(main())"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            assert process.stdout.readline().startswith("ready ")
            for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                process.send_signal(ending)
            process.stdin.close()
            assert json.loads(process.stdout.read())["script"] == "tour"
            assert process.wait(30) == 0
        finally:
            process.kill()


def test_tags_have_nine_digits_at_most_and_begin_again_at_one(port: HostPort) -> None:
    host = RobotHost(port, Script(()), P)
    host.send("PING")
    assert list(host._waiting) == [1]
    host._tag = 999_999_997
    for _ in range(3):
        host.send("PING")
    assert list(host._waiting) == [1, 999_999_998, 999_999_999] and host._tag == 1
    assert host.counts["sent"] == 4
