"""Receivers over real sockets, pseudo-terminals and pipes."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import pytest

from controller.base.errors import LinkError
from controller.formats.format import FORMATS
from controller.links.line.hostport import HostPort
from controller.links.net import receivers
from controller.links.net.address import parse_address
from controller.links.net.opening import open_receiver
from controller.links.net.receivers import MAX_CONNECTIONS, Gate, InputReceiver, Receiver, enable_keepalive
from drivers.base.errors import PortMissing
from tests.controller.links.net.sockets import free_port

FORM = FORMATS.get("json")
Open = Callable[..., Receiver]


@pytest.fixture
def opened() -> Iterator[Open]:
    with ExitStack() as closers:

        def make(address: str, **options: object) -> Receiver:
            receiver = open_receiver(parse_address(address, FORM), **options)  # type: ignore[arg-type]
            closers.callback(receiver.close)
            return receiver

        yield make


def taken(receiver: Receiver, enough: int) -> bytes:
    """Bytes until there are enough."""
    data, end_s = b"", time.monotonic() + 60
    while len(data) < enough:
        assert time.monotonic() < end_s, data
        data += b"".join(each for _, each in receiver.receive(0.05))
    return data


def test_datagrams_come_with_their_host(opened: Open) -> None:
    port = free_port()
    receiver = opened(f"udp:127.0.0.1:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for data in (b"one", b"two"):
            sender.sendto(data, ("127.0.0.1", port))
        found: list[tuple[str, bytes]] = []
        while len(found) < 2:
            found += receiver.receive(1.0)
    assert found == [("127.0.0.1", b"one"), ("127.0.0.1", b"two")]
    assert receiver.receive(0.0) == []


def test_calls_come_as_streams_and_end_as_such(opened: Open) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", port)) as call:
        call.sendall(b"hello")
        assert taken(receiver, 5) == b"hello"
    found: list[tuple[str, bytes]] = []
    while not found:
        found = receiver.receive(1.0)
    assert found[0][1] == b""


def test_a_web_page_is_turned_away(opened: Open) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}")
    with socket.create_connection(("127.0.0.1", port)) as call:
        call.sendall(b'POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n{"jawOpen": 1}\n')
        found, end_s = list[tuple[str, bytes]](), time.monotonic() + 10
        while not found:
            assert time.monotonic() < end_s
            found = receiver.receive(0.1)
    assert [data for _, data in found] == [b""] and "browser" in receiver.error


@pytest.mark.parametrize("size", [1, 5, 100])
def test_a_stream_begins_with_a_token_where_one_is_wanted(opened: Open, size: int) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver, stream = opened(f"tcp:127.0.0.1:{port}", gate=Gate("abcdef", b"\n")), b"AUTH abcdef\nhello"
    with socket.create_connection(("127.0.0.1", port)) as call:
        call.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for at in range(0, len(stream), size):
            call.sendall(stream[at : at + size])
        assert taken(receiver, 5) == b"hello" and receiver.error == ""


@pytest.mark.parametrize("start", [b"AUTH abcdeg\nhello", b"AUTH abc\n", b"hello, hello, hello", b"\n"])
def test_a_stream_without_the_token_is_turned_away(opened: Open, start: bytes) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}", gate=Gate("abcdef", b"\n"))
    with socket.create_connection(("127.0.0.1", port)) as call:
        call.sendall(start)
        found, end_s = list[tuple[str, bytes]](), time.monotonic() + 10
        while not found:
            assert time.monotonic() < end_s
            found = receiver.receive(0.1)
    assert [data for _, data in found] == [b""] and "without the token" in receiver.error


def test_only_datagrams_that_begin_with_the_token_count(opened: Open) -> None:
    port = free_port()
    receiver = opened(f"udp:127.0.0.1:{port}", gate=Gate("abcdef", b"\n"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as call:
        for data in (b"AUTH abcdef\none ", b"AUTH abcdeg\ntwo ", b"three ", b"AUTH abcdef\n", b"AUTH abcdef\nfour"):
            call.sendto(data, ("127.0.0.1", port))
        assert taken(receiver, 8) == b"one four" and "without the token" in receiver.error


def test_who_gives_no_token_is_sent_away(opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}", gate=Gate("abcdef", b"\n"))
    monkeypatch.setattr(receivers, "AUTH_TIMEOUT_S", 0.05)
    with socket.create_connection(("127.0.0.1", port), 10.0) as call:
        end_s = time.monotonic() + 10
        while "without the token" not in receiver.error:
            assert time.monotonic() < end_s and receiver.receive(0.05) == []
        assert call.recv(1) == b""


def test_calls_are_limited(opened: Open) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}")
    with ExitStack() as calls:
        for _ in range(MAX_CONNECTIONS + 1):
            call = calls.enter_context(socket.create_connection(("127.0.0.1", port)))
            receiver.receive(1.0)
        call.settimeout(10)
        assert call.recv(1) == b"" and receiver.error == f"more than {MAX_CONNECTIONS} connections"


def test_a_program_that_is_called_is_called_again(opened: Open) -> None:
    port = free_port(socket.SOCK_STREAM)
    receiver = opened(f"tcp:127.0.0.1:{port}", connect=True)
    assert receiver.receive(0.01) == [] and receiver.error
    for word in (b"first", b"again"):
        with closing(socket.create_server(("127.0.0.1", port))) as server:
            server.settimeout(10)
            end_s = time.monotonic() + 60
            while receiver.error and time.monotonic() < end_s:
                receiver.receive(0.05)
            call, _ = server.accept()
            call.sendall(word)
            assert taken(receiver, 5) == word
            call.close()
        while not receiver.error:
            receiver.receive(0.05)
        assert receiver.error == "the far end hung up"


@pytest.mark.skipif(not hasattr(socket, "TCP_KEEPIDLE"), reason="needs Linux's options")
def test_a_far_end_that_goes_without_a_word_is_asked_after() -> None:
    with socket.socket() as call:
        enable_keepalive(call)
        options = [socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT]
        idle_s, between_s, count = (call.getsockopt(socket.IPPROTO_TCP, option) for option in options)
        assert call.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) and idle_s + between_s * count <= 10


def test_a_serial_port_is_read(opened: Open) -> None:
    with HostPort() as port:
        receiver = opened(port.path)
        port.write(b"bytes")
        assert taken(receiver, 5) == b"bytes"


def test_a_serial_port_that_is_not_there_is_told() -> None:
    with pytest.raises(PortMissing):
        open_receiver(parse_address("/dev/none", FORM))


def test_standard_input_is_read_until_it_ends(opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    with os.fdopen(reading) as pipe:
        monkeypatch.setattr(sys, "stdin", pipe)
        receiver = opened("-")
        assert receiver.receive(0.01) == []
        os.write(writing, b"line\n")
        assert taken(receiver, 5) == b"line\n"
        os.close(writing)
        receiver.receive(1.0)
        assert isinstance(receiver, InputReceiver) and receiver.ended


def test_an_address_that_is_taken_is_told(opened: Open) -> None:
    port = free_port()
    opened(f"udp:127.0.0.1:{port}")
    with pytest.raises(LinkError, match="cannot listen") as caught:
        opened(f"udp:127.0.0.1:{port}")
    assert "another program" in caught.value.hint and str(port) in caught.value.hint
    with pytest.raises(LinkError, match="cannot listen") as caught:
        opened("udp:203.0.113.7:5000")  # an address of nobody (RFC 5737)
    assert "an address of this machine" in caught.value.hint
