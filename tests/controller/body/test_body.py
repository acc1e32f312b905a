"""controller.body.body in this process: what plays, what is published, and what its process answers."""

from __future__ import annotations

import logging
import multiprocessing
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from controller.base.errors import ConfigError, LinkError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body import messages
from controller.body.body import Body
from controller.body.main import _handle, _wait
from controller.body.messages import RunOptions
from controller.body.panel_state import PanelState
from controller.body.sources import Voice, show_part
from controller.stage.stage import Stage, load_stage
from controller.takes.recording import replay

JAW = P.index("jawOpen")
TAKE = "0.0\taa\n0.2\tsil\n"


def until(condition: Callable[[], object]) -> None:
    for _ in range(2000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("waited in vain")


def stage_of(tmp_path: Path, text: str = "") -> Stage:
    path = tmp_path / "stage.toml"
    path.write_text(f'name = "mine"\n{text}')
    return load_stage(str(path), P)


@contextmanager
def running(stage: Stage, options: RunOptions = RunOptions()) -> Iterator[tuple[Body, Mailbox]]:
    with Mailbox.create(len(P)) as mailbox:
        body = Body(stage, P, mailbox, options)
        body.start()
        try:
            yield body, mailbox
        finally:
            body.stop()


def published(mailbox: Mailbox) -> np.ndarray:
    values = np.zeros(len(P))
    mailbox.read(values)
    return values


def test_commands_are_published_with_the_time_they_came(tmp_path: Path) -> None:
    with running(stage_of(tmp_path, "control_hz = 200")) as (body, mailbox):
        stamp = time.monotonic_ns()
        body.state.set_parameters([JAW], [1.0], stamp)
        until(lambda: published(mailbox)[JAW] > 0.99)
        assert body.newest()[0][JAW] > 0.99
        assert body.newest()[1] == stamp
        report = body.report()
        assert report["control"]["wanted_hz"] == pytest.approx(200.0)  # type: ignore[index]
        assert (report["take"], report["voice"], report["links"], report["buses"]) == (None, None, [], [])
        assert body.live and not body.finished and body.measured_face is None
        body.check()


def test_a_take_waits_for_the_face_and_ends_the_run(tmp_path: Path) -> None:
    (tmp_path / "a.tsv").write_text(TAKE)
    with running(stage_of(tmp_path), RunOptions(tmp_path / "a.tsv")) as (body, _):
        until(lambda: body.clock.ticks > 10)
        assert body.newest()[0][JAW] < 0.01 and not body.live
        body.begin()
        until(lambda: body.newest()[0][JAW] > 0.05)
        until(lambda: body.finished)
        assert body.report()["take"]["played_s"] > 0.0  # type: ignore[index]


def test_a_run_is_recorded_and_its_recording_played_again(tmp_path: Path) -> None:
    stage, file = stage_of(tmp_path), tmp_path / "a.rec"
    with running(stage, RunOptions(record=file)) as (body, _):
        body.begin()
        body.state.set_parameters([JAW], [0.5], time.monotonic_ns())
        until(lambda: body.newest()[0][JAW] > 0.49)
    assert max(values[JAW] for _, values in replay(file, P)) > 0.49
    with running(stage, RunOptions(file)) as (body, _):
        until(lambda: body.clock.ticks > 5)
        assert body.newest()[0][JAW] == 0.0 and not body.finished
        body.begin()
        until(lambda: body.newest()[0][JAW] > 0.49)
        until(lambda: body.finished)
        assert body.report()["take"] is None


def test_a_voice_of_the_command_line_goes_before_that_of_the_stage(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(b"\0" * 4000)
    stage = stage_of(tmp_path, 'voice = "a.raw"\nvoice_hz = 8000\n')
    with Mailbox.create(len(P)) as mailbox:
        own = Body(stage, P, mailbox).sources._voice
        other = Body(stage, P, mailbox, RunOptions(voice=Voice("b.raw"))).sources._voice
    assert own == Voice(str(tmp_path / "a.raw"), 8000) and other == Voice("b.raw")


def test_a_link_that_does_not_come_up_is_raised_where_there_is_nothing_else(tmp_path: Path) -> None:
    with (
        running(stage_of(tmp_path, '[[links]]\nport = "/dev/none"\n')) as (body, _),
        pytest.raises(Exception) as caught,
    ):
        body.begin()
    assert "/dev/none" in str(caught.value)


def test_a_stage_chooses_how_the_face_behaves(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, 'liveliness = 0.5\nmanner = "listen"\n')
    with Mailbox.create(len(P)) as mailbox:
        state = Body(stage, P, mailbox).state
    state.tick(10**9, 0.01, P.neutral())
    assert (state.status()["life"], state.status()["manner"]) == (0.5, "listen")


def test_a_stage_mirrors_its_servos_and_leaves_simulated_links_out(tmp_path: Path) -> None:
    stage = stage_of(
        tmp_path, 'robots = ["head24"]\nliveliness = 1.0\n[[links]]\nport = "simulated"\nscript = "tour"\n'
    )
    with Mailbox.create(len(P)) as mailbox:
        plain, mirror = Body(stage, P, mailbox), Body(stage, P, mailbox, RunOptions(mirror=True))
    assert not plain.follows_servos and mirror.follows_servos
    assert plain.state.servo_monitor is plain.measured_face is not None
    assert [loop.limp for loop in (*plain.buses, *mirror.buses)] == [False, True]


@pytest.fixture
def pipe() -> Iterator[tuple[Connection, Connection]]:
    ours, theirs = multiprocessing.Pipe()
    yield ours, theirs
    ours.close()
    theirs.close()


@pytest.mark.slow
def test_requests_of_the_panel_reach_the_layers(tmp_path: Path, pipe: tuple[Connection, Connection]) -> None:
    main, end = pipe
    with running(stage_of(tmp_path)) as (body, _):

        def ask(request: object) -> bool:
            main.send(request)
            return _handle(body, end)

        assert ask(messages.Hold(JAW, 0.5))
        until(lambda: body.state.holder(JAW) == "manual")
        assert ask(messages.Hold(JAW, None))
        until(lambda: body.state.holder(JAW) != "manual")
        assert ask(messages.Show("happiness", 1.0))
        until(lambda: body.newest()[0][P.index("mouthSmileLeft")] > 0.3)
        assert ask(messages.Neutral(0.05))
        until(lambda: body.newest()[0][P.index("mouthSmileLeft")] < 0.01)
        assert ask(messages.Begin()) and body._begun.is_set()
        latch = body.state.stop_latch
        assert ask(messages.StopServos()) and latch.stopped is not None and latch.stopped.who == "panel"
        assert ask(messages.StartServos()) and latch.stopped is None
        assert not ask(messages.Stop())
        main.close()
        assert not _handle(body, end)  # main is gone


def test_a_servo_turned_in_the_panel_leaves_the_face_alone_keeps_its_limits_and_is_given_back(
    tmp_path: Path, pipe: tuple[Connection, Connection]
) -> None:
    ours, theirs = pipe
    with running(stage_of(tmp_path, 'robots = ["head24"]\n')) as (body, mailbox):
        (loop,) = body.buses
        name, other = loop.table.names[:2]
        rest, still = np.degrees(loop.goals_rad)[:2]
        high = float(np.degrees(loop.table.high_rad[0]))

        def ask(request: object) -> None:
            ours.send(request)
            assert _handle(body, theirs)

        def measured() -> np.ndarray:
            state = loop.measured()
            assert state is not None
            return np.degrees(state.position_rad)

        ask(messages.Begin())
        ask(messages.Jog("head", name, 999.0))
        until(lambda: abs(measured()[0] - high) < 1.0)
        assert abs(measured()[1] - still) < 0.5 and abs(high - rest) > 2.0
        assert not published(mailbox).any()
        ask(messages.Jog("head", name, None))
        until(lambda: abs(measured()[0] - rest) < 1.0)
        ask(messages.Jog("head", other, 999.0))
        until(lambda: abs(measured()[1] - still) > 2.0)
        ask(messages.Neutral(0.1))
        until(lambda: abs(measured()[1] - still) < 1.0)
        ask(messages.Jog("head", "nobody", 1.0))
        ask(messages.Jog("elsewhere", name, 1.0))


def test_the_panel_is_told_of_servos_links_and_warnings_and_plays_a_take(
    tmp_path: Path, pipe: tuple[Connection, Connection]
) -> None:
    main, end = pipe
    (tmp_path / "a.tsv").write_text(TAKE)
    stage = stage_of(tmp_path, 'robots = ["head24"]\n[[links]]\nport = "simulated"\nscript = "tour"\n')
    with running(stage) as (body, _):
        logging.getLogger().addHandler(body.notes)

        def ask() -> messages.Details:
            main.send(messages.AskDetails())
            assert _handle(body, end) and main.poll(10.0)
            answer = main.recv()
            assert isinstance(answer, messages.Details)
            return answer

        body.begin()
        until(lambda: ask().servos[0].get("measured_deg") is not None)
        found = ask()
        assert len(found.servos) == 24 and found.servos[0]["low_deg"] < found.servos[0]["high_deg"]
        assert found.links[0]["name"].startswith("line") and found.links[0]["error"] == ""
        assert found.buses == [{"name": "head", "running": True, "fault": ""}] and found.notes == []
        main.send(messages.PlayTake(tmp_path / "none.tsv"))
        assert _handle(body, end)
        assert any("none.tsv" in note for note in ask().notes) and ask().notes == []
        main.send(messages.PlayTake(tmp_path / "a.tsv"))
        assert _handle(body, end)
        until(lambda: body.newest()[0][JAW] > 0.1)
        until(lambda: body.sources._player is not None and body.sources._player.finished)
        assert not body.finished
        logging.getLogger().removeHandler(body.notes)


def test_main_hears_once_that_nothing_is_left_and_sees_the_panel_state(
    tmp_path: Path, pipe: tuple[Connection, Connection]
) -> None:
    main, end = pipe
    (tmp_path / "a.tsv").write_text(TAKE)
    stop = threading.Event()
    with (
        running(stage_of(tmp_path), RunOptions(tmp_path / "a.tsv")) as (body, _),
        Mailbox.create(PanelState.size(P)) as box,
    ):
        body.begin()
        writer = PanelState(box, body.state.layer_names(), P)
        thread = threading.Thread(target=_wait, args=(body, end, stop, writer))
        thread.start()
        try:
            assert main.poll(30.0) and main.recv() == messages.Finished()
            sequence = box.sequence
            until(lambda: box.sequence > sequence + 2)
            assert not main.poll()
        finally:
            stop.set()
            thread.join(30.0)
        assert not thread.is_alive()


def test_an_error_of_a_loop_ends_the_wait(tmp_path: Path, pipe: tuple[Connection, Connection]) -> None:
    with running(stage_of(tmp_path)) as (body, _):
        body._error = LinkError("mine")
        with pytest.raises(LinkError, match="mine"):
            _wait(body, pipe[1], threading.Event(), None)


def test_a_robot_gets_shows_by_name_and_the_stage_by_path(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    for name in ("act.toml", "sub/act.toml"):
        (tmp_path / name).write_text('steps = ["0 PING"]\n')
    with running(stage_of(tmp_path, 'show = "sub/act.toml"\n')) as (body, _):
        shows = body.state.shows
        assert shows is not None and shows.status().startswith("act@")
        shows.start("act")
        for path in ("sub/act.toml", str(tmp_path / "act.toml"), "/etc/passwd"):
            with pytest.raises(ConfigError, match="no script"):
                shows.start(path)


def test_the_show_of_a_stage_begins_with_the_run(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('steps = ["0 SET jawOpen 1"]')
    with running(stage_of(tmp_path, 'show = "act.toml"\n')) as (body, _):
        until(lambda: body.clock.ticks > 10)
        assert body.newest()[0][JAW] < 0.01
        body.begin()
        until(lambda: body.newest()[0][JAW] > 0.9)


class Main:
    """The end of a pipe that never asks for anything, and the state of a panel that ends the wait after some rounds."""

    def __init__(self, rounds: int) -> None:
        self.sent: list[object] = []
        self.waits: list[float] = []
        self.published: list[object] = []
        self.stop = threading.Event()
        self._rounds = rounds

    def poll(self, seconds: float) -> bool:
        self.waits.append(seconds)
        return False

    def send(self, message: object) -> None:
        self.sent.append(message)

    def publish(self, state: object, face: object) -> None:
        self.published.append((state, face))
        if len(self.published) == self._rounds:
            self.stop.set()


@pytest.mark.parametrize(("finished", "sent"), [(True, [messages.Finished()]), (False, [])])
def test_main_is_told_exactly_once_and_only_when_all_was_played(finished: bool, sent: list[object]) -> None:
    main, checks = Main(5), list[int]()
    body: Any = SimpleNamespace(finished=finished, check=lambda: checks.append(1))
    body.publish = lambda panel_state: panel_state.publish("s", "m")
    _wait(body, cast(Any, main), main.stop, cast(Any, main))
    assert main.sent == sent and main.waits == [0.1] * 5  # ten times a second
    assert main.published == [("s", "m")] * 5 and len(checks) == 5


def test_a_message_that_is_no_request_ends_the_wait(pipe: tuple[Connection, Connection]) -> None:
    main, end = pipe
    main.send(messages.Hold(JAW, 1))  # a whole number is no value of a parameter
    body: Any = SimpleNamespace(state=None)
    assert not _handle(body, end)


def test_servos_follow_after_the_links_are_open_and_a_take_needs_no_links(tmp_path: Path) -> None:
    text = '[[links]]\nport = "simulated"\nscript = "tour"\n'
    stage = stage_of(tmp_path, text)
    with running(stage) as (body, _):
        assert body.links == []
        body.begin()
        assert len(body.links) == len(stage.settings.links) == 1
    (tmp_path / "a.tsv").write_text(TAKE)
    with running(stage, RunOptions(tmp_path / "a.tsv")) as (body, _):
        body.begin()
        assert body.links == [] and not body.live


@pytest.mark.parametrize(("mirror", "ports"), [(False, ["simulated", "/dev/x"]), (True, ["/dev/x"])])
def test_a_limp_head_listens_to_links_that_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mirror: bool, ports: list[str]
) -> None:
    opened: list[Any] = []
    monkeypatch.setattr("controller.body.link_part.open_links", lambda links, context: opened.extend(links) or [None])
    links = '[[links]]\nport = "simulated"\nscript = "tour"\n[[links]]\nport = "/dev/x"\n'
    stage = stage_of(tmp_path, f'robots = ["head24"]\n{links}')
    with Mailbox.create(len(P)) as mailbox:
        body = Body(stage, P, mailbox, RunOptions(mirror=mirror))
        body.buses.clear()
        body.begin()
        body.stop()
    assert [stage.settings.links.index(link) for link in opened] == [0, 1][2 - len(ports) :]


def test_requests_are_served_until_one_says_stop(tmp_path: Path, pipe: tuple[Connection, Connection]) -> None:
    main, end = pipe
    held: list[object] = []
    state = SimpleNamespace(
        set_parameters=lambda *given: held.append(given[:2]), release=lambda *given: held.append(given[:1])
    )
    body: Any = SimpleNamespace(state=state, finished=False, check=lambda: None)
    for message in (messages.Hold(JAW, 0.5), messages.Hold(JAW, None), messages.Stop(), messages.Hold(JAW, 0.7)):
        main.send(message)
    _wait(body, end, threading.Event(), None)
    assert held == [([JAW], [0.5]), ([JAW],)]


class FedBus:
    """A bus that only keeps what it is fed."""

    error = None

    def __init__(self) -> None:
        self.fed: list[tuple[float, bool]] = []

    def start(self) -> None:
        pass

    stop = begin = start

    def feed(self, step_s: float, *, urgent: bool) -> None:
        self.fed.append((step_s, urgent))


def test_every_tick_feeds_the_buses_and_a_command_brings_it_forward(tmp_path: Path) -> None:
    with Mailbox.create(len(P)) as mailbox:
        body = Body(stage_of(tmp_path, "control_hz = 10"), P, mailbox)
        bus = FedBus()
        body.buses.append(cast(Any, bus))
        body.start()
        try:
            until(lambda: len(bus.fed) > 1)
            assert bus.fed[0] == (pytest.approx(0.1), False)
            for _ in range(3):
                body.state.set_parameters([JAW], [1.0], time.monotonic_ns())
                count = sum(urgent for _, urgent in bus.fed)
                until(lambda count=count: sum(urgent for _, urgent in bus.fed) > count)
            until(lambda: not bus.fed[-1][1])
        finally:
            body.buses.remove(cast(Any, bus))
            body.stop()
    early = [step for step, urgent in bus.fed if urgent]
    assert min(early) >= 0.05 and min(early) < 0.099, "half a period lies between two ticks at least"


def test_layers_that_rested_go_on_with_the_time_that_passed(tmp_path: Path) -> None:
    with Mailbox.create(len(P)) as mailbox:
        body = Body(stage_of(tmp_path, ""), P, mailbox)
        steps: list[float] = []
        body.state.tick = lambda now_ns, dt, out: steps.append(dt) or 0  # type: ignore[func-returns-value, method-assign]
        for rests in (False, True, True, False, *[True] * 30, False, False):
            body.rests = lambda rests=rests: rests  # type: ignore[misc]
            body.tick(0, 0.01)
    assert steps == pytest.approx([0.01, 0.03, 0.1, 0.01])


def ticks_on(body: Body) -> bool:
    """Whether the control loop goes on."""
    ticks = body.clock.ticks
    until(lambda: body.clock.ticks > ticks + 20)
    body.check()
    return True


def test_a_full_disk_ends_the_recording_and_nothing_else(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with running(stage_of(tmp_path), RunOptions(record=Path("/dev/full"))) as (body, _):
        body.begin()
        until(lambda: body.state.parts.failed)
        assert ticks_on(body)
        (said,) = (message for message in caplog.messages if message.startswith("recording"))
        assert said.startswith("recording /dev/full failed: /dev/full: No space left on device; the earlier ticks")
        (part,) = body.report()["parts"]  # type: ignore[misc]
        assert part["part"] == "recording /dev/full" and part["state"] == "failed"  # type: ignore[index]


def test_a_link_that_does_not_come_up_leaves_the_show_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "act.toml").write_text('loop_s = 1\nsteps = ["0 SET jawOpen 1"]')
    stage = stage_of(tmp_path, 'show = "act.toml"\n[[links]]\nport = "/dev/none"\n')
    with running(stage) as (body, _):
        body.begin()
        until(lambda: body.newest()[0][JAW] > 0.9)
        assert ticks_on(body)
        assert sum("link line on /dev/none failed: " in message for message in caplog.messages) == 1
        assert body.report()["links"][0]["port"] == "line on /dev/none"  # type: ignore[index]
        assert body.state.parts.failed == ("link line on /dev/none",)
        assert not any("NOTHING IS LEFT" in message for message in caplog.messages)
        assert body.state.shows is not None
        body.state.shows.control("STOP")
        body.check()
        body.check()
        assert sum("NOTHING IS LEFT TO FOLLOW" in message for message in caplog.messages) == 1


def test_a_voice_that_fails_leaves_the_run_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "a.wav").write_bytes(b"no sound")
    with running(stage_of(tmp_path, 'voice = "a.wav"\n')) as (body, _):
        body.begin()
        until(lambda: body.sources.voice_ended)
        assert ticks_on(body) and body.sources.error is None
        assert sum("not WAV of PCM" in message for message in caplog.messages) == 1
        assert sum("NOTHING IS LEFT TO FOLLOW" in message for message in caplog.messages) == 1


def test_a_panel_state_that_fails_leaves_the_run_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def publish(state: object, face: object) -> None:
        raise ValueError("no panel")

    panel: Any = SimpleNamespace(publish=publish)
    with running(stage_of(tmp_path)) as (body, _):
        body.publish(panel)
        body.publish(panel)
        assert ticks_on(body) and len(caplog.messages) == 1 and caplog.messages[0].startswith("panel state failed: ")


def test_a_recording_that_cannot_be_played_on_ends_the_run(tmp_path: Path) -> None:
    stage, file = stage_of(tmp_path), tmp_path / "a.rec"
    with running(stage, RunOptions(record=file)) as (body, _):
        until(lambda: body.clock.ticks > 60)
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:40], "damaged"]) + "\n")
    with running(stage, RunOptions(file)) as (body, _):
        body.begin()
        until(lambda: body.sources.error is not None)
        ticks = body.clock.ticks
        until(lambda: body.clock.ticks > ticks + 20)  # the servos still get a face to be led to rest from
        with pytest.raises(Exception, match=r"a\.rec, line 41: damaged"):
            body.check()


