"""The body's process: it starts, obeys, reports, and never leaves a servo powered behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS
from controller.body import messages
from controller.body.messages import Hold, Neutral, Show
from controller.body.preload import PreloadedBody
from controller.body.process import BodyProcess, deadline
from controller.stage.stage import Stage, load_stage
from drivers.sim import SimulatedBus
from tests.controller.links.net.sockets import free_port

JAW_ID = 4


def until(condition: Callable[[], bool]) -> bool:
    """Wait for ``condition``, by counting: a machine that stood still for a while is no fault of the program."""
    for _ in range(1000):
        if condition():
            return True
        time.sleep(0.02)
    return False


@pytest.fixture
def servos() -> Iterator[SimulatedBus]:
    with SimulatedBus(range(1, 25)) as bus:
        yield bus


@pytest.fixture
def stage(tmp_path: Path, root: Path, servos: SimulatedBus) -> Stage:
    """The shipped head on the simulated bus's port, no links; late answers of a busy machine are waited for."""
    robot = (root / "configs/robots/head24.toml").read_text()
    robot = robot.replace('kind = "simulated"', f'kind = "dynamixel"\nport = "{servos.path}"\nmargin_s = 2.0')
    (tmp_path / "robot.toml").write_text(robot)
    (tmp_path / "stage.toml").write_text('name = "mine"\nrobots = ["robot.toml"]\n')
    return load_stage(str(tmp_path / "stage.toml"), PARAMETERS)


def powered(servos: SimulatedBus) -> list[int]:
    return [i for i in range(1, 25) if servos.servo(i).torque]


def newest(body: BodyProcess, name: str) -> float:
    values = np.zeros(len(PARAMETERS.names))
    body.mailbox.read(values)
    return float(values[PARAMETERS.index(name)])


@pytest.mark.slow
def test_what_is_open_to_others_is_said_on_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "open.toml").write_text("".join(
        f'[[links]]\nkind = "{kind}"\nlisten = "udp:0.0.0.0:{free_port()}"\nopen_to_network = true\nlayer = "{layer}"\n'
        for kind, layer in (("livelink", "capture"), ("json", "speech"))
    ))  # fmt: skip
    with BodyProcess(load_stage(str(tmp_path / "open.toml"), PARAMETERS), PARAMETERS) as body:
        body.wait_ready()
        body.begin()
        body.stop()
    told = capfd.readouterr().err
    assert "can move this face and its servos, without a password" in told
    assert (tmp_path / "omote" / "token").read_text().strip() in told


@pytest.mark.slow
def test_servos_stand_until_commands_may_come_obey_the_panel_and_end_limp(stage: Stage, servos: SimulatedBus) -> None:
    jaw, rest = PARAMETERS.index("jawOpen"), 2048
    places = [rest + 10 * i for i in range(1, 25)]
    for i, place in enumerate(places, 1):
        servos.servo(i).place(place)
    with BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
        assert powered(servos) == list(range(1, 25))
        body.send(Hold(jaw, 1.0))
        assert until(lambda: newest(body, "jawOpen") > 0.999)
        assert [servos.servo(i).position_ticks for i in range(1, 25)] == pytest.approx(places, abs=2)
        body.begin()
        assert until(lambda: servos.servo(JAW_ID).position_ticks - rest > 300)
        body.send(Hold(jaw, None))
        assert until(lambda: newest(body, "jawOpen") < 0.001)
        body.send(Show("happiness", 1.0))
        assert until(lambda: newest(body, "mouthSmileLeft") > 0.3)
        body.send(Neutral(0.1))
        assert until(lambda: newest(body, "mouthSmileLeft") < 0.01)
        body.send(Hold(jaw, 1.0))
        assert until(lambda: servos.servo(JAW_ID).position_ticks - rest > 300)
        body.stop()
        report = body.report
    assert powered(servos) == []
    assert abs(servos.servo(JAW_ID).position_ticks - rest) < 20  # led to rest before it went limp
    bus = report["buses"][0]  # type: ignore[index]
    assert bus["servos"] == 24
    assert bus["bus"]["errors"] == {}
    assert bus["ticks"] > 10


@pytest.mark.slow
def test_an_error_on_the_way_out_of_main_still_stops_the_servos(stage: Stage, servos: SimulatedBus) -> None:
    with pytest.raises(RuntimeError, match="mine"), BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
        raise RuntimeError("mine")
    assert powered(servos) == []


@pytest.mark.slow
@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGHUP])
def test_a_body_that_is_told_to_end_stops_the_servos_first(
    stage: Stage, servos: SimulatedBus, ending: signal.Signals
) -> None:
    with BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
        os.kill(body._process.pid or 0, ending)
        assert until(lambda: powered(servos) == [])


