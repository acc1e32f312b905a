"""What ``omote simulate`` serves, as another program sees it."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial

from controller.errors import ConfigError
from controller.simulating import robot_servos


@contextmanager
def served(*words: str) -> Iterator[subprocess.Popen[str]]:
    """``omote simulate WORDS``, ready; it must end well on SIGINT."""
    command = [sys.executable, "-c", "from controller.cli import main; main()", "simulate", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("ready ")
        yield process
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
    finally:
        process.kill()
        process.communicate()


def test_any_program_can_open_the_servos(tmp_path: Path) -> None:
    link = tmp_path / "head"
    with served("dynamixel", "--ids", "1", "--link", str(link)), serial.Serial(str(link), 1_000_000, timeout=2) as port:
        port.write(bytes.fromhex("FFFFFD00010300 01194E"))  # ping, from the e-Manual
        reply = port.read(14)
        assert reply[:9] == bytes.fromhex("FFFFFD000107005500")
        assert int.from_bytes(reply[9:11], "little") == 1200
    assert not link.exists()


@pytest.mark.parametrize(
    ("words", "asked", "answer"),
    [
        (("feetech", "--ids", "1"), "FFFF010201FB", "FFFF010200FC"),  # ping, Protocol 1.0 framing
        (("dynamixel", "--ids", "1", "--model", "ax-12a"), "FFFF010201FB", "FFFF010200FC"),
        (("maestro",), "A1", "0000"),  # get errors: none
        (("ssc32",), "510D", "2E"),  # Q: nothing moves
    ],
)
def test_every_family_answers(tmp_path: Path, words: tuple[str, ...], asked: str, answer: str) -> None:
    link = tmp_path / "port"
    with served(*words, "--link", str(link)), serial.Serial(str(link), 1_000_000, timeout=2) as port:
        port.write(bytes.fromhex(asked))
        assert port.read(len(answer) // 2) == bytes.fromhex(answer)


def test_the_host_plays_its_script_to_whoever_opens_it(tmp_path: Path) -> None:
    link = tmp_path / "robot"
    with served("host", "tour", "--link", str(link)), serial.Serial(str(link), 115_200, timeout=5) as port:
        line = port.readline()
    assert b"HELLO" in line


def test_a_robot_file_says_which_servos(root: Path) -> None:
    servos, baud = robot_servos("head24", None)
    assert [servo.id for servo in servos] == list(range(1, 25))
    assert {servo.model for servo in servos} == {"xl330-m288"}
    assert baud == 1_000_000
    with pytest.raises(ConfigError, match="no bus called 'neck'") as caught:
        robot_servos("head24", "neck")
    assert "head" in caught.value.hint
