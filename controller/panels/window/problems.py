"""What went wrong, for the panel: each message once, with its next step, until the user has read it.

Independent of the window library, but for :func:`draw_problems`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from controller.base.parts import describe
from controller.panels.window.colours import AMBER

_MOST = 100


@dataclass
class Problem:
    """One message and how often it came."""

    text: str
    times: int = 1


class Problems:
    """Those that were not read yet, oldest first."""

    def __init__(self) -> None:
        self.unread: list[Problem] = []

    def add(self, what: str | BaseException) -> None:
        """Add a message, or an error with its hint; one that is unread already is counted."""
        text = what if isinstance(what, str) else describe(what)
        for problem in self.unread:
            if problem.text == text:
                problem.times += 1
                return
        self.unread.append(Problem(text))
        del self.unread[:-_MOST]

    def dismiss(self) -> None:
        """The newest was read."""
        if self.unread:
            self.unread.pop()

    def dismiss_all(self) -> None:
        """All were read."""
        self.unread.clear()


def draw_problems(imgui: Any, problems: Problems) -> None:
    """Draw the newest with a button that dismisses it; nothing without any."""
    if not problems.unread:
        return
    newest, more = problems.unread[-1], len(problems.unread) - 1
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*AMBER))
    imgui.text_wrapped(newest.text + (f" ({newest.times} times)" if newest.times > 1 else ""))
    imgui.pop_style_color()
    if imgui.button("read##problem"):
        problems.dismiss()
    if more:
        imgui.same_line()
        if imgui.button(f"all {more + 1}##problem"):
            problems.dismiss_all()
    imgui.separator()
