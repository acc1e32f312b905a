"""Driver of hobby servos on a board that reads lines of text, whose format is given by templates.

A line contains the servos whose goals changed and, in turn, one other servo, so that a board that was reset gets all
goals again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError
from drivers.boards.hobby import ValueScale
from drivers.boards.pulses import GROUP, PulseBus
from drivers.text.template import NAMES, TEXTS, VALUES, AnswerPattern, check_texts, decimals

TIME_MS = (1, 1000)
"""Limits of the duration of a line's moves, ms."""
READ_DECIMALS = 6
"""Decimals of values that are only read: enough for no rounding."""
MAX_MISSES = 2
"""Number of missing answers in a row after which a servo is silent."""
RETRY_S = 1.0
"""Interval of requests for silent servos."""


class TextBus(PulseBus):
    """A text board on one port; a servo's ``id`` is the channel.

    template : one servo's move, with placeholders (:mod:`drivers.text.template`).
    begin, separator, end : text before, between and after the moves of one line; where all are empty each move is a
        line.
    off : switches one servo off; without it servos stay on when the bus is closed.
    query, answer : request for one servo and its answer; ``answer`` must name the servo and end with text.
    options : see :class:`~drivers.boards.bus.BoardBus`.

    Raises DriverError: a template that is not valid, named with what is wrong; or an unknown model.
    """

    tells_torque: ClassVar[bool] = False

    def __init__(self, servos: Iterable[ServoSpec], **options: Any) -> None:
        self._texts: dict[str, str] = {key: options.pop(key, "") for key in TEXTS}
        super().__init__(servos, **options)
        self._move, self._frame, self._off_text, self._query, self._answer = check_texts(**self._texts)
        if len(self.servos) > 1 and not self._move.fields & set(NAMES):
            raise DriverError("template: does not say which servo it is for", hint="put {ch} or {name} into it")
        n = len(self.servos)
        self._names: list[dict[str, float | str]] = [
            {"ch": servo.id, "id": servo.id, "name": servo.wire_name or servo.name} for servo in self.servos
        ]
        self._scales = {
            piece.field: ValueScale(self.servos, [piece.field] * n, [decimals(piece.spec)] * n)
            for piece in self._move.pieces
            if piece.field in VALUES
        }
        self._main = next(iter(self._scales))
        answered = [field for field in VALUES if self._answer and field in self._answer.fields]
        self._answered = (*answered, "us")[0]
        self._read_scale = ValueScale(self.servos, [self._answered] * n, [READ_DECIMALS] * n)
        self._sent = np.full(n, math.nan)
        self._refresh = 0
        self._sent_s = self._retry_s = -math.inf
        self._missed = np.zeros(n, dtype=int)

    def far_end(self) -> dict[str, Any]:
        return {"texts": self._texts, "names": [named["name"] for named in self._names]}

    def _open_link(self) -> None:
        super()._open_link()
        self._sent[:] = math.nan
        self._sent_s = self._retry_s = -math.inf
        self._missed[:] = 0

    def _begin(self) -> Floats:
        """What the board puts out is unknown: every servo starts at its rest position."""
        return np.full(len(self.servos), math.nan)

    def _bring_up(self) -> Floats:
        if not self._off_text:
            self._warn(f"servos on {self.path} cannot be switched off: give the bus an off template")
        return super()._bring_up()

    def _off(self, index: int) -> None:
        if self._off_text:
            self._port.write(self._off_text.fill(self._names[index]).encode())

    def _go(self, angle_rad: Floats) -> Floats:
        known = np.isfinite(angle_rad)
        values = {name: scale.values(np.where(known, angle_rad, 0.0)) for name, scale in self._scales.items()}
        main = values[self._main]
        changed = known & ((main != self._sent) | self._forgot)
        changed[self._refresh] |= known[self._refresh]
        self._refresh = (self._refresh + 1) % len(self.servos)
        self._forgot = False
        self._sent = np.where(known, main, self._sent)
        sent = np.where(known, self._scales[self._main].radians(main), math.nan)
        self._track.go(self._scale.pulses(sent))
        if changed.any():
            self._write(np.flatnonzero(changed).tolist(), values)
        if not self._query:
            self._port.drain()  # nothing else reads what the board sends
        return sent

    def _write(self, indices: list[int], values: dict[str, Floats]) -> None:
        now = self._clock()
        wait_ms = min(max((now - self._sent_s) * 1000.0, TIME_MS[0]), TIME_MS[1])
        self._sent_s = now
        moves = [
            self._move.fill({**self._names[i], "time_ms": wait_ms, **{name: v[i] for name, v in values.items()}})
            for i in indices
        ]
        begin, end = (part.fill({"time_ms": wait_ms}) for part in self._frame)
        self._port.write((begin + self._texts["separator"].join(moves) + end).encode())

    def _poll(self) -> None:
        if self._query is None or self._answer is None:
            here = self._limits.target if self._running else self._position
            self._position = np.where(np.isnan(self._sent), here, self._scales[self._main].radians(self._sent))
            return
        group = self._choose_polled()
        if not group:
            return
        self._port.drain()
        self._port.write("".join(self._query.fill(self._names[index]) for index in group).encode())
        answers = self._answers(self._answer, group)
        lost = [self.ids[index] for index in group if index not in answers and self._miss(index)]
        self._note_answer(bool(answers) or len(self._mute) < len(self.servos))
        if lost and not self._silent:
            self._warn(f"the board on {self.path} does not answer about {', '.join(map(str, lost))}")
        for index, pulse in answers.items():
            self._missed[index] = 0
            self._take([index], [pulse])

    def _choose_polled(self) -> list[int]:
        """Choose the servos (indices) to poll in this cycle; silent servos get separate cycles, every ``RETRY_S``."""
        now = self._clock()
        if self._mute and now >= self._retry_s:
            self._retry_s = now + RETRY_S
            group, self._mute = self._mute[:GROUP], self._mute[GROUP:]
            return group
        return [index for index in self._turn() if index not in self._mute]

    def _miss(self, index: int) -> bool:
        """Count a missing answer; return whether the servo counts as silent now."""
        self._report.count("no_reply", self.ids[index])
        self._missed[index] += 1
        if self._missed[index] >= MAX_MISSES:
            self._mute.append(index)
            self._retry_s = self._clock() + RETRY_S
        return bool(self._missed[index] == MAX_MISSES)

    def _answers(self, pattern: AnswerPattern, group: list[int]) -> dict[int, float]:
        """Pulses (us) by index from the answers that arrive in time; other lines are counted as stray."""
        found, data = dict[int, float](), b""
        end = self._port.clock() + self._margin_s + 320.0 * len(group) / self._port.baud
        while len(found) < len(group):
            got = self._port.read(end)
            *lines, data = (data + got).split(pattern.end)
            for line in lines:
                values = pattern.read((line + pattern.end).decode("latin-1")) or {}
                names = {name: values[name] for name in NAMES if name in values}
                index = next((i for i in group if names and names.items() <= self._names[i].items()), None)
                if index is None:
                    self._report.stray += 1
                else:
                    found[index] = self._pulse(index, values)
            if not got and self._port.clock() >= end:
                break
        return found

    def _pulse(self, index: int, values: Mapping[str, float | str]) -> float:
        """Return the pulse (us) in an answer."""
        value = float(values[self._answered])
        if self._answered == "us":
            return value
        return float(self._scale.pulses(self._read_scale.radians(np.full(len(self.servos), value)))[index])
