"""The sketches of the pages, compiled, at a real body: they do what their comments and pages say."""

from __future__ import annotations

import os
import re
import select
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.body import Body
from controller.links.line.hostport import HostPort
from controller.stage.stage import load_stage
from tests.arduino import compile_sketch

JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")
RELEASED, PRESSED = 1, 0
LIMIT_S = 60.0


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@contextmanager
def running(folder: Path, stage: str) -> Iterator[Body]:
    """The body of a stage."""
    (folder / "stage.toml").write_text(f'name = "mine"\n{stage}')
    with Mailbox.create(len(P)) as mailbox:
        body = Body(load_stage(str(folder / "stage.toml"), P), P, mailbox)
        try:
            body.start()
            body.begin()
            yield body
        finally:
            body.stop()


class Cable:
    """Joins a sketch and a port; ``damage`` changes what passes to omote, ``lose`` what comes back."""

    def __init__(self, sketch: Path, inputs: Path, log: Path) -> None:
        self.port = HostPort()
        self.damage = self.lose = lambda line: line
        self.sent: list[bytes] = []
        self._inputs, self._ended = inputs, threading.Event()
        self._log = log.open("wb")
        self._process = subprocess.Popen(
            [sketch], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, env={"INPUTS": str(inputs)}
        )
        self._thread = threading.Thread(target=self._run, daemon=True)

    def pins(self, analogue: int, digital: int) -> None:
        """What the sketch reads from now on."""
        part = self._inputs.with_suffix(".part")
        part.write_text(f"{analogue} {digital}")
        part.replace(self._inputs)

    def __enter__(self) -> Cable:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._process.kill()
        self._process.communicate()
        self._log.close()
        self.port.close()

    def _run(self) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        halves = {self._process.stdout.fileno(): b"", self.port.descriptors[0]: b""}
        while not self._ended.is_set():
            for descriptor in select.select([*halves], [], [], 0.02)[0]:
                *lines, halves[descriptor] = (halves[descriptor] + os.read(descriptor, 4096)).split(b"\n")
                for line in lines:
                    self._pass(line, to_omote=descriptor == self._process.stdout.fileno())

    def _pass(self, line: bytes, *, to_omote: bool) -> None:
        if to_omote:
            self.sent.append(line)
            self.port.write(self.damage(line) + b"\n")
        else:
            assert self._process.stdin is not None
            self._process.stdin.write(self.lose(line) + b"\n")
            self._process.stdin.flush()


@pytest.fixture(scope="module")
def potentiometer(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_sketch(root / "docs/line-protocol.md", tmp_path_factory.mktemp("potentiometer"))


@pytest.fixture(scope="module")
def head(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_sketch(root / "docs/boards.md", tmp_path_factory.mktemp("head"))


@pytest.fixture
def cable(potentiometer: Path, tmp_path: Path) -> Iterator[Cable]:
    (tmp_path / "inputs").write_text(f"0 {RELEASED}")
    with Cable(potentiometer, tmp_path / "inputs", tmp_path / "log") as cable:
        yield cable


def on(cable: Cable) -> str:
    return f'[[links]]\nkind = "line"\nport = "{cable.port.path}"\n'


@pytest.mark.slow
def test_releasing_the_button_keeps_what_the_potentiometer_holds(cable: Cable, tmp_path: Path) -> None:
    with running(tmp_path, on(cable)) as body:
        status = body.state.status
        cable.pins(1016, RELEASED)
        until(lambda: body.newest()[0][JAW] == pytest.approx(1.0, abs=1e-3))
        cable.pins(1016, PRESSED)
        until(lambda: status()["expression"] == "smile" and body.newest()[0][SMILE] > 0.2)
        cable.pins(1016, RELEASED)
        until(lambda: status()["expression"] == "neutral" and body.newest()[0][SMILE] < 0.01)
        assert status()["manual"] == 1 and body.newest()[0][JAW] == pytest.approx(1.0, abs=1e-3)
        assert not body.links[0].report()["refused"]


def quiet(cable: Cable) -> bool:
    """Nothing is sent for longer than a sketch waits for an answer."""
    before = len(cable.sent)
    time.sleep(0.5)
    return len(cable.sent) == before


@pytest.mark.slow
@pytest.mark.parametrize("way", ["damage", "lose"])
def test_a_line_that_is_lost_or_damaged_is_sent_again(cable: Cable, tmp_path: Path, way: str) -> None:
    with running(tmp_path, on(cable)) as body:
        until(lambda: body.state.status()["manual"] == 1)
        left = [b"", b"\xff", None]  # a line that vanishes, one that is damaged, one with a wrong bit before the *

        def spoil(line: bytes) -> bytes:
            if not left:
                return line
            how = left.pop(0)
            return line.replace(b"*", b".") if how is None else how

        until(lambda: quiet(cable))  # on a busy machine a late answer has the line before sent again
        setattr(cable, way, spoil)
        first = len(cable.sent)
        cable.pins(512, RELEASED)
        until(lambda: not left and body.newest()[0][JAW] == pytest.approx(0.503, abs=1e-3))
        until(lambda: len(cable.sent) >= first + 4)
        sent = cable.sent[first:]
        assert set(sent[:4]) == {sent[0]} and b" SET jawOpen 0.503*" in sent[0]


def test_the_light_shows_that_a_line_was_refused(cable: Cable, tmp_path: Path) -> None:
    lights = tmp_path / "log"
    with running(tmp_path, on(cable)) as body:
        until(lambda: body.state.status()["manual"] == 1)
        assert "pin 13 1" not in lights.read_text()
        body.state.vocabulary._lookup.pop("smile")
        cable.pins(0, PRESSED)
        until(lambda: "pin 13 1" in lights.read_text())
        cable.pins(0, RELEASED)
        until(lambda: lights.read_text().rstrip().endswith("pin 13 0"))


def test_a_head_of_a_sketch_follows_the_body_and_is_let_go(head: Path, tmp_path: Path, root: Path) -> None:
    master, slave = os.openpty()
    robot = (root / "configs/robots/head-arduino.toml").read_text(encoding="utf-8")
    robot = robot.replace('kind = "simulated"\nsimulates = "omote"', f'kind = "omote"\nport = "{os.ttyname(slave)}"')
    (tmp_path / "robot.toml").write_text(robot)
    log = tmp_path / "pulses"
    with log.open("wb") as pulses, subprocess.Popen([head], stdin=master, stdout=master, stderr=pulses) as process:
        try:
            with running(tmp_path, 'robots = ["robot.toml"]\n') as body:
                body.state.set_parameters([JAW], [1.0], time.monotonic_ns())
                jaw = round(1500 + 25 * 2000 / 180)
                until(lambda: abs(int((re.findall(r"^9 (\d+)$", log.read_text(), re.M) or ["0"])[-1]) - jaw) <= 1)
            until(lambda: {"9 off", "10 off", "11 off"} <= set(log.read_text().splitlines()))
        finally:
            process.kill()
    os.close(master)
    os.close(slave)
