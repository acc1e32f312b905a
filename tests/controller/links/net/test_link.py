"""Links in the formats, over real sockets: in, out, lost and found again."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.layers.commands import CommandState
from controller.links.kind import LINKS, LinkContext
from controller.links.line.hostport import HostPort
from controller.links.links import open_links, read_link
from tests.controller.formats.faces import face
from tests.controller.links.net.sockets import free_port, wait_for

Open = Callable[..., "Far"]
JAW = P.index("jawOpen")


class Far:
    """A face with one link, and what sends to it."""

    def __init__(self, closers: ExitStack, kind: str, **keys: object) -> None:
        self.port = free_port()
        self.state = CommandState(P)
        self.form = FORMATS.get(kind)
        self._encoder = self.form.encoder(P)
        settings = {"kind": kind, "listen": f"127.0.0.1:{self.port}", **keys}
        (self.link,) = open_links([read_link(settings)], LinkContext(self.state, closers))
        self._socket = closers.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._time_s = 0.0

    def send(self, frame: Frame) -> None:
        self._time_s += 1 / 60
        timed = Frame(frame.values, frame.mask, self._time_s, None, frame.face)
        for message in self._encoder.encode(timed):
            self._socket.sendto(message, ("127.0.0.1", self.port))

    def jaw(self, value: float) -> None:
        values = P.neutral()
        values[JAW] = value
        self.send(Frame(values, np.ones(len(P), dtype=bool)))

    @property
    def layer(self) -> np.ndarray:
        return self.state.mixer["capture"].values

    @property
    def holding(self) -> int:
        return self.state.mixer["capture"].holding


@pytest.fixture
def far() -> Iterator[Open]:
    with ExitStack() as closers:
        yield lambda kind="livelink", **keys: Far(closers, kind, **keys)


@pytest.mark.parametrize("kind", ["livelink", "vmc"])
def test_a_face_that_arrives_is_the_layers(far: Open, kind: str) -> None:
    there, sent = far(kind, eyes="both"), face(5)
    there.send(sent)
    wait_for(lambda: there.holding == len(P))
    np.testing.assert_allclose(there.layer, sent.values, atol=1e-4)
    report = there.link.report()
    assert report["accepted"] == 1 and report["refused"] == {} and report["sender"].startswith("127.0.0.1")


def test_the_newest_face_counts_and_a_flood_leaves_no_queue(far: Open) -> None:
    there = far()
    for n in range(3000):
        there.jaw(n / 3000)
    there.jaw(0.123)
    wait_for(lambda: there.layer[JAW] == pytest.approx(0.123, abs=1e-5))
    assert there.link.report()["accepted"] > 100


def test_rubbish_is_counted_by_reason_and_the_next_face_is_taken(far: Open) -> None:
    there = far()
    for data in (b"", b"?", b"\5" + bytes(300), bytes(2000)):
        there._socket.sendto(data, ("127.0.0.1", there.port))
    there.jaw(0.5)
    wait_for(lambda: there.holding)
    wait_for(lambda: sum(there.link.report()["refused"].values()) >= 1)


def test_silence_gives_the_layer_back_and_a_source_comes_again(far: Open) -> None:
    there = far(timeout_s=0.2)
    there.jaw(0.5)
    wait_for(lambda: there.holding == len(P), "the first face")
    wait_for(lambda: there.holding == 0, "giving back")
    there.jaw(0.75)
    wait_for(lambda: there.holding == len(P) and there.layer[JAW] == pytest.approx(0.75), "the second face")


@pytest.mark.slow
def test_a_lost_source_can_be_held_beyond_the_time_out_of_its_layer(far: Open) -> None:
    there = far(timeout_s=0.1, lost="hold")
    there.jaw(0.5)
    wait_for(lambda: there.holding == len(P))
    end_s = time.monotonic() + 1.5
    while time.monotonic() < end_s:
        there.state.tick(time.monotonic_ns(), 0.01, P.neutral())
        time.sleep(0.02)
    assert there.holding == len(P) and there.layer[JAW] == pytest.approx(0.5)


def test_a_lost_source_can_leave_a_neutral_face(far: Open) -> None:
    there = far(timeout_s=0.1, lost="neutral")
    there.jaw(0.5)
    wait_for(lambda: there.layer[JAW] == pytest.approx(0.5))
    wait_for(lambda: there.layer[JAW] == 0.0 and there.holding == len(P))


def test_a_lost_wire_can_stop_the_servos_and_a_lost_face_does_not(far: Open) -> None:
    there = far(timeout_s=0.3, lost="stop")
    there.jaw(0.5)
    wait_for(lambda: there.holding == len(P))
    end_s = time.monotonic() + 0.8
    while time.monotonic() < end_s:
        there.send(Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False))
        time.sleep(0.02)
    assert there.state.stop_latch.stopped is None and there.holding == 0
    there.jaw(0.5)
    wait_for(lambda: there.state.stop_latch.stopped is not None)
    assert "livelink" in there.state.stop_latch.stopped.who


def test_a_second_source_waits_until_the_first_is_silent(far: Open) -> None:
    there = far("vmc", source="10.1.2.3")
    there.jaw(0.5)
    wait_for(lambda: there.link.report()["refused"])
    assert there.holding == 0
    by_subject = far(source="omote")
    by_subject.jaw(0.5)
    wait_for(lambda: by_subject.holding == len(P))


def test_what_is_written_goes_through_mirror_and_gains(far: Open) -> None:
    there = far(mirror=True, gains={"brows": 0.5})
    values = P.neutral()
    for name, value in {"mouthSmileLeft": 0.5, "browInnerUp": 0.5, "headYaw": 0.25}.items():
        values[P.index(name)] = value
    there.send(Frame(values, np.ones(len(P), dtype=bool)))
    wait_for(lambda: there.holding)
    found = {name: round(float(there.layer[i]), 4) for i, name in enumerate(P.names) if there.layer[i]}
    assert found == {"mouthSmileRight": 0.5, "browInnerUp": 0.25, "headYaw": -0.25}


def test_the_present_face_is_sent(far: Open) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver, ExitStack() as closers:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        state = CommandState(P)
        state.set_parameters([JAW], [0.5], 1)
        for n in range(200):
            state.tick(n * 10_000_000, 0.01, P.neutral())
        keys = {"kind": "livelink", "send": f"127.0.0.1:{receiver.getsockname()[1]}", "rate_hz": 200.0}
        (link,) = open_links([read_link(keys)], LinkContext(state, closers))
        decoder = FORMATS.get("livelink").decoder(P)
        (frame,) = decoder.feed(receiver.recv(65536))
        assert frame.values[JAW] == pytest.approx(0.5, abs=1e-3)
        wait_for(lambda: link.report()["sent"] >= 3)


def test_one_serial_port_carries_both_ways(tmp_path: Path) -> None:
    with HostPort() as board, ExitStack() as closers:
        other_name = tmp_path / "board"
        other_name.symlink_to(board.path)
        state, form = CommandState(P), FORMATS.get("binary")
        keys = {"kind": "binary", "port": board.path, "send": str(other_name), "rate_hz": 200.0}
        (link,) = open_links([read_link(keys)], LinkContext(state, closers))
        sent, decoder, heard = face(5), form.decoder(P), b""
        board.write(form.encoder(P).encode(sent)[0] + b"\0")
        wait_for(lambda: state.mixer["capture"].holding == len(P), "the face of the board")
        end_s = time.monotonic() + 60
        while heard.count(b"\0") < 3 and time.monotonic() < end_s:
            heard += board.read(0.1)
        assert len([frame for each in heard.split(b"\0")[1:-1] for frame in decoder.feed(each)]) >= 2
        report = link.report()
        assert report["sent"] >= 2 and report["error"] == report["send_error"] == ""


def test_an_address_that_is_taken_is_told_with_what_to_do(far: Open) -> None:
    there = far()
    with ExitStack() as closers, pytest.raises(LinkError, match="cannot listen") as told:
        choices = [read_link({"kind": "vmc", "listen": f"127.0.0.1:{there.port}"})]
        open_links(choices, LinkContext(CommandState(P), closers))
    assert str(there.port) in told.value.hint


@pytest.mark.parametrize(("kind", "by"), [("json", "tcp"), ("json", "udp"), ("binary", "udp")])
def test_two_omotes_share_a_token(kind: str, by: str) -> None:
    sort = socket.SOCK_STREAM if by == "tcp" else socket.SOCK_DGRAM
    token, address = "a-token-of-two", f"{by}:127.0.0.1:{free_port(sort)}"
    one, two = CommandState(P), CommandState(P)
    one.set_parameters([JAW], [0.5], 1)
    for n in range(200):
        one.tick(n * 10_000_000, 0.01, P.neutral())
    with ExitStack() as closers:
        open_links([read_link({"kind": kind, "listen": address, "token": token})], LinkContext(two, closers))
        open_links([read_link({"kind": kind, "send": address, "token": token})], LinkContext(one, closers))
        wait_for(lambda: two.mixer["capture"].values[JAW] == pytest.approx(0.5, abs=1e-3))


def test_beyond_this_machine_a_stream_of_ours_needs_a_token(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    port = free_port(socket.SOCK_STREAM)
    keys = {"kind": "csv", "listen": f"tcp:0.0.0.0:{port}", "open_to_network": True}
    with ExitStack() as closers:
        (link,) = open_links([read_link(keys)], LinkContext(CommandState(P), closers))
        assert "shown only now" in caplog.text and (tmp_path / "omote" / "token").exists()
        with socket.create_connection(("127.0.0.1", port)) as call:
            call.sendall(b"time,jawOpen\n0,0.5\n")
            wait_for(lambda: "without the token" in link.report()["error"])
            assert link.report()["refused"] == {"a caller without the token": 1}


def test_an_unknown_layer_is_told_with_those_there_are() -> None:
    with ExitStack() as closers, pytest.raises(LinkError, match="unknown layer 'captur', did you mean 'capture'"):
        choices = [read_link({"kind": "vmc", "listen": f"127.0.0.1:{free_port()}", "layer": "captur"})]
        open_links(choices, LinkContext(CommandState(P), closers))


def test_there_is_a_kind_of_link_for_every_format() -> None:
    assert {*FORMATS.kinds()} <= {*LINKS.kinds()}
    for kind in FORMATS.kinds():
        assert LINKS.get(kind).settings.form is FORMATS.get(kind)


def test_two_heads_keep_what_they_learn_of_their_persons_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    for head in ("maple", "oak", ""):
        state = CommandState(P)
        state.name = head
        with ExitStack() as closers:
            keys = {"kind": "livelink", "listen": f"127.0.0.1:{free_port()}", "ranges": True}
            open_links([read_link(keys)], LinkContext(state, closers))
    found = sorted(path.stem for path in (tmp_path / "omote" / "links").iterdir())
    assert found == ["livelink-capture", "livelink-maple-capture", "livelink-oak-capture"]
