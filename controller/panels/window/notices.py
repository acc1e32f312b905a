"""Draws reported problems and running jobs at the top of every tab."""

from __future__ import annotations

import time
from typing import Any

from controller.panels.overlay.colours import AMBER
from controller.panels.session.jobs import Jobs
from controller.panels.session.problems import Problems


def draw_problems(imgui: Any, problems: Problems) -> None:
    """Draw the newest problem, if there is one, with a button that dismisses it."""
    if not problems.unread:
        return
    newest, more = problems.unread[-1], len(problems.unread) - 1
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*AMBER))
    imgui.text_wrapped(newest.text + (f" ({newest.times} times)" if newest.times > 1 else ""))
    imgui.pop_style_color()
    if imgui.button("dismiss##problem"):
        problems.dismiss()
    if more:
        imgui.same_line()
        if imgui.button(f"all {more + 1}##problem"):
            problems.dismiss_all()
    imgui.separator()


def draw_jobs(imgui: Any, jobs: Jobs) -> None:
    """Draw a progress bar and a cancel button for each job."""
    for job in [job for job in jobs.running if not job.cancelled]:
        imgui.progress_bar(-0.5 * (time.monotonic() - job.since_s) - 1e-3, imgui.ImVec2(-1, 0), job.title)
        if imgui.button(f"cancel##{job.title}"):
            job.cancelled = True
