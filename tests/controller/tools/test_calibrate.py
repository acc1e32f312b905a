"""omote calibrate in a real terminal, with a simulated head that is moved by hand."""

from __future__ import annotations

import io
import itertools
import os
import re
import resource
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import pytest
from rich.console import Console

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS
from controller.robot.robot import load_robot
from controller.tools import calibrate as module
from controller.tools.calibrate import keyboard, split_keys
from drivers.base.errors import PortLost
from drivers.sim import ServoView, SimulatedBus

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")

ROBOT = """
name = "pair"
[[buses]]
name = "head"
kind = "dynamixel"
port = "{port}"
[[channels]]
name = "jaw"
bus = "head"
id = 1
model = "xl330-m288"
mix = {{ jawOpen = 1.0 }}
map = {{ at = [0, 1], deg = [0, 20] }}
limit_deg = [-30, 30]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""


class Terminal:
    """omote calibrate on a pseudo-terminal of its own; a context manager that leaves no process behind."""

    def __init__(self, *words: str) -> None:
        self.master, slave = os.openpty()
        command = [sys.executable, "-c", "from controller.cli.app import main; main()", "calibrate", *words]
        environment = {**os.environ, "COLUMNS": "140", "LINES": "40", "TERM": "xterm"}
        self.process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=environment)
        os.close(slave)
        os.set_blocking(self.master, False)
        self.shown = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)

    def until(self, pattern: str) -> None:
        """Wait until a pattern was drawn after the last one that was waited for."""

        def drawn() -> re.Match[str] | None:
            self.drain()
            return re.search(pattern, re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.shown))

        wait(drawn)
        found = drawn()
        assert found is not None
        self.shown = found.string[found.end() :]

    def press(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def end(self) -> int:
        """Its exit code, once it has ended by itself."""

        def ended() -> bool:
            self.drain()  # a terminal that nobody reads would hold it up
            return self.process.poll() is not None

        wait(ended)
        return self.process.returncode

    def drain(self) -> None:
        """Take what was drawn."""
        with suppress(BlockingIOError, OSError):
            self.shown += os.read(self.master, 65536).decode("utf-8", "ignore")

    def capture(self, servo: ServoView) -> None:
        """Neutral, lowest and highest of the only channel, each seen before the hand moves on."""
        for angle, key in ((5, "n"), (-10, "["), (18, "]")):
            servo.place(degrees(angle))
            self.until(rf" {angle}\.0 ")
            self.press(key)
            self.until(rf" {angle}\.0 [^\n]* {angle}\.0 ")


def degrees(value: float) -> float:
    return 2048 + value * 4096 / 360


def wait(done: Callable[[], object]) -> None:
    """Wait by counting, not by the clock: a machine that stood still for a while is no fault of the program."""
    for _ in range(3000):
        if done():
            return
        time.sleep(0.01)
    raise AssertionError("waited 30 s in vain")


Opened = Callable[[Terminal], Terminal]


@pytest.fixture
def opened() -> Iterator[Opened]:
    """Keeps terminals until the test ends, whatever its end is."""
    with ExitStack() as stack:
        yield stack.enter_context


@pytest.mark.slow
def test_a_head_is_calibrated_by_hand_and_by_keys_and_saved(tmp_path: Path, opened: Opened) -> None:
    with SimulatedBus([1], link=tmp_path / "port") as head:
        robot = tmp_path / "pair.toml"
        robot.write_text(ROBOT.format(port=head.path))
        servo, terminal = head.servo(1), opened(Terminal(str(robot), "--name", "desk", "--margin", "0"))
        terminal.capture(servo)
        assert not servo.torque
        terminal.press("h")
        wait(lambda: servo.torque)
        terminal.press("\x1b[D\x1b[D")
        wait(lambda: servo.goal < degrees(17.3))
        terminal.press("h")
        wait(lambda: not servo.torque)
        terminal.press("s")
        terminal.until("saved 1 channels")
        terminal.press("q")
        assert terminal.end() == 0
        assert not servo.torque
    captured = tomllib.loads((tmp_path / "pair.desk.calibration.toml").read_text())
    assert captured["channels"]["jaw"] == pytest.approx({"min_deg": -10, "neutral_deg": 5, "max_deg": 18}, abs=0.1)


def test_keys_of_a_windows_console_have_the_same_names(monkeypatch: pytest.MonkeyPatch) -> None:
    typed = list("a\xe0H\x00P\xe0M\xe0Kb\xe0X")
    console = SimpleNamespace(kbhit=lambda: bool(typed), getwch=lambda: typed.pop(0))
    now = itertools.count(10.0, 0.0625)
    slept: list[float] = []
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    monkeypatch.setattr(module.time, "monotonic", lambda: next(now))
    monkeypatch.setattr(module.time, "sleep", slept.append)
    assert module._windows_keys(1.0) == ["a", "up", "down", "right", "left", "b"]
    assert len(slept) == 8 and all(0.0 < seconds < 0.1 for seconds in slept)  # until the second is over


@pytest.mark.slow
def test_a_calibration_that_exists_is_not_replaced_without_a_yes(tmp_path: Path, opened: Opened) -> None:
    with SimulatedBus([1], link=tmp_path / "port") as head:
        robot, old = tmp_path / "pair.toml", tmp_path / "pair.desk.calibration.toml"
        robot.write_text(ROBOT.format(port=head.path))
        old.write_text("precious")
        servo, terminal = head.servo(1), opened(Terminal(str(robot), "--name", "desk"))
        terminal.capture(servo)
        terminal.press("s")
        terminal.until("replace")
        terminal.press("n")
        terminal.until("not saved")
        assert old.read_text() == "precious"
        terminal.press("s")
        terminal.until("replace")
        terminal.press("y")
        terminal.until("saved 1 channels")
        terminal.press("q")
        assert terminal.end() == 0
    assert "precious" not in old.read_text()


@pytest.mark.slow
def test_a_calibration_that_is_told_to_end_leaves_the_motors_off(tmp_path: Path, opened: Opened) -> None:
    with SimulatedBus([1], link=tmp_path / "port") as head:
        robot = tmp_path / "pair.toml"
        robot.write_text(ROBOT.format(port=head.path))
        terminal = opened(Terminal(str(robot)))
        terminal.until("jaw")
        terminal.press("h")
        wait(lambda: head.servo(1).torque)
        terminal.process.terminate()
        assert terminal.end() == 0
        assert not list(tmp_path.glob("*.calibration.toml"))
        assert not head.servo(1).torque


def test_keys_arrive_one_by_one_and_the_terminal_is_left_as_it_was() -> None:
    import termios

    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    with keyboard(slave) as read_keys:
        assert read_keys(0.0) == []
        os.write(master, b"n\x1b[A\x1b[D[q")
        assert read_keys(0.2) == ["n", "up", "left", "[", "q"]
    assert termios.tcgetattr(slave) == before
    os.close(master)
    os.close(slave)


def test_unknown_sequences_are_left_out() -> None:
    assert split_keys("\x1b[Ha") == ["a"]


def test_something_that_is_no_terminal_is_refused() -> None:
    reading, writing = os.pipe()
    with pytest.raises(ControllerError, match="terminal"):
        keyboard(reading).__enter__()
    os.close(reading)
    os.close(writing)


class Servos:
    """A bus of a calibration: what it is asked, and angles (deg) of some age for every read."""

    measures = True
    is_open = True

    def __init__(self, count: int) -> None:
        self.asked: list[object] = []
        self.running = False
        self.angle_deg, self.age_s = np.full(count, 5.0), np.zeros(count)

    def __enter__(self) -> Servos:
        return self

    def __exit__(self, *_: object) -> None:
        self.asked.append("closed")

    def start(self) -> None:
        self.running = True
        self.asked.append("start")

    def stop(self) -> None:
        self.running = False
        self.asked.append("stop")

    def write(self, angle_rad: np.ndarray) -> None:
        self.asked.append(np.degrees(angle_rad).round(6).tolist())

    def read(self) -> SimpleNamespace:
        return SimpleNamespace(age_s=self.age_s, position_rad=np.radians(self.angle_deg))


def calibrated(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    keys: list[list[str]],
    read_keys: Callable[[float], list[str]] | None = None,
    **changes: Any,
) -> tuple[bool, Servos, list[Any], str]:
    """Run a calibration of jaw and brow, of two servos on one bus; keys come a round at a time, then q and y."""
    text = ROBOT.format(port="/dev/none")
    other = text[text.index("[[channels]]") :].replace('"jaw"', '"brow"').replace("id = 1", "id = 2")
    (tmp_path / "pair.toml").write_text(text + other.replace("max_speed_deg_s = 300", "max_speed_deg_s = 20"))
    robot = load_robot(tmp_path / "pair.toml", PARAMETERS)
    servos, opened, left = Servos(2), list[Any](), iter(keys)
    for name, value in changes.items():
        setattr(servos, name, value)

    def open_bus(kind: str, specs: Any, **options: Any) -> Servos:
        opened.append((kind, specs, options))
        return servos

    def read_next(wait_s: float) -> list[str]:
        assert wait_s == 0.03
        return next(left, ["q", "y"])

    monkeypatch.setattr(module, "open_bus", open_bus)
    monkeypatch.setattr(module, "keyboard", lambda: nullcontext(read_keys or read_next))
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, width=140)
    target = tmp_path / "c.toml"
    written = module.run_calibration(robot, robot.channels, "desk", target, 0.0, console)
    return written, servos, opened, out.getvalue()


def test_servos_are_slow_while_they_are_calibrated_and_closed_at_the_end(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    written, servos, opened, shown = calibrated(monkeypatch, tmp_path, [["h"], ["right"], ["h"], []])
    ((kind, specs, options),) = opened
    assert kind == "dynamixel" and options["port"] == "/dev/none"
    assert [spec.max_speed_rad_s for spec in specs] == pytest.approx([0.5, np.radians(20)])
    assert not written and not (tmp_path / "c.toml").exists()
    assert servos.asked == ["start", [5.0, 5.0], [5.5, 5.0], "stop", "closed"]
    assert "pair, calibration 'desk'" in shown


def test_what_was_captured_is_saved_once_it_is_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys = [["t"], ["N"]]
    angles = iter([-10.0, 3.0, 20.0])
    read = Servos.read

    def moving(servos: Servos) -> SimpleNamespace:
        servos.angle_deg = np.array([next(angles, 3.0), 3.0])
        return read(servos)

    monkeypatch.setattr(Servos, "read", moving)
    written, _, _, shown = calibrated(monkeypatch, tmp_path, [*keys, [], [], ["s"], []])
    assert written and "saved 1 channels; not complete: brow" in shown
    captured = tomllib.loads((tmp_path / "c.toml").read_text())
    assert captured["channels"] == {"jaw": pytest.approx({"min_deg": 3, "neutral_deg": 3, "max_deg": 20})}


@pytest.mark.parametrize(("age_s", "known"), [(0.49, True), (0.5, False)])
def test_an_angle_is_known_for_half_a_second(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, age_s: float, known: bool
) -> None:
    _, servos, _, shown = calibrated(monkeypatch, tmp_path, [["h"], []], age_s=np.array([0.0, age_s]))
    assert ("start" in servos.asked) is known
    assert ("the angle of a servo is unknown" in shown) is not known


def test_angles_of_servos_that_measure_nothing_count_whatever_their_age(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _, servos, _, _ = calibrated(monkeypatch, tmp_path, [["h"], ["right"]], age_s=np.full(2, np.inf), measures=False)
    assert servos.asked == ["start", [5.0, 5.0], [5.5, 5.0], "closed"]  # 5 deg, and a step of the right key


def test_a_lost_port_leaves_what_was_captured_and_switches_nothing_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A loose plug after the angles of a channel: the calibration goes on, and can be saved."""
    angles, once, read = iter([-10.0, -10.0, 3.0, 3.0, 20.0, 20.0]), iter([True]), Servos.read

    def unplugged(servos: Servos) -> SimpleNamespace:
        if (angle := next(angles, None)) is None and next(once, False):
            servos.is_open = False
            raise PortLost("port /dev/none is lost", hint="plug it in again")
        servos.angle_deg = np.array([5.0 if angle is None else angle, 5.0])
        return read(servos)

    def reconnect(servos: Servos) -> None:
        servos.asked.append("reconnect")
        servos.is_open = True

    monkeypatch.setattr(Servos, "read", unplugged)
    monkeypatch.setattr(Servos, "reconnect", reconnect, raising=False)
    keys = [["["], [], ["n"], [], ["]"], ["h"], [], [], ["s"], []]
    written, servos, _, shown = calibrated(monkeypatch, tmp_path, keys)
    assert written and "port /dev/none is lost" in shown and "saved 1 channels" in shown
    assert servos.asked == ["start", [20.0, 5.0], "reconnect", "stop", "closed"]
    captured = tomllib.loads((tmp_path / "c.toml").read_text())
    assert captured["channels"] == {"jaw": pytest.approx({"min_deg": -10, "neutral_deg": 3, "max_deg": 20})}


