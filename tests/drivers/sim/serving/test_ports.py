"""drivers.sim.serving.ports: pseudo-terminals, TCP and sockets within this process, at both ends; URLs of pyserial."""

from __future__ import annotations

import os
import socket
import termios
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
from drivers.sim.serving import ports
from drivers.sim.serving.make_port import make_port
from drivers.sim.serving.ports import MemoryPort, PtyPort, TcpPort
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
        data, end = b"", time.monotonic() + 60
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
        assert first.read(time.monotonic() + 60)
        with pytest.raises(PortLost):
            second.open()
            second.read(time.monotonic() + 60)
        second.close()
        first.close()


@pytest.mark.parametrize("link", LINKS)
def test_unplugging_is_seen_and_the_port_comes_back(link: str) -> None:
    with SimulatedBus([1], link=link) as bus:
        path, port = bus.path, SerialPort(bus.path)
        port.open()
        port.write(PING)
        assert port.read(time.monotonic() + 60)
        bus.fault("unplug")
        with pytest.raises(PortLost, match="went away"):
            port.read(time.monotonic() + 60)
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
    data, end = b"", time.monotonic() + 60
    while len(data) < 6:
        data += port.read(end)
    assert data == b"round!"
    assert port.read(time.monotonic() + 0.02) == b""
    port.close()
    assert reply_margin_s("loop://") == 0.05


def test_an_unknown_transport_is_told() -> None:
    with pytest.raises(DriverError, match="no transport 'pigeon'"):
        open_bus("simulated", SERVOS, transport="pigeon")


# ---------------------------------------------------------------- pseudo-terminals
def test_every_byte_passes_unchanged_both_ways():
    port = PtyPort()
    everything = bytes(range(256))
    client = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(client, everything)
        assert port.read() == everything
        port.write(everything)
        assert os.read(client, 512) == everything
        assert port.read() == b""
    finally:
        os.close(client)
        port.close()


def test_clients_come_and_go():
    port = PtyPort()
    try:
        for byte in (b"\x0a", b"\x0d"):
            with serial.Serial(port.path, 1_000_000, timeout=10, exclusive=True) as client:
                client.write(byte)
                assert port.read() == byte
                port.write(byte)
                assert client.read() == byte
    finally:
        port.close()


def test_link_is_made_replaces_an_old_one_and_goes_away(tmp_path: Path):
    link = tmp_path / "ttyHEAD"
    link.symlink_to("/dev/pts/nowhere")
    port = PtyPort(link)
    assert port.path == str(link)
    assert os.readlink(link) == port.device
    port.close()
    assert not link.is_symlink()
    assert os.listdir(tmp_path) == []


def test_a_link_that_somebody_else_took_over_is_left_alone(tmp_path: Path):
    link = tmp_path / "port"
    port = PtyPort(link)
    other = PtyPort(link)
    port.close()
    assert os.readlink(link) == other.device
    other.close()


def test_a_file_is_never_replaced(tmp_path: Path):
    path = tmp_path / "precious"
    path.write_text("data")
    with pytest.raises(PortBusy, match="there is a file of that name"):
        PtyPort(path)
    assert path.read_text() == "data"


def test_a_missing_folder_is_said_and_nothing_stays_open(tmp_path: Path):
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(PortError, match="cannot make the link") as error:
        PtyPort(tmp_path / "none" / "port")
    assert "mkdir -p" in error.value.hint
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_system_without_terminals_is_said(monkeypatch):
    def broken() -> tuple[int, int]:
        raise OSError("out of pty devices")

    monkeypatch.setattr(ports.os, "openpty", broken)
    with pytest.raises(PortError, match="out of pty devices"):
        PtyPort()


def test_closing_pulls_the_plug_and_opening_makes_a_new_port(tmp_path: Path):
    port = PtyPort()
    client = serial.Serial(port.path, 1_000_000, timeout=0.1)
    port.close()
    assert not port.is_open
    with pytest.raises((serial.SerialException, OSError, termios.error)):
        client.write(b"x")
        client.read()
    client.close()
    port.open(tmp_path / "again")
    assert port.path == str(tmp_path / "again")
    port.close()
    port.close()


def test_bit_rate_that_the_client_set():
    port = PtyPort()
    assert port.baud() is None
    try:
        for baud in (57_600, 1_000_000, 4_000_000, 123_456):
            with serial.Serial(port.path, baud):
                assert port.baud() == baud
    finally:
        port.close()


def test_bit_rate_is_unknown_elsewhere(monkeypatch):
    port = PtyPort()
    monkeypatch.setattr(ports.sys, "platform", "darwin")
    assert port.baud() is None
    port.close()


def test_what_nobody_reads_is_dropped_and_never_blocks():
    port = PtyPort()
    client = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
    try:
        for _ in range(200):
            port.write(bytes(1000))
        assert 0 < port.dropped < 200_000
    finally:
        os.close(client)
        port.close()


# ---------------------------------------------------------------- the server's end
@pytest.mark.parametrize("link", [*LINKS, ""])
def test_a_port_as_its_server_sees_it(link: str) -> None:
    port = make_port(link or None)
    try:
        assert port.is_open and len(port.descriptors) == 1
        assert (port.read(), port.baud(), port.dropped) == (b"", None, 0)
        client = SerialPort(port.path)
        client.open()
        try:
            client.write(b"to")
            received, end = b"", time.monotonic() + 60
            while received != b"to":
                assert time.monotonic() < end
                received += port.read()
            assert len(port.descriptors) == (2 if link else 1)
            port.write(b"fro")
            answer = b""
            while answer != b"fro":
                answer += client.read(end)
            assert port.dropped == 0
        finally:
            client.close()
    finally:
        port.close()
    assert (port.is_open, port.descriptors) == (False, [])
    port.close()


@pytest.mark.parametrize("link", LINKS)
def test_bytes_without_a_client_are_lost_and_counted(link: str) -> None:
    port = make_port(link)
    port.write(b"abc")
    port.write(b"d")
    assert port.dropped == 4
    port.close()


def test_a_port_comes_back_under_another_name() -> None:
    port = make_port("memory://one")
    port.close()
    port.open("memory://two")
    assert port.path == "memory://two"
    assert port.is_open
    port.close()
    port.open()
    assert port.path == "memory://two"
    port.close()


def test_a_tcp_port_keeps_its_number_and_a_taken_one_is_said_to_be_busy() -> None:
    port = make_port("socket://127.0.0.1:0")
    path = port.path
    assert path.startswith("socket://127.0.0.1:") and not path.endswith(":0")
    port.close()
    port.open()
    assert port.path == path
    port.close()
    with pytest.raises(PortError, match="cannot listen") as error:
        TcpPort("socket://192.0.2.1:1")
    assert not isinstance(error.value, PortBusy)
    assert error.value.hint == "for example --tcp 127.0.0.1:4000"


def test_a_terminal_without_a_link_has_its_own_name(tmp_path: Path) -> None:
    port = PtyPort()
    assert port.path == port.device != ""
    port.close()
    port.open(tmp_path / "link")
    assert port.path == str(tmp_path / "link")
    port.close()
