"""What a session plays, refuses and leaves behind."""

from __future__ import annotations

import gc
import json
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ControllerError, TakeError
from controller.body.messages import RunOptions
from controller.body.sources import Voice
from controller.cli.app import make_app
from controller.panels.session.next_run import NextRun
from controller.tools import stage_run as module
from controller.tools.stage_run import REPORT_FORMAT, StageRun, has_display, write_report


def test_a_report_states_the_version_of_its_keys_first(tmp_path: Path) -> None:
    report = {"stage": "demo", "written": []}
    write_report(report, tmp_path / "r.json")
    found = json.loads((tmp_path / "r.json").read_text())
    assert found == {"format": REPORT_FORMAT, **report} and next(iter(found)) == "format"
    assert report == {"stage": "demo", "written": []}
    assert found["format"] == 1
    assert (tmp_path / "r.json").read_text() == '{\n  "format": 1,\n  "stage": "demo",\n  "written": []\n}\n'


@pytest.mark.parametrize(
    ("platform", "names", "there"),
    [
        ("linux", (), False),
        ("linux", ("DISPLAY",), True),
        ("linux", ("WAYLAND_DISPLAY",), True),
        ("darwin", (), True),
        ("win32", (), True),
    ],
)
def test_linux_alone_may_have_no_display(
    monkeypatch: pytest.MonkeyPatch, platform: str, names: tuple[str, ...], there: bool
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for name in names:
        monkeypatch.setenv(name, ":1")
    monkeypatch.setattr(sys, "platform", platform)
    assert has_display() is there


@pytest.fixture
def stage(tmp_path: Path) -> str:
    """A stage without robots and links, with a small picture."""
    (tmp_path / "a.tsv").write_text("0.0\taa\n0.2\tsil\n")
    text = 'name = "mine"\nidentity = { broad = 0.25 }\n[face]\nsize = [64, 48]\nquality = "fast"\n'
    (tmp_path / "stage.toml").write_text(text)
    return str(tmp_path / "stage.toml")


def test_options_replace_what_the_stage_says(stage: str) -> None:
    plain = StageRun(stage).stage.settings
    assert (plain.identity, plain.face.size, plain.face.theme) == ({"broad": 0.25}, (64, 48), "skin")
    other = StageRun(stage, identity={"broad": 0.5}, look={"theme": "mask", "quality": None}).stage.settings
    assert (other.identity, other.face.theme, other.face.quality) == ({"broad": 0.5}, "mask", "fast")
    assert StageRun(stage, identity={}).stage.settings.identity == {"broad": 0.25}


def test_what_cannot_be_played_is_refused_before_anything_starts(stage: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'nobody'"):
        StageRun(stage, identity={"nobody": 0.5})
    with pytest.raises(ConfigError, match=r"stage\.toml: robots: a stage without a robot has nothing to mirror"):
        StageRun(stage, RunOptions(mirror=True))
    assert StageRun("everything", RunOptions(mirror=True)).stage.robots
    with pytest.raises(TakeError, match=r"none\.tsv"):
        StageRun(stage, RunOptions(tmp_path / "none.tsv"))
    (tmp_path / "bad.rec").write_text("no recording")
    for name in ("none.rec", "bad.rec"):
        with pytest.raises(ControllerError, match=name):
            StageRun(stage, RunOptions(tmp_path / name))
    StageRun(stage, RunOptions(tmp_path / "a.tsv"))


class FakeBody:
    """The body's process, without a process: it has something to play for as many questions as ``lives``."""

    def __init__(self, told: list[str], lives: int) -> None:
        self.told, self.lives, self.report = told, lives, {"control": {"ticks": 3}}
        self.flag, self.ready, self.ready_at = threading.Event(), False, 0

    def __call__(self, stage: Any, parameters: Any, options: RunOptions, *, preloaded: object) -> FakeBody:
        self.options, self.preloaded = options, preloaded
        return self

    def __enter__(self) -> FakeBody:
        return self

    def __exit__(self, *_: object) -> None:
        self.told.append("left")

    def wait_ready(self) -> None:
        self.ready = True
        self.told.append("ready")

    def begin(self) -> None:
        self.told.append("begin")

    def alive(self) -> bool:
        self.lives -= 1
        self.ready = self.ready or self.lives < self.ready_at
        return self.lives >= 0

    def stop(self) -> None:
        self.told.append("stop")


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """What was done, in order; waits are told instead of waited."""
    found: list[str] = []
    monkeypatch.setattr(
        module,
        "time",
        SimpleNamespace(sleep=lambda seconds: found.append(f"sleep {seconds}"), monotonic=time.monotonic),
    )
    yield found
    gc.unfreeze()


@pytest.mark.parametrize(("robots", "ends"), [("", "stopping"), ('robots = ["head24"]', "bringing the servos to rest")])
def test_a_run_without_a_face_goes_on_while_the_body_plays(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch, robots: str, ends: str
) -> None:
    Path(stage).write_text(f"{robots}\n{Path(stage).read_text()}")
    body = FakeBody(told, 2)
    monkeypatch.setattr(module, "BodyProcess", body)
    preloaded: Any = object()
    gc.disable()
    report = StageRun(stage, RunOptions(), status=told.append, preloaded=preloaded).run_without_face(60.0)
    assert told == [
        "starting", "ready", "begin", "running for 60 s", "sleep 0.05", "sleep 0.05", ends,
        "stop", "left",
    ]  # fmt: skip
    assert gc.isenabled()
    assert gc.get_freeze_count() > 0
    assert body.preloaded is preloaded
    assert report == {"stage": "mine", "face": None, "control": {"ticks": 3}, "written": []}


def test_what_was_measured_is_kept_where_the_run_ends_with_an_error(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Failing(FakeBody):
        def stop(self) -> None:
            self.report = {"control": {"ticks": 3}, "failed": "servo 7 is on"}
            raise ControllerError("servo 7 is on")

    monkeypatch.setattr(module, "BodyProcess", Failing(told, 1))
    words = ["run", stage, "--no-face", "--report", str(tmp_path / "r.json")]
    assert isinstance(CliRunner().invoke(make_app(), words).exception, ControllerError)
    kept = json.loads((tmp_path / "r.json").read_text())
    assert kept == {"format": 1, "stage": "mine", "control": {"ticks": 3}, "failed": "servo 7 is on"}


def test_a_limp_head_is_not_brought_to_rest(told: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BodyProcess", FakeBody(told, 1))
    StageRun("everything", RunOptions(mirror=True), status=told.append).run_without_face(None)
    assert told == ["starting", "ready", "begin", "running", "sleep 0.05", "stopping", "stop", "left"]


def test_a_run_ends_when_its_time_is_over_or_it_is_interrupted(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "BodyProcess", FakeBody(told, 10**9))
    began = time.monotonic()
    StageRun(stage).run_without_face(0.05)
    assert time.monotonic() - began >= 0.05
    assert "sleep 0.05" in told

    class Flag:
        def __enter__(self) -> threading.Event:
            flag = threading.Event()
            flag.set()
            return flag

        def __exit__(self, *_: object) -> None:
            pass

    told.clear()
    monkeypatch.setattr(module, "stop_flag", Flag)
    StageRun(stage).run_without_face(None)
    assert told == ["ready", "begin", "stop", "left"]


def test_a_window_is_given_the_head_and_what_the_body_shows(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import controller.panels.window.face as window

    given: list[Any] = []

    class Window:
        next_run = NextRun(Path("next.toml"))

        def __init__(self, *words: Any, **more: Any) -> None:
            given.extend([*words, more])

        def run(self, keep_going: Any) -> None:
            while keep_going():
                told.append("frame")

        def report(self) -> dict[str, object]:
            return {"frames": 2}

    body: Any = FakeBody(told, 3)
    body.details, body.ready_at = object(), 2
    body.send, body.panel_state, body.mailbox = object(), object(), object()
    monkeypatch.setattr(module, "BodyProcess", body)
    monkeypatch.setattr(module, "HeadValues", lambda mailbox, parameters, names: (mailbox, len(names)))
    monkeypatch.setattr(module, "lower_process_priority", lambda: told.append("lower"))
    monkeypatch.setattr(window, "WindowFace", Window)
    session = StageRun(stage, status=told.append)
    report = session.run_window(None)
    head, settings, values, send, panel_state, copy, options, controls, more = given
    assert more["stage"] is session.stage and more["details"]() is body.details
    assert session.next_run == NextRun(Path("next.toml"))
    assert controls == session.stage.controls
    assert options.vocabulary is session.stage.vocabulary and "tour" in options.shows
    assert settings is session.stage.settings.face and (send, panel_state) == (body.send, body.panel_state)
    assert values == (body.mailbox, len(head.parameters)) and copy == session.stage.load_head
    assert report["face"] == {"frames": 2}
    # servos start while the head loads and the first frames are drawn
    assert told == ["starting", "lower", "begin", "frame", "running", "frame", "frame", "stopping", "stop", "left"]


def test_seconds_of_a_window_count_once_the_servos_are_started(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    body: Any = FakeBody(told, 10**9)
    now = [100.0]
    monkeypatch.setattr("controller.body.process.time", SimpleNamespace(monotonic=lambda: now[0]))
    run = StageRun(stage)
    keep_going = run._begin(body, threading.Event(), 2.0, wait=False)
    now[0] = 150.0
    assert keep_going(), "servos may take long"
    body.ready = True
    assert keep_going()
    now[0] = 151.9
    assert keep_going()
    now[0] = 152.0
    assert not keep_going()


def test_a_service_manager_hears_of_the_servos_once_they_are_started(
    stage: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run, body = StageRun(stage), cast(Any, FakeBody(told, 10**9))
    body.mailbox = SimpleNamespace(sequence=7)
    heard: list[object] = []
    run._manager = cast(
        Any,
        SimpleNamespace(watches=True, ready=lambda: heard.append("ready"), alive=lambda number: heard.append(number)),
    )
    keep_going = run._begin(body, threading.Event(), None, wait=False)
    assert keep_going() and heard == []
    body.ready = True
    assert keep_going() and keep_going() and heard == ["ready", 7, 7]
    heard.clear()
    run._begin(body, threading.Event(), None)
    assert heard == ["ready"], "who waits for them says so at once"


def test_pictures_are_kept_only_where_a_folder_is_given(
    stage: str, told: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorders: list[Any] = []

    class Headless:
        def __init__(self, head: Any, settings: Any, values: Any, recorder: Any) -> None:
            recorders.append(recorder)

        def run(self, keep_going: Any) -> None:
            while keep_going():
                told.append("frame")

        def report(self) -> dict[str, object]:
            return {"frames": 3}

        def close(self) -> None:
            told.append("closed")

    class Recorder:
        def write(self, folder: Path) -> list[str]:
            told.append(f"write {folder.name}")
            return ["a.png"]

    body: Any = FakeBody(told, 3)
    body.mailbox = None
    monkeypatch.setattr(module, "BodyProcess", body)
    monkeypatch.setattr(module, "HeadValues", lambda *_: None)
    monkeypatch.setattr(module, "lower_process_priority", lambda: None)
    monkeypatch.setattr(module, "HeadlessFace", Headless)
    monkeypatch.setattr(module, "Recorder", Recorder)
    report = StageRun(stage, status=told.append).run_headless(None, tmp_path)
    assert (report["face"], report["written"]) == ({"frames": 3}, ["a.png"])
    assert told[-3:] == ["left", "writing the pictures", f"write {tmp_path.name}"]
    assert told.count("frame") == 3 and told.index("stop") > told.index("closed") > told.index("frame")
    body.lives = 1
    report = StageRun(stage).run_headless(None)
    assert report["written"] == [] and isinstance(recorders[0], Recorder) and recorders[1] is None


@pytest.mark.slow
def test_a_picture_that_fails_leaves_the_servos_their_run(
    told: list[str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, stage: str
) -> None:
    class Headless:
        def __init__(self, *words: Any) -> None:
            pass

        def run(self, keep_going: Any) -> None:
            assert keep_going()
            raise RuntimeError("the context is lost")

        def report(self) -> dict[str, object]:
            raise RuntimeError("no report either")

        def close(self) -> None:
            told.append("closed")

    body: Any = FakeBody(told, 3)
    body.mailbox = None
    monkeypatch.setattr(module, "BodyProcess", body)
    monkeypatch.setattr(module, "HeadValues", lambda *_: None)
    monkeypatch.setattr(module, "lower_process_priority", lambda: None)
    monkeypatch.setattr(module, "HeadlessFace", Headless)
    report = StageRun("everything").run_headless(None)
    assert told == ["ready", "begin", "sleep 0.05", "sleep 0.05", "closed", "stop", "left"]
    assert report["face"] is None and report["parts"][0]["part"] == "the picture"
    assert caplog.messages == [
        "the picture failed: RuntimeError: the context is lost; links and servos go on; "
        "it comes back with the next start"
    ]
    body.lives = 3
    with pytest.raises(RuntimeError, match="context is lost"):  # nobody would see or feel anything
        StageRun(stage).run_headless(None)


def test_the_end_of_the_body_is_no_failure_of_the_picture(
    told: list[str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Headless:
        def __init__(self, *words: Any) -> None:
            pass

        def run(self, keep_going: Any) -> None:
            keep_going()

        def close(self) -> None:
            pass

    def gave_up() -> bool:
        raise ControllerError("bus head: gave up")

    body: Any = FakeBody(told, 1)
    body.mailbox, body.alive = None, gave_up
    monkeypatch.setattr(module, "BodyProcess", body)
    monkeypatch.setattr(module, "HeadValues", lambda *_: None)
    monkeypatch.setattr(module, "lower_process_priority", lambda: None)
    monkeypatch.setattr(module, "HeadlessFace", Headless)
    with pytest.raises(ControllerError, match="gave up"):
        StageRun("everything").run_headless(None)
    assert caplog.messages == []


def test_a_voice_that_is_not_there_is_refused_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "stage.toml").write_text('name = "mine"\nvoice = "none.wav"\n')
    with pytest.raises(TakeError, match=r"none\.wav: cannot be read: No such file"):
        StageRun(str(tmp_path / "stage.toml"))
    with pytest.raises(TakeError, match=r"other\.wav: cannot be read: No such file"):
        StageRun("everything", RunOptions(voice=Voice("other.wav")))
    StageRun(str(tmp_path / "stage.toml"), RunOptions(voice=Voice("-")))
