"""The whole line: bytes in on one pseudo-terminal, servos on another and pixels in a picture move."""

from __future__ import annotations

import os
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS
from controller.body.body import Body
from controller.face.face import HeadValues
from controller.stage.stage import Stage, load_stage
from drivers.sim import SimulatedBus
from surface.head import Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera

JAW_ID = 4


def until(condition: Callable[[], bool], seconds: float = 60.0) -> bool:
    """Wait for ``condition``, at most ``seconds``."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return condition()


class Host:
    """A robot host at the master side of a pseudo-terminal."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)

    def say(self, line: str, seconds: float = 60.0) -> str:
        """Write one line and return the line that answers it."""
        os.write(self._master, line.encode() + b"\n")
        answer = b""
        os.set_blocking(self._master, False)
        end = time.monotonic() + seconds
        while not answer.endswith(b"\n") and time.monotonic() < end:
            try:
                answer += os.read(self._master, 1)
            except BlockingIOError:
                time.sleep(0.001)
        return answer.decode().strip()

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)


@pytest.fixture
def host() -> Iterator[Host]:
    made = Host()
    yield made
    made.close()


@pytest.fixture
def servos() -> Iterator[SimulatedBus]:
    with SimulatedBus(range(1, 25)) as bus:
        yield bus


def make_stage(folder: Path, root: Path, link: str, wire: str) -> Stage:
    """The shipped 24-servo head on a real port name, commanded over another."""
    robot = (root / "configs/robots/head24.toml").read_text()
    robot = robot.replace('kind = "simulated"', f'kind = "dynamixel"\nport = "{wire}"')
    (folder / "robot.toml").write_text(robot)
    stage = f'name = "line"\nrobots = ["robot.toml"]\n[[links]]\nkind = "line"\nport = "{link}"\n'
    (folder / "stage.toml").write_text(stage)
    return load_stage(str(folder / "stage.toml"), PARAMETERS)


@pytest.mark.slow
def test_one_line_moves_the_servo_and_the_picture(tmp_path: Path, root: Path, host: Host, servos: SimulatedBus) -> None:
    stage = make_stage(tmp_path, root, host.path, servos.path)
    head = Head.load(stage.head)
    with Mailbox.create(len(PARAMETERS.names)) as mailbox, Offscreen(head, (320, 320)) as screen:
        values = HeadValues(mailbox, PARAMETERS, head.parameters)
        body = Body(stage, PARAMETERS, mailbox)
        body.start()
        body.begin()
        try:
            closed = screen.render(values(), Camera.front()).astype(int)
            rest = servos.servo(JAW_ID).position_ticks
            others = [servos.servo(i).position_ticks for i in (1, 2, 3, 18, 19)]

            assert host.say("SET jawOpen 0.8").startswith("OK")

            wanted = round(0.8 * 28 / 360 * 4096)
            assert until(lambda: abs(servos.servo(JAW_ID).position_ticks - rest - wanted) <= 3)
            assert [servos.servo(i).position_ticks for i in (1, 2, 3, 18, 19)] == others
            measured = body.buses[0].measured()
            assert measured is not None
            assert until(lambda: abs(np.degrees(body.buses[0].measured().position_rad[JAW_ID - 1]) - 22.4) < 0.3)
            opened = screen.render(values(), Camera.front()).astype(int)
        finally:
            body.stop()
    moved = np.abs(opened - closed).max(axis=2) > 24
    rows = np.nonzero(moved)[0]
    assert moved.mean() > 0.01
    assert np.median(rows) > 320 / 2  # the lower half of the picture: mouth and chin
    assert moved[: 320 // 4].mean() < 1e-3  # the forehead stays
    assert all(servos.servo(i).torque is False for i in range(1, 25))


def test_a_refused_line_changes_nothing(tmp_path: Path, root: Path, host: Host, servos: SimulatedBus) -> None:
    stage = make_stage(tmp_path, root, host.path, servos.path)
    with Mailbox.create(len(PARAMETERS.names)) as mailbox:
        body = Body(stage, PARAMETERS, mailbox)
        body.start()
        body.begin()
        try:
            assert host.say("SET jawOpen 0.5").startswith("OK")
            jaw = PARAMETERS.index("jawOpen")
            assert until(lambda: abs(body.newest()[0][jaw] - 0.5) < 1e-6)
            for line in ("SET jawOpn 1", "SET jawOpen nan", "SET jawOpen 7", "SET jawOpen 0.1 headYaw x", "\x80\xff"):
                before = body.newest()[0].copy()
                assert host.say(line).startswith("ERR"), line
                time.sleep(0.05)
                assert np.abs(body.newest()[0] - before).max() < 1e-5, line
        finally:
            body.stop()
