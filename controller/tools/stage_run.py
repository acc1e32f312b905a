"""Runs one stage (head, links and robots) from start to end, with or without a window, and returns its report."""

from __future__ import annotations

import gc
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from controller.base.errors import ConfigError
from controller.base.files import replacing
from controller.base.parts import Part
from controller.base.paths import config_dir
from controller.base.service_manager import ServiceManager
from controller.base.signals import stop_flag
from controller.body.messages import RunOptions, WebPanel
from controller.body.preload import PreloadedBody
from controller.body.process import BodyProcess, deadline
from controller.body.sources import Voice
from controller.face.face import HeadlessFace, HeadValues, Recorder
from controller.links.line.script import script_names
from controller.panels.web_face import face_file_in_background
from controller.stage.last import remember
from controller.stage.stage import Stage, check_identity, heads_of, with_picture
from controller.takes.reader import load_take
from controller.takes.recording import SUFFIX, replay
from drivers.base.priority import lower_process_priority
from surface.base.extras import require

if TYPE_CHECKING:
    from controller.face.wall import WallFace  # imported lazily: the body starts first
    from controller.panels.session.next_run import NextRun
    from controller.panels.window.face import WindowFace  # imported lazily: the body starts first
    from controller.panels.window.head_source import HeadSource  # imported lazily: as above
    from controller.panels.window.panel import PanelOptions  # imported lazily: as above
    from surface.head import Head

REPORT_FORMAT = 1
"""Version of a report's keys, raised when a key changes its meaning or is removed. Old reports state no version."""

_POLL_S = 0.05


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