@pytest.mark.slow
def test_a_body_that_is_killed_leaves_the_rest_to_the_bus_watchdog(stage: Stage, servos: SimulatedBus) -> None:
    with pytest.raises(ControllerError, match="ended unexpectedly"), BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
        body.send(Hold(PARAMETERS.index("jawOpen"), 1.0))
        body._process.kill()
        assert until(lambda: all(servos.servo(i).register("Bus Watchdog") == 255 for i in range(1, 25)))
        while body.alive():
            time.sleep(0.02)


@pytest.mark.slow
def test_main_killed_is_noticed_and_the_servos_stopped(stage: Stage, servos: SimulatedBus) -> None:
    program = (
        "import sys, time\n"
        "from controller.base.parameters import PARAMETERS\n"
        "from controller.body.process import BodyProcess\n"
        "from controller.stage.stage import load_stage\n"
        "if __name__ == '__main__':\n"
        "    body = BodyProcess(load_stage(sys.argv[1], PARAMETERS), PARAMETERS)\n"
        "    body.wait_ready(); print('ready', flush=True); time.sleep(60)\n"
    )
    script = stage.path.parent / "main.py"
    script.write_text(program)
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    main = subprocess.Popen([sys.executable, str(script), str(stage.path)], stdout=subprocess.PIPE, env=environment)
    try:
        assert main.stdout is not None
        assert main.stdout.readline() == b"ready\n"
        assert powered(servos) == list(range(1, 25))
        main.send_signal(signal.SIGKILL)
        assert until(lambda: powered(servos) == [])
    finally:
        main.kill()
        main.communicate()


@pytest.mark.slow
@pytest.mark.usefixtures("stage")
def test_a_servo_that_does_not_answer_is_named_and_nothing_moves(tmp_path: Path, servos: SimulatedBus) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text(robot.read_text().replace("margin_s = 2.0", "margin_s = 0.5"))  # it is asked several times
    stage = load_stage(str(tmp_path / "stage.toml"), PARAMETERS)
    servos.fault("mute:7")
    with pytest.raises(ControllerError, match="7") as caught, BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
    assert caught.value.hint
    assert powered(servos) == []


@pytest.mark.slow
@pytest.mark.usefixtures("stage")
def test_a_servo_that_fails_later_is_said_at_once_and_does_not_take_the_report_along(
    tmp_path: Path, servos: SimulatedBus, capfd: pytest.CaptureFixture[str]
) -> None:
    robot = tmp_path / "robot.toml"
    robot.write_text(robot.read_text().replace("margin_s = 2.0", "margin_s = 0.1"))
    said = ""

    def stopped_answering() -> bool:
        nonlocal said
        said += capfd.readouterr().err
        return "(id 7) stopped answering" in said

    stage = load_stage(str(tmp_path / "stage.toml"), PARAMETERS)
    with pytest.raises(ControllerError, match="not confirmed off") as caught, BodyProcess(stage, PARAMETERS) as body:
        body.wait_ready()
        body.begin()
        servos.fault("silent:7")
        assert until(stopped_answering)
        body.stop()
    assert body.report["failed"] == str(caught.value)
    assert body.report["buses"][0]["servos"] == 24  # type: ignore[index]


class Ended:
    """What a body's process and its pipe are asked for, in order; it is alive for so many questions."""

    exitcode = 3

    def __init__(self, alive: int = 0, *messages: object) -> None:
        self.asked: list[object] = []
        self._alive, self._messages = alive, list(messages)

    def is_alive(self) -> bool:
        self._alive -= 1
        return self._alive >= 0

    def join(self, seconds: float | None = None) -> None:
        self.asked.append(("join", seconds))

    def terminate(self) -> None:
        self.asked.append("terminate")

    def kill(self) -> None:
        self.asked.append("kill")

    def poll(self, seconds: float = 0.0) -> bool:
        return bool(self._messages)

    def recv(self) -> object:
        message = self._messages.pop(0)
        if isinstance(message, Exception):
            raise message
        return message

    def send(self, message: object) -> None:
        self.asked.append(message)

    def close(self) -> None:
        self.asked.append("close")


def body_of(end: Ended) -> BodyProcess:
    body = BodyProcess.__new__(BodyProcess)
    body.report, body.ready, body.finished = {}, False, False
    body._in_time = lambda: True
    body._pipe = body._process = cast(Any, end)
    body.mailboxes = body._panel_mailboxes = [cast(Any, end)]
    return body


@pytest.mark.parametrize(
    ("alive", "asked"),
    [
        (0, [("join", 30.0)]),
        (1, [("join", 30.0), "terminate", ("join", 5.0)]),
        (2, [("join", 30.0), "terminate", ("join", 5.0), "kill", ("join", None)]),
    ],
)
def test_a_process_that_does_not_end_is_made_to(alive: int, asked: list[object]) -> None:
    end = Ended(alive)
    body_of(end)._end_process()
    assert end.asked == asked


