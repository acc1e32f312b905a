"""The sketch of docs/boards.md, compiled for this machine, is a head for the line protocol as an output."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from tests.drivers.contract import settle

ARDUINO = """
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <cstdint>
#include <poll.h>
#include <time.h>
#include <unistd.h>
unsigned long millis() { timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec * 1000 + t.tv_nsec / 1000000; }
struct SerialPort {
  void begin(long) {}
  int available() { pollfd p = {0, POLLIN, 0}; return poll(&p, 1, 1) > 0; }
  int read() { char c; if (::read(0, &c, 1) < 1) exit(0); return (unsigned char)c; }
  void print(const char *s) { if (write(1, s, strlen(s))) {} }
  void print(char c) { if (write(1, &c, 1)) {} }
} Serial;
struct Servo {
  int pin = 0;
  bool attached() { return pin; }
  void attach(int p, int, int) { pin = p; }
  void detach() { if (pin) { fprintf(stderr, "%d off\\n", pin); pin = 0; } }
  void writeMicroseconds(int us) { fprintf(stderr, "%d %d\\n", pin, us); }
};
"""
SERVOS = [
    ServoSpec(i, name, "rc-180", -0.5, 0.5, 20.0, 900.0) for i, name in enumerate(("jaw", "neckYaw", "neckPitch"))
]


@pytest.fixture(scope="module")
def sketch(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("g++") is None:
        pytest.skip("needs g++ to compile the sketch")
    folder = tmp_path_factory.mktemp("sketch")
    code = re.search(r"```cpp\n#include <Servo.h>\n(.*?)```", (root / "docs/boards.md").read_text(), re.DOTALL)
    assert code
    (folder / "s.cpp").write_text(ARDUINO + code[1] + "int main() { setup(); for (;;) loop(); }\n")
    subprocess.run(["g++", "-O0", "-o", folder / "s", folder / "s.cpp"], check=True)
    return folder / "s"


@pytest.fixture
def board(sketch: Path, tmp_path: Path) -> Iterator[tuple[str, Path]]:
    master, slave = os.openpty()
    log = tmp_path / "pulses"
    with log.open("wb") as pulses:
        process = subprocess.Popen([sketch], stdin=master, stdout=master, stderr=pulses)
        yield os.ttyname(slave), log
        process.kill()
        process.wait()
    os.close(master)
    os.close(slave)


def test_it_obeys_and_lets_go(board: tuple[str, Path]) -> None:
    path, log = board
    with open_bus("omote", SERVOS, port=path, margin_s=0.2) as bus:
        bus.start()
        settle(bus, [0.3, -0.3, 0.1], 0.01, measured=False)
        errors = dict(bus.report().errors)
    last = {pin: us for pin, us in (line.split() for line in log.read_text().splitlines()) if us != "off"}
    for pin, angle in zip(("9", "10", "11"), (0.3, -0.3, 0.1), strict=True):
        assert float(last[pin]) == pytest.approx(1500 + angle * 2000 / np.pi, abs=1)
    assert log.read_text().splitlines()[-3:] == ["9 off", "10 off", "11 off"]
    assert set(errors) <= {"held_back"}


def test_it_lets_go_by_itself_when_nobody_speaks(board: tuple[str, Path]) -> None:
    path, log = board
    bus = open_bus("omote", SERVOS, port=path, margin_s=0.2)
    bus.open()
    bus.start()
    bus._close_link()  # as a program that was killed
    end = time.monotonic() + 4
    while log.read_text().count("off") < 3:
        assert time.monotonic() < end
        time.sleep(0.05)
