"""How the head and the picture follow each other: what a driven head lags behind, and what a limp one shows."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np

from controller.base.parameters import REGIONS, Flags, Floats, Parameters
from controller.layers.commands import CommandState, StatusValue
from controller.robot.channels import ChannelTable
from controller.robot.mirror import Mirror
from drivers.base.bus import BusState


class Following:
    """The difference between the face that was wanted and the one the servos were measured to make.

    Parameters
    ----------
    names : the channels. regions : of the face, one a channel; none without.
    """

    def __init__(self, names: Sequence[str], regions: Sequence[str] = ()) -> None:
        self._names, self._regions = tuple(names), tuple(regions)
        self._now: Floats | None = None
        self._squares, self._most = np.zeros(len(names)), np.zeros(len(names))
        self._count = np.zeros(len(names), dtype=np.int64)

    def note(self, wanted_rad: Floats, state: BusState) -> None:
        """Take one cycle: wanted angles (n,) rad, and what was measured; stale positions do not count."""
        good = state.fresh & np.isfinite(state.position_rad)
        away = np.where(good, np.abs(state.position_rad - wanted_rad), 0.0)
        self._now = np.degrees(np.where(good, away, np.nan))
        self._squares += away**2
        np.maximum(self._most, away, out=self._most)
        self._count += good

    def now(self) -> list[tuple[str, float]]:
        """Region and difference (deg) of every channel that was measured in the last cycle."""
        away = self._now
        if away is None:
            return []
        return [(region, float(x)) for region, x in zip(self._regions, away, strict=False) if np.isfinite(x)]

    def report(self) -> dict[str, object]:
        """Root mean square (deg) over all channels and by region, and the three channels that were furthest away."""
        if not self._count.any():
            return {}
        rms = np.degrees(np.sqrt(self._squares / np.maximum(self._count, 1)))
        worst = np.argsort(-rms)[:3]
        return {
            "rms_deg": float(np.degrees(np.sqrt(self._squares.sum() / self._count.sum()))),
            "regions_rms_deg": {region: self._region_rms(region) for region in REGIONS if region in self._regions},
            "worst": [
                {"channel": self._names[i], "rms_deg": float(rms[i]), "max_deg": float(np.degrees(self._most[i]))}
                for i in worst
            ],
        }

    def _region_rms(self, region: str) -> float:
        own = np.array([each == region for each in self._regions])
        return float(np.degrees(np.sqrt(self._squares[own].sum() / max(int(self._count[own].sum()), 1))))


def regions_of(table: ChannelTable, parameters: Parameters) -> list[str]:
    """(n,) the region of the parameter each channel follows most."""
    return [parameters.regions[int(np.argmax(np.abs(row)))] for row in table.linear]


class MeasuredFace:
    """The face that the servos were measured to make, whatever it was that moved them; asked from any thread.

    Parameters
    ----------
    tables : the channels of each bus. measured : gives the newest measurement of each, None before the first.
    following : of each bus, for the difference.

    Attributes
    ----------
    touched : (P,) bool, the parameters that any channel follows.
    """

    def __init__(
        self,
        tables: Sequence[ChannelTable],
        measured: Sequence[Callable[[], BusState | None]],
        parameters: Parameters,
        following: Sequence[Following] = (),
    ) -> None:
        self._mirrors = [(Mirror(table, parameters), read) for table, read in zip(tables, measured, strict=True)]
        self._touched = [np.abs(table.linear).sum(axis=0) > 0.0 for table in tables]
        self._following, self._parameters = following, parameters
        self.touched = np.any([np.zeros(len(parameters), dtype=bool), *self._touched], axis=0)
        self._lock = threading.Lock()
        for mirror, _ in self._mirrors:  # the solver is made ready before the clock runs
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
        """See :class:`controller.layers.commands.CommandSink`; what no servo shows is 0."""
        out.fill(0.0)
        return self.read(out, np.zeros(len(out), dtype=bool))

    def differences(self) -> dict[str, float]:
        """How far the servos of each region are from where they were wanted at this moment (rms, degrees)."""
        found: dict[str, list[float]] = {}
        for following in self._following:
            for region, away in following.now():
                found.setdefault(region, []).append(away)
        return {region: float(np.sqrt(np.mean(np.square(found[region])))) for region in REGIONS if region in found}

    def status(self) -> dict[str, StatusValue]:
        """How far the servos are from where they were wanted: everywhere, and by region (rms, degrees)."""
        away = self.differences()
        every = [each for following in self._following for _, each in following.now()]
        if not every:
            return {"away_deg": "unknown"}
        found: dict[str, StatusValue] = {"away_deg": round(float(np.sqrt(np.mean(np.square(every)))), 2)}
        return found | {f"away_{region}_deg": round(value, 2) for region, value in away.items()}


class FollowMode:
    """A limp head that is moved by hand: what is measured goes to the capture layer, and the face follows.

    Parameters
    ----------
    reflection : reads the head.
    """

    def __init__(self, reflection: MeasuredFace, parameters: Parameters) -> None:
        self._measured_face = reflection
        self._values, self._mask = parameters.neutral(), np.zeros(len(parameters), dtype=bool)

    def tick(self, state: CommandState, now_ns: int) -> None:
        """Write the face that the servos make now."""
        if self._measured_face.read(self._values, self._mask):
            state.capture(self._values, self._mask, now_ns, now_ns)
