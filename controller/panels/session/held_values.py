"""What is held by hand, in this window or by other panels and links, and how both agree again after a change."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from controller.body.panel_state import PanelState
from controller.panels.session.commands import Commands

PATIENCE_S = 1.0
"""For so long after a value was set here, another one that the control process (body) reports may be older."""
LOST_S = 10.0
"""For so long it may not report a new value at all, as while it opens links and servos."""


class HeldValues:
    """Values at which parameters are held by hand; :meth:`update` is called once a frame.

    A value that was set here counts until the body has reported it, or for a while if it does not. After that what the
    body reports counts: what others have changed or released is changed or released in the settings here, too.

    state : what the body reports; without it only the settings here are known. clock : seconds.
    """

    def __init__(
        self, commands: Commands, state: PanelState | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._commands, self._state, self._clock = commands, state, clock
        self._own: Mapping[int, float] = commands.now.held
        self._switches = commands.head_switches
        self._pending: dict[int, float] = {}  # index -> when it was set
        self._reported: Mapping[int, float] | None = None

    def get(self, index: int) -> float | None:
        """Return the value at which a parameter is held; None where it is not."""
        own = self._commands.now.held
        if self._reported is None or own is not self._own or index in self._pending:
            return own.get(index)
        return self._reported.get(index)

    def update(self) -> None:
        """Take over what the body reports, but not what is older than the settings here."""
        self._note_own_changes()
        self._reported = None if self._state is None else self._state.held()
        if self._reported is None:
            return
        changes: dict[int, float | None] = {}
        for index in self._own.keys() | self._pending.keys():
            own, reported = self._own.get(index), self._reported.get(index)
            if own == reported:
                self._pending.pop(index, None)
            elif not self._is_awaited(index, reported):
                self._pending.pop(index, None)
                if own is not None:
                    changes[index] = reported
        if changes:
            self._commands.adopt(changes)
            self._own = self._commands.now.held

    def _note_own_changes(self) -> None:
        """Note which values were set or released here since the last call, and when."""
        before, self._own = self._own, self._commands.now.held
        if self._switches != self._commands.head_switches:  # the body has known those of the other head for long
            self._switches = self._commands.head_switches
            self._pending.clear()
        elif before is not self._own:
            now = self._clock()
            for index in before.keys() | self._own.keys():
                if before.get(index) != self._own.get(index):
                    self._pending[index] = now

    def _is_awaited(self, index: int, reported: float | None) -> bool:
        """Whether the body may not have reported yet what was set here."""
        if index not in self._pending:
            return False
        limit_s = LOST_S if reported is None else PATIENCE_S
        return self._clock() - self._pending[index] < limit_s
