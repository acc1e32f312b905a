"""Reopens a process's Zenoh session if the network has lost its declarations.

Over a link that loses messages (UDP), Zenoh sends a declaration only once. If the declaration of a key is lost, the
router refuses later declarations that use the key's number for the whole session, so only a new session helps.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from controller.fleet.hearing import Hearing
from controller.fleet.offset import Clocks
from controller.fleet.silence import Silence
from controller.fleet.wire import ALL, Wire

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

log = logging.getLogger(__name__)

_SILENT_S = 0.4
"""A head that receives no face for this time is silent. Replacing a conductor on an idle machine takes less."""
_DEAF_S = 0.3
"""Time after which a silent head is deaf, if its conductor answers queries."""
_MAX_PAUSE_S = 30.0
"""Longest pause between two new sessions, since a conductor may have no face for the head at all."""
_ANSWERED_S = 1.5
"""A conductor counts as present for this time after its last answer."""


class Rejoining:
    """Decides when the session of ``wire`` is reopened, from the faces in ``hearing`` and the answers in ``clocks``.

    Not for a process that may conduct, because its control loop sends through the session.

    open_again : opens another session; an error is raised by :meth:`check`, and a later call tries again.
    """

    def __init__(
        self, wire: Wire, hearing: Hearing, clocks: Clocks, open_again: Callable[[], zenoh.Session], now_s: float
    ) -> None:
        self._wire, self._hearing, self._clocks, self._open_again = wire, hearing, clocks, open_again
        self._heard = Silence(_DEAF_S, _MAX_PAUSE_S, now_s)

    def silent(self, now_s: float) -> bool:
        """Whether a head has received no face for some time."""
        return now_s - self._hearing.silent()[1] >= _SILENT_S

    def check(self, now_s: float) -> None:
        """Reopen the session if that is due; call it often."""
        name, since_s = self._hearing.silent()
        if not self._is_deaf(now_s, since_s):
            self._heard.hear(now_s)
        if self._heard.due(now_s):
            if self._heard.acts == 1:
                whose = "all heads" if name == ALL else f"head {name}"
                log.warning("zenoh: a conductor answers, but no face of %s arrives; opening the session again", whose)
            self._wire.move(self._open_again())

    def _is_deaf(self, now_s: float, since_s: float) -> bool:
        """Whether a head is silent although a conductor has answered recently, and after the silence began."""
        answered_s = 1e-9 * self._clocks.answered_ns
        return answered_s - since_s > _SILENT_S and now_s - answered_s < _ANSWERED_S
