"""Defines takes (recorded faces), reads those of Live Link Face from CSV files, and plays takes at their own rate.

Undocumented properties of Live Link Face, measured on public takes: the timecode counts frames of 1/60 s even in takes
of 30 Hz; rows are missing; values may exceed 1; head angles that are zero throughout mean "not recorded"; eye angles
repeat the eyeLook columns; and left and right are swapped in JawLeft/JawRight and MouthLeft/MouthRight.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.errors import ParameterError, TakeError
from controller.base.parameters import Flags, Floats, Indices, Parameters, fold
from controller.layers.commands import CommandState
from controller.takes.csvtable import header_of, read_csv

_FRAMES_PER_S = 60.0
_DAY_S = 86_400.0
_TIMECODE = re.compile(r"\s*(\d{1,2}):(\d{1,2}):(\d{1,2}):(\d{1,2}(?:\.\d*)?)\s*")
_SWAPPED = {"jawLeft": "jawRight", "jawRight": "jawLeft", "mouthLeft": "mouthRight", "mouthRight": "mouthLeft"}
_HEAD = ("headYaw", "headPitch", "headRoll")
_EYES = ("leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch")
_NEGATED = ("headYaw", "leftEyeYaw", "rightEyeYaw")
"""Angles of the opposite sign: yaw is positive to the subject's right (measured for the eyes, assumed for the head)."""
_HINT = "a Live Link Face take begins with the line Timecode,BlendShapeCount,EyeBlinkLeft,..."


@dataclass(frozen=True, eq=False)
class Take:
    """A recorded take.

    name : file name. times_s : (n,) float64, ascending, beginning at 0. values : (n, P) float64, normalised but not
    clipped. mask : (P,) bool, which parameters the take drives. low, high : (P,) range to which :meth:`sample` clips.
    through : (P,) weight 0..1 with which the layers below show through; None for 0.
    """

    name: str
    times_s: Floats
    values: Floats
    mask: Flags
    low: Floats
    high: Floats
    through: Floats | None = None

    @classmethod
    def load(
        cls, path: Path, parameters: Parameters, *, swap_jaw_mouth_lr: bool = True, use_eye_angles: bool = False
    ) -> Take:
        """Read a CSV take.

        swap_jaw_mouth_lr : swap left and right of jaw and mouth, which the format has the wrong way round.
        use_eye_angles : read the eyes from the eye angle columns, not from the eyeLook columns, if both have data.

        Raises TakeError: the file cannot be read or a cell is invalid; it names file, line and column.
        """
        columns, times, table = _read(Path(path))
        values, present = _sort_columns(columns, table, parameters, swap_jaw_mouth_lr)
        _drop_redundant(values, present, parameters, use_eye_angles)
        for array in (times, values, present):
            array.flags.writeable = False
        return cls(Path(path).name, times, values, present, parameters.low, parameters.high)

    @property
    def frames(self) -> int:
        """Number of rows."""
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        """Time from the first row to the last."""
        return float(self.times_s[-1])

    @property
    def rate_hz(self) -> float:
        """Rows per second where no row is missing, from the median step of the timecode; 0 for a single row."""
        return float(1.0 / np.median(np.diff(self.times_s))) if self.frames > 1 else 0.0

    @property
    def gaps(self) -> int:
        """Number of steps between rows that are longer than one and a half times the median step."""
        steps = np.diff(self.times_s)
        return int(np.count_nonzero(steps > 1.5 * np.median(steps))) if len(steps) else 0

    def sample(self, t: float, out: Floats) -> Floats:
        """Write the parameters at ``t`` s to ``out`` : (P,), interpolated linearly between rows and clipped."""
        t = min(max(t, 0.0), self.duration_s)
        after = min(int(np.searchsorted(self.times_s, t, side="right")), self.frames - 1)
        before = max(after - 1, 0)
        span = self.times_s[after] - self.times_s[before]
        weight = (t - self.times_s[before]) / span if span > 0.0 else 1.0
        np.subtract(self.values[after], self.values[before], out=out)
        out *= weight
        out += self.values[before]
        return np.clip(out, self.low, self.high, out=out)


