"""drivers.sim.serving.ptyport: a terminal that behaves as a serial port, and its link."""

from __future__ import annotations

import os
import termios
from pathlib import Path

import pytest
import serial

from drivers.base.errors import PortBusy, PortError
from drivers.sim.serving import ptyport
from drivers.sim.serving.ptyport import PtyPort


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

    monkeypatch.setattr(ptyport.os, "openpty", broken)
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
    monkeypatch.setattr(ptyport.sys, "platform", "darwin")
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
