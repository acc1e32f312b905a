"""Opens a process's session again where the network has lost what it declared.

Over a link that loses messages (UDP) Zenoh sends a declaration once. Where that of a key is lost, the router refuses
whatever is declared by the key's number later, as long as the session lasts; so only another session helps.
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
"""Without a face for so long a head is silent, longer than it takes to replace a conductor on an idle machine."""
_DEAF_S, _DEAF_PAUSE_S = 0.3, 30.0
"""A silent head whose conductor answers questions for so long is deaf; longest pause between two sessions, as a
conductor may have no face for it at all."""
_ANSWERED_S = 1.5
"""A conductor that answered so long ago is there."""


class Rejoining:
    """Decides when the session of ``wire`` is opened again, by what ``hearing`` and ``clocks`` know.

    open_again : opens another session; what cannot be opened is tried again. Not for a process that conducts: its
    control loop sends by the session, and where it hears nobody it conducts by itself.
    """

    def __init__(
        self, wire: Wire, hearing: Hearing, clocks: Clocks, open_again: Callable[[], zenoh.Session], now_s: float
    ) -> None:
        self._wire, self._hearing, self._clocks, self._open_again = wire, hearing, clocks, open_again
        self._heard = Silence(_DEAF_S, _DEAF_PAUSE_S, now_s)

    def silent(self, now_s: float) -> bool:
        """Whether a head has heard no face for some time."""
        return now_s - self._hearing.silent()[1] >= _SILENT_S

    def check(self, now_s: float) -> None:
        """Called often: open the session again if that is due."""
        name, since_s = self._hearing.silent()
        if not self._is_deaf(now_s, since_s):
            self._heard.hear(now_s)
        if self._heard.due(now_s):
            if self._heard.acts == 1:
                whose = "all heads" if name == ALL else f"head {name}"
                log.warning("zenoh: a conductor answers, but no face of %s arrives; opening the session again", whose)
            self._wire.move(self._open_again())

    def _is_deaf(self, now_s: float, since_s: float) -> bool:
        """Whether a head is silent while a conductor answers, as it did after the silence had begun."""
        answered_s = 1e-9 * self._clocks.answered_ns
        return answered_s - since_s > _SILENT_S and now_s - answered_s < _ANSWERED_S
