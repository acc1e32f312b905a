"""How the head and the picture follow each other: what a driven head lags behind, and what a limp one shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from controller.channels import ChannelTable
from controller.mirror import Mirror
from controller.parameters import Floats, Parameters
from controller.recording import Face
from drivers.bus import BusState


class Following:
    """The difference between the face that was wanted and the one the servos were measured to make.

    Parameters
    ----------
    names : the channels.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._squares, self._most = np.zeros(len(names)), np.zeros(len(names))
        self._count = np.zeros(len(names), dtype=np.int64)

    def note(self, wanted_rad: Floats, state: BusState) -> None:
        """Take one cycle: wanted angles (n,) rad, and what was measured; stale positions do not count."""
        good = state.fresh & np.isfinite(state.position_rad)
        away = np.where(good, np.abs(state.position_rad - wanted_rad), 0.0)
        self._squares += away**2
        np.maximum(self._most, away, out=self._most)
        self._count += good

    def report(self) -> dict[str, object]:
        """Root mean square over all channels (deg), and the three channels that were furthest away."""
        if not self._count.any():
            return {}
        rms = np.degrees(np.sqrt(self._squares / np.maximum(self._count, 1)))
        worst = np.argsort(-rms)[:3]
        return {
            "rms_deg": float(np.degrees(np.sqrt(self._squares.sum() / self._count.sum()))),
            "worst": [
                {"channel": self._names[i], "rms_deg": float(rms[i]), "max_deg": float(np.degrees(self._most[i]))}
                for i in worst
            ],
        }


class Puppet:
    """A limp head that is moved by hand: what is measured goes to the capture layer, and the face follows.

    Parameters
    ----------
    tables : the channels of each bus. measured : gives the newest measurement of each, None before the first.
    """

    def __init__(
        self,
        tables: Sequence[ChannelTable],
        measured: Sequence[Callable[[], BusState | None]],
        parameters: Parameters,
    ) -> None:
        self._mirrors = [(Mirror(table, parameters), read) for table, read in zip(tables, measured, strict=True)]
        self._touched = [np.abs(m.linear).sum(axis=0) > 0.0 for m in tables]
        for mirror, _ in self._mirrors:  # the solver is made ready before the clock runs
            mirror.read(np.zeros(len(mirror.readable)))
        self._values, self._mask = parameters.neutral(), np.zeros(len(parameters), dtype=bool)

    def tick(self, state: Face, now_ns: int) -> None:
        """Write the face that the servos make now."""
        self._mask.fill(False)
        stamp = 0
        for (mirror, read), touched in zip(self._mirrors, self._touched, strict=True):
            found = read()
            if found is None or not found.fresh.any():
                continue
            np.copyto(self._values, mirror.read(found.position_rad, found.fresh), where=touched)
            self._mask |= touched
            stamp = now_ns
        if stamp:
            state.capture(self._values, self._mask, now_ns, stamp)
