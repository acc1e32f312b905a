"""The host's end of a pseudo-terminal."""

from __future__ import annotations

import os
import threading
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


def test_a_read_waits_for_the_first_byte() -> None:
    with HostPort() as port:
        device = SerialPort(port.path, 115200)
        device.open()
        later = threading.Timer(0.05, device.write, [b"late"])
        later.start()
        assert port.read(30.0) == b"late"
        assert port.read(-1.0) == b""  # a time that has passed asks without waiting
        later.join()
        device.close()


def test_a_write_waits_for_room_and_loses_nothing_while_the_other_side_reads() -> None:
    sent, got = bytes(range(256)) * 400, bytearray()
    with HostPort() as port:
        device = SerialPort(port.path, 115200)
        device.open()
        writer = threading.Thread(target=port.write, args=[sent])
        writer.start()
        while len(got) < len(sent) - port.dropped:
            got += device.read(time.monotonic() + 5)
        writer.join()
        assert port.dropped == 0 and bytes(got) == sent
        device.close()


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
