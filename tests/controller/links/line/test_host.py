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
    end = time.monotonic() + 60
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


class TimedPort:
    """A port on a clock of its own: a read takes all of its time, and every line from ``answers_s`` on is accepted."""

    dropped = 0

    def __init__(self, answers_s: float = 0.0) -> None:
        self.now_s, self._answers_s = 0.0, answers_s
        self.sent: list[tuple[float, str]] = []
        self.waits: list[float] = []
        self._replies = b""

    def read(self, timeout_s: float) -> bytes:
        self.waits.append(timeout_s)
        self.now_s += max(timeout_s, 1e-7)  # time never stands still
        replies, self._replies = self._replies, b""
        return replies

    def write(self, data: bytes) -> None:
        tag, line = data.decode().rpartition("*")[0].split(" ", 1)
        self.sent.append((round(self.now_s, 5), line))
        if self.now_s >= self._answers_s:
            self._replies += f"{tag} OK\n".encode()


def played(script: Script, until_s: float, answers_s: float = 0.0) -> tuple[TimedPort, RobotHost]:
    port = TimedPort(answers_s)
    host = RobotHost(port, script, P, now_s=lambda: port.now_s)  # type: ignore[arg-type]
    host.run(lambda: port.now_s < until_s)
    return port, host


def test_it_greets_ten_times_a_second_until_it_is_answered_and_steps_count_from_then() -> None:
    script = Script(((0.0, "PING a"), (0.0, "PING b"), (0.25, "PING c"), (0.251, "PING d")))
    port, host = played(script, 1.0, answers_s=0.25)
    greetings = [(0.0, "HELLO"), (0.1, "HELLO"), (0.2, "HELLO"), (0.3, "HELLO")]
    assert port.sent == [*greetings, (0.4, "PING a"), (0.4, "PING b"), (0.65, "PING c"), (0.651, "PING d")]
    assert all(wait <= 0.02 + 1e-9 for wait in port.waits[4:])  # it looks often whether it shall end
    assert (host.counts["accepted"], host.counts["unasked"], host.counts["unanswered"]) == (5, 0, 0)


def test_a_far_end_that_takes_long_to_answer_is_greeted_too() -> None:
    """An answer that comes after the next greeting is one all the same."""
    port = TimedPort(answers_s=99.0)
    host = RobotHost(port, Script(((0.0, "PING a"),)), P, now_s=lambda: port.now_s)  # type: ignore[arg-type]
    write, late = port.write, list[tuple[float, bytes]]()

    def answered_late(data: bytes) -> None:
        write(data)
        late.append((port.now_s + 0.35, data.split(b" ", 1)[0] + b" OK\n"))

    def read(timeout_s: float) -> bytes:
        TimedPort.read(port, timeout_s)
        due = [reply for at_s, reply in late if at_s <= port.now_s]
        late[:] = [each for each in late if each[0] > port.now_s]
        return b"".join(due)

    port.write, port.read = answered_late, read  # type: ignore[method-assign]
    host.run(lambda: port.now_s < 1.5)
    assert [line for _, line in port.sent][-1] == "PING a" and host.counts["unasked"] == 0


def test_a_script_that_is_behind_ends_when_it_shall() -> None:
    """Where the far side does not read, each line takes long to send."""
    port = TimedPort()
    host = RobotHost(port, Script(tuple((0.0, f"PING {k}") for k in range(1000))), P, now_s=lambda: port.now_s)  # type: ignore[arg-type]
    write = port.write

    def slowly(data: bytes) -> None:
        write(data)
        port.now_s += 0.2

    port.write = slowly  # type: ignore[method-assign]
    host.run(lambda: port.now_s < 2.0)
    assert port.now_s < 3.0


def test_a_loop_repeats_its_steps_in_its_own_time() -> None:
    port, _ = played(Script(((0.0, "PING a"), (0.125, "PING b")), loop_s=0.25), 0.7)
    start = 0.1  # after the greeting
    assert [(round(at - start, 5), line[-1]) for at, line in port.sent[1:]] == [
        (0.0, "a"), (0.125, "b"), (0.25, "a"), (0.375, "b"), (0.5, "a")
    ]  # fmt: skip


def test_frames_come_at_their_rate_and_those_that_were_missed_are_left_out() -> None:
    port, host = played(Script((), frames_hz=20.0), 0.42)
    assert [round(at - 0.1, 5) for at, _ in port.sent[1:]] == pytest.approx([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3])
    assert all(line.startswith("FRAME ") and len(line.split()) == 60 for _, line in port.sent[1:])
    assert host._send_frame(2, 0.5) == 11  # ten periods and the first: one is sent for those between
    assert host._send_frame(11, 0.5) == 11 and len(port.sent) == 9
    assert len(played(Script(()), 0.5)[0].sent) == 1  # the greeting


def test_an_answer_is_waited_for_one_second() -> None:
    port = TimedPort(answers_s=99.0)
    host = RobotHost(port, Script(()), P, now_s=lambda: port.now_s)  # type: ignore[arg-type]
    host._greeted = True
    host.send("PING")
    host._listen(1.0)
    assert host.counts["unanswered"] == 0
    host._listen(1.01)
    assert host.counts["unanswered"] == 1 and not host._waiting


def test_the_first_twenty_refusals_are_kept_and_round_trips_are_in_milliseconds() -> None:
    port = TimedPort(answers_s=99.0)
    host = RobotHost(port, Script(()), P, now_s=lambda: port.now_s)  # type: ignore[arg-type]
    for i in range(1, 22):
        host.send(f"PING {i}")
    port.now_s = 0.25
    for i in range(1, 22):
        host._take(f"#{i} ERR 21 no".encode())
    assert host.counts["refused"] == 21 and len(host.refusals) == 20 and host.refusals[-1] == "PING 20 -> ERR 21 no"
    assert host.round_trip_ms.summary()["max"] == pytest.approx(250.0)
    assert host.report() == {
        "script": "", "sent": 21, "accepted": 0, "refused": 21, "unanswered": 0, "damaged": 0, "unasked": 0,
        "streamed": 0, "dropped_bytes": 0, "refusals": host.refusals, "round_trip_ms": host.round_trip_ms.summary(),
    }  # fmt: skip
    host._take(b"")
    host._take(b"OK without a tag")
    host._take(b"P 1 jawOpen=0")
    host._take(b"F 1 0")
    assert (host.counts["unasked"], host.counts["streamed"], host.counts["damaged"]) == (1, 2, 0)


def test_tags_have_nine_digits_at_most_and_begin_again_at_one(port: HostPort) -> None:
    host = RobotHost(port, Script(()), P)
    host.send("PING")
    assert list(host._waiting) == [1]
    host._tag = 999_999_997
    for _ in range(3):
        host.send("PING")
    assert list(host._waiting) == [1, 999_999_998, 999_999_999] and host._tag == 1
    assert host.counts["sent"] == 4
