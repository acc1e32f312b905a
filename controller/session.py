"""A session: one stage run from start to end, with or without a window, and its report."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.face import HeadlessFace, HeadValues, Recorder
from controller.files import replacing
from controller.parameters import PARAMETERS
from controller.pictures import write_pictures
from controller.plan import plan_rows
from controller.priority import yield_to_servos
from controller.run import BodyProcess, Deadline
from controller.signals import stop_flag
from controller.stage import Stage, load_stage

if TYPE_CHECKING:
    from surface.head import Head


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


class Session:
    """One stage, ready to run.

    Parameters
    ----------
    stage : what to run.
    take : a recorded take to play instead of the stage's links.
    """

    def __init__(self, stage: Stage, take: Path | None = None) -> None:
        self.stage = stage
        self.take = take

    @classmethod
    def load(cls, stage: str, take: Path | None = None) -> Session:
        """Find and check a stage and, where given, a take; raises before anything is opened."""
        if take is not None:
            from controller.livelink import Take

            Take.load(take, PARAMETERS)
        return cls(load_stage(stage, PARAMETERS), take)

    def run_headless(self, seconds: float | None, pictures: Path | None = None) -> dict[str, Any]:
        """Run without a display; returns the report.

        Parameters
        ----------
        seconds : when to stop; None runs until the take ends or Ctrl-C.
        pictures : folder for a contact sheet and a clip; None reads no picture back.
        """
        recorder = Recorder() if pictures else None
        with stop_flag() as flag, self._body() as body:
            face = self._headless_face(body, recorder)
            body.wait_ready()
            deadline = Deadline(seconds)
            try:
                face.run(lambda: not flag.is_set() and deadline() and body.alive())
            finally:
                face.close()
            body.stop()
            report = self._report(face.report(), body)
        if recorder is not None and pictures is not None:
            report["written"] = write_pictures(recorder, pictures)
        return report

    def run_window(self, seconds: float | None) -> dict[str, Any]:
        """Run with a window until it is closed, the take ends or ``seconds`` are over; returns the report."""
        from controller.window import WindowFace

        with stop_flag() as flag, self._body() as body:
            yield_to_servos()
            head = load_head(self.stage)
            values = HeadValues(body.mailbox, PARAMETERS, head.parameters)
            face = WindowFace(head, self.stage.settings.face, values, body)
            body.wait_ready()
            deadline = Deadline(seconds)
            face.run(lambda: not flag.is_set() and deadline() and body.alive())
            body.stop()
            return self._report(face.report(), body)

    def _body(self) -> BodyProcess:
        return BodyProcess(self.stage, PARAMETERS, self.take)

    def _headless_face(self, body: BodyProcess, recorder: Recorder | None) -> HeadlessFace:
        yield_to_servos()
        head = load_head(self.stage)
        values = HeadValues(body.mailbox, PARAMETERS, head.parameters)
        return HeadlessFace(head, self.stage.settings.face, values, recorder)

    def _report(self, face: dict[str, object], body: BodyProcess) -> dict[str, Any]:
        return {"stage": self.stage.settings.name, "face": face, **body.report, "written": []}

    def plan(self) -> list[dict[str, str]]:
        """What each channel would be sent: its chain in words and its angle for a neutral face."""
        return [row for robot in self.stage.robots for row in plan_rows(robot, PARAMETERS)]


def load_head(stage: Stage) -> Head:
    """The stage's head, ready to pose."""
    from surface.head import Head

    return Head.load(stage.head)


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write a report as JSON, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
