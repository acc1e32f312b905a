"""drivers.port.endpoints: every far end gives bytes without waiting, waits for them, and says when it is gone."""

from __future__ import annotations

import errno
import importlib.util
import os
import socket
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from drivers.port.endpoints import (
    MEMORY_PORTS,
    UNPLUGGED,
    DeviceEnd,
    Endpoint,
    SocketEnd,
    UrlEnd,
    address_of,
    open_endpoint,
)

Far = tuple[Endpoint, Callable[[bytes], object], Callable[[int], bytes], Callable[[], object]]
"""An open end, and how its far side sends, receives and goes."""


def pty_end() -> Iterator[Far]:
    master, slave = os.openpty()
    end = open_endpoint(os.ttyname(slave), 115_200)
    assert isinstance(end, DeviceEnd)

    def hang_up() -> None:
        os.close(master)
        os.close(slave)

    yield end, lambda data: os.write(master, data), lambda count: os.read(master, count), hang_up
    with suppress(OSError):
        hang_up()


def tcp_end() -> Iterator[Far]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        end = open_endpoint(f"socket://127.0.0.1:{server.getsockname()[1]}", 1)
        far, _ = server.accept()
        assert isinstance(end, SocketEnd)
        assert end.device.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        yield end, far.sendall, far.recv, far.close
        far.close()


def memory_end() -> Iterator[Far]:
    taken: list[socket.socket] = []
    MEMORY_PORTS.serve("test", taken.append)
    end = open_endpoint("memory://test", 1)
    (far,) = taken
    yield end, far.sendall, far.recv, far.close
    MEMORY_PORTS.withdraw("test")
    far.close()


@pytest.fixture(params=[pty_end, tcp_end, memory_end], ids=["pty", "tcp", "memory"])
def far(request: pytest.FixtureRequest) -> Iterator[Far]:
    for found in request.param():
        yield found
        found[0].close()


def test_bytes_go_both_ways(far: Far) -> None:
    end, send, receive, _ = far
    with pytest.raises(BlockingIOError):
        end.take()
    send(b"\x00\xff\r\n")
    end.wait(20.0, False)
    assert end.take() == b"\x00\xff\r\n"
    with pytest.raises(BlockingIOError):
        end.take()
    assert end.put(memoryview(b"\x11\x13")) == 2
    assert receive(10) == b"\x11\x13"


def test_a_wait_for_bytes_ends_with_them_and_one_for_room_at_once(far: Far) -> None:
    end, send, _, _ = far
    end.wait(60.0, True)  # there is room
    later = threading.Timer(0.05, send, (b"x",))
    later.start()
    end.wait(60.0, False)
    assert end.take() == b"x"
    later.join()


def test_a_wait_that_brings_nothing_ends_at_its_time(far: Far) -> None:
    before = time.monotonic()
    far[0].wait(0.05, False)
    assert time.monotonic() - before >= 0.04


def test_there_is_not_always_room(far: Far) -> None:
    end, block = far[0], memoryview(bytes(1 << 16))
    with pytest.raises(BlockingIOError):
        for _ in range(1000):
            assert 0 < end.put(block) <= len(block)
    end.wait(0.0, True)


def test_a_far_side_that_goes_is_an_error_and_not_silence(far: Far) -> None:
    end, _, _, go = far
    go()
    with pytest.raises(UNPLUGGED):
        for _ in range(100):
            with suppress(BlockingIOError):
                end.take()
            end.wait(0.1, False)
    end.close()


def test_a_device_is_for_one_program() -> None:
    for end, *_ in pty_end():
        with pytest.raises(OSError) as caught:
            open_endpoint(end.device.port, 115_200)
        assert caught.value.errno in (errno.EBUSY, errno.EAGAIN)
        end.close()


def test_an_empty_read_of_a_device_is_not_its_end() -> None:
    master, slave = os.openpty()
    end = open_endpoint(os.ttyname(slave), 115_200)
    attributes = termios.tcgetattr(slave)
    assert attributes[6][termios.VMIN] == 1
    attributes[6][termios.VMIN] = 0
    termios.tcsetattr(slave, termios.TCSANOW, attributes)
    with pytest.raises(BlockingIOError):
        end.take()
    end.close()
    os.close(master)
    os.close(slave)


def test_other_urls_are_pyserials() -> None:
    end = open_endpoint("loop://", 115_200)
    assert isinstance(end, UrlEnd)
    with pytest.raises(BlockingIOError):
        end.take()
    assert end.put(memoryview(b"abc")) == 3
    assert end.wait(0.0, True)
    assert end.wait(20.0, False)
    assert end.wait(20.0, False)  # the first byte waits already
    assert end.take() == b"abc"
    with pytest.raises(BlockingIOError):
        end.take()
    end.close()


def test_a_url_that_nobody_knows_is_refused() -> None:
    with pytest.raises(ValueError, match="nowhere"):
        open_endpoint("nowhere://x", 115_200)


def test_a_memory_port_has_one_server_and_is_gone_when_withdrawn() -> None:
    with pytest.raises(FileNotFoundError, match="nothing in this process serves memory://nobody"):
        open_endpoint("memory://nobody", 1)
    clients: list[socket.socket] = []
    MEMORY_PORTS.serve("once", clients.append)
    with pytest.raises(OSError, match="memory://once is served already") as caught:
        MEMORY_PORTS.serve("once", lambda client: None)
    assert caught.value.errno == errno.EADDRINUSE
    first, second = MEMORY_PORTS.connect("once"), MEMORY_PORTS.connect("once")
    assert len(clients) == 2
    clients[1].sendall(b"2")
    assert second.recv(1) == b"2"
    MEMORY_PORTS.withdraw("once")
    MEMORY_PORTS.withdraw("once")
    with pytest.raises(FileNotFoundError):
        MEMORY_PORTS.connect("once")
    MEMORY_PORTS.serve("once", clients.append)
    MEMORY_PORTS.withdraw("once")
    for each in (first, second, *clients):
        each.close()


def test_addresses() -> None:
    assert address_of("socket://127.0.0.1:9000") == ("127.0.0.1", 9000)
    assert address_of("socket://[::1]:80") == ("::1", 80)
    for wrong in ("socket://host", "socket://:80", "socket://host:99999", "host:80"):
        with pytest.raises(ValueError):
            address_of(wrong)


def test_a_system_without_termios_opens_every_port_with_pyserial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "termios", None)
    spec = importlib.util.find_spec("drivers.port.endpoints")
    assert spec is not None and spec.loader is not None
    other = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(other)
    assert other.termios is None
    assert issubclass(other.TermiosError, Exception) and other.TermiosError in other.UNPLUGGED
    end = other.open_endpoint("loop://", 9600)
    assert isinstance(end, other.UrlEnd)
    end.close()
