"""A session: one stage run from start to end, with or without a window, and its report."""

from __future__ import annotations

import gc
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.base.errors import ConfigError
from controller.base.files import replacing
from controller.base.parameters import PARAMETERS
from controller.base.signals import stop_flag
from controller.body.preload import PreloadedBody
from controller.body.process import BodyProcess, Deadline
from controller.body.sources import Voice
from controller.face.face import HeadlessFace, HeadValues, Recorder
from controller.stage.identity import check_identity
from controller.stage.stage import Stage, load_stage
from controller.takes.reader import load_take
from controller.takes.recording import SUFFIX, replay
from drivers.base.priority import lower_process_priority

if TYPE_CHECKING:
    from surface.head import Head  # start-up: the body gets its orders first


Tell = Callable[[str], None]

REPORT_FORMAT = 1
"""Version of a report's keys: raised when one changes its meaning or goes; reports before it state none."""

_IDLE_S = 0.05


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


class StageRun:
    """One stage, ready to run.

    Parameters
    ----------
    stage : what to run.
    take : a recorded take to play instead of the stage's links.
    tell : hears in a few words what is being done.
    mirror : leave the servos limp; the face shows where somebody moves them.
    voice : a voice that moves the mouth. record : file to write every command and tick to.
    waiting : the body's process, where it has been started already.
    """

    def __init__(
        self,
        stage: Stage,
        take: Path | None = None,
        tell: Tell = lambda _: None,
        *,
        mirror: bool = False,
        voice: Voice | None = None,
        record: Path | None = None,
        waiting: PreloadedBody | None = None,
    ) -> None:
        self.stage = stage
        self.take = take
        self.tell = tell
        self.mirror = mirror
        self.voice = voice
        self.record = record
        self.waiting = waiting

    @classmethod
    def load(
        cls,
        stage: str,
        take: Path | None = None,
        tell: Tell = lambda _: None,
        *,
        mirror: bool = False,
        voice: Voice | None = None,
        record: Path | None = None,
        identity: Mapping[str, float] | None = None,
        waiting: PreloadedBody | None = None,
    ) -> StageRun:
        """Find and check a stage and, where given, a take; raises before anything is opened.

        ``identity`` replaces the stage's own.
        """
        found = load_stage(stage, PARAMETERS)
        if identity:
            check_identity(found.head, identity)
            found = replace(found, settings=found.settings.model_copy(update={"identity": dict(identity)}))
        if take is not None:
            check_take(take, found)
        if mirror and not found.robots:
            raise ConfigError(f"{found.path}: robots: a stage without a robot has nothing to mirror")
        return cls(found, take, tell, mirror=mirror, voice=voice, record=record, waiting=waiting)

    def run_headless(self, seconds: float | None, pictures: Path | None = None) -> dict[str, Any]:
        """Run without a display; returns the report.

        Parameters
        ----------
        seconds : when to stop; None runs until the take ends or Ctrl-C.
        pictures : folder for a contact sheet and a clip; None reads no picture back.
        """
        recorder = Recorder() if pictures else None
        with stop_flag() as flag, self._body() as body:
            values, head = self._head(body)
            face = HeadlessFace(head, self.stage.settings.face, values, recorder)
            try:
                face.run(self._begin(body, flag, seconds))
            finally:
                face.close()
            report = self._end(body, face.report())
        if recorder is not None and pictures is not None:
            from controller.face.pictures import write_pictures  # start-up: only --pictures draws any

            self.tell("writing the pictures")
            report["written"] = write_pictures(recorder, pictures)
        return report

    def run_window(self, seconds: float | None) -> dict[str, Any]:
        """Run with a window until it is closed, the take ends or ``seconds`` are over; returns the report."""
        with stop_flag() as flag, self._body() as body:
            values, head = self._head(body)
            from controller.face.window import WindowFace  # start-up: the body gets its orders first

            face = WindowFace(head, self.stage.settings.face, values, body, self.stage.load_head)
            face.run(self._begin(body, flag, seconds))
            return self._end(body, face.report())

    def run_without_face(self, seconds: float | None) -> dict[str, Any]:
        """Run links and servos only, as on a robot without OpenGL; returns the report."""
        with stop_flag() as flag, self._body() as body:
            keep_going = self._begin(body, flag, seconds)
            while keep_going():
                time.sleep(_IDLE_S)
            return self._end(body, None)

    def _body(self) -> BodyProcess:
        self.tell("starting")
        waiting, self.waiting = self.waiting, None
        return BodyProcess(
            self.stage,
            PARAMETERS,
            self.take,
            mirror=self.mirror,
            voice=self.voice,
            record=self.record,
            waiting=waiting,
        )

    def _head(self, body: BodyProcess) -> tuple[HeadValues, Head]:
        """The head and its values; the servos come up meanwhile in the body's process."""
        lower_process_priority()
        head = self.stage.load_head()
        return HeadValues(body.mailbox, PARAMETERS, head.parameters), head

    def _begin(self, body: BodyProcess, flag: threading.Event, seconds: float | None) -> Callable[[], bool]:
        """Wait for the servos, let commands in; gives the question whether to go on."""
        gc.enable()
        gc.freeze()  # what was loaded stays: no collection has to look at it while pictures are drawn
        body.wait_ready()
        body.begin()
        self.tell("running" + (f" for {seconds:g} s" if seconds else ""))
        deadline = Deadline(seconds)
        return lambda: not flag.is_set() and deadline() and body.alive()

    def _end(self, body: BodyProcess, face: dict[str, object] | None) -> dict[str, Any]:
        self.tell("stopping" if self.mirror else "bringing the servos to rest")
        body.stop()
        return {"stage": self.stage.settings.name, "face": face, **body.report, "written": []}

    def plan(self, seconds: float | None = None) -> tuple[list[dict[str, str]], list[dict[str, object]]]:
        """What the servos would be sent, without opening a port.

        Parameters
        ----------
        seconds : how much of it; all of the take or one round of the script without, 30 s at most for an endless one.

        Returns
        -------
        A row a channel for people, and every angle of every cycle for programs.
        """
        from controller.stage.dry_run import dry_run  # start-up: only a dry run needs it

        return dry_run(self.stage, self.take, seconds, PARAMETERS)


def check_take(take: Path, stage: Stage) -> None:
    """Raise what is wrong with a take or a recording."""
    if take.suffix == SUFFIX:
        next(replay(take, PARAMETERS, make=stage.state), None)
        return

    load_take(take, PARAMETERS)


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write a report as JSON with the version of its keys, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps({"format": REPORT_FORMAT, **report}, indent=2) + "\n", encoding="utf-8")