def test_a_show_that_failed_too_often_is_refused(tmp_path: Path) -> None:
    (tmp_path / "act.toml").write_text('steps = ["0 SET jawOpen 1"]')
    with running(stage_of(tmp_path)) as (body, _):
        shows = body.state.shows
        assert shows is not None
        shows.start("act")
        part = body.state.parts.add(show_part("act"))
        for _ in range(6):
            part.fail(ValueError("no"), time.monotonic())
        with pytest.raises(ConfigError, match="show act failed too often and is switched off: ValueError: no"):
            shows.start("act")


@pytest.mark.parametrize("request_", [messages.PlayTake(Path("a.plugin")), messages.AskDetails()])
def test_an_error_in_a_request_of_the_panel_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, request_: object
) -> None:
    """Readers of takes come from other packages, too, and may raise anything."""

    def fails(*_: object) -> None:
        raise ZeroDivisionError("of another package")

    monkeypatch.setattr("controller.body.body.load_take", fails)
    ours, theirs = multiprocessing.Pipe()
    with running(stage_of(tmp_path)) as (body, _):
        monkeypatch.setattr(body.state, "overview", fails)
        ours.send(request_)
        assert _handle(body, theirs) is True
        assert f"panel: {type(request_).__name__} failed: ZeroDivisionError: of another package" in caplog.text
        if isinstance(request_, messages.AskDetails):
            assert ours.poll(5.0) and ours.recv() == messages.Details()
        ours.send(messages.Stop())
        assert _handle(body, theirs) is False


def test_a_lively_face_breathes_and_another_does_not(tmp_path: Path) -> None:
    for liveliness, breathes in ((1.0, True), (0.0, False)):
        stage, seen, values = stage_of(tmp_path, f"liveliness = {liveliness}\n"), set(), P.neutral()
        with Mailbox.create(len(P)) as mailbox:
            body = Body(stage, P, mailbox)
            for k in range(300):
                body.tick(10**9 + k * 10**7, 0.01)
                mailbox.read(values)
                seen.add(mailbox.life)
        assert (max(rise for rise, _ in seen) > 2.5) == breathes and (len(seen) > 100) == breathes
