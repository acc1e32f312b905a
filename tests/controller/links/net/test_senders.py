"""Senders over real sockets, pseudo-terminals and pipes; a far end that is not there holds nothing up."""

from __future__ import annotations

import os
import socket
import sys
import time
from contextlib import closing

import pytest

from controller.formats.format import FORMATS
from controller.links.line.hostport import HostPort
from controller.links.net.address import parse_address
from controller.links.net.senders import Sender, open_sender
from tests.controller.links.net.sockets import free_port

FORM = FORMATS.get("json")


def sender(address: str) -> Sender:
    return open_sender(parse_address(address, FORM), b"\n")


def test_datagrams_have_no_delimiter_and_nobody_needs_to_listen() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        with closing(sender(f"udp:127.0.0.1:{receiver.getsockname()[1]}")) as out:
            assert out.send(b"one") and receiver.recv(100) == b"one"
    with closing(sender(f"udp:127.0.0.1:{free_port()}")) as out:
        assert all(out.send(b"nobody") for _ in range(20)) and not out.error


def test_messages_of_a_stream_end_with_the_delimiter_and_a_far_end_that_hangs_up_is_called_again() -> None:
    port = free_port(socket.SOCK_STREAM)
    with closing(sender(f"tcp:127.0.0.1:{port}")) as out:
        assert not out.send(b"nobody") and out.error
        for _ in range(2):
            with closing(socket.create_server(("127.0.0.1", port))) as server:
                server.settimeout(10)
                end_s = time.monotonic() + 60
                while not out.send(b"hello"):
                    assert time.monotonic() < end_s
                    time.sleep(0.02)
                call, _ = server.accept()
                call.settimeout(10)
                with closing(call):
                    data = call.recv(6)
                    assert data in (b"hello\n", b"hello")
            while out.send(b"x" * 1000):  # until it is noticed that nobody is there
                assert time.monotonic() < end_s + 10


def test_a_far_end_that_does_not_read_loses_messages_and_keeps_the_rest_whole() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        server.settimeout(10)
        with closing(sender(f"tcp:127.0.0.1:{server.getsockname()[1]}")) as out:
            sent = sum(out.send(b"%06d" % n + b"x" * 10_000) for n in range(3000))
            assert 0 < sent < 3000
            call, _ = server.accept()
            call.settimeout(0.3)
            data = b""
            with closing(call):
                try:
                    while more := call.recv(1 << 20):
                        data += more
                except TimeoutError:
                    pass
            lines = data.split(b"\n")[:-1]
            assert len(lines) >= sent - 1 and {len(line) for line in lines} == {10_006}


def test_a_serial_port_takes_messages() -> None:
    with HostPort() as port, closing(sender(port.path)) as out:
        assert out.send(b"hello")
        end_s = time.monotonic() + 60
        data = b""
        while len(data) < 6 and time.monotonic() < end_s:
            data += port.read(0.1)
        assert data == b"hello\n"


def test_standard_output_takes_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        with closing(sender("-")) as out:
            assert out.send(b"hello") and os.read(reading, 100) == b"hello\n"
            while out.send(b"x" * 1000):  # a reader that does not read holds nothing up
                pass
    os.close(reading)


def test_a_token_begins_each_stream() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        address = parse_address(f"tcp:127.0.0.1:{server.getsockname()[1]}", FORM)
        with closing(open_sender(address, b"\n", token="secret")) as out:
            assert out.send(b"hello")
            server.settimeout(10)
            call, _ = server.accept()
            call.settimeout(10)
            with closing(call), call.makefile("rb") as lines:
                assert (lines.readline(), lines.readline()) == (b"AUTH secret\n", b"hello\n")
