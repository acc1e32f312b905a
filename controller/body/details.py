"""What the window's panel shows besides the face: servos, links, buses, failed parts, and what was logged."""

from __future__ import annotations

import logging
import threading
from collections import deque
from typing import TYPE_CHECKING

from controller.body.messages import Details

if TYPE_CHECKING:
    from controller.body.body import Body

_MOST = 50


class Notes(logging.Handler):
    """Keeps the newest warnings and errors of this process until they are taken; any thread may log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._kept: deque[str] = deque(maxlen=_MOST)
        self._taking = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one."""
        with self._taking:
            self._kept.append(record.getMessage())

    def take(self) -> list[str]:
        """Those since the last time, oldest first; 50 at most."""
        with self._taking:
            taken = list(self._kept)
            self._kept.clear()
        return taken


def details_of(body: Body) -> Details:
    """What a body's servos, links and parts report now."""
    overview = body.state.overview()
    return Details(
        servos=overview["servos"],
        links=[{"name": link.name.removeprefix("link "), **link.report()} for link in body.links],
        buses=[loop.condition() for loop in body.buses],
        parts=body.state.parts.report(),
        notes=body.notes.take(),
    )
