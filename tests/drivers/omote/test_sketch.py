"""The sketch of docs/boards.md, compiled for this machine, is a head for the line protocol as an output."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from tests.arduino import compile_sketch
from tests.drivers.contract import settle

SERVOS = [
    ServoSpec(i, name, "rc-180", -0.5, 0.5, 20.0, 900.0) for i, name in enumerate(("jaw", "neckYaw", "neckPitch"))
]


@pytest.fixture(scope="module")
def sketch(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_sketch(root / "docs/boards.md", tmp_path_factory.mktemp("sketch"))


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
