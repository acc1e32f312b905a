"""Compares measured positions of servos with the wanted ones, and finds the face that the servos show."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Flags, Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.layers.commands import CommandState, StatusValue
from controller.robot.channels import ChannelTable
from controller.robot.likely import LikelyFace
from drivers.base.bus import BusState

_RIDGE, _TOLERANCE = 1e-4, 1e-5
_MAX_STEPS = 8
_CLOSE = 1e-3  # rms, as a fraction of each channel's range, below which a face fits
_MAX_ERROR = 0.01  # rms, as a fraction of each channel's range


def _rms(squares: Floats, counts: NDArray[np.int64] | int) -> float:
    return float(np.sqrt(squares.sum() / np.maximum(np.sum(counts), 1)))


class FollowingStatistics:
    """Statistics of the difference between the wanted angles of a bus's channels and the measured ones.

    A channel belongs to the region of the face of the parameter that it follows most.
    """

    def __init__(self, table: ChannelTable, parameters: Parameters) -> None:
        self._names, self._region_names = table.names, parameters.region_names
        self._regions = np.array([parameters.regions[int(np.argmax(np.abs(row)))] for row in table.linear])
        self._now: Floats | None = None
        self._squares, self._max_deg = np.zeros((2, len(table.names)))
        self._count = np.zeros(len(table.names), dtype=np.int64)

    def add(self, wanted_rad: Floats, state: BusState) -> None:
        """Add the wanted angles (n,) rad and the measured ones of one cycle; stale positions are ignored."""
        good = state.fresh & np.isfinite(state.position_rad) & np.isfinite(wanted_rad)
        error_deg = np.where(good, np.degrees(np.abs(state.position_rad - wanted_rad)), 0.0)
        self._now = np.where(good, error_deg, np.nan)
        self._squares += error_deg**2
        np.maximum(self._max_deg, error_deg, out=self._max_deg)
        self._count += good

    def now(self) -> list[tuple[str, float]]:
        """Region and difference (deg) of every channel that was measured in the last cycle."""
        if self._now is None:
            return []
        return [(str(region), float(x)) for region, x in zip(self._regions, self._now, strict=True) if np.isfinite(x)]

    def report(self) -> dict[str, object]:
        """Root mean square (deg) over all channels and by region, and the three channels that were furthest away."""
        if not self._count.any():
            return {}
        rms = np.sqrt(self._squares / np.maximum(self._count, 1))
        return {
            "rms_deg": _rms(self._squares, self._count),
            "regions_rms_deg": {
                region: _rms(self._squares[self._regions == region], self._count[self._regions == region])
                for region in self._region_names
                if region in self._regions
            },
            "worst": [
                {"channel": self._names[i], "rms_deg": float(rms[i]), "max_deg": float(self._max_deg[i])}
                for i in np.argsort(-rms)[:3]
            ],
        }


class Mirror:
    """Finds parameters for which the channels have the measured angles.

    A servo head has fewer degrees of freedom than a face, so many faces have the same angles. The likely one is chosen,
    made of few known expressions and few parameters (:class:`controller.robot.likely.LikelyFace`), and corrected until
    it has the angles. Eyes give the parameters of eye angles, never the eyeLook shapes.

    faces : (k, P) what each known expression adds to the neutral face. Default: none.
    readable : (n,) bool, the channels that can be inverted: those whose map is strictly monotonic.
    """

    def __init__(self, table: ChannelTable, parameters: Parameters, faces: Floats | None = None) -> None:
        self._table = table
        high = parameters.high.copy()
        high[[i for i, name in enumerate(parameters.names) if name.startswith("eyeLook")]] = 0.0
        self._bounds = parameters.low, high
        self._at, self._rad = _points(table)
        self._ends = self._at[:, 0], self._at[:, -1]
        self._span = np.maximum(self._ends[1] - self._ends[0], 1e-9)
        steps = np.diff(self._rad, axis=1)
        real = np.diff(self._at, axis=1) > 0.0
        self.readable = np.array([_is_monotonic(row[keep]) for row, keep in zip(steps, real, strict=True)])
        self._rest = self._last = parameters.neutral()
        faces = np.zeros((0, len(parameters))) if faces is None else faces * table.reached  # what servos can show
        faces = faces[np.abs(faces).sum(axis=1) > 0.0]
        self._likely = LikelyFace(
            table.mixed, table.linear, faces, rest=self._rest, bounds=self._bounds, ends=self._ends
        )
        self._step = lru_cache(64)(self._make_step)  # most cycles use the same channels

    def read(self, angles_rad: Floats, fresh: Flags | None = None) -> Floats:
        """Return the parameters (P,) that fit ``angles_rad`` : (n,) best; angles not ``fresh`` : (n,) are ignored."""
        counted = self.readable & np.isfinite(angles_rad)
        if fresh is not None:
            counted &= fresh
        wanted = np.where(counted, self._mixes(angles_rad), 0.0)
        found = self._approach(self._likely.find(wanted, counted), wanted, counted)
        if self._table.bound and self._fit_error(found, wanted, counted) > _MAX_ERROR:
            # another branch of a condition or linkage may fit
            others = [self._approach(start, wanted, counted) for start in (self._last, self._rest)]
            found = min((found, *others), key=lambda each: self._fit_error(each, wanted, counted))
        self._last = found
        return found.copy()

    def _approach(self, start: Floats, wanted: Floats, counted: Flags) -> Floats:
        """Move parameters (P,) from ``start`` as little as needed until their mixes fit, by bounded Gauss-Newton steps.

        A step that does not improve the fit is shortened.
        """
        at, error = start, self._fit_error(start, wanted, counted)
        for _ in range(_MAX_STEPS):
            if error < _CLOSE:
                return at
            goal = np.clip(at + self._way(at, wanted, counted), *self._bounds)
            for fraction in (1.0, 0.5, 0.25, 0.1):
                candidate = at + fraction * (goal - at)
                if (new_error := self._fit_error(candidate, wanted, counted)) < error:
                    break
            else:
                return at
            at, gain, error = candidate, error - new_error, new_error
            if gain < 1e-3 * _MAX_ERROR:
                return at
        return at

    def _way(self, at: Floats, wanted: Floats, counted: Flags) -> Floats:
        """(P,) the smallest change of parameters from ``at`` that makes up for what the mixes lack."""
        lacking = self._lacking(at, wanted, counted)
        if not self._table.bound:
            return self._step(counted.tobytes()) @ lacking
        weights = counted.astype(np.float64)
        low, high = self._bounds
        return BoundedSolver(self._table.slopes(at), low - at, high - at, weights=weights, ridge=_RIDGE,
                             tolerance=_TOLERANCE).solve(lacking)  # fmt: skip

    def _lacking(self, values: Floats, wanted: Floats, counted: Flags) -> Floats:
        """(n,) wanted mixes less those of parameters (P,), which show at most the ends of their curves."""
        shown = np.clip(np.nan_to_num(self._table.mixed(values)), *self._ends)
        return np.where(counted, wanted - shown, 0.0)

    def _fit_error(self, values: Floats, wanted: Floats, counted: Flags) -> float:
        """Difference of the mixes from the wanted ones, rms over channels, as a fraction of each channel's range."""
        difference = self._lacking(values, wanted, counted) / self._span
        return float(np.sqrt((difference**2).sum() / max(int(counted.sum()), 1)))

    def _mixes(self, angles_rad: Floats) -> Floats:
        """(n,) mixes for which the channels have the angles, inside the calibrated points; 0 where unreadable."""
        mixes = np.zeros(len(angles_rad))
        for i, angle in enumerate(angles_rad):
            if self.readable[i] and np.isfinite(angle):
                rad, at = self._rad[i], self._at[i]
                mixes[i] = np.interp(angle, rad, at) if rad[-1] > rad[0] else np.interp(-angle, -rad, at)
        return mixes

    def _make_step(self, counted: bytes) -> Floats:
        """(P, n) smallest change of parameters per unit of each mix; ``counted`` : flags of the channels, as bytes."""
        slopes = self._table.linear * np.frombuffer(counted, bool)[:, None]
        step: Floats = slopes.T @ np.linalg.inv(slopes @ slopes.T + _RIDGE * np.eye(len(slopes)))
        return step


