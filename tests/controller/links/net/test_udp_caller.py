"""A phone that sends only after it was asked, at another address of loopback, and one that does not answer."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links, read_link
from controller.links.net import udp_caller
from controller.links.net.address import Address
from tests.controller.links.net.sockets import free_port, wait_for

JAW = P.index("jawOpen")
STARTS = {
    "ifacialmocap": b"iFacialMocap_sahuasouryya9218sauhuiayeta91555dy3719",
    "facemotion3d": b"FACEMOTION3D_OtherStreaming",
}
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems have one address of loopback")


@pytest.fixture
def phone() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.2", free_port()))
        made.settimeout(10)
        yield made


@pytest.mark.parametrize("kind", STARTS)
def test_a_phone_that_is_asked_moves_the_face(kind: str, phone: socket.socket) -> None:
    host, port = phone.getsockname()
    between = "-" if kind == "ifacialmocap" else "&"
    state = CommandState(P)
    with ExitStack() as closers, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        choice = read_link({"kind": kind, "connect": f"udp:{host}:{port}"})
        (link,) = open_links([choice], LinkContext(state, closers))
        asked, asker = phone.recvfrom(1000)
        assert asked == STARTS[kind] and asker == ("127.0.0.1", port)
        stranger.sendto(f"jawOpen{between}90|".encode(), asker)
        phone.sendto(f"jawOpen{between}40|".encode(), asker)
        wait_for(lambda: state.mixer["capture"].values[JAW] == pytest.approx(0.4))
        assert link.report()["accepted"] == 1 and link.report()["error"] == ""


def test_a_phone_that_is_silent_is_asked_again(phone: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(udp_caller, "REQUEST_INTERVAL_S", 0.02)
    caller = udp_caller.UdpCaller(Address("udp", *phone.getsockname()), b"hello")
    try:
        assert caller.receive(0.001) == [] and caller.error == "", "it had no time to answer"
        end_s = time.monotonic() + 0.1
        while time.monotonic() < end_s:
            assert caller.receive(0.01) == []
        assert [phone.recv(100) for _ in range(2)] == [b"hello"] * 2 and "has not answered" in caller.error
    finally:
        caller.close()


def test_a_host_that_is_none_is_told() -> None:
    with pytest.raises(LinkError, match="cannot be reached"):
        udp_caller.UdpCaller(Address("udp", "no such host", 49983), b"hello")


def test_what_has_no_words_to_ask_is_not_called() -> None:
    assert not FORMATS.get("livelink").greeting
    with pytest.raises(ValueError, match="only TCP can be connected to"):
        read_link({"kind": "livelink", "connect": "udp:127.0.0.1:11111"})