class StageRun:
    """One stage, ready to run once by one of the methods ``run_...``, which return the report.

    Creating it finds and checks the stage and the take of ``options``, and raises before anything is opened.

    name : of the stage, or its file. identity : replaces the stage's own. look : command-line options that replace
        settings of its picture. web : HOST:PORT of a web panel.
    status : called with a short text about the present step. preloaded : the control process (body), if it was started
        already. carried : settings of the previous window, which this one continues with.

    Attributes
    ----------
    measured : after a run, what the body measured, and under ``failed`` the error that ended it, if any.
    next_run : after a run in a window, the stage and settings that the user wants to continue with; None to end.
    """

    def __init__(
        self,
        name: str,
        options: RunOptions = RunOptions(),
        identity: Mapping[str, float] | None = None,
        look: Mapping[str, object] | None = None,
        status: Callable[[str], object] = lambda _: None,
        preloaded: PreloadedBody | None = None,
        web: str | None = None,
        carried: NextRun | None = None,
    ) -> None:
        if web is not None:
            check_web(web, alone=options.take is not None)
        stage = with_picture(options.load_stage(name), look or {})
        if identity:
            check_identity(stage.head, identity)
            stage = replace(stage, settings=stage.settings.model_copy(update={"identity": dict(identity)}))
        if options.take is not None and options.take.suffix == SUFFIX:
            next(replay(options.take, stage.parameters, make=stage.state), None)
        elif options.take is not None:
            load_take(options.take, stage.parameters)
        if (voice := _voice(stage, options)) is not None:
            voice.check()
        if options.mirror and not any(each.robots for each in heads_of(stage)):
            raise ConfigError(f"{stage.path}: robots: a stage without a robot has nothing to mirror")
        self.stage, self._options, self._status, self._preloaded = stage, options, status, preloaded
        self._web, self._web_look, self._identity = web, look or {}, identity
        self._manager = ServiceManager()
        self.measured: dict[str, Any] = {}
        self._carried = carried
        self.next_run: NextRun | None = None

    def run_headless(self, seconds: float | None, pictures: Path | None = None) -> dict[str, Any]:
        """Run headless for ``seconds``; None runs until the take ends or Ctrl-C.

        ``pictures`` : folder for a contact sheet and a clip; None writes neither.
        """
        recorder = None
        if pictures:
            recorder = Recorder(whole=True) if self.stage.heads else Recorder()
        with self._body() as (body, flag):
            with closing(self._headless_face(body, recorder)) as face:
                failed = self._show(face, self._begin(body, flag, seconds))
            report = self._end(body, None if failed else face.report(), failed)
        if recorder is not None and pictures is not None:
            self._status("writing the pictures")
            report["written"] = recorder.write(pictures)
        return report

    def _headless_face(self, body: BodyProcess, recorder: Recorder | None) -> HeadlessFace | WallFace:
        """Return what draws the head, or the wall of several heads."""
        if self.stage.heads:
            from controller.face.wall import WallFace  # imported lazily: the body starts first

            lower_process_priority()
            return WallFace(self.stage, self.stage.parameters, body.mailboxes, recorder)
        values, head = self._load_head(body)
        return HeadlessFace(head, self.stage.settings.face, values, recorder)

    def run_window(self, seconds: float | None) -> dict[str, Any]:
        """Run with a window until it is closed, the take ends or ``seconds`` are over."""
        with self._body() as (body, flag):
            values, head = self._load_head(body)
            from controller.panels.window.face import WindowFace  # imported lazily: the body starts first

            stage = self.stage
            face = WindowFace(
                head, stage.settings.face, values, body.send, body.panel_state, stage.load_head, _panel_options(stage),
                stage.controls, stage=stage, details=lambda: body.details, carried=self._carried,
                heads=self._head_sources(body),
            )  # fmt: skip
            if self._options.take is None:
                remember(stage.path, self._options.vocabularies)
            failed = self._show(face, self._begin(body, flag, seconds, wait=False))
            self.next_run = face.next_run
            return self._end(body, None if failed else face.report(), failed)

    def _head_sources(self, body: BodyProcess) -> list[HeadSource]:
        """Return the heads among which the window can choose; none for a stage with one head."""
        from controller.panels.window.head_source import HeadSource  # imported lazily: the body starts first

        boxes = zip(self.stage.heads, body.mailboxes, body.panel_states, strict=True) if self.stage.heads else ()
        return [HeadSource(head.name, head.stage, mailbox, state) for head, mailbox, state in boxes]

    def run_without_face(self, seconds: float | None) -> dict[str, Any]:
        """Run links and servos only, for a computer without OpenGL."""
        with self._body() as (body, flag):
            keep_going = self._begin(body, flag, seconds)
            while keep_going():
                time.sleep(_POLL_S)
            return self._end(body, None)

    @contextmanager
    def _body(self) -> Iterator[tuple[BodyProcess, threading.Event]]:
        """Yield the control process (body) and a flag that Ctrl-C sets."""
        self._status("starting")
        preloaded, self._preloaded = self._preloaded, None
        with stop_flag() as flag, self._with_web() as options:
            body = BodyProcess(self.stage, self.stage.parameters, options, preloaded=preloaded)
            try:
                with body:
                    yield body, flag
            finally:
                self.measured = {"stage": self.stage.settings.name, **body.report}

    @contextmanager
    def _with_web(self) -> Iterator[RunOptions]:
        """Yield the options; if a web panel is wanted, with its settings, while its face file is made in background."""
        if self._web is None:
            yield self._options
            return
        stage = self.stage
        with face_file_in_background(stage.path, self._web_look, self._identity, stage.vocabularies) as face:
            yield replace(self._options, web=WebPanel(self._web, face))

    def _load_head(self, body: BodyProcess) -> tuple[HeadValues, Head]:
        """Load the head, while the servos start in the control process; return its values and the head."""
        lower_process_priority()
        head = self.stage.load_head()
        return HeadValues(body.mailbox, self.stage.parameters, head.parameters), head

    def _begin(
        self, body: BodyProcess, flag: threading.Event, seconds: float | None, *, wait: bool = True
    ) -> Callable[[], bool]:
        """Accept commands as soon as the servos are started; return a function that is true while the run continues.

        The function is to be called often. ``wait`` : whether to wait for the servos here; if not, the face is shown
        meanwhile, and the function raises an error of their start. ``seconds`` count once they are started.
        """
        gc.enable()
        gc.freeze()  # objects that are loaded by now stay, so no collection has to check them while pictures are drawn
        if wait:
            body.wait_ready()
        body.begin()
        in_time = deadline(seconds)
        started = self._start_notice(seconds)

        def keep_going() -> bool:
            going = not flag.is_set() and body.alive()
            if not body.ready:
                return going
            started()
            if self._manager.watches:
                self._manager.alive(body.mailbox.sequence)
            return going and in_time()

        if wait:
            started()
        return keep_going

    def _start_notice(self, seconds: float | None) -> Callable[[], object]:
        """Return a function whose first call says that the servos are started."""

        @cache
        def started() -> None:
            self._status("running" + (f" for {seconds:g} s" if seconds else ""))
            self._manager.ready()

        return started

    def _show(self, face: HeadlessFace | WallFace | WindowFace, keep_going: Callable[[], bool]) -> Part | None:
        """Show the face while the run continues. If it fails and there are robots, run on and return it as a part.

        Raises an error that ends the run, and an error of the face if the stage has no robot.
        """
        condition = _Condition(keep_going)
        try:
            face.run(condition)
        except Exception as error:
            if condition.failed or not any(stage.robots for stage in heads_of(self.stage)):
                raise
            part = Part("the picture", remedy="it comes back with the next start", effect="links and servos go on")
            part.fail(error, time.monotonic())
            while keep_going():
                time.sleep(_POLL_S)
            return part
        return None

    def _end(self, body: BodyProcess, face: dict[str, object] | None, failed: Part | None = None) -> dict[str, Any]:
        self._manager.stopping()
        self._status("stopping" if self._options.mirror or not self.stage.robots else "bringing the servos to rest")
        body.stop()
        report: dict[str, Any] = {"stage": self.stage.settings.name, "face": face, **body.report, "written": []}
        if failed is not None:
            report["parts"] = [*report.get("parts", []), failed.report()]
        return report


