"""The line protocol over real TCP connections on loopback."""

from __future__ import annotations

import math
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.line import server
from controller.links.line.protocol import MAX_REPLY, LineDecoder, Reply, parse_reply
from controller.links.line.server import LineServer
from controller.links.links import open_links, read_link
from drivers import open_bus
from drivers.base.bus import ServoSpec
from tests.controller.links.net.sockets import free_port, wait_for

TOKEN = "a-token-for-tests"


class Peer:
    """A client."""

    def __init__(self, port: int) -> None:
        self.call = socket.create_connection(("127.0.0.1", port), 10.0)
        self._decoder, self._lines = LineDecoder(MAX_REPLY), list[Reply]()

    def send(self, text: str) -> None:
        self.call.sendall(text.encode())

    def next(self) -> Reply:
        while not self._lines:
            data = self.call.recv(65536)
            assert data, "it hung up"
            self._lines += [reply for line in self._decoder.feed(data) if (reply := parse_reply(line))]
        return self._lines.pop(0)

    def ask(self, line: str) -> Reply:
        self.send(line + "\n")
        return self.next()

    def is_hung_up(self) -> bool:
        try:
            while self.call.recv(65536):
                pass
        except ConnectionResetError:
            pass
        return True


class Far:
    """A face with a link over TCP."""

    def __init__(self, closers: ExitStack, **keys: object) -> None:
        self.port, self.state, self._closers = free_port(socket.SOCK_STREAM), CommandState(P), closers
        (self.link,) = open_links(
            [read_link({"listen": f"127.0.0.1:{self.port}", **keys})], LinkContext(self.state, closers)
        )

    def call(self) -> Peer:
        peer = Peer(self.port)
        self._closers.callback(peer.call.close)
        return peer


@pytest.fixture
def far() -> Iterator[Callable[..., Far]]:
    with ExitStack() as closers:
        yield lambda **keys: Far(closers, **keys)


def test_several_clients_have_conversations_of_their_own(far: Callable[..., Far]) -> None:
    there = far()
    one, two = there.call(), there.call()
    assert one.ask("#1 SET jawOpen 0.5*B0").code == 13 and two.ask("#2 SET jawOpen 0.5").tag == 2
    assert one.ask("HELLO checksum=required").text.endswith("checksum=required")
    assert one.ask("PING").code == 13 and two.ask("PING").ok
    assert two.ask("LIST LAYERS").text == "LIST LAYERS " + " ".join(there.state.layer_names())
    wait_for(lambda: there.link.report()["accepted"] == 4)
    report = there.link.report()
    assert (report["clients"], report["served"], report["refused"]) == (2, 2, {"13": 2})
    assert report["connected"] and report["age_s"] < 10.0 and report["error"] == ""


def test_a_stream_goes_to_the_client_that_asked_for_it(far: Callable[..., Far]) -> None:
    there = far()
    one, two = there.call(), there.call()
    assert one.ask("SUB 100 jawOpen").ok
    assert [one.next().kind for _ in range(3)] == ["P", "P", "P"]
    assert two.ask("PING").text == "PONG"


def test_stop_and_start_work_and_say_who(far: Callable[..., Far]) -> None:
    there = far()
    one, two = there.call(), there.call()
    assert one.ask("STOP").ok
    stopped = there.state.stop_latch.stopped
    assert stopped is not None and stopped.who == f"line 127.0.0.1:{one.call.getsockname()[1]}"
    assert "stopped=line_127.0.0.1" in two.ask("STATUS").text
    assert two.ask("START").ok and there.state.stop_latch.stopped is None


def test_places_are_bounded_and_become_free(far: Callable[..., Far]) -> None:
    there = far(clients=1)
    one = there.call()
    assert one.ask("PING").ok
    refused = there.call().next()
    assert (refused.code, refused.text) == (30, "all 1 places are taken")
    one.call.close()
    wait_for(lambda: there.link.report()["clients"] == 0)
    assert there.call().ask("PING").ok
    report = there.link.report()
    assert (report["accepted"], report["turned_away"]) == (2, {"full": 1})


