"""drivers.port.serialport on real pseudo-terminals."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
import serial

from drivers.base.errors import PortBusy, PortError, PortLost, PortMissing, PortPermission
from drivers.port.serialport import SerialPort, latency_s


class Pty:
    """The far end of a pseudo-terminal in raw mode."""

    def __init__(self) -> None:
        self.master, slave = os.openpty()
        self.path = os.ttyname(slave)
        self._slave = slave

    def unplug(self) -> None:
        for fd in (self.master, self._slave):
            with suppress(OSError):
                os.close(fd)


@pytest.fixture
def pty() -> Iterator[Pty]:
    end = Pty()
    yield end
    end.unplug()


def test_bytes_go_both_ways_unchanged(pty: Pty) -> None:
    port = SerialPort(pty.path, 1_000_000)
    port.open()
    every = bytes(range(256))
    port.write(every)
    assert os.read(pty.master, 1000) == every
    os.write(pty.master, every)
    got = b""
    while len(got) < 256:
        got += port.read(time.monotonic() + 2) or pytest.fail("bytes lost")
    assert got == every
    port.close()


def test_read_waits_without_spinning_and_gives_up_at_the_deadline(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    cpu, start = time.thread_time(), time.monotonic()
    assert port.read(start + 0.25) == b""
    assert time.monotonic() - start >= 0.25
    assert time.thread_time() - cpu < 0.05
    port.close()


def test_bytes_that_came_during_a_stall_still_count(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    os.write(pty.master, b"late")
    assert port.read(time.monotonic() - 5) == b"late"
    assert port.read(time.monotonic() - 5) == b""
    port.close()


def test_opening_drops_what_a_killed_program_left_behind(pty: Pty) -> None:
    os.write(pty.master, b"leftovers")
    port = SerialPort(pty.path)
    port.open()
    os.write(pty.master, b"new")
    assert port.read(time.monotonic() + 2) == b"new"
    port.close()


def test_drain_waits_until_the_line_is_quiet(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    os.write(pty.master, b"one")
    later = threading.Timer(0.05, os.write, (pty.master, b"more"))
    later.start()
    assert port.drain(quiet_s=0.4, limit_s=0.6) == 7
    later.join()
    port.close()


def test_a_second_opener_is_told_that_the_port_is_held(pty: Pty) -> None:
    first = SerialPort(pty.path)
    first.open()
    with pytest.raises(PortBusy, match="held by another program") as caught:
        SerialPort(pty.path).open()
    assert caught.value.port == pty.path
    assert caught.value.hint
    first.close()
    second = SerialPort(pty.path)
    second.open()
    second.close()


def test_a_missing_port_says_what_to_type(tmp_path: os.PathLike[str]) -> None:
    path = os.path.join(tmp_path, "ttyUSB7")
    with pytest.raises(PortMissing, match="ttyUSB7") as caught:
        SerialPort(path).open()
    assert "omote ports" in caught.value.hint


def test_a_file_that_is_no_terminal_is_a_port_error(tmp_path: os.PathLike[str]) -> None:
    path = os.path.join(tmp_path, "file")
    with open(path, "w"):
        pass
    with pytest.raises(PortError, match="file"):
        SerialPort(path).open()


@pytest.mark.parametrize(
    ("code", "kind"),
    [(13, PortPermission), (1, PortPermission), (16, PortBusy), (2, PortMissing), (19, PortMissing)],
)
def test_the_systems_reason_picks_the_error(monkeypatch: pytest.MonkeyPatch, code: int, kind: type[Exception]) -> None:
    def refuse(*args: object, **options: object) -> None:
        raise serial.SerialException(code, os.strerror(code))

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(kind):
        SerialPort("/dev/null").open()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may open everything")
def test_permission_is_told_with_the_group_to_join(pty: Pty) -> None:
    os.chmod(pty.path, 0)
    with pytest.raises(PortPermission) as caught:
        SerialPort(pty.path).open()
    assert "dialout" in caught.value.hint


@pytest.mark.parametrize("use", ["read", "write", "drain"])
def test_unplugging_is_one_error_whatever_one_does(pty: Pty, use: str) -> None:
    port = SerialPort(pty.path)
    port.open()
    pty.unplug()
    with pytest.raises(PortLost, match="went away"):
        {
            "read": lambda: port.read(time.monotonic() + 2),
            "write": lambda: port.write(b"x"),
            "drain": lambda: port.drain(),
        }[use]()
    port.close()
    port.close()
    with pytest.raises(PortMissing):
        port.open()


def test_unplugging_ends_a_read_that_waits(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    threading.Timer(0.05, pty.unplug).start()
    with pytest.raises(PortLost):
        port.read(time.monotonic() + 10)
    port.close()


def test_a_far_end_that_takes_nothing_does_not_block_for_ever(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    with pytest.raises(PortLost, match="takes no bytes"):
        port.write(bytes(1 << 20))
    port.close()


def test_a_closed_port_refuses_use() -> None:
    port = SerialPort("/dev/nowhere")
    with pytest.raises(PortLost, match="not open"):
        port.write(b"x")


def test_latency_timer_is_read_where_the_system_keeps_it(tmp_path: os.PathLike[str]) -> None:
    folder = os.path.join(tmp_path, "bus/usb-serial/devices/ttyUSB3")
    os.makedirs(folder)
    with open(os.path.join(folder, "latency_timer"), "w") as file:
        file.write("16\n")
    assert latency_s("/dev/ttyUSB3", tmp_path) == 0.016
    assert latency_s("/dev/ttyUSB4", tmp_path) is None