def test_the_first_error_is_the_one_that_is_told() -> None:
    end = Ended(1, messages.Failed("of the body", "hint"))
    with pytest.raises(RuntimeError, match="mine"), body_of(end):
        raise RuntimeError("mine")
    assert end.asked[0] == messages.Stop() and end.asked[-3:] == ["close"] * 3
    end = Ended(1, messages.Failed("of the body", "a hint"))
    with pytest.raises(ControllerError, match="of the body") as caught, body_of(end) as body:
        pass
    assert caught.value.hint == "a hint" and body.report == {"failed": "of the body"}
    assert end.asked[-3:] == ["close"] * 3


def test_messages_that_come_too_late_or_out_of_order_are_errors() -> None:
    with pytest.raises(ControllerError, match=r"the body did not answer within 60 s"):
        body_of(Ended()).wait_ready()
    with pytest.raises(ControllerError, match=r"the body sent Finished\(\) before it was ready"):
        body_of(Ended(1, messages.Finished())).wait_ready()
    for error in (EOFError(), OSError()):
        end = Ended(1, error)
        with pytest.raises(ControllerError, match=r"the body process ended unexpectedly \(exit code 3\)"):
            body_of(end).alive()
        assert end.asked == [("join", 1.0)]
    body = body_of(Ended(1, messages.Ready(), messages.Finished(), messages.Report({"a": 1})))
    assert body.wait_ready() == messages.Ready()
    assert not body.alive() and body.report == {"a": 1}
    gone = Ended(0)
    body_of(gone).stop()
    assert gone.asked == []  # nobody is there to be asked
    last = Ended(0, messages.Report({"b": 2}))
    body = body_of(last)
    body.stop()
    assert body.report == {"b": 2} and last.asked == [messages.Stop(), ("join", 30.0)]


def test_who_does_not_wait_for_the_servos_sees_when_they_are_started_or_that_they_never_are() -> None:
    body = body_of(Ended(1))
    assert body.alive() and not body.ready
    body = body_of(Ended(1, messages.Ready()))
    assert body.alive() and body.ready
    late = body_of(Ended(1))
    late._in_time = lambda: False
    with pytest.raises(ControllerError, match=r"the body did not answer within 60 s"):
        late.alive()
    late.ready = True  # then there is nothing to wait for
    assert late.alive()
    assert body_of(Ended(1, messages.Ready())).wait_ready() == messages.Ready()
    body = body_of(Ended(1, messages.Failed("servo 7 does not answer", "a hint")))
    with pytest.raises(ControllerError, match="servo 7 does not answer"):
        body.alive()


def test_a_deadline_counts_from_the_first_question(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("controller.body.process.time", SimpleNamespace(monotonic=lambda: now[0]))
    in_time = deadline(2.0)
    now[0] = 500.0
    assert in_time()
    now[0] = 501.5
    assert in_time()
    now[0] = 502.0
    assert not in_time()
    assert deadline(None)() and not deadline(0.0)()


def test_a_body_that_a_signal_ended_has_left_its_report() -> None:
    class Gone(Ended):
        def send(self, message: object) -> None:
            raise BrokenPipeError

    body = body_of(Gone(1, messages.Ready(), messages.Report({"a": 1})))
    body.stop()
    assert body.report == {"a": 1}
    with pytest.raises(ControllerError, match="ended unexpectedly"):
        body_of(Gone(1, EOFError())).stop()


def with_links(folder: Path, *kinds: str) -> Stage:
    """A stage without servos whose links listen at standard input, each with a layer of its own."""
    text = "".join(
        f'[layers.in_{kind}]\npriority = {55 + n}\n[[links]]\nkind = "{kind}"\nlisten = "-"\nlayer = "in_{kind}"\n'
        for n, kind in enumerate(kinds)
    )
    (folder / "stage.toml").write_text(text)
    return load_stage(str(folder / "stage.toml"), PARAMETERS)


def test_lines_at_standard_input_move_the_face(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    with os.fdopen(read) as stdin, os.fdopen(write, "w") as there:
        monkeypatch.setattr(sys, "stdin", stdin)
        with BodyProcess(with_links(tmp_path, "json"), PARAMETERS) as body:
            body.wait_ready()
            body.begin()
            print('{"jawOpen": 0.6}', file=there, flush=True)
            assert until(lambda: body.alive() and newest(body, "jawOpen") > 0.55)
            there.close()
    (link,) = cast(list[dict[str, Any]], body.report["links"])
    assert link["accepted"] == 1


def test_only_one_link_can_have_standard_input(tmp_path: Path) -> None:
    with PreloadedBody() as waiting, pytest.raises(ConfigError, match="only one voice or link"):
        BodyProcess(with_links(tmp_path, "json", "csv"), PARAMETERS, preloaded=waiting)