def test_a_client_that_floods_and_does_not_read_holds_nobody_up(far: Callable[..., Far]) -> None:
    there = far()
    bad, good = there.call(), there.call()
    bad.call.setblocking(False)
    with pytest.raises(BlockingIOError):
        while True:
            bad.call.send(b"SUB 200 ALL\nLIST PARAMETERS\nREAD MOOD\n" * 1000)
    assert good.ask("SET jawOpen 0.25").ok
    assert there.state.status()["manual"] == 1
    assert there.link.report()["clients"] == 2


def test_an_error_of_omote_is_a_fault_of_one_client(far: Callable[..., Far], monkeypatch: pytest.MonkeyPatch) -> None:
    there = far()
    one = there.call()
    assert one.ask("PING").ok
    monkeypatch.setattr(server.Talk, "serve", lambda *_: 1 / 0)
    one.send("PING\n")
    wait_for(lambda: there.link.report()["faults"])
    monkeypatch.undo()
    assert one.ask("PING").ok and "ZeroDivisionError" in str(there.link.report()["last_fault"])


@pytest.mark.parametrize("request_", ["POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "x\r\nHost: 127.0.0.1\r\n\r\n"])
def test_what_a_web_page_sends_is_turned_away(far: Callable[..., Far], request_: str) -> None:
    there = far()
    page = there.call()
    page.send(request_ + "SET jawOpen 1\nSTOP\n")
    assert page.is_hung_up()
    assert there.state.status()["manual"] == 0 and there.state.stop_latch.stopped is None
    wait_for(lambda: there.link.report()["turned_away"] == {"browser": 1})


def test_a_token_comes_first(far: Callable[..., Far]) -> None:
    there = far(token=TOKEN)
    peer = there.call()
    for line in ("PING", "STOP", "AUTH", "HELLO"):
        assert peer.ask(line).code == 32
    assert there.state.stop_latch.stopped is None
    assert peer.ask(f"#3 auth {TOKEN}").text == "AUTH"
    assert peer.ask("STOP").ok and there.state.stop_latch.stopped is not None


def test_who_guesses_tokens_is_sent_away(far: Callable[..., Far]) -> None:
    there = far(token=TOKEN)
    peer = there.call()
    assert [peer.ask(f"AUTH {TOKEN}{n}").code for n in range(3)] == [32] * 3
    assert peer.is_hung_up()
    wait_for(lambda: there.link.report()["turned_away"] == {"token": 1})


def test_who_gives_no_token_is_sent_away(far: Callable[..., Far], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_AUTH_TIMEOUT_S", 0.05)
    assert far(token=TOKEN).call().is_hung_up()


def test_without_a_token_auth_means_nothing(far: Callable[..., Far]) -> None:
    assert far().call().ask("AUTH whatever").text == "AUTH"


def test_another_omote_drives_this_one_as_a_robot_head(far: Callable[..., Far]) -> None:
    there = far()
    servo = ServoSpec(0, "jaw", "parameter", 0.0, math.pi / 2, 50.0, 900.0, wire_name="jawOpen")
    bus = open_bus("omote", [servo], port=f"socket://127.0.0.1:{there.port}", margin_s=2.0)
    bus.open()
    try:
        bus.start()
        for _ in range(50):
            bus.write(np.array([math.pi / 4]))
        wait_for(lambda: there.state.mixer["manual"].values[P.index("jawOpen")] > 0.0)
    finally:
        bus.close()
    assert not there.state.status()["manual"]


@pytest.mark.slow
def test_the_example_without_ros_talks_to_a_face(far: Callable[..., Far], root: Path) -> None:
    one = far(token=TOKEN)
    program = [sys.executable, "-I", str(root / "examples" / "3_without_ros.py"), f"127.0.0.1:{one.port}"]
    done = subprocess.run([*program, TOKEN], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) > 5 and all("GET jawOpen=" in line for line in done.stdout.splitlines())
    assert one.state.status()["gaze"] == "off", "it ended with NEUTRAL"
    refused = subprocess.run(program, capture_output=True, text=True, timeout=60, check=False)
    assert refused.returncode == 1 and "32" in refused.stderr and "Traceback" not in refused.stderr


def test_an_address_that_is_taken_is_told_with_what_to_do(far: Callable[..., Far]) -> None:
    there = far()
    with pytest.raises(LinkError, match="cannot listen") as told:
        LineServer(read_link({"listen": f"127.0.0.1:{there.port}"}).own, there.state)
    assert str(there.port) in told.value.hint
