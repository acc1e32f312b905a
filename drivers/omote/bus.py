"""Driver of a head that takes the omote line protocol, such as an Arduino or another omote.

Each servo is a name in ``SET`` lines. Lines have tags and their answers are read: only a few lines may be unanswered at
a time, so a slow head gets the newest values and no queue. The values that the head acknowledged are the positions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any, ClassVar

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import BusError, DriverError, NoReply, ServoRefused, WrongModel
from drivers.boards.bus import BoardBus
from drivers.boards.hobby import ValueScale, check_hobby, known_models
from drivers.omote import protocol
from drivers.omote.protocol import Answer

MODELS = {"parameter": ("parameter", 4), "degrees": ("deg", 2)}
"""Value and decimals of models besides hobby servos, which are sent as pulses (us)."""
MAX_UNANSWERED = 2
"""Number of lines that may be unanswered, because small boards have small input buffers."""
HELLO_TIMEOUT_S, HELLO_INTERVAL_S = 5.0, 0.5
"""Time in which a head must answer (a board resets when its port is opened), and interval between requests."""
ANSWER_TIMEOUT_S = 0.5
"""Time after which an unanswered line counts as lost."""
MAX_TRIES = 3


def check_lineout(model: str) -> None:
    """Raise DriverError unless a model is ``parameter``, ``degrees`` or a hobby servo."""
    try:
        if model not in MODELS:
            check_hobby(model)
    except DriverError as error:
        names = ", ".join((*MODELS, *sorted(known_models())))
        raise DriverError(f"there is no model {model!r} for the line protocol", hint=f"use one of {names}") from error


class LineOutBus(BoardBus):
    """A head on one port.

    servos : the servos; ``wire_name`` or ``name`` is the name on the wire. ``model`` selects the value: ``"parameter"``
        (90 degrees are 1), ``"degrees"``, or a hobby servo's model for its pulse in us.
    checksum : end every line with a checksum.
    heartbeat_s : all values are sent again after this time; a head may switch off when nothing comes for longer.
    options : see :class:`~drivers.boards.bus.BoardBus`.

    Raises DriverError: unknown model, or a name that cannot be used in a line.
    """

    tells_torque: ClassVar[bool] = False

    def __init__(
        self, servos: Iterable[ServoSpec], *, checksum: bool = True, heartbeat_s: float = 0.25, **options: Any
    ) -> None:
        super().__init__(servos, **options)
        self._names = [servo.wire_name or servo.name for servo in self.servos]
        for id, name in zip(self.ids, self._names, strict=True):
            if not protocol.is_word(name):
                raise DriverError(
                    f"servo {id}: {name!r} cannot be a name in the line protocol",
                    hint="set its wire_name to one without blanks and *",
                )
        twice = sorted({name for name in self._names if self._names.count(name) > 1})
        if twice:
            raise DriverError(f"two servos are called {', '.join(twice)}", hint="give each a different wire_name")
        for servo in self.servos:
            check_lineout(servo.model)
        fields = [MODELS.get(servo.model, ("us", 1)) for servo in self.servos]
        self._scale = ValueScale(self.servos, *zip(*fields, strict=True))
        self._checked, self._heartbeat_s = checksum, heartbeat_s
        self._tag = 0
        self._reset()

    def _reset(self) -> None:
        """Forget what is known of the head."""
        self._waiting: dict[int, tuple[float, dict[int, float]]] = {}  # tag: (when it was sent, angle by index)
        self._answers: dict[int, Answer] = {}
        self._input = b""
        self._sent = np.full(len(self.servos), math.nan)
        self._all_sent_s = self._answer_s = -math.inf
        self._max_line = protocol.MAX_LINE

    def far_end(self) -> dict[str, Any]:
        return {"names": self._names}

    def _open_link(self) -> None:
        super()._open_link()
        self._reset()

    def _begin(self) -> Floats:
        """Send HELLO and request the present values; NaN where the head does not report them."""
        hello = dict(word.partition("=")[::2] for word in self._greet().text.split() if "=" in word)
        if hello.get("max_line", "").isdecimal():
            self._max_line = min(int(hello["max_line"]), protocol.MAX_LINE)
        values = np.full(len(self.servos), math.nan)
        index = {name: i for i, name in enumerate(self._names)}
        for group in self._groups(self._names):
            answer = self._insist(["GET", *group])
            if answer.code == protocol.UNKNOWN_COMMAND:
                break  # a simple head does not report values; its servos start at rest
            if not answer.ok:
                raise self._refusal(group, answer)
            for name, word in zip(group, answer.text.split()[1:], strict=False):
                with suppress(ValueError):
                    values[index[name]] = float(word.partition("=")[2])
        return self._scale.radians(values)

    def _greet(self) -> Answer:
        end = self._port.clock() + HELLO_TIMEOUT_S
        while True:
            self._port.write(b"\n")  # ends an incomplete line that the head may have received
            answer = self._exchange(["HELLO"], HELLO_INTERVAL_S)
            if answer is not None and answer.ok:
                return answer
            if self._port.clock() >= end:
                raise self._error(
                    NoReply,
                    f"no head answers in the line protocol on {self.path} at {self._port.baud} baud",
                    "check its power, its cable, its baud rate, and that its sketch takes the omote line protocol",
                )

    def _refusal(self, group: Sequence[str], answer: Answer) -> BusError:
        """Return the error for names that a head refuses; requests each name separately to find the wrong one."""
        for name in group:
            single = self._insist(["GET", name])
            if not single.ok:
                index = self._names.index(name)
                kind = WrongModel if single.code == protocol.UNKNOWN_NAME else ServoRefused
                message = f"the head on {self.path} does not take {name!r} (servo {self.ids[index]}): {single.text}"
                return self._error(kind, message, "set wire_name of the channel to a name that it knows", [index])
        return self._error(ServoRefused, f"the head on {self.path} refused GET: {answer.text}", indices=())

    def _off(self, index: int) -> None:
        """Does nothing: :meth:`_switch_off` releases all names in a few lines."""

    def _switch_off(self) -> None:
        """Release every name, after which the head follows its other sources, or switches its servos off."""
        left: list[int] = []
        lost = None
        try:
            for group in self._groups(self._names):
                left += [self._names.index(name) for name in self._release_names(group)]
        except DriverError as error:
            left, lost = list(range(len(self.servos))), error
        self._on[:] = False
        self._sent[:] = math.nan
        if left:
            raise self._not_off_error(left, None) from lost

    def _release_names(self, group: Sequence[str]) -> list[str]:
        """Release some names, one by one where they are refused together; return the names not released."""
        for _ in range(MAX_TRIES):
            answer = self._exchange(["RELEASE", *group], ANSWER_TIMEOUT_S)
            if answer is None:
                continue
            if answer.ok:
                return []
            if len(group) > 1:
                return [name for one in group for name in self._release_names([one])]
        return list(group)

    def _go(self, angle_rad: Floats) -> Floats:
        self._listen()
        known = np.isfinite(angle_rad)
        values = self._scale.values(np.where(known, angle_rad, 0.0))
        sent = np.where(known, self._scale.radians(values), math.nan)
        now = self._clock()
        refresh = now - self._all_sent_s >= self._heartbeat_s
        due = known & ((values != self._sent) | refresh)
        if len(self._waiting) >= MAX_UNANSWERED:
            if due.any():
                self._report.count("held_back")
            return sent
        if refresh:
            self._all_sent_s = now
        pairs = {f"{self._names[i]} {protocol.number(values[i])}": int(i) for i in np.flatnonzero(due)}
        for words in self._groups(pairs):
            group = [pairs[pair] for pair in words]
            self._send_line(["SET", *words], {i: float(sent[i]) for i in group})
            self._sent[group] = values[group]
        return sent

    def _poll(self) -> None:
        """Process the answers that have arrived, without waiting."""
        self._listen()
        now = self._clock()
        for tag in [tag for tag, (when, _) in self._waiting.items() if now - when > ANSWER_TIMEOUT_S]:
            del self._waiting[tag]
            self._report.count("no_reply")
            self._sent[:] = math.nan  # send all values again
        if self._running:
            self._note_answer(now - self._answer_s <= self._heartbeat_s + 2 * ANSWER_TIMEOUT_S)

    def _groups(self, words: Iterable[str]) -> list[list[str]]:
        return protocol.split_to_fit(words, self._max_line - len(f"#{protocol.MAX_TAG} RELEASE*00"))

    def _send_line(self, words: Sequence[str], angles: dict[int, float]) -> int:
        """Send a line; returns its tag."""
        self._tag = self._tag % protocol.MAX_TAG + 1
        self._waiting[self._tag] = self._clock(), angles
        self._port.write(protocol.line(words, self._tag, self._checked))
        return self._tag

    def _exchange(self, words: Sequence[str], wait_s: float) -> Answer | None:
        """Send a line and wait for its answer; None when it does not come."""
        tag = self._send_line(words, {})
        end = self._port.clock() + wait_s + self._margin_s
        while tag not in self._answers and self._port.clock() < end:
            self._listen(end)
        self._waiting.pop(tag, None)
        return self._answers.pop(tag, None)

    def _insist(self, words: Sequence[str]) -> Answer:
        for _ in range(MAX_TRIES):
            answer = self._exchange(words, ANSWER_TIMEOUT_S)
            if answer is not None:
                return answer
        raise self._error(NoReply, f"the head on {self.path} does not answer {words[0]}")

    def _listen(self, deadline_s: float = 0.0) -> None:
        """Process the input; with a deadline, wait for input until then."""
        *lines, self._input = (self._input + self._port.read(deadline_s)).split(b"\n")
        self._input = self._input[-4 * protocol.MAX_LINE :]
        for line in lines:
            answer = protocol.read_answer(line.strip(b"\r"))
            if answer is not None:
                self._take(answer)
            elif line.strip() and line[:2] not in (b"P ", b"F "):
                self._report.count("corrupt")

    def _take(self, answer: Answer) -> None:
        waiting = self._waiting.pop(answer.tag or 0, None)
        if waiting is None:
            self._report.stray += answer.tag is not None
            if not answer.ok and answer.tag is None:
                self._note_refusal(answer, {})
            return
        self._answer_s = self._clock()
        angles = waiting[1]
        if not angles:
            self._answers[answer.tag or 0] = answer
        elif answer.ok:
            for index, angle in angles.items():
                self._note(index, angle)
        else:
            self._note_refusal(answer, angles)

    def _note_refusal(self, answer: Answer, angles: dict[int, float]) -> None:
        """Count a refused line, which changed nothing at the head; its values are sent again."""
        self._report.count("refused")
        self._sent[list(angles) or slice(None)] = math.nan
        self._warn(f"the head on {self.path} refused a line: {answer.code} {answer.text}")
