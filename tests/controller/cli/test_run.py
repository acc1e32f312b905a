"""``omote run``, ``play`` and ``demo``: a report as rows, and runs from the command line."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any, ClassVar

import pytest
from typer.testing import CliRunner, Result

from controller.body.messages import RunOptions
from controller.body.sources import Voice
from controller.cli.app import make_app
from controller.cli.console import console
from controller.cli.run import _describe_link, report_rows
from controller.panels.session.commands import History, Settings
from controller.panels.session.next_run import NextRun
from controller.stage.last import remember

SPREAD = {"mean": 1.0, "p50": 1.0, "p95": 2.0, "p99": 3.25, "max": 4.0}
FACE = {
    "frames": 300,
    "seconds": 10.0,
    "frames_per_second": 30.0,
    "frames_with_motion": 299,
    "frame_ms": SPREAD,
    "size": [1280, 720],
    "quality": "full",
    "renderer": "llvmpipe",
    "start_to_first_frame_s": 2.5,
}
LOOP = {"rate_hz": 49.98, "wanted_hz": 50.0, "ticks": 500, "skipped": 2, "jitter_ms": SPREAD}


def test_every_part_of_a_run_has_its_rows() -> None:
    bus = {
        "name": "head",
        "servos": 24,
        **LOOP,
        "command_to_wire_ms": {},
        "channels_held_at_limit": 3,
        "bus": {"errors": {"no_reply": 2}, "limits_hit": 4},
    }
    link = {"port": "/dev/x", "accepted": 7, "refused": {"E_NAME": 1}}
    found = dict(report_rows({"stage": "s", "face": FACE, "control": LOOP, "links": [link], "buses": [bus]}))
    assert found["frames per second"] == "30.0"
    assert found["milliseconds per frame"] == "p50 1.00  p95 2.00  p99 3.25  max 4.00"
    assert found["start to first frame"] == "2.50 s"
    assert found["link /dev/x"] == "7 accepted, 1 refused"
    assert found["bus head: 24 servos"] == "50.0 Hz of 50 wanted, 2 skipped"
    assert found["bus head: command to wire (ms)"] == "nothing measured"
    assert found["bus head: errors"] == "2 no_reply"
    assert found["bus head: targets held at a limit"] == "7"


def test_a_stage_without_body_or_robots_still_reports_its_face() -> None:
    assert dict(report_rows({"stage": "s", "face": FACE}))["frames"] == "300 in 10.0 s, 299 of them with motion"


def test_rules_takes_voices_and_differences_have_rows() -> None:
    worst = {"channel": "jaw", "rms_deg": 4.0, "max_deg": 9.0}
    bus = {
        "name": "head",
        "servos": 24,
        **LOOP,
        "command_to_wire_ms": SPREAD,
        "channels_held_at_limit": 0,
        "bus": {"errors": {}, "limits_hit": 0},
        "face_difference": {"rms_deg": 1.25, "worst": [worst], "regions_rms_deg": {"jaw": 2.0, "mouth": 0.5}},
        "rules": [{"rule": "timing jaw toward high", "times": 2, "seconds": 3.21}],
    }
    take = {"rows": 60, "rate_hz": 60.0, "played_s": 0.5, "duration_s": 1.0}
    found = report_rows({"stage": "s", "take": take, "voice": {"heard_s": 2.0}, "buses": [bus]})
    assert found[:2] == [("take", "0.5 of 1.0 s played, 60 rows at 60 Hz"), ("voice", "2.0 s heard")]
    assert found[-3:] == [
        ("bus head: measured minus commanded face", "rms 1.2 deg, most at jaw: rms 4.0 deg"),
        ("bus head: by region (rms deg)", "jaw 2.0  mouth 0.5"),
        ("bus head: rule", "timing jaw toward high: 2 times, 3.2 s"),
    ]
    assert ("bus head: errors", "none") in found


@pytest.fixture
def stage(tmp_path: Path) -> str:
    (tmp_path / "a.tsv").write_text("0.0\taa\n0.2\tsil\n")
    (tmp_path / "stage.toml").write_text('name = "mine"\n[face]\nsize = [64, 64]\nquality = "fast"\n')
    return str(tmp_path / "stage.toml")


def omote(*words: str) -> Result:
    return CliRunner().invoke(make_app(), list(words))


@pytest.mark.slow
def test_a_run_without_a_face_writes_its_report(stage: str, tmp_path: Path) -> None:
    report = tmp_path / "r.json"
    result = omote("run", stage, "--no-face", "--seconds", "0.2", "--report", str(report))
    assert result.exit_code == 0, result.output
    assert "omote mine" in result.output and "control loop" in result.output
    assert f"wrote {report}" in result.output
    measured = json.loads(report.read_text())
    assert measured["face"] is None and measured["format"] == 1 and measured["written"] == []
    assert measured["control"]["ticks"] > 0


@pytest.mark.slow
def test_a_take_is_played_to_its_end_and_pictures_are_written(stage: str, tmp_path: Path) -> None:
    out, report = tmp_path / "pictures", tmp_path / "r.json"
    words = ["play", str(tmp_path / "a.tsv"), "--stage", stage, "--headless", "--pictures", str(out)]
    result = omote(*words, "--report", str(report))
    assert result.exit_code == 0, result.output
    measured = json.loads(report.read_text())
    assert measured["take"]["played_s"] == measured["take"]["duration_s"] > 0
    assert measured["face"]["frames"] > 0 and measured["face"]["size"] == [64, 64]
    assert sorted(path.name for path in out.iterdir()) == ["face.webp", "sheet.png"]
    assert measured["written"] == [str(out / "sheet.png"), str(out / "face.webp")]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "--identity", "nobody=0.5"], "no identity 'nobody'"),
        (["run", "--identity", "broad=2"], "expected NAME=AMOUNT, 0 to 1"),
        (["run", "--mirror"], "nothing to mirror"),
        (["run", "--theme", "clown"], "--theme clown: must be 'skin', 'mask' or 'robot'"),
        (["run", "--voice", "none.wav", "--seconds", "30"], "none.wav: cannot be read"),
    ],
)
def test_what_is_wrong_with_a_run_is_one_error(stage: str, words: list[str], message: str) -> None:
    command, *options = words
    result = omote(command, stage, "--no-face", *options)
    assert result.exit_code == 1 and message in str(result.exception)


def test_a_dry_run_says_when_there_is_no_robot(stage: str, tmp_path: Path) -> None:
    assert omote("run", stage, "--dry-run").output == "This stage has no robot; nothing would be sent.\n"
    report = tmp_path / "r.json"
    played = omote("play", str(tmp_path / "a.tsv"), "--stage", stage, "--dry-run", "--report", str(report))
    assert played.exit_code == 0, played.output
    found = {"format": 1, "stage": stage, "dry_run": True, "played_s": 0.0, "length_s": 0.0, "buses": []}
    assert json.loads(report.read_text()) == found
    missing = omote("play", "none.tsv", "--stage", "everything", "--dry-run")
    assert missing.exit_code == 1 and "none.tsv" in str(missing.exception)


def test_a_dry_run_lists_every_channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "width", 250)
    (tmp_path / "stage.toml").write_text('name = "mine"\nrobots = ["head24"]\n')
    text = omote("run", str(tmp_path / "stage.toml"), "--dry-run", "--seconds", "0.1").output
    assert "dry run: no port was opened" in text and text.count("xl330-m288") == 24 and "neutral (deg)" in text


def test_rows_come_in_the_order_of_a_run_and_name_the_picture() -> None:
    face = {**FACE, "start_to_first_frame_s": 0.0}
    bus = {"name": "b", "servos": 2, **LOOP, "command_to_wire_ms": SPREAD, "channels_held_at_limit": 1,
           "bus": {"errors": {"no_reply": 2, "crc": 3}, "limits_hit": 2}}  # fmt: skip
    link = {"port": "/dev/x", "accepted": 7, "refused": {"E_NAME": 1, "E_RANGE": 2}}
    rows = report_rows({"stage": "s", "face": face, "control": LOOP, "links": [link], "buses": [bus]})
    assert [name for name, _ in rows] == [
        "picture", "frames", "frames per second", "milliseconds per frame", "control loop", "link /dev/x",
        "bus b: 2 servos", "bus b: jitter (ms)", "bus b: command to wire (ms)", "bus b: errors",
        "bus b: targets held at a limit",
    ]  # fmt: skip
    found = dict(rows)
    assert found["picture"] == "1280 x 720, full, llvmpipe"
    assert found["bus b: errors"] == "2 no_reply, 3 crc" and found["bus b: targets held at a limit"] == "3"
    assert found["link /dev/x"] == "7 accepted, 3 refused"
    assert report_rows({"stage": "s"}) == []
    away = {"rms_deg": 1.0, "worst": [{"channel": "a", "rms_deg": 2.0}, {"channel": "b", "rms_deg": 1.0}]}
    rows = report_rows({"stage": "s", "buses": [{**bus, "face_difference": away}]})
    assert rows[-2:] == [
        ("bus b: measured minus commanded face", "rms 1.0 deg, most at a: rms 2.0 deg"),
        ("bus b: by region (rms deg)", ""),
    ]


class Session:
    """Stands in for a run: keeps what it is started with, and reports nothing."""

    def __init__(
        self, stage: str, options: RunOptions, identity: Any, look: Any, status: Any, preloaded: Any = None,
        web: Any = None, carried: Any = None,
    ) -> None:  # fmt: skip
        self.web, self.carried = web, carried
        self.given = {"stage": stage, "options": options, "identity": identity, "look": look}
        self.how: tuple[Any, ...] = ()
        self.next_run = Session.dropped.pop() if Session.dropped else None
        Session.last = self
        status("starting")

    last: Session
    dropped: ClassVar[list[NextRun]] = []

    def _run(self, *how: Any) -> dict[str, Any]:
        self.how = how
        return {"stage": self.given["stage"], "face": None, "written": []}

    def run_without_face(self, seconds: float | None) -> dict[str, Any]:
        return self._run("no face", seconds)

    def run_headless(self, seconds: float | None, pictures: Path | None) -> dict[str, Any]:
        return self._run("headless", seconds, pictures)

    def run_window(self, seconds: float | None) -> dict[str, Any]:
        return self._run("window", seconds)


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """Runs are only noted in :class:`Session`; the entry ``there`` says whether there is a display."""
    found = {"there": True}
    monkeypatch.setattr("controller.body.preload.PreloadedBody", nullcontext)
    monkeypatch.setattr("controller.tools.stage_run.StageRun", Session)
    monkeypatch.setattr("controller.tools.stage_run.has_display", lambda: found["there"])
    return found


def noted(*words: str) -> Session:
    result = omote(*words)
    assert result.exit_code == 0, result.output
    return Session.last


LOOK = dict.fromkeys(("kiosk", "monitor", "quality", "fps", "theme", "camera", "evaluator", "person"))


def test_a_stage_that_is_dropped_on_the_window_goes_on(display: dict[str, bool]) -> None:
    Session.dropped.append(NextRun(Path("next.toml")))
    session = noted("run", "mine", "--theme", "mask")
    assert session.given["stage"] == "next.toml" and session.given["look"]["theme"] == "mask"
    assert session.how == ("window", None) and session.given["options"] == RunOptions()


def test_a_run_without_a_stage_opens_the_last_one_of_a_window(
    display: dict[str, bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMOTE_STATE", str(tmp_path))
    result = omote("run")
    assert result.exit_code == 1 and "none was shown in a window" in str(result.exception)
    assert noted("edit").given["stage"] == "demo" and Session.last.given["options"] == RunOptions(at_rest=True)
    stage, mine = tmp_path / "a.toml", tmp_path / "mine.toml"
    stage.touch()
    mine.touch()
    remember(stage, (mine,))
    for command, at_rest in (("run", False), ("edit", True)):
        session = noted(command)
        assert session.given["stage"] == str(stage)
        assert session.given["options"] == RunOptions(vocabularies=(mine,), at_rest=at_rest)
    assert noted("run", "other", "--vocabulary", str(mine)).given["options"] == RunOptions(vocabularies=(mine,))
    display["there"] = False
    result = omote("edit")
    assert result.exit_code == 1 and "needs a display" in str(result.exception)


def test_a_window_that_saved_a_group_opens_again_with_it(display: dict[str, bool]) -> None:
    carried = History(Settings(held={3: 0.5}))
    then = NextRun(Path("mine.toml"), (Path("own.toml"),), carried)
    Session.dropped.append(then)
    session = noted("edit", "mine", "--identity", "broad=0.5")
    assert session.given["options"] == RunOptions(vocabularies=(Path("own.toml"),), at_rest=True)
    assert session.given["identity"] == {"broad": 0.5} and session.carried is then


def test_a_run_without_options_opens_a_window_where_there_is_a_display(display: dict[str, bool]) -> None:
    session = noted("run", "mine")
    assert session.how == ("window", None)
    assert session.given == {"stage": "mine", "options": RunOptions(), "identity": {}, "look": LOOK}
    display["there"] = False
    assert noted("run", "mine").how == ("headless", None, None)


def test_every_option_of_a_run_arrives(display: dict[str, bool], tmp_path: Path) -> None:
    session = noted("run", "mine", "--headless", "--pictures", str(tmp_path), "--seconds", "0.1", "--mirror")
    assert session.how == ("headless", 0.1, tmp_path)
    assert session.given["options"] == RunOptions(mirror=True)
    assert noted("run", "mine", "--no-face", "--headless").how == ("no face", None)
    session = noted("run", "mine", "--voice", "v.wav", "--voice-rate", "1000", "--record", "a.rec")
    assert session.given["options"] == RunOptions(voice=Voice("v.wav", 1000), record=Path("a.rec"))
    words = ["--kiosk", "--monitor", "0", "--quality", "fast", "--theme", "mask", "--camera", "front", "--fps", "240"]
    session = noted("run", "mine", *words, "--evaluator", "cpu", "--identity", "broad=0.5", "--person", "maple")
    assert session.given["look"] == {"kiosk": True, "monitor": 0, "quality": "fast", "fps": 240.0, "theme": "mask",
                                     "camera": "front", "evaluator": "cpu", "person": "maple"}  # fmt: skip
    assert session.given["identity"] == {"broad": 0.5} and session.web is None
    assert noted("run", "mine", "--web", "127.0.0.1:8123").web == "127.0.0.1:8123"


def test_what_is_played_arrives_with_its_stage(display: dict[str, bool], tmp_path: Path) -> None:
    session = noted("play", "a.csv", "--record", "a.rec", "--no-face")
    assert session.given["stage"] == "play" and session.how == ("no face", None)
    assert session.given["options"] == RunOptions(Path("a.csv"), record=Path("a.rec"))
    assert noted("play", "a.csv").how == ("window", None)
    session = noted("play", "-", "--stage", "mine", "--voice-rate", "8000", "--headless", "--seconds", "2")
    assert session.given["stage"] == "mine" and session.how == ("headless", 2.0, None)
    assert session.given["options"] == RunOptions(voice=Voice("-", 8000, alone=True))
    assert noted("play", "-", "--record", "b.rec").given["options"] == RunOptions(
        voice=Voice("-", alone=True), record=Path("b.rec")
    )


def test_the_demo_runs_for_a_while_and_leaves_pictures_where_there_is_no_display(
    display: dict[str, bool], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert noted("demo").how == ("window", None) and Session.last.given["stage"] == "demo"
    assert noted("demo", "--seconds", "3").how == ("window", 3.0)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out").mkdir()
    assert noted("demo", "--headless").how == ("headless", 15.0, Path("out"))
    assert json.loads((tmp_path / "out" / "report.json").read_text())["stage"] == "demo"
    (tmp_path / "other").mkdir()
    display["there"] = False
    assert noted("demo", "--seconds", "3", "--out", "other").how == ("headless", 3.0, Path("other"))
    assert (tmp_path / "other" / "report.json").is_file()


@pytest.mark.parametrize(
    "words",
    [
        ("run", "mine", "--seconds", "0.09"),
        ("play", "-", "--voice-rate", "999"),
        ("demo", "--seconds", "0"),
    ],
)
def test_options_have_limits(display: dict[str, bool], words: tuple[str, ...]) -> None:
    assert omote(*words).exit_code == 2


@pytest.mark.parametrize(
    ("more", "shown"),
    [
        ({"rate_hz": 60.0, "lost": 2, "error": ""}, "7 frames received, 2 lost, 1 refused"),
        ({"sent": 300, "dropped": 1, "send_error": "gone"}, "300 messages sent, 1 dropped; gone"),
        (
            {"rate_hz": 60.0, "lost": 0, "error": "", "sent": 5, "dropped": 0, "send_error": ""},
            "7 frames received, 0 lost, 1 refused; 5 messages sent, 0 dropped",
        ),
    ],
)
def test_links_that_take_and_send_faces_are_reported_as_such(more: dict[str, object], shown: str) -> None:
    link = {"port": "udp:127.0.0.1:5", "accepted": 7, "refused": {"too short": 1}, **more}
    assert _describe_link(link) == shown
