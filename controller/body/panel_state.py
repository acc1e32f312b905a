"""State for the panel besides the values: who holds each parameter, and at what, what the servos measure, who stopped
them.

The control process (body) writes it ten times a second to a mailbox; main reads it when it draws.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controller.base.mailboxes import Mailbox
from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.robot.following import MeasuredFace

_NAME_LENGTH = 64
"""Characters of the name of who stopped the servos; each is encoded as a number, since a mailbox carries numbers."""


class PanelState:
    """Reads and writes the state through a mailbox; main calls :meth:`refresh` once a frame.

    ``layers`` : names of all layers, lowest first.
    """

    def __init__(self, mailbox: Mailbox, layers: Sequence[str], parameters: Parameters) -> None:
        self._mailbox, self._layers, self._p = mailbox, tuple(layers), len(parameters)
        self._all = np.full(self.size(parameters), np.nan)
        self._regions = parameters.region_names
        ends = np.cumsum([self._p, self._p, self._p, len(self._regions)])
        self._holders, self._held, self._measured, self._differences, self._stopped = np.split(self._all, ends)

    @staticmethod
    def size(parameters: Parameters) -> int:
        """Return the length of the mailbox's vector: layers, held and measured values (P each), regions, a name."""
        return 3 * len(parameters) + len(parameters.region_names) + _NAME_LENGTH

    def publish(self, state: CommandState, measured_face: MeasuredFace | None) -> None:
        """Write the present state; ``measured_face`` is None without servos."""
        layers = {name: i for i, name in enumerate(self._layers)}
        self._holders[:] = [layers.get(state.holder(i) or "", -1) for i in range(self._p)]
        self._held[:] = np.nan
        for index, value in state.held().items():
            self._held[index] = value
        if measured_face is not None:
            known = np.zeros(self._p, dtype=bool)
            measured_face.read(self._measured, known)
            self._measured[~known] = np.nan
            differences = measured_face.differences()
            self._differences[:] = [differences.get(region, np.nan) for region in self._regions]
        stopped = state.stop_latch.stopped
        _encode_text(self._stopped, stopped.who if stopped is not None else "")
        self._mailbox.publish(self._all)

    def turn_to(self, other: PanelState) -> None:
        """Read from now on the mailbox of another head, which has the same parameters."""
        self._mailbox, self._layers = other._mailbox, other._layers
        self._all[:] = np.nan

    def refresh(self) -> None:
        """Read the newest state, if any was written."""
        if self._mailbox.sequence:
            self._mailbox.read(self._all)

    def holder(self, index: int) -> str:
        """Return the layer that holds a parameter; empty if none does or it is not known."""
        layer = self._holders[index]
        return self._layers[int(layer)] if layer >= 0 else ""

    def held(self) -> dict[int, float] | None:
        """Values of the parameters that are held by hand, by any panel or link; None where nothing is known yet."""
        if np.isnan(self._holders).all():
            return None
        return {int(i): float(self._held[i]) for i in np.flatnonzero(np.isfinite(self._held))}

    @property
    def stopped_by(self) -> str:
        """Who stopped the servos; empty while they may move."""
        return _decode_text(self._stopped)

    def measured(self, index: int) -> float | None:
        """Return the value of a parameter that the servos measure; None if not known."""
        return float(self._measured[index]) if np.isfinite(self._measured[index]) else None

    def show_measured(self, values: Floats) -> None:
        """Replace parameter values (P,) by the measured ones where these are known."""
        np.copyto(values, self._measured, where=np.isfinite(self._measured))

    def away_deg(self, region: str) -> float | None:
        """Return the difference (rms, degrees) of a region's servos from their wanted angles; None if not known."""
        value = self._differences[self._regions.index(region)]
        return float(value) if np.isfinite(value) else None


def _encode_text(out: Floats, text: str) -> None:
    """Write the code points of a text to ``out``, as many as fit, and NaN after them."""
    codes = [ord(letter) for letter in text[: len(out)]]
    out[:] = np.nan
    out[: len(codes)] = codes


def _decode_text(codes: Floats) -> str:
    return "".join(chr(int(code)) for code in codes[np.isfinite(codes)])