def _points(table: ChannelTable) -> tuple[Floats, Floats]:
    """Calibrated points (n, k + 1) of mix and angle (rad); shorter curves are padded with their last point."""
    curves = table.curves
    ends = np.where(curves.widths > 0.0, curves.knots + curves.widths, -np.inf)
    at = np.maximum.accumulate(np.concatenate([curves.knots[:, :1], ends], axis=1), axis=1)
    rise = np.cumsum(curves.widths * curves.slopes, axis=1)
    return at, curves.start[:, None] + np.concatenate([np.zeros((len(at), 1)), rise], axis=1)


def _is_monotonic(steps: Floats) -> bool:
    return len(steps) > 0 and bool(np.all(steps > 0.0) or np.all(steps < 0.0))


class MeasuredFace:
    """The face that the measured positions of all servos show, whatever moved them; may be read from any thread.

    tables : the channels of each bus. measured : returns the newest measurement of each, None before the first.
    following : the statistics of each bus, for :meth:`differences` and :meth:`status`.
    faces : (k, P) what each known expression adds to the neutral face, for :class:`Mirror`.
    """

    def __init__(
        self,
        tables: Sequence[ChannelTable],
        measured: Sequence[Callable[[], BusState | None]],
        parameters: Parameters,
        following: Sequence[FollowingStatistics] = (),
        faces: Floats | None = None,
    ) -> None:
        self._mirrors = [(Mirror(table, parameters, faces), read) for table, read in zip(tables, measured, strict=True)]
        self._touched = [table.reached for table in tables]
        self._following, self._region_names = following, parameters.region_names
        self._rest = parameters.neutral()
        self._lock = threading.Lock()
        for mirror, _ in self._mirrors:  # compiles the solvers before the first cycle
            mirror.read(np.zeros(len(mirror.readable)))

    def read(self, out: Floats, mask: Flags) -> bool:
        """Write the face to ``out`` : (P,), and flags of the parameters that are known to ``mask`` : (P,).

        Return whether any is known.
        """
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
        """Write the face to ``out``; parameters without a servo are neutral. Return whether any is known.

        See :class:`controller.layers.commands.CommandSink`.
        """
        np.copyto(out, self._rest)
        return self.read(out, np.zeros(len(out), dtype=bool))

    def capture(self, state: CommandState, now_ns: int) -> None:
        """Write the face to the capture layer, so that the picture follows a head that is moved by hand."""
        values, mask = state.parameters.neutral(), np.zeros(len(state.parameters), dtype=bool)
        if self.read(values, mask):
            state.capture(values, mask, now_ns, now_ns)

    def differences(self) -> dict[str, float]:
        """Difference of the servos from their wanted angles now, by region (rms, degrees)."""
        found: dict[str, list[float]] = {}
        for following in self._following:
            for region, away in following.now():
                found.setdefault(region, []).append(away)
        return {
            region: _rms(np.square(found[region]), len(found[region]))
            for region in self._region_names
            if region in found
        }

    def status(self) -> dict[str, StatusValue]:
        """Difference of the servos from their wanted angles now (rms, degrees): over all, and by region."""
        every = np.array([each for following in self._following for _, each in following.now()])
        if not len(every):
            return {"away_deg": "unknown"}
        found: dict[str, StatusValue] = {"away_deg": round(_rms(every**2, len(every)), 2)}
        return found | {f"away_{region}_deg": round(value, 2) for region, value in self.differences().items()}
