"""Reads the action units of OpenFace 2, of the format ``au-csv``, and of py-feat from CSV files.

OpenFace (its wiki, "Output Format") has a space after each comma of the header; ``AU01_r`` is an intensity 0..5,
``AU01_c`` a presence 0 or 1, and AU28 has only a presence; rows with ``success`` 0 are not valid. Head and gaze are
angles in the camera's frame: x to the right of its picture, y down, z away from it. ``au-csv`` has only times and
intensities, also of one side (``AUL12_r``). py-feat has ``AU01`` 0..1, one row for every face of every frame, empty
cells for faces that were not found, and frame numbers as times.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Flags, Floats, Parameters
from controller.takes.csvtable import CsvTable, header_of, read_csv
from controller.takes.livelink import Take, hold_looks
from controller.vocabulary.facs import Facs

_OPENFACE = "an OpenFace 2 file has the columns timestamp, success, AU01_r, AU01_c and so on: FeatureExtraction -aus"
_PYFEAT = "a py-feat file has the columns frame, AU01, AU02 and so on: Detector().detect_video(...).to_csv(...)"
_UNIT = re.compile(r"au([lr]?)0*(\d+)(_r|_c)?")
_MAX_INTENSITY = 5.0
_PRESENT = 0.6  # level of a unit that has only a presence; it stands for the FACS intensity C
_MIN_CONFIDENCE = 0.5
_RATE_HZ = 30.0


def is_openface(start: bytes) -> bool:
    """Whether a file that begins with these bytes was written by OpenFace, or as ``au-csv``."""
    names = header_of(start)
    of_units = any(re.fullmatch(r"au[lr]?\d+_[rc]", name) for name in names)
    return of_units and ("confidence" in names or "timestamp" in names)


def is_pyfeat(start: bytes) -> bool:
    """Whether a file that begins with these bytes was written by py-feat."""
    names = header_of(start)
    return "au01" in names and any(name in names for name in ("facescore", "facerectx", "frame", "input"))


def openface_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from OpenFace's action units, head and gaze. Raises TakeError."""
    table = read_csv(path, _OPENFACE)
    columns = {name.lower(): i for i, name in enumerate(table.header)}
    times = _column(table, columns, "timestamp", _OPENFACE)
    table, times = _one_face(table, times, _face_ids(table, columns, "face_id"), _found(table, columns))
    levels = _openface_levels(table, columns)
    values, mask = _expand_units(levels, parameters)
    _set_angles(table, columns, values, mask, parameters)
    return _take(path, times, values, mask, parameters)


def pyfeat_take(path: Path, parameters: Parameters) -> Take:
    """Read a take from py-feat's action units, at the rate of ``approx_time`` or else 30 Hz. Raises TakeError."""
    table = read_csv(path, _PYFEAT)
    columns = {name.lower(): i for i, name in enumerate(table.header)}
    units = {match[2]: i for name, i in columns.items()
             if (match := _UNIT.fullmatch(name)) and not match[1] and not match[3]}  # fmt: skip
    cells = table.numbers([*units.values()], gaps=True)
    frames = _column(table, columns, "frame", _PYFEAT) if "frame" in columns else np.arange(float(len(table.rows)))
    times = frames / _rate(table, columns, frames)
    found = np.logical_and.reduce(np.isfinite(cells), axis=1)
    table, times = _one_face(table, times, _face_ids(table, columns, "identity"), found)
    levels = {unit: np.clip(table.numbers([i])[:, 0], 0.0, 1.0) for unit, i in units.items()}
    values, mask = _expand_units(levels, parameters)
    return _take(path, times, values, mask, parameters)


def _column(table: CsvTable, columns: dict[str, int], name: str, hint: str) -> Floats:
    if name not in columns:
        raise TakeError(f"{table.path}, line 1: no column {name}", hint=hint)
    column: Floats = table.numbers([columns[name]])[:, 0]
    return column


def _face_ids(table: CsvTable, columns: dict[str, int], name: str) -> list[str]:
    """Return the id of the face of each row; empty strings if there is no such column."""
    return [text.strip() for text in table.texts(columns[name])] if name in columns else [""] * len(table.rows)


def _found(table: CsvTable, columns: dict[str, int]) -> Flags:
    """Return (n,) bool, whether a face was found in each row."""
    found: Flags = np.ones(len(table.rows), dtype=bool)
    for name, minimum in (("success", 0.5), ("confidence", _MIN_CONFIDENCE)):
        if name in columns:
            found = np.logical_and(found, np.nan_to_num(table.numbers([columns[name]], gaps=True)[:, 0]) >= minimum)
    return found


