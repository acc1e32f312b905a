"""drivers.port.serialport on real pseudo-terminals."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import serial

from drivers.base.errors import PortBusy, PortError, PortLost, PortMissing, PortPermission
from drivers.port.serialport import SerialPort, as_serial_port, latency_s, reply_margin_s, tapped


class Pty:
    """The far end of a pseudo-terminal in raw mode.

    path : a link to it, which goes with it; the system may give its own name to another program at once.
    """

    def __init__(self, path: Path) -> None:
        self.master, slave = os.openpty()
        path.symlink_to(os.ttyname(slave))
        self._slave, self._link, self.path = slave, path, str(path)

    def unplug(self) -> None:
        self._link.unlink(missing_ok=True)
        for fd in (self.master, self._slave):
            with suppress(OSError):
                os.close(fd)


@pytest.fixture
def pty(tmp_path: Path) -> Iterator[Pty]:
    end = Pty(tmp_path / "port")
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


def test_bytes_wait_for_a_far_end_that_is_slow_to_take_them(pty: Pty) -> None:
    data, taken = bytes(range(256)) * 256, bytearray()
    port = SerialPort(pty.path)
    port.open()

    def take() -> None:
        time.sleep(0.1)
        while len(taken) < len(data):
            taken.extend(os.read(pty.master, 4096))

    far_end = threading.Thread(target=take)
    far_end.start()
    port.write(data)
    far_end.join(20.0)
    port.close()
    assert taken == data


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


def test_the_margin_for_a_reply_is_by_what_the_path_leads_to(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    assert reply_margin_s(pty.path) == reply_margin_s("socket://host:1") == 0.05
    assert reply_margin_s("/dev/ttyNowhere7") == pytest.approx(0.010 + 2 * 0.002)
    monkeypatch.setattr("drivers.port.serialport.latency_s", lambda path: 0.016)
    assert reply_margin_s("/dev/ttyUSB0") == pytest.approx(0.042)


def test_opening_again_lets_go_of_the_device_before(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    first = port.serial
    port.open()
    assert not first.is_open and port.serial.is_open
    port.close()
    assert port.serial is None


def test_everything_that_passes_can_be_watched(pty: Pty) -> None:
    seen: list[tuple[bool, bytes]] = []
    with tapped(lambda sent, data: seen.append((sent, data))):
        port = SerialPort(pty.path)
    assert SerialPort(pty.path).tap is None
    port.open()
    port.write(b"out")
    assert port.put(b"more") == 4
    os.read(pty.master, 100)
    os.write(pty.master, b"in")
    assert port.read(time.monotonic() + 20) == b"in"
    assert seen == [(True, b"out"), (True, b"more"), (False, b"in")]
    port.close()


def test_put_takes_what_there_is_room_for(pty: Pty) -> None:
    port = SerialPort(pty.path)
    port.open()
    end = time.monotonic() + 20
    assert port.put(bytes(4096)) > 0
    refused = 0
    while refused < 50:  # the kernel moves what was put on, which makes room again; little may fit where much does not
        assert time.monotonic() < end, "it takes more and more"
        refused = 0 if port.put(bytes(4096)) or port.put(b"x") else refused + 1
        time.sleep(0.01 if refused else 0.0)
    port.close()
    with pytest.raises(PortLost, match="not open"):
        port.put(b"x")


def test_a_url_that_nobody_serves_says_what_to_start() -> None:
    with pytest.raises(PortMissing, match="no port memory://nobody: nothing in this process serves") as caught:
        SerialPort("memory://nobody").open()
    assert "omote simulate" in caught.value.hint


def test_a_rate_that_the_device_does_not_take_is_named(pty: Pty) -> None:
    with pytest.raises(PortError, match=r"does not take -1 baud") as caught:
        SerialPort(pty.path, -1).open()
    assert "baud rate" in caught.value.hint


def test_a_path_or_a_port_gives_a_port(pty: Pty) -> None:
    port = as_serial_port(pty.path, 9600)
    assert (port.path, port.baud, port.is_open) == (pty.path, 9600, False)
    assert as_serial_port(port, 1) is port
