"""What went wrong, for the panel: each message once, with its next step, until the user has read it."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from controller.base.parts import describe

log = logging.getLogger(__name__)

_MAX_PROBLEMS = 100


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
        del self.unread[:-_MAX_PROBLEMS]

    def log_all(self) -> None:
        """Log all as errors and dismiss them, where no panel shows them."""
        for problem in self.unread:
            log.error("%s", problem.text)
        self.dismiss_all()

    def dismiss(self) -> None:
        """The newest was read."""
        if self.unread:
            self.unread.pop()

    def dismiss_all(self) -> None:
        """All were read."""
        self.unread.clear()
