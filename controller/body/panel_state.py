"""State for the panel besides the values: the layer that holds each parameter, and what the servos show of it.

The body writes it ten times a second to a mailbox; main reads it when it draws.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.base.mailboxes import Mailbox
from controller.base.parameters import REGIONS, Parameters
from controller.robot.following import MeasuredFace
from controller.takes.recording import Face


def panel_state_size(parameters: Parameters) -> int:
    """Length of the mailbox's vector: holders (P), measured (P), degrees by region."""
    return 2 * len(parameters) + len(REGIONS)


class PanelStateWriter:
    """Writes the state in the body; the mailbox has :func:`panel_state_size` numbers."""

    def __init__(self, mailbox: Mailbox, state: Face, measured_face: MeasuredFace | None) -> None:
        self._mailbox, self._state, self._measured_face = mailbox, state, measured_face
        p = len(state.parameters)
        self._all = np.full(panel_state_size(state.parameters), np.nan)
        self._holders, self._measured, self._away = self._all[:p], self._all[p : 2 * p], self._all[2 * p :]
        self._mask = np.zeros(p, dtype=bool)

    def publish(self) -> None:
        """Write the state of this moment."""
        layers = {name: i for i, name in enumerate(self._state.layer_names())}
        self._holders[:] = [layers.get(self._state.holder(i) or "", -1) for i in range(len(self._holders))]
        if self._measured_face is not None:
            self._measured_face.read(self._measured, self._mask)
            self._measured[~self._mask] = np.nan
            away = self._measured_face.differences()
            self._away[:] = [away.get(region, np.nan) for region in REGIONS]
        self._mailbox.publish(self._all)


class PanelState:
    """Reads the state in main, where :meth:`refresh` is called once a frame; ``layers`` : their names, lowest first."""

    def __init__(self, mailbox: Mailbox, layers: Sequence[str], parameters: Parameters) -> None:
        self._mailbox, self._layers, self._p = mailbox, tuple(layers), len(parameters)
        self._all = np.full(panel_state_size(parameters), np.nan)

    def refresh(self) -> None:
        """Read what was written last; nothing is known before the first time."""
        if self._mailbox.sequence:
            self._mailbox.read(self._all)

    def holder(self, index: int) -> str:
        """The layer that holds a parameter; empty when none does or nothing is known."""
        layer = self._all[index]
        return self._layers[int(layer)] if layer >= 0 else ""

    def measured(self, index: int) -> float | None:
        """What the servos show of a parameter; None where that is not known."""
        return self._known(self._p + index)

    def away_deg(self, region: str) -> float | None:
        """How far the servos of a region are from their wanted angles (rms, degrees); None where not known."""
        return self._known(2 * self._p + REGIONS.index(region))

    def _known(self, index: int) -> float | None:
        value = self._all[index]
        return float(value) if np.isfinite(value) else None