def test_keys_of_a_terminal_are_told_apart() -> None:
    keys = "\x1b[A\x1b[B\x1b[C\x1b[D\x1bOA\x1bOB\x1bOC\x1bOD\nq"
    assert split_keys(keys) == ["up", "down", "right", "left", "up", "down", "right", "left", "\n", "q"]
    assert split_keys("\x1b") == [] and split_keys("") == []


@pytest.mark.parametrize("place", ["full disk", "read-only folder"])
def test_what_was_captured_stays_where_it_cannot_be_saved_until_it_can(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, place: str
) -> None:
    angles = iter([-10.0, 3.0, 20.0])
    read, save, refusals = Servos.read, module.save_calibration, iter([True])

    def moving(servos: Servos) -> SimpleNamespace:
        servos.angle_deg = np.array([next(angles, 3.0), 3.0])
        return read(servos)

    def save_later(path: Path, *rest: Any) -> None:
        """First on a disk where no byte fits, or in a folder of the kernel's in which not even root may write."""
        first, before = next(refusals, False), resource.getrlimit(resource.RLIMIT_FSIZE)
        if first and place == "read-only folder":
            return save(Path("/proc/self/c.toml"), *rest)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0 if first else before[0], before[1]))
        try:
            save(path, *rest)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    monkeypatch.setattr(Servos, "read", moving)
    monkeypatch.setattr(module, "save_calibration", save_later)
    keys = [["t"], ["N"], [], [], ["s"], [], ["s"], []]
    written, _, _, shown = calibrated(monkeypatch, tmp_path, keys)
    assert "not saved: " in shown and "saved 1 channels" in shown and written
    assert tomllib.loads((tmp_path / "c.toml").read_text())["channels"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.toml", "pair.toml"]


OLD = """
name = "desk"
robot = "{robot}"
[channels.jaw]
min_deg = -1
neutral_deg = 0
max_deg = 1
[channels.brow]
min_deg = -7
neutral_deg = 0
max_deg = 7
[channels.gone]
min_deg = -7
neutral_deg = 0
max_deg = 7
"""


def moved_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """The jaw is at -10, 3 and 20 degrees, in turn, and then rests."""
    angles, read = iter([-10.0, 3.0, 20.0]), Servos.read

    def moving(servos: Servos) -> SimpleNamespace:
        servos.angle_deg = np.array([next(angles, 3.0), 3.0])
        return read(servos)

    monkeypatch.setattr(Servos, "read", moving)


@pytest.mark.parametrize(("robot", "kept"), [("pair", {"jaw", "brow"}), ("another", {"jaw"})])
def test_channels_that_are_not_captured_again_stay_in_the_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, robot: str, kept: set[str]
) -> None:
    """Of this robot, that is, and channels that it still has."""
    (tmp_path / "c.toml").write_text(OLD.format(robot=robot))
    moved_by_hand(monkeypatch)
    written, _, _, shown = calibrated(monkeypatch, tmp_path, [["["], ["n"], ["]"], ["s"], ["y"], []])
    found = tomllib.loads((tmp_path / "c.toml").read_text())
    assert written and set(found["channels"]) == kept and found["robot"] == "pair"
    assert found["channels"]["jaw"]["max_deg"] == pytest.approx(20)
    assert ("and keep 1 other channels in it?" in shown) == (len(kept) == 2)


