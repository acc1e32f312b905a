"""What ``omote simulate`` serves, as another program sees it."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import FrozenInstanceError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.tools import simulate
from controller.tools.simulate import Serving, robot_bus
from controller.tools.traffic_files import read_traffic


@contextmanager
def served(*words: str) -> Iterator[str]:
    """What ``omote simulate WORDS`` serves, once it is ready; it must end well on SIGINT."""
    command = [sys.executable, "-c", "from controller.cli.app import main; main()", "simulate", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        word, _, path = process.stdout.readline().strip().partition(" ")
        assert word == "ready"
        yield path
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_any_program_can_open_the_servos(tmp_path: Path) -> None:
    link = tmp_path / "head"
    with (
        served("dynamixel", "--ids", "1", "--link", str(link)),
        serial.Serial(str(link), 1_000_000, timeout=10) as port,
    ):
        port.write(bytes.fromhex("FFFFFD00010300 01194E"))  # ping, from the e-Manual
        reply = port.read(14)
        assert reply[:9] == bytes.fromhex("FFFFFD000107005500")
        assert int.from_bytes(reply[9:11], "little") == 1200
    assert not link.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "asked", "answer"),
    [
        (("feetech", "--ids", "1"), "FFFF010201FB", "FFFF010200FC"),  # ping, Protocol 1.0 framing
        (("dynamixel", "--ids", "1", "--model", "ax-12a"), "FFFF010201FB", "FFFF010200FC"),
        (("maestro",), "A1", "0000"),  # get errors: none
        (("ssc32",), "510D", "2E"),  # Q: nothing moves
        (("text", "--query", r"?{ch}\n", "--answer", r"{ch}={us}\n"), b"#2P1500\r?2\n".hex(), b"2=1500\n".hex()),
        (("omote", "--names", "jawOpen"), b"SET jawOpen 0.5\n".hex(), b"OK SET 1\n".hex()),
    ],
)
def test_every_family_answers(tmp_path: Path, words: tuple[str, ...], asked: str, answer: str) -> None:
    link = tmp_path / "port"
    with served(*words, "--link", str(link)), serial.Serial(str(link), 1_000_000, timeout=10) as port:
        port.write(bytes.fromhex(asked))
        assert port.read(len(answer) // 2) == bytes.fromhex(answer)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "asked", "answer"),
    [
        ("head-dynamixel1", "FFFF010201FB", b"\xff\xff\x01\x02\x00\xfc"),  # ping, Protocol 1.0
        ("head-feetech", "FFFF010201FB", b"\xff\xff\x01\x02\x00\xfc"),
        ("eyes-maestro", "AE", b"\x01"),  # script status: stopped
        ("head-ssc32", b"VER\r".hex(), b"SSC32-V2.50USB\r"),
        ("head-arduino", b"HELLO\n".hex(), b"OK HELLO head"),
    ],
)
def test_every_shipped_robot_is_served_on_tcp(robot: str, asked: str, answer: bytes) -> None:
    with served("robot", robot, "--tcp", "127.0.0.1:0") as ready:
        client = serial.serial_for_url(ready, baudrate=115_200, timeout=10)
        client.write(bytes.fromhex(asked))
        assert client.read(len(answer)) == answer
        client.close()


@pytest.mark.slow
def test_a_port_is_a_terminal_or_an_address() -> None:
    command = [sys.executable, "-c", "from controller.cli.app import main; main()", "simulate", "maestro"]
    done = subprocess.run([*command, "--link", "/tmp/x", "--tcp", ":1"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "--link and --tcp exclude each other" in done.stderr + done.stdout


@pytest.mark.slow
def test_the_host_plays_its_script_to_whoever_opens_it(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    with served("host", "tour", "--link", str(link)), serial.Serial(str(link), 115_200, timeout=10) as port:
        line = port.readline()
    assert b"HELLO" in line


def test_a_robot_file_says_which_servos(root: Path) -> None:
    bus, channels = robot_bus("head24", None)
    assert [channel.id for channel in channels] == list(range(1, 25))
    assert {channel.model for channel in channels} == {"xl330-m288"}
    assert bus.baud == 1_000_000
    with pytest.raises(ConfigError, match="no bus called 'neck'") as caught:
        robot_bus("head24", "neck")
    assert "head" in caught.value.hint


@pytest.mark.slow
def test_boards_take_their_time_on_the_wire_and_faults_at_a_socket(tmp_path: Path) -> None:
    link, control = tmp_path / "board", tmp_path / "board.ctl"
    with (
        served("ssc32", "--link", str(link), "--baud", "2400", "--wire", "--control", str(control)),
        serial.Serial(str(link), 2400, timeout=10) as port,
        socket.socket(socket.AF_UNIX) as commands,
    ):
        began = time.monotonic()
        port.write(b"VER\r")
        assert port.read(15) == b"SSC32-V2.50USB\r"
        assert time.monotonic() - began >= 19 * 10 / 2400
        commands.connect(str(control))
        commands.sendall(b"fault mute:*\n")
        assert commands.recv(100).startswith(b"ok")
        port.timeout = 0.3
        port.write(b"VER\r")
        assert port.read(15) == b""


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("maestro", "--latency", "16"), "--latency is part of the time on the wire"),
        (("maestro", "--channels", "7"), "--channels 7"),
        (("text", "--template", "S{ch}"), "holds no value"),
        (("dynamixel", "--ids", "1-x"), "'1-x' is no id"),
    ],
)
def test_what_cannot_be_simulated_is_told(words: tuple[str, ...], why: str) -> None:
    from controller.cli.app import make_app

    result = CliRunner().invoke(make_app(), ["simulate", *words])
    assert result.exit_code != 0
    assert why in f"{result.output}{result.exception}"


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Serving).anything = 1


@pytest.mark.slow
def test_faults_come_by_time_and_traffic_is_recorded_and_served_again(tmp_path: Path) -> None:
    faults, record, link = tmp_path / "faults.toml", tmp_path / "bus.log", tmp_path / "bus"
    faults.write_text('timeline = ["0 place 1 1000", "0 fault alert:1"]')
    ping = bytes.fromhex("FFFFFD00010300 01194E")
    words = ("dynamixel", "--ids", "1", "--link", str(link), "--script", str(faults), "--record", str(record))
    with served(*words), serial.Serial(str(link), 1_000_000, timeout=10) as port:
        port.write(ping)
        answer = port.read(14)
        assert answer[8] == 0x80, "the alert of the timeline"
    assert read_traffic(record).wire.servos == {1: "xl330-m288"}
    with served("record", str(record), "--link", str(link)), serial.Serial(str(link), 1_000_000, timeout=10) as port:
        port.write(ping)
        assert port.read(14) == answer


def test_a_watched_bus_is_drawn_while_it_is_served_and_no_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[object] = []

    class View:
        """Draws until it is told to end."""

        def __init__(self, title: str, rows: Any, decoder: Any, console: Any) -> None:
            self.tap = "its tap"
            seen.append(title)

        def run(self, goes_on: Callable[[], bool]) -> None:
            end_s = time.monotonic() + 10.0
            seen.append(goes_on())
            while goes_on() and time.monotonic() < end_s:
                time.sleep(0.01)
            seen.append(time.monotonic() < end_s)

    def serve(line: Any, link: Any, ready: Any, *, on_server: Callable[[Any], None], **options: Any) -> None:
        server = SimpleNamespace(port=SimpleNamespace(path="/dev/pts/9"), line=line, tap=None)
        on_server(server)
        end_s = time.monotonic() + 10.0
        while len(seen) < 2 and time.monotonic() < end_s:
            time.sleep(0.01)
        seen.append("served")

    monkeypatch.setattr(simulate, "BusView", View)
    monkeypatch.setattr(simulate, "serve", serve)
    line: Any = SimpleNamespace(faults=SimpleNamespace(add=lambda faults, now_s: None))
    wire: Any = SimpleNamespace(baud=1_000_000)
    simulate._serve(line, wire, Serving(watch=True), None, None)  # type: ignore[arg-type]
    assert seen == ["simulated bus on /dev/pts/9", True, "served", True]
