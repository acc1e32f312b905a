"""Ports that are no terminals: TCP and lines within this process, at both ends; and any URL of pyserial."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path

import pytest
import serial

from drivers import open_bus
from drivers.base.bus import Bus
from drivers.base.errors import DriverError, PortBusy, PortError, PortLost, PortMissing
from drivers.port.serialport import SerialPort, reply_margin_s
from drivers.sim import SimulatedBus
from drivers.sim.serving.farports import MemoryPort, TcpPort, make_port
from drivers.sim.serving.ptyport import PtyPort
from tests.drivers.contract import SERVOS, BusContract

PING = bytes.fromhex("FFFFFD0001030001194E")
LINKS = ["socket://127.0.0.1:0", "memory://head"]


class TestOverTcp(BusContract):
    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", SERVOS, transport="tcp", process=False, margin_s=0.5, watchdog_ms=0)


class TestWithinTheProcess(BusContract):
    @pytest.fixture
    def bus(self) -> Bus:
        return open_bus("simulated", SERVOS, transport="memory", margin_s=0.5, watchdog_ms=0)


def ping(path: str) -> bytes:
    port = SerialPort(path)
    port.open()
    try:
        port.write(PING)
        data, end = b"", time.monotonic() + 20
        while len(data) < 14 and time.monotonic() < end:
            data += port.read(end)
        return data
    finally:
        port.close()


@pytest.mark.parametrize("link", LINKS)
def test_programs_come_one_after_the_other(link: str) -> None:
    with SimulatedBus([1], link=link) as bus:
        assert {ping(bus.path)[:5] for _ in range(3)} == {bytes.fromhex("FFFFFD0001")}


def test_a_plain_pyserial_client_uses_tcp() -> None:
    with SimulatedBus([1], link=LINKS[0], process=True) as bus:
        client = serial.serial_for_url(bus.path, timeout=10)
        client.write(PING)
        assert client.read(14)[:5] == bytes.fromhex("FFFFFD0001")
        client.close()


def test_any_number_of_buses_beside_each_other(tmp_path: Path) -> None:
    links = [*LINKS, "memory://other", tmp_path / "a", tmp_path / "b", LINKS[0]]
    buses = [SimulatedBus([1], link=link) for link in links]
    try:
        paths = [bus.__enter__().path for bus in buses]
        assert len(set(paths)) == len(links)
        assert all(len(ping(path)) == 14 for path in paths)
    finally:
        for bus in buses:
            bus.close()


@pytest.mark.parametrize("link", LINKS)
def test_a_second_client_is_turned_away(link: str) -> None:
    with SimulatedBus([1], link=link) as bus:
        first, second = SerialPort(bus.path), SerialPort(bus.path)
        first.open()
        first.write(PING)
        assert first.read(time.monotonic() + 20)
        with pytest.raises(PortLost):
            second.open()
            second.read(time.monotonic() + 20)
        second.close()
        first.close()


@pytest.mark.parametrize("link", LINKS)
def test_unplugging_is_seen_and_the_port_comes_back(link: str) -> None:
    with SimulatedBus([1], link=link) as bus:
        path, port = bus.path, SerialPort(bus.path)
        port.open()
        port.write(PING)
        assert port.read(time.monotonic() + 20)
        bus.fault("unplug")
        with pytest.raises(PortLost, match="went away"):
            port.read(time.monotonic() + 20)
        with pytest.raises(PortMissing):
            port.open()
        bus.clear("unplug")
        assert len(ping(path)) == 14


def test_what_cannot_be_served_is_told() -> None:
    port = make_port(LINKS[0])
    assert isinstance(port, TcpPort)
    with pytest.raises(PortBusy, match="cannot listen"):
        TcpPort(port.path)
    port.close()
    memory = make_port(LINKS[1])
    assert isinstance(memory, MemoryPort)
    with pytest.raises(PortBusy, match="served already"):
        MemoryPort(memory.path)
    memory.close()
    memory.close()
    with pytest.raises(PortError, match="not socket://HOST:PORT"):
        TcpPort("socket://nowhere")
    pty = make_port(None)
    assert isinstance(pty, PtyPort)
    pty.close()


@pytest.mark.parametrize("url", ["socket://127.0.0.1:1", "memory://nobody", "nonsense://x"])
def test_a_port_that_nobody_serves_is_missing(url: str) -> None:
    with pytest.raises(PortError, match="port"):
        SerialPort(url).open()


def test_tcp_waits_for_no_acknowledgement() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = SerialPort(f"socket://127.0.0.1:{server.getsockname()[1]}")
        accepted: list[socket.socket] = []
        thread = threading.Thread(target=lambda: accepted.append(server.accept()[0]))
        thread.start()
        port.open()
        thread.join()
        assert port.serial.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
        port.close()
        accepted[0].close()


def test_other_urls_go_through_pyserial() -> None:
    port = SerialPort("loop://", 115_200)
    port.open()
    port.write(b"round")
    assert port.put(b"!") == 1
    data, end = b"", time.monotonic() + 20
    while len(data) < 6:
        data += port.read(end)
    assert data == b"round!"
    assert port.read(time.monotonic() + 0.02) == b""
    port.close()
    assert reply_margin_s("loop://") == 0.05


def test_an_unknown_transport_is_told() -> None:
    with pytest.raises(DriverError, match="no transport 'pigeon'"):
        open_bus("simulated", SERVOS, transport="pigeon")