def check_web(listen: str, *, alone: bool) -> None:
    """Check the address of a web panel. ``alone`` : a take plays, without the links of the stage.

    Raises ConfigError: ``listen`` is not an address, or a take plays alone. MissingPackage: websockets is missing.
    """
    if alone:
        raise ConfigError("--web: a take plays without links", hint="omote run STAGE --web")
    require("a web panel", "websockets")
    try:
        WebPanel(listen, Path()).link()
    except ValidationError as error:
        why = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        raise ConfigError(f"--web {listen}: {why}", hint="--web 127.0.0.1:8080") from error


def _panel_options(stage: Stage) -> PanelOptions:
    """Return what the window's panel shows of a stage."""
    from controller.panels.window.panel import PanelOptions  # imported lazily: the body starts first

    own = [file for file in stage.vocabularies if not file.resolve().is_relative_to(config_dir().resolve())]
    return PanelOptions(
        stage.vocabulary, own, script_names(beside=stage.path), stage.settings.liveliness, parameters=stage.parameters,
        robots=[robot for each in heads_of(stage) for robot in each.robots],
    )  # fmt: skip


class _Condition:
    """Calls ``keep_going`` for the face. ``failed`` : it raised, so the error is of the run and not of the face."""

    def __init__(self, keep_going: Callable[[], bool]) -> None:
        self._keep_going, self.failed = keep_going, False

    def __call__(self) -> bool:
        try:
            return self._keep_going()
        except BaseException:
            self.failed = True
            raise


def _voice(stage: Stage, options: RunOptions) -> Voice | None:
    """Return the voice that a run listens to: of the options, else, unless a take plays, of the stage."""
    if options.voice is not None or options.take is not None or stage.settings.voice is None:
        return options.voice
    return Voice(str(stage.file(stage.settings.voice)))


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write a report as JSON with the version of its keys; the file is replaced atomically."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps({"format": REPORT_FORMAT, **report}, indent=2) + "\n", encoding="utf-8")