def test_a_file_of_a_newer_omote_is_refused_before_anything_is_captured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    target = tmp_path / "c.toml"
    text = "format = 2\n" + OLD.format(robot="pair")
    target.write_text(text)
    with pytest.raises(ConfigError, match="written by a newer omote") as caught:
        calibrated(monkeypatch, tmp_path, [["s"], ["y"], []])
    assert "pip install --upgrade omote" in caught.value.hint and "--name" in caught.value.hint
    assert target.read_text() == text


@pytest.mark.parametrize("end", ["SIGHUP", "SIGINT", "closed terminal"])
def test_what_was_captured_and_not_saved_is_not_lost_when_it_is_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, end: str
) -> None:
    (tmp_path / "c.unsaved.calibration.toml").write_text("of another time")
    moved_by_hand(monkeypatch)
    rounds = iter([["["], ["n"], ["]"]])

    def read_keys(_: float) -> list[str]:
        if (keys := next(rounds, None)) is not None:
            return keys
        if end == "closed terminal":
            raise ControllerError("the terminal was closed")
        os.kill(os.getpid(), getattr(signal, end))
        return []

    ending = pytest.raises(ControllerError) if end == "closed terminal" else nullcontext()
    with ending:
        _, servos, _, shown = calibrated(monkeypatch, tmp_path, [], read_keys=read_keys)
        assert "c.unsaved1.calibration.toml" in shown and servos.asked == ["closed"]
    found = tomllib.loads((tmp_path / "c.unsaved1.calibration.toml").read_text())
    assert found["channels"] == {"jaw": pytest.approx({"min_deg": -10, "neutral_deg": 3, "max_deg": 20})}
    assert not (tmp_path / "c.toml").exists()


def test_a_terminal_that_was_closed_is_an_error_and_no_endless_loop() -> None:
    master, slave = os.openpty()
    try:
        with pytest.raises(ControllerError, match="the terminal was closed"), keyboard(slave) as read_keys:
            os.close(master)
            read_keys(5.0)
    finally:
        with suppress(OSError):
            os.close(slave)


def test_without_standard_input_keys_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(ControllerError, match="only be read from a terminal"):
        keyboard().__enter__()
