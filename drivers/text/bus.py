"""Hobby servos on a board that reads lines of text: a template says what a line looks like.

A line holds the servos whose goals changed, and one more in turn, so that a board that was reset hears of all of them.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError
from drivers.boards.pulses import GROUP, PulseBus
from drivers.boards.scales import ValueScale
from drivers.text.template import NAMES, VALUES, AnswerPattern, check_texts, decimals

log = logging.getLogger(__name__)

TIME_MS = (1, 1000)
"""Shortest and longest time that a line may give the board for its moves."""
MISSES = 2
"""So many answers in a row that do not come make a servo silent."""
RETRY_S = 1.0
"""Silent servos are asked about once in this time."""


class TextBus(PulseBus):
    """A text board on one port. See :class:`~drivers.boards.bus.BoardBus` for what it shares with other boards.

    Parameters
    ----------
    servos : the servos; ``id`` is the channel.
    template : one servo's move, with placeholders (:mod:`drivers.text.template`).
    begin, separator, end : what stands before, between and behind the moves of one line. With all of them empty each
        move is a line of its own.
    off : what switches one servo off; without it servos stay on when the bus is closed.
    query, answer : what asks for one servo, and what comes back; ``answer`` must name the servo and end with text.
    options : see :class:`~drivers.boards.bus.BoardBus`.

    Raises
    ------
    DriverError : a template that does not fit, named with what is wrong; or an unknown model.
    """

    tells_torque: ClassVar[bool] = False

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        template: str,
        begin: str = "",
        separator: str = "",
        end: str = "",
        off: str = "",
        query: str = "",
        answer: str = "",
        clock: Callable[[], float] = time.monotonic,
        **options: Any,
    ) -> None:
        super().__init__(servos, port=port, clock=clock, **options)
        self._texts = {"template": template, "begin": begin, "separator": separator, "end": end, "off": off}
        self._texts |= {"query": query, "answer": answer}
        self._move, self._frame, self._off_text, self._query, self._answer = check_texts(**self._texts)
        self._separator = separator
        if len(self.servos) > 1 and not self._move.fields & set(NAMES):
            raise DriverError("template: does not say which servo it is for", hint="put {ch} or {name} into it")
        self._scales = {
            piece.field: ValueScale(piece.field, decimals(piece), self.servos, self._scale)
            for piece in self._move.pieces
            if piece.field in VALUES
        }
        self._read_scale = _read_scale(self._answer, self.servos, self._scale) if self._answer else None
        self._main = next(iter(self._scales.values()))
        self._sent = np.full(len(self.servos), math.nan)
        self._refresh = 0
        self._sent_s = self._retry_s = -math.inf
        self._missed = np.zeros(len(self.servos), dtype=int)

    def far_end(self) -> dict[str, Any]:
        """What a simulated board has to be set to."""
        return {"texts": self._texts, "names": [servo.wire_name or servo.name for servo in self.servos]}

    # ------------------------------------------------------------------ starting and stopping

    def _open_link(self) -> None:
        super()._open_link()
        self._sent[:] = math.nan
        self._sent_s = self._retry_s = -math.inf
        self._missed[:] = 0

    def _begin(self) -> Floats:
        """A board that is not asked, or does not answer yet, may put out anything: every servo begins at its rest."""
        return np.full(len(self.servos), math.nan)

    def _bring_up(self) -> Floats:
        if not self._off_text:
            self._say(f"servos on {self.path} cannot be switched off: give the bus an off template")
        return super()._bring_up()

    def _off(self, index: int) -> None:
        if self._off_text:
            self._port.write(self._off_text.fill(self._named(index)).encode())

    # ------------------------------------------------------------------ every cycle

    def _go(self, angle_rad: Floats) -> Floats:
        known = np.isfinite(angle_rad)
        values = {name: scale.values(np.where(known, angle_rad, 0.0)) for name, scale in self._scales.items()}
        main = values[self._main.field]
        changed = known & ((main != self._sent) | self._forgot)
        changed[self._refresh] |= known[self._refresh]
        self._refresh = (self._refresh + 1) % len(self.servos)
        self._forgot = False
        self._sent = np.where(known, main, self._sent)
        sent = np.where(known, self._main.radians(main), math.nan)
        self._track.go(self._scale.pulses(sent))
        if changed.any():
            self._write(np.flatnonzero(changed).tolist(), values)
        self._forget_input()
        return sent

    def _write(self, indices: list[int], values: dict[str, Floats]) -> None:
        now = self._clock()
        wait_ms = min(max((now - self._sent_s) * 1000.0, TIME_MS[0]), TIME_MS[1])
        self._sent_s = now
        moves = [
            self._move.fill({**self._named(i), "time_ms": wait_ms, **{name: v[i] for name, v in values.items()}})
            for i in indices
        ]
        begin, end = (part.fill({"time_ms": wait_ms}) for part in self._frame)
        self._port.write((begin + self._separator.join(moves) + end).encode())

    def _named(self, index: int) -> dict[str, float | str]:
        servo = self.servos[index]
        return {"ch": servo.id, "id": servo.id, "name": servo.wire_name or servo.name}

    def _forget_input(self) -> None:
        """Without a question nobody reads what a board says; its words must not pile up."""
        if not self._query:
            self._port.drain()

    def _poll(self) -> None:
        """Ask some servos in turn, or believe what they were told."""
        if self._query is None or self._answer is None:
            here = self._limits.target if self._running else self._position
            self._position = np.where(np.isnan(self._sent), here, self._main.radians(self._sent))
            return
        group = self._asked_now()
        if not group:
            return
        self._port.drain()
        self._port.write("".join(self._query.fill(self._named(index)) for index in group).encode())
        answers = self._answers(group)
        lost = [self.ids[index] for index in group if index not in answers and self._miss(index)]
        self._heard(bool(answers) or len(self._mute) < len(self.servos))
        if lost and not self._silent:
            self._say(f"the board on {self.path} does not answer about {', '.join(map(str, lost))}")
        for index, pulse in answers.items():
            self._missed[index] = 0
            self._take([index], [pulse])

    def _asked_now(self) -> list[int]:
        """The servos to ask in this cycle; those that are never answered about once a second, and by themselves."""
        now = self._clock()
        if self._mute and now >= self._retry_s:
            self._retry_s = now + RETRY_S
            group, self._mute = self._mute[:GROUP], self._mute[GROUP:]
            return group
        return [index for index in self._turn() if index not in self._mute]

    def _miss(self, index: int) -> bool:
        """A servo that was asked about without an answer; whether nobody waits for it from now on."""
        self._report.count("no_reply", self.ids[index])
        self._missed[index] += 1
        if self._missed[index] >= MISSES:
            self._mute.append(index)
            self._retry_s = self._clock() + RETRY_S
        return bool(self._missed[index] == MISSES)

    def _answers(self, group: list[int]) -> dict[int, float]:
        """Pulses (us) by index that answers bring; what is no answer is thrown away."""
        pattern, found, data = self._answer, dict[int, float](), b""
        if pattern is None:
            return found
        end = self._port.clock() + self._margin_s + self._wire_s(32 * len(group))
        while len(found) < len(group):
            got = self._port.read(end)
            *lines, data = (data + got).split(pattern.end)
            for line in lines:
                found.update(self._answered(pattern, (line + pattern.end).decode("latin-1"), group))
            if not got and self._port.clock() >= end:
                break
        return found

    def _answered(self, pattern: AnswerPattern, line: str, group: list[int]) -> dict[int, float]:
        """The pulse (us) by index that one answer brings; nothing where it is none of a servo that was asked."""
        values = pattern.read(line) or {}
        for index in group if values else ():
            named = self._named(index)
            if all(values[name] == named[name] for name in NAMES if name in values):
                return {index: self._pulse(index, values)}
        self._report.stray += 1
        return {}

    def _pulse(self, index: int, values: Mapping[str, float | str]) -> float:
        scale = self._read_scale
        if scale is None or scale.field == "us":
            return float(values["us"])
        angles = np.zeros(len(self.servos))
        angles[index] = scale.radian(index, float(values[scale.field]))
        return float(self._scale.pulses(angles)[index])

    def _doubt(self) -> None:
        """Answers name their servo: one that is wrong says nothing of the next."""


def _read_scale(pattern: AnswerPattern, servos: tuple[ServoSpec, ...], pulses: Any) -> ValueScale:
    field = next(name for name in VALUES if name in pattern.fields)
    return ValueScale(field, VALUES[field][1], servos, pulses)