class TakePlayer:
    """Plays a take into a layer at its own rate.

    Parameters
    ----------
    take : the take to play. state : whose layer is written. layer : ``"capture"``, or ``"speech"`` for a take that
    drives only the mouth.

    Attributes
    ----------
    position_s : time since the beginning of the take. finished : whether the last row has been played.
    """

    def __init__(self, take: Take, state: CommandState, layer: str = "capture") -> None:
        self.take = take
        self.layer = layer
        self.finished = False
        self._state = state
        self._values = np.zeros(take.values.shape[1])
        self._start_ns: int | None = None
        self.position_s = 0.0

    def tick(self, now_ns: int) -> None:
        """Write the values of ``now_ns`` (monotonic clock) to the layer; the first call begins the take."""
        if self._start_ns is None:
            self._start_ns = now_ns
        self.position_s = (now_ns - self._start_ns) * 1e-9
        if self.finished:
            return
        self.finished = self.position_s >= self.take.duration_s
        values = self.take.sample(self.position_s, self._values)
        self._state.write_layer(self.layer, values, self.take.mask, now_ns, now_ns, through=self.take.through)


def is_livelink(start: bytes) -> bool:
    """Whether a file that begins with these bytes is a take of Live Link Face."""
    return "timecode" in header_of(start)


def _read(path: Path) -> tuple[list[str], Floats, Floats]:
    """Return column names (folded, without timecode and count), times from the first row (s) and cells (n, columns)."""
    table = read_csv(path, _HINT)
    folded = [fold(cell) for cell in table.header]
    if "timecode" not in folded:
        raise TakeError(f"{path}, line 1: no column Timecode", hint=_HINT)
    codes = table.texts(folded.index("timecode"))
    times = _times(path, [(line, code) for (line, _), code in zip(table.rows, codes, strict=True)])
    keep = [i for i, name in enumerate(folded) if name not in ("timecode", "blendshapecount", "framerate")]
    return [folded[i] for i in keep], times, table.numbers(keep)


def _times(path: Path, lines: list[tuple[int, str]]) -> Floats:
    """Return the times since the first row (s) for line numbers and timecodes, also across midnight."""
    seconds = np.empty(len(lines))
    for i, (number, text) in enumerate(lines):
        match = _TIMECODE.fullmatch(text)
        if match is None:
            message = f"{path}, line {number}, column Timecode: {text!r} is not HH:MM:SS:FF.fff"
            raise TakeError(message, hint="correct or remove that line")
        hours, minutes, whole = map(int, match.groups()[:3])
        seconds[i] = 3600 * hours + 60 * minutes + whole + float(match[4]) / _FRAMES_PER_S
    seconds += _DAY_S * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -_DAY_S / 2)
    for (number, _), step in zip(lines[1:], np.diff(seconds), strict=True):
        if step < 0:
            message = f"{path}, line {number}, column Timecode: goes back in time"
            raise TakeError(message, hint="two takes in one file? split it there")
    since_first: Floats = seconds - seconds[0]
    return since_first


def _sort_columns(columns: list[str], table: Floats, parameters: Parameters, swap: bool) -> tuple[Floats, Flags]:
    """Return the cells as values (n, P), with normalised angles, and which parameters have a column."""
    values = np.zeros((len(table), len(parameters)))
    present = np.zeros(len(parameters), dtype=bool)
    for column, cells in zip(columns, table.T, strict=True):
        try:
            i = parameters.index(column)
        except ParameterError:
            continue  # such as eye rolls, and emotion columns of other programs
        if swap:
            i = parameters.index(_SWAPPED.get(parameters.names[i], parameters.names[i]))
        full = parameters.full_scale_rad[i]
        sign = -1.0 if parameters.names[i] in _NEGATED else 1.0
        values[:, i] = cells if math.isnan(full) else sign * cells / full
        present[i] = True
    return values, present


def _drop_redundant(values: Floats, present: Flags, parameters: Parameters, use_eye_angles: bool) -> None:
    """Drop head angles that were not recorded, and the eye columns that repeat others; modifies both arrays."""
    head, eyes = parameters.indices(_HEAD), parameters.indices(_EYES)
    looks = _looks(parameters)
    if not values[:, head].any():
        present[head] = False
    dropped = looks if use_eye_angles and values[:, eyes].any() else eyes
    if dropped is looks or values[:, looks].any():
        _hold(values, present, dropped)


def hold_looks(values: Floats, present: Flags, parameters: Parameters) -> None:
    """Hold the eyeLook parameters of a take with eye angles at zero; modifies both arrays."""
    _hold(values, present, _looks(parameters))


def _looks(parameters: Parameters) -> Indices:
    return np.array([i for i, name in enumerate(parameters.names) if name.startswith("eyeLook")])


def _hold(values: Floats, present: Flags, indices: Indices) -> None:
    """Hold parameters at zero, so that no lower layer adds its own gaze."""
    values[:, indices] = 0.0
    present[indices] = True
