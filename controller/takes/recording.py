"""Records every command and every tick of a run to a file, and replays it bit by bit.

A recording is a text file with one JSON list per line: a header, then ``["name", ...arguments]`` for each call in the
order in which the calls took effect. A tick also has the CRC-32 of the resulting parameters.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import ControllerError
from controller.base.files import format_fault
from controller.base.mailboxes import REST, Life
from controller.base.parameters import Floats, Parameters
from controller.layers.commands import CommandState
from controller.takes.line_writer import LineWriter
from surface.base import files

SUFFIX = ".rec"
"""File name suffix of recordings."""

_KIND, _VERSION = "omote recording", 1
_MAX_LINE_BYTES = 1 << 20
_MIN_TICK_S, _MAX_TICK_S = 1e-4, 1.0
_COMMANDS = ("set_parameters", "release", "expression", "gaze", "gaze_at", "gaze_off", "neutral", "live")


Maker = Callable[[Parameters, int, float], CommandState]


def default_state(parameters: Parameters, seed: int, period_s: float) -> CommandState:
    """Return a command state with the shipped layers, expressions and idle motion."""
    return CommandState(parameters, seed=seed, period_s=period_s)


@contextmanager
def recorded(
    state: CommandState,
    path: Path,
    *,
    seed: int = 0,
    period_s: float = 0.01,
    failed: Callable[[Exception], object] | None = None,
) -> Iterator[CommandState]:
    """Record the calls of ``state`` until the block ends.

    path : the file to write. seed, period_s : those of ``state``, for the replay.
    failed : called, perhaps from another thread, when the file cannot be written any more; what has been written can
    still be replayed. If None, that error is raised when the block ends.

    Raises ControllerError: the file cannot be written.
    """
    try:
        writer = LineWriter(path, failed or (lambda _: None))
    except OSError as error:
        raise _write_error(path, error) from error
    writer.put(_line(_KIND, _VERSION, seed, period_s, state.parameters.names))
    state.record(lambda name, *arguments: writer.put(_entry(name, *arguments)))
    try:
        yield state
    finally:
        state.record(None)
        writer.close()
    if writer.error is not None and failed is None:
        raise _write_error(path, writer.error) from writer.error


def _entry(name: str, *arguments: Any) -> bytes:
    """Return the line of a call."""
    if name == "tick":
        now_ns, dt, out = arguments
        return _line(name, now_ns, dt, zlib.crc32(out.tobytes()))
    if name == "write_layer":
        layer, values, mask, *rest = arguments
        held = np.flatnonzero(mask)
        return _line(name, layer, held, values[held], *rest)
    return _line(name, *arguments)


def _line(*items: Any) -> bytes:
    return json.dumps(items, separators=(",", ":"), default=lambda array: array.tolist()).encode("ascii") + b"\n"


def _write_error(path: Path, error: OSError) -> ControllerError:
    return ControllerError(f"{path}: cannot be written: {error.strerror}", hint="choose another path")


def replay(path: Path, parameters: Parameters, *, make: Maker = default_state) -> Iterator[tuple[int, Floats]]:
    """Replay a recording and yield the time (ns) and parameters (P,) of each tick, always in the same array.

    make : returns the state to play into, for parameters, a seed and the length of a tick (s).

    Raises ControllerError: the file cannot be read or is damaged, or the result of a tick is not the recorded one.
    """
    lines = _lines(path)
    seed, period_s = _header(path, lines, parameters)
    state, out = make(parameters, seed, period_s), parameters.neutral()
    for number, items in lines:
        try:
            if items[0] == "tick":
                now_ns, dt, crc = items[1:]
                state.tick(now_ns, dt, out)
                if zlib.crc32(out.tobytes()) != crc:
                    raise ControllerError(
                        f"{path}, line {number}: this tick came out differently from the recorded one",
                        hint="it was recorded with another stage, other vocabularies or another version of omote",
                    )
                yield now_ns, out
            else:
                _apply(state, items)
        except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
            raise _damaged(path, number) from error


class Replay:
    """Plays a recording in real time in place of a command state, without taking commands; see :func:`replay`.

    finished : whether the last tick has been played. ticks : number of ticks played. played_s : time of the last one
    since the first. beside : breath and pupils of the last one, see :class:`controller.layers.commands.CommandState`.
    """

    def __init__(self, path: Path, parameters: Parameters, make: Maker = default_state) -> None:
        self._states: list[CommandState] = []
        self._ticks = replay(path, parameters, make=lambda *how: self._keep(make(*how)))
        self._next, self.beside = self._read_next(), REST
        self._start_ns = (0, 0)
        self.finished = False
        self.ticks, self.played_s = 0, 0.0

    def tick(self, now_ns: int, dt: float, out: Floats) -> int:
        """Write the recorded parameters of this time to ``out`` : (P,); return 0, because no command arrived."""
        if not self.ticks and self._next is not None:
            self._start_ns = now_ns, self._next[0]
        start_ns, first = self._start_ns
        while self._next is not None and self._next[0] - first <= now_ns - start_ns:
            out[:], self.beside = self._next[1:]
            self.played_s = (self._next[0] - first) * 1e-9
            self.ticks += 1
            self._next = self._read_next()
        self.finished = self._next is None
        return 0

    def _keep(self, state: CommandState) -> CommandState:
        self._states.append(state)
        return state

    def _read_next(self) -> tuple[int, Floats, Life] | None:
        found = next(self._ticks, None)
        return None if found is None else (found[0], found[1].copy(), self._states[0].beside)


def _apply(state: CommandState, items: list[Any]) -> None:
    name, *arguments = items
    if name in _COMMANDS:
        getattr(state, name)(*arguments)
        return
    if name != "write_layer":
        raise ValueError(name)
    layer, held, given, now_ns, stamp_ns, through = arguments
    values, mask = state.parameters.neutral(), np.zeros(len(state.parameters), dtype=bool)
    values[held], mask[held] = given, True
    state.write_layer(layer, values, mask, now_ns, stamp_ns, through=None if through is None else np.array(through))


def _lines(path: Path) -> Iterator[tuple[int, list[Any]]]:
    with files.reading(path, ControllerError), files.open_file(path) as file:
        for number, line in enumerate(iter(lambda: file.readline(_MAX_LINE_BYTES), b""), 1):
            try:
                items = files.parse_json(line.decode("ascii"))
            except ValueError as error:
                raise _damaged(path, number) from error
            if not isinstance(items, list) or not items:
                raise _damaged(path, number)
            yield number, items


def _header(path: Path, lines: Iterator[tuple[int, list[Any]]], parameters: Parameters) -> tuple[int, float]:
    """Read the seed and the length of a tick (s), and check that this is a recording of these parameters."""
    _, items = next(lines, (1, []))
    if items[:1] == [_KIND] and (fault := format_fault(items[1:2] and items[1], _VERSION)):
        raise ControllerError(f"{path}: {fault}", hint="bring omote up to date, or record it again")
    if len(items) != 5 or items[0] != _KIND or not isinstance(items[2], int):
        raise ControllerError(f"{path}: not a recording of version {_VERSION}", hint="record it again")
    if items[4] != list(parameters.names):
        raise ControllerError(f"{path}: recorded with other parameters", hint="use the vocabulary it was recorded with")
    seed, period_s = items[2:4]
    numbers = not isinstance(seed, bool) and isinstance(period_s, int | float) and not isinstance(period_s, bool)
    if not (numbers and seed >= 0 and _MIN_TICK_S <= period_s <= _MAX_TICK_S):
        raise _damaged(path, 1)
    return seed, float(period_s)


def _damaged(path: Path, number: int) -> ControllerError:
    return ControllerError(f"{path}, line {number}: damaged", hint="the recording may be cut off; record it again")
