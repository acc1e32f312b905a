"""The host's end of a pseudo-terminal."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from controller.links.line.hostport import HostPort
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort


def test_bytes_pass_unchanged_both_ways_without_echo() -> None:
    every = bytes(range(256))
    with HostPort() as port:
        device = SerialPort(port.path, 115200)
        device.open()
        port.write(every)
        assert device.read(time.monotonic() + 5) == every
        device.write(every)
        assert port.read(1.0) == every
        assert port.read(0.0) == b""
        device.close()


def test_a_full_wire_drops_and_counts() -> None:
    with HostPort() as port:
        port.write(b"x" * 200_000)
        assert 0 < port.dropped < 200_000


def test_link_is_made_replaced_and_removed(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    link.symlink_to("/nowhere")
    port = HostPort(link)
    assert os.readlink(link) == port.path
    port.close()
    port.close()
    assert not link.is_symlink()


def test_a_link_over_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot"
    path.write_text("mine")
    with pytest.raises(PortError, match="cannot make the link"):
        HostPort(path)
    assert path.read_text() == "mine"