def _one_face(table: CsvTable, times: Floats, faces: list[str], found: Flags) -> tuple[CsvTable, Floats]:
    """Return the rows of the face that is seen most often, one for each time, sorted by time, and these times (s)."""
    if not found.any():
        raise TakeError(f"{table.path}: no face was found in any row", hint="track the video again")
    seen = [face for face, there in zip(faces, found, strict=True) if there]
    most = max(dict.fromkeys(seen), key=seen.count)
    keep = [i for i in np.flatnonzero(found).tolist() if faces[i] == most]
    chosen, order = np.unique(times[keep], return_index=True)
    rows = [table.rows[keep[i]] for i in order]
    return CsvTable(table.path, table.header, rows, table.decimal_comma), chosen - chosen[0]


def _rate(table: CsvTable, columns: dict[str, int], frames: Floats) -> float:
    """Return the frames per second by the column approx_time (``MM:SS``) if it changes at least twice, else 30."""
    if "approx_time" not in columns:
        return _RATE_HZ
    texts = table.texts(columns["approx_time"])
    clock = [re.fullmatch(r"(?:(\d+):)?(\d+):(\d+)(?:\.\d+)?", text.strip()) for text in texts]
    if not all(clock):
        return _RATE_HZ
    seconds = np.array([3600 * int(m[1] or 0) + 60 * int(m[2]) + int(m[3]) for m in clock if m], dtype=np.float64)
    ticks = np.flatnonzero(np.diff(seconds) > 0) + 1
    if len(ticks) < 2 or frames[ticks[-1]] <= frames[ticks[0]]:
        return _RATE_HZ
    return float((frames[ticks[-1]] - frames[ticks[0]]) / (seconds[ticks[-1]] - seconds[ticks[0]]))


def _openface_levels(table: CsvTable, columns: dict[str, int]) -> dict[str, Floats]:
    """Return the levels (n,) 0..1 of each unit: its intensity, or, if it has none, its presence."""
    found: dict[str, Floats] = {}
    for name, i in columns.items():
        match = _UNIT.fullmatch(name)
        if match and match[3] == "_r":
            found[match[1].upper() + match[2]] = np.clip(table.numbers([i])[:, 0] / _MAX_INTENSITY, 0.0, 1.0)
        elif match and match[3] == "_c" and f"au{match[1]}{int(match[2]):02}_r" not in columns:
            found[match[1].upper() + match[2]] = np.where(table.numbers([i])[:, 0] > 0.5, _PRESENT, 0.0)
    return found


def _expand_units(levels: dict[str, Floats], parameters: Parameters) -> tuple[Floats, Flags]:
    """Return values (n, P) for levels of units, and a mask (P,) of those that a unit moves; ignores unknown units."""
    facs = Facs.load(parameters)
    count = len(next(iter(levels.values()), np.zeros(0)))
    shown = np.zeros((count, len(facs.names)))
    for unit, level in levels.items():
        columns = facs.columns_of(unit)
        shown[:, columns] = np.maximum(shown[:, columns], level[:, None])
    moving = [i for unit in levels for i in facs.columns_of(unit)]
    mask = (facs.matrix[:, moving] != 0.0).any(axis=1)
    return np.minimum(shown @ facs.matrix.T, 1.0), mask


def _set_angles(table: CsvTable, columns: dict[str, int], values: Floats, mask: Flags, parameters: Parameters) -> None:
    """Add the angles of head and eyes; in the camera's frame a head that turns to its own left has a negative Ry."""
    pose = [columns.get(name) for name in ("pose_rx", "pose_ry", "pose_rz")]
    if any(i is None for i in pose):
        return
    head = table.numbers([i for i in pose if i is not None]) * (1.0, -1.0, -1.0)
    angles = dict(zip(("headPitch", "headYaw", "headRoll"), head.T, strict=True))
    if (x := columns.get("gaze_angle_x")) is not None and (y := columns.get("gaze_angle_y")) is not None:
        gaze = table.numbers([x, y]) - head[:, [1, 0]]
        angles |= {f"{side}EyeYaw": gaze[:, 0] for side in ("left", "right")}
        angles |= {f"{side}EyePitch": gaze[:, 1] for side in ("left", "right")}
        hold_looks(values, mask, parameters)
    for name, angle_rad in angles.items():
        i = parameters.index(name)
        values[:, i], mask[i] = angle_rad / parameters.full_scale_rad[i], True


def _take(path: Path, times: Floats, values: Floats, mask: Flags, parameters: Parameters) -> Take:
    if not mask.any():
        raise TakeError(f"{path}: none of its action units is known", hint="configs/vocabularies/facs.toml lists them")
    return Take(path.name, times, values, mask, parameters.low, parameters.high)
