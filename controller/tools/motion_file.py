"""Converts a take, a show (timed script) or a recording to parameter values over time, for other programs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from controller.base.config import read_toml
from controller.base.errors import TakeError
from controller.base.parameters import Flags, Floats, Parameters
from controller.layers.commands import CommandState
from controller.links.line.script import load_script
from controller.links.line.show import Show
from controller.takes.mcap_files import write_mcap
from controller.takes.plain import write_plain
from controller.takes.reader import load_take
from controller.takes.recording import SUFFIX, Maker, default_state, replay
from controller.takes.retarget import load_ranges, retarget
from controller.takes.voices.network import network_take
from controller.vocabulary.vocabulary import Vocabulary

SHOW_HZ = 60.0
"""Rows per second of shows and recordings."""
_MAX_SHOW_S = 3600.0
_SETTLE_S = 2.0  # time after the last step of a show, in which its last expression is reached
_SCRIPT = ".toml"
_WRITERS = {".csv": write_plain, ".mcap": write_mcap}


@dataclass(frozen=True, eq=False)
class Motion:
    """Parameter values over time.

    name : for people. times_s : (n,) float64, ascending from 0. values : (n, P) float64 in range. mask : (P,) bool,
    the parameters that it moves. lives : (n, 2) float64 breath, mm, and pupils, a share, that a recording shows
    beside them, see :meth:`surface.head.Head.live`; None for takes and shows, which have none.
    """

    name: str
    times_s: Floats
    values: Floats
    mask: Flags
    lives: Floats | None = None

    def with_rest(self) -> Floats:
        """Return (n, P + 1): the values, and a last column of zeros for names that are not parameters."""
        return np.append(self.values, np.zeros((len(self.values), 1)), axis=1)


def load_motion(
    path: Path,
    parameters: Parameters,
    rate_hz: float | None = None,
    model: Path | None = None,
    make: Maker = default_state,
    vocabulary: Vocabulary | None = None,
) -> Motion:
    """Read the motion of a file: a take of any kind, a recording (.rec), or a script (.toml), which is played.

    rate_hz : rows per second; None keeps those of a take, and means 60 for shows and recordings.
    model : network (ONNX) that computes the face from a voice (WAV); see :mod:`controller.takes.voices.network`.
    make : returns the state that a recording is played into; see :func:`controller.takes.recording.replay`.
    vocabulary : the named expressions of shows. Default: the shipped ones.

    Raises TakeError, ConfigError or ControllerError: the file cannot be read or is wrong.
    """
    if path.suffix.lower() == _SCRIPT:
        return _resample(path.name, *_play_show(path, parameters, vocabulary), rate_hz or SHOW_HZ)
    if path.suffix == SUFFIX:
        return _load_recording(path, parameters, rate_hz or SHOW_HZ, make)
    take = load_take(path, parameters) if model is None else network_take(path, model, parameters)
    times = take.times_s if rate_hz is None else _grid(take.duration_s, rate_hz)
    values = np.array([take.sample(float(t), parameters.neutral()) for t in times])
    return Motion(take.name, *_drop_repeated_times(times, values), take.mask)


def _load_recording(path: Path, parameters: Parameters, rate_hz: float, make: Maker) -> Motion:
    """Return the motion of a recording, with the breath and pupils of its idle motion."""
    states: list[CommandState] = []

    def keep(of: Parameters, seed: int, period_s: float) -> CommandState:
        states.append(make(of, seed, period_s))
        return states[0]

    ticks = [(now_ns * 1e-9, row.copy(), states[0].beside) for now_ns, row in replay(path, parameters, make=keep)]
    if not ticks:
        raise TakeError(f"{path}: nothing is recorded in it", hint="record it again")
    times, rows, lives = (np.array(column) for column in zip(*ticks, strict=True))
    times -= times[0]
    motion = _resample(path.name, times, rows, rate_hz)
    return replace(motion, lives=np.stack([np.interp(motion.times_s, times, column) for column in lives.T], axis=1))


def _play_show(path: Path, parameters: Parameters, vocabulary: Vocabulary | None) -> tuple[Floats, Floats]:
    """Return times (n,) and values (n, P) of every tick of a show, to its end, or one repetition of a loop."""
    read_toml(path)
    state = CommandState(parameters, vocabulary)
    script = load_script(str(path), parameters, vocabulary)
    show = Show(script, state)
    show.playing = True
    last_s = script.steps[-1][0] if script.steps else 0.0
    length_s = min(script.loop_s or last_s + _SETTLE_S, _MAX_SHOW_S)
    ticks, out, rows = round(length_s * 100), parameters.neutral(), []
    for k in range(ticks + 1):
        now_ns = 10_000_000 * (k + 1)
        show.tick(now_ns)
        state.tick(now_ns, 0.01, out)
        rows.append(out.copy())
    return np.arange(ticks + 1) / 100.0, np.array(rows)


def _resample(name: str, times: Floats, rows: Floats, rate_hz: float) -> Motion:
    """Interpolate ticks linearly at a constant rate."""
    grid = _grid(float(times[-1]), rate_hz)
    values = np.stack([np.interp(grid, times, column) for column in rows.T], axis=1)
    return Motion(name, grid, values, np.logical_or.reduce(values != 0.0, axis=0))


def _grid(length_s: float, rate_hz: float) -> Floats:
    times: Floats = np.arange(int(length_s * rate_hz + 1e-6) + 1) / rate_hz
    return times


def _drop_repeated_times(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return times and values without rows that are not later than the row before."""
    later = np.append(True, np.diff(times) > 0.0)
    return times[later], values[later]


def convert(
    path: Path,
    out: Path,
    parameters: Parameters,
    rate_hz: float | None = None,
    model: Path | None = None,
    ranges: Path | None = None,
) -> Motion:
    """Write the motion of a file as a plain table (.csv) or as MCAP (.mcap), and return it.

    ``ranges`` : file with the ranges of a person's face; see :mod:`controller.takes.retarget`.

    Raises what :func:`load_motion` raises. TakeError: another suffix, or a path that cannot be written.
    MissingPackage: mcap is not installed.
    """
    write = _WRITERS.get(out.suffix.lower())
    if write is None:
        raise TakeError(
            f"{out}: tables of parameters are .csv files, or .mcap", hint=f"omote convert {path.name} {path.stem}.csv"
        )
    if out.exists() and out.samefile(path):
        raise TakeError(f"{out}: is the input file", hint="choose another name")
    motion = load_motion(path, parameters, rate_hz, model)
    if ranges is not None:
        low, high = load_ranges(ranges, parameters)
        motion = replace(motion, values=retarget(motion.values, low, high, parameters))
    write(out, motion.times_s, motion.values, motion.mask, parameters)
    return motion
