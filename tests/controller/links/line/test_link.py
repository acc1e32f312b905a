"""The line protocol over real pseudo-terminals and a real serial port object."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line.hostport import HostPort
from controller.links.line.link import LineLink
from controller.links.line.protocol import MAX_REPLY, LineDecoder, Reply, format_words, parse_reply
from drivers.base.errors import PortMissing

LIMIT_S = 60.0


class Peer:
    """The other end of a link."""

    def __init__(self, port: HostPort) -> None:
        self.port = port
        self._decoder = LineDecoder(MAX_REPLY)
        self._lines: list[Reply] = []

    def send(self, data: bytes) -> None:
        self.port.write(data)

    def next(self, *kinds: str) -> Reply:
        """The next line of one of ``kinds``; others before it are dropped."""
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            while self._lines:
                reply = self._lines.pop(0)
                if not kinds or reply.kind in kinds:
                    return reply
            found = (parse_reply(line) for line in self._decoder.feed(self.port.read(0.1)))
            self._lines += [reply for reply in found if reply is not None]
        raise AssertionError("no answer")

    def ask(self, line: str) -> Reply:
        self.send(format_words([line], tag=7, checked=True))
        return self.next("OK", "ERR")


def eventually(question: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT_S
    while not question():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture
def state() -> CommandState:
    return CommandState(P)


@pytest.fixture
def port() -> Iterator[HostPort]:
    with HostPort() as port:
        yield port


@pytest.fixture
def link(port: HostPort, state: CommandState) -> Iterator[LineLink]:
    with LineLink(port.path, 115200, state, retry_s=0.02) as link:
        eventually(lambda: link.connected)  # what is sent before is thrown away by the opening of the port
        yield link


def test_a_line_in_is_answered_and_moves_the_face(port: HostPort, state: CommandState, link: LineLink) -> None:
    before = time.monotonic_ns()
    reply = Peer(port).ask("SET jawOpen 0.8")
    after = time.monotonic_ns()
    assert (reply.kind, reply.tag, reply.checked, reply.text) == ("OK", 7, True, "SET 1")
    out = P.neutral()
    stamp = state.tick(after, 0.01, out)
    assert before <= stamp <= after
    assert out[P.index("jawOpen")] > 0
    assert link.report()["accepted"] == 1


def test_noise_partial_and_overlong_lines(port: HostPort, link: LineLink) -> None:
    peer = Peer(port)
    peer.send(b"\xff\x00garbage\xfe\r\n")
    assert peer.next().code == 12
    for piece in (b"PI", b"NG ", b"hel", b"lo\r"):
        peer.send(piece)
        time.sleep(0.005)
    assert peer.next().text == "PONG hello"
    peer.send(b"x" * 5000 + b"\nPING\n")
    assert peer.next().code == 10 and peer.next().ok
    peer.send(b"PING\x85\n")
    assert peer.next().code == 11
    assert link.report()["refused"] == {"10": 1, "11": 1, "12": 1}


def test_many_lines_at_once_are_each_answered_in_order(port: HostPort, link: LineLink) -> None:
    peer = Peer(port)
    peer.send(b"".join(b"#%d SET jawOpen 0.5\n" % i for i in range(100)))
    assert [peer.next().tag for _ in range(100)] == list(range(100))


def test_a_subscription_streams_the_newest_values(port: HostPort, state: CommandState, link: LineLink) -> None:
    peer = Peer(port)
    assert peer.ask("SUB 100 jawOpen").ok
    assert peer.next("P").text.endswith(" jawOpen=0")
    peer.ask("SET jawOpen 1")
    now = time.monotonic_ns()
    for i in range(100):
        state.tick(now + i * 10_000_000, 0.01, P.neutral())
    eventually(lambda: peer.next("P").text.endswith(" jawOpen=1"))
    assert peer.ask("UNSUB").ok
    assert link.report()["streamed"]


def test_every_line_that_is_streamed_is_counted(port: HostPort, link: LineLink) -> None:
    peer, kinds = Peer(port), list[str]()
    peer.send(b"SUB 100 jawOpen\n")
    while kinds.count("P") < 3:
        kinds.append(peer.next().kind)
    peer.send(b"UNSUB\n")
    while kinds.count("OK") < 2:
        kinds.append(peer.next().kind)
    report = link.report()
    assert (report["streamed"], report["accepted"], report["dropped"]) == (kinds.count("P"), 2, 0)


def test_a_peer_that_does_not_read_never_holds_up_the_link(port: HostPort, state: CommandState, link: LineLink) -> None:
    port.write(b"SUB 200 ALL\n")
    eventually(lambda: link.report()["dropped"])
    port.write(b"SET jawOpen 1\n")
    eventually(lambda: state.status()["manual"] == 1)
    time.sleep(0.05)
    peer = Peer(port)
    reply = peer.next("OK")
    assert reply.text == "SUB 200 59"  # whole lines come out once it reads again
    assert peer.next("OK").text == "SET 1"


def test_a_port_that_vanishes_is_found_again(tmp_path: Path, state: CommandState) -> None:
    path = tmp_path / "robot"
    first = HostPort(path)
    with LineLink(str(path), 115200, state, retry_s=0.02) as link:
        peer = Peer(first)
        assert peer.ask("SET jawOpen 0.5").ok and peer.ask("SUB 50 jawOpen").ok
        taken = link.report()["bytes_in"]
        assert isinstance(taken, int)
        peer.send(b"SET ja")  # never ends
        eventually(lambda: link.report()["bytes_in"] == taken + 6)
        first.close()
        eventually(lambda: not link.connected)
        assert state.status()["manual"] == 1  # the face keeps what it was told
        with HostPort(path) as second:
            eventually(lambda: link.connected)
            peer = Peer(second)
            assert peer.next("P").text.endswith("jawOpen=0")  # the stream goes on
            assert peer.ask("PING").ok
            assert link.report()["reconnects"] == 1 and link.report()["refused"] == {}
            link.stop()
    assert not link.connected


def test_every_count_begins_at_nothing_and_bytes_are_counted_both_ways(port: HostPort, state: CommandState) -> None:
    link = LineLink(port.path, 115200, state)
    assert link.report() == {
        "port": port.path, "connected": False, "accepted": 0, "refused": {}, "bytes_in": 0, "bytes_out": 0,
        "unanswered": 0, "streamed": 0, "dropped": 0, "reconnects": 0, "faults": 0, "last_fault": "",
        "rate_hz": 0.0, "jitter_ms": 0.0, "lost": 0, "age_s": None, "error": "the port is not there",
    }  # fmt: skip
    with link:
        peer = Peer(port)
        peer.send(b"PING abc\n")
        assert peer.next().text == "PONG abc"
        eventually(lambda: link.report()["bytes_out"])
        assert (link.report()["bytes_in"], link.report()["bytes_out"]) == (9, len(b"OK PONG abc\n"))
        assert link.report()["age_s"] is not None and link.report()["error"] == ""


def test_a_missing_port_is_one_clear_error(tmp_path: Path, state: CommandState) -> None:
    with pytest.raises(PortMissing, match="no port"):
        LineLink(str(tmp_path / "none"), 115200, state).start()


def test_stop_may_be_called_again_and_before_start(port: HostPort, state: CommandState) -> None:
    link = LineLink(port.path, 115200, state)
    link.stop()
    descriptors = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    with LineLink(port.path, 115200, state) as link:
        link.stop()
    if descriptors:
        assert len(os.listdir("/proc/self/fd")) == descriptors


def test_a_fault_of_its_own_is_told_once_and_the_link_goes_on(
    port: HostPort,
    state: CommandState,
    link: LineLink,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(amount: float, stamp_ns: int) -> None:
        raise ZeroDivisionError("life is short")

    monkeypatch.setattr(state, "live", broken)
    peer = Peer(port)
    peer.send(b"PING a\nLIFE 1\n#2 LIFE 0\nPING b\n")
    answers = [peer.next() for _ in range(4)]
    assert [(reply.code, reply.tag) for reply in answers] == [(None, None), (31, None), (31, 2), (None, None)]
    assert answers[1].text == "an error in omote, see its log: ZeroDivisionError: life is short"
    assert (answers[0].text, answers[3].text) == ("PONG a", "PONG b")  # the fault costs no other line its answer
    assert link.report()["faults"] == 2
    assert link.report()["last_fault"] == "ZeroDivisionError: life is short"
    assert caplog.text.count("continues with the next line") == 1


def test_faults_that_repeat_leave_the_processor_to_others(
    port: HostPort, state: CommandState, monkeypatch: pytest.MonkeyPatch
) -> None:
    link, waits = LineLink(port.path, 115200, state), list[float]()
    monkeypatch.setattr(link._stopping, "wait", waits.append)

    def serve() -> None:
        link._stopping.set()  # this was the last time
        raise ValueError("mine")

    monkeypatch.setattr(link, "_serve", serve)
    link._run()
    assert link.report()["faults"] == 1 and len(waits) == 1 and 0.0 < waits[0] < 0.5


@pytest.mark.slow
def test_replies_beyond_the_buffer_are_dropped_whole_and_counted(port: HostPort, link: LineLink) -> None:
    count = 250
    for i in range(count):  # one after the other: what arrives at once is dropped at once
        port.write(b"LIST PARAMETERS\n")
        eventually(lambda i=i: link.report()["accepted"] == i + 1)
    dropped = link.report()["dropped"]
    assert isinstance(dropped, int) and 0 < dropped < count - 60  # 64 kB hold more than 60 of them
    peer = Peer(port)
    answers = {peer.next("OK").text for _ in range(count - dropped)}
    assert len(answers) == 1 and answers.pop().split()[2:] == list(P.names)
    assert link.report()["unanswered"] == dropped
    assert peer.ask("PING").text == "PONG"
    assert f" unanswered={dropped}" in peer.ask("STATUS").text + " "
    assert link.report()["bytes_in"] == count * 16 + len(b"#7 STATUS*HH\n#7 PING*HH\n")


def test_every_line_of_a_burst_is_answered_or_counted(port: HostPort, link: LineLink) -> None:
    peer, count = Peer(port), 4000
    for first in range(0, count, 500):
        peer.send(b"".join(b"#%d PING\n" % i for i in range(first, first + 500)))
    eventually(lambda: link.report()["accepted"] == count)
    unanswered = link.report()["unanswered"]
    assert isinstance(unanswered, int)
    tags = [peer.next("OK").tag for _ in range(count - unanswered)]
    assert tags == sorted(set(tags), key=lambda tag: tag or 0)
    assert f"unanswered={unanswered}" in peer.ask("STATUS").text.split()


def test_answers_that_a_lost_port_did_not_take_are_counted(tmp_path: Path, state: CommandState) -> None:
    path = tmp_path / "robot"
    first = HostPort(path)
    with LineLink(str(path), 115200, state, retry_s=0.02) as link:
        first.write(b"LIST PARAMETERS\n" * 200)  # more than a pseudo-terminal holds
        eventually(lambda: link.report()["accepted"] == 200)
        before = link.report()["unanswered"]
        assert isinstance(before, int)
        first.close()
        eventually(lambda: not link.connected)
        eventually(lambda: link.report()["unanswered"] > before)


def test_a_stop_acts_before_the_lines_that_arrived_with_it(port: HostPort, state: CommandState) -> None:
    seen: list[bool] = []
    link = LineLink(port.path, 115200, state)
    record, state.live = state.live, lambda amount, stamp_ns: seen.append(state.stop_latch.stopped is not None)  # type: ignore[method-assign]
    link._serial.open()
    port.write(b"LIFE 1\n" * 1500 + b"STOP\n")  # there before the link reads for the first time
    link._thread.start()
    try:
        peer = Peer(port)
        answers = [peer.next().text for _ in range(1501)]
        assert answers == ["LIFE 1"] * 1500 + ["STOP"] and seen == [True] * 1500
        assert state.stop_latch.stopped is not None and state.stop_latch.stopped.who == f"line {port.path}"
    finally:
        state.live = record  # type: ignore[method-assign]
        link.stop()


def test_the_setting_of_the_stage_reaches_the_link(port: HostPort, state: CommandState) -> None:
    with LineLink(port.path, 115200, state, checksum="required"):
        peer = Peer(port)
        peer.send(b"PING\n")
        assert peer.next().code == 13
        assert peer.ask("PING").ok
