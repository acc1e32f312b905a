"""Compares the measured positions of the servos with the wanted ones, and shows them as a face."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import REGIONS, Flags, Floats, Parameters
from controller.layers.commands import StatusValue
from controller.robot.channels import ChannelTable
from controller.robot.mirror import Mirror
from controller.takes.recording import Face
from drivers.base.bus import BusState


def _rms(squares: Floats, counts: NDArray[np.int64] | int) -> float:
    return float(np.sqrt(squares.sum() / np.maximum(np.sum(counts), 1)))


class FollowingStatistics:
    """Statistics of the difference between the wanted angles of a bus's channels and the measured ones.

    ``names`` : the channels. ``regions`` : of the face, one for each channel; may be left out.
    """

    def __init__(self, names: Sequence[str], regions: Sequence[str] = ()) -> None:
        self._names, self._regions = tuple(names), tuple(regions)
        self._now: Floats | None = None
        self._squares, self._most = np.zeros(len(names)), np.zeros(len(names))
        self._count = np.zeros(len(names), dtype=np.int64)

    def add(self, wanted_rad: Floats, state: BusState) -> None:
        """Add one cycle: wanted angles (n,) rad, and the measured ones; stale positions do not count."""
        good = state.fresh & np.isfinite(state.position_rad)
        away = np.where(good, np.degrees(np.abs(state.position_rad - wanted_rad)), 0.0)
        self._now = np.where(good, away, np.nan)
        self._squares += away**2
        np.maximum(self._most, away, out=self._most)
        self._count += good

    def now(self) -> list[tuple[str, float]]:
        """Region and difference (deg) of every channel that was measured in the last cycle."""
        if self._now is None:
            return []
        return [(region, float(x)) for region, x in zip(self._regions, self._now, strict=False) if np.isfinite(x)]

    def report(self) -> dict[str, object]:
        """Root mean square (deg) over all channels and by region, and the three channels that were furthest away."""
        if not self._count.any():
            return {}
        rms = np.sqrt(self._squares / np.maximum(self._count, 1))
        regions = np.array(self._regions)
        return {
            "rms_deg": _rms(self._squares, self._count),
            "regions_rms_deg": {
                region: _rms(self._squares[regions == region], self._count[regions == region])
                for region in REGIONS
                if region in self._regions
            },
            "worst": [
                {"channel": self._names[i], "rms_deg": float(rms[i]), "max_deg": float(self._most[i])}
                for i in np.argsort(-rms)[:3]
            ],
        }


def regions_of(table: ChannelTable, parameters: Parameters) -> list[str]:
    """(n,) the region of the parameter that each channel follows most."""
    return [parameters.regions[int(np.argmax(np.abs(row)))] for row in table.linear]


class MeasuredFace:
    """The face that the measured positions of all servos show, whatever moved them; may be read from any thread.

    Parameters
    ----------
    tables : the channels of each bus. measured : returns the newest measurement of each, None before the first.
    following : the statistics of each bus.
    """

    def __init__(
        self,
        tables: Sequence[ChannelTable],
        measured: Sequence[Callable[[], BusState | None]],
        parameters: Parameters,
        following: Sequence[FollowingStatistics] = (),
    ) -> None:
        self._mirrors = [(Mirror(table, parameters), read) for table, read in zip(tables, measured, strict=True)]
        self._touched = [np.abs(table.linear).sum(axis=0) > 0.0 for table in tables]
        self._following = following
        self._lock = threading.Lock()
        for mirror, _ in self._mirrors:  # the solver is compiled before the clock runs
            mirror.read(np.zeros(len(mirror.readable)))

    def read(self, out: Floats, mask: Flags) -> bool:
        """Write the face to ``out`` : (P,) and which parameters it knows to ``mask`` : (P,); False for none."""
        mask.fill(False)
        with self._lock:
            for (mirror, read), touched in zip(self._mirrors, self._touched, strict=True):
                found = read()
                if found is None or not (found.fresh & np.isfinite(found.position_rad)).any():
                    continue
                np.copyto(out, mirror.read(found.position_rad, found.fresh), where=touched)
                mask |= touched
        return bool(mask.any())

    def measured(self, out: Floats) -> bool:
        """See :class:`controller.layers.commands.CommandSink`; parameters without a servo are 0."""
        out.fill(0.0)
        return self.read(out, np.zeros(len(out), dtype=bool))

    def capture(self, state: Face, now_ns: int) -> None:
        """Write the face to the capture layer, so that the picture follows a limp head that is moved by hand."""
        values, mask = state.parameters.neutral(), np.zeros(len(state.parameters), dtype=bool)
        if self.read(values, mask):
            state.capture(values, mask, now_ns, now_ns)

    def differences(self) -> dict[str, float]:
        """How far the servos of each region are from their wanted angles now (rms, degrees)."""
        found: dict[str, list[float]] = {}
        for following in self._following:
            for region, away in following.now():
                found.setdefault(region, []).append(away)
        return {region: _rms(np.square(found[region]), len(found[region])) for region in REGIONS if region in found}

    def status(self) -> dict[str, StatusValue]:
        """How far the servos are from their wanted angles now: all together, and by region (rms, degrees)."""
        every = np.array([each for following in self._following for _, each in following.now()])
        if not len(every):
            return {"away_deg": "unknown"}
        found: dict[str, StatusValue] = {"away_deg": round(_rms(every**2, len(every)), 2)}
        return found | {f"away_{region}_deg": round(value, 2) for region, value in self.differences().items()}
