"""drivers.boards.ordered_replies: answers without names, told apart by a question whose answer is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from drivers.base.bus import ServoSpec
from drivers.base.errors import NoReply
from drivers.boards.ordered_replies import OrderedBus
from drivers.sim.serving.virtual import VirtualBus, VirtualClock


class Script:
    """A port whose far end answers each write as a function says; (delay, bytes) comes later."""

    def __init__(self, answer: Callable[[bytes], list[tuple[float, bytes]]]) -> None:
        self.answer, self.baud, self.clock = answer, 1_000_000, VirtualClock()
        self.due: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        self.due += [(self.clock() + delay, piece) for delay, piece in self.answer(data)]
        self.due.sort(key=lambda item: item[0])

    def read(self, deadline_s: float) -> bytes:
        if self.due and self.due[0][0] <= max(deadline_s, self.clock()):
            time_s, data = self.due.pop(0)
            self.clock.wait_until(time_s)
            return data
        self.clock.wait_until(deadline_s)
        return b""

    def drain(self) -> int:
        count = 0
        while data := self.read(0.0):
            count += len(data)
        return count


class Talker(OrderedBus):
    """A board whose probe is V, answered by v!."""

    def _probe(self) -> bytes:
        return b"V"

    def _answers_probe(self, data: bytes) -> bool:
        return data == b"v!"

    def _ask_pulses(self, group: Sequence[int], insist: bool = False) -> None:
        raise NotImplementedError

    def _go(self, angle_rad: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def _off(self, index: int) -> None:
        raise NotImplementedError

    def ask(self, requests: bytes, count: int, insist: bool = False) -> bytes | None:
        return self._request(requests, count, insist)


def talk(answer: Callable[[bytes], list[tuple[float, bytes]]]) -> tuple[Talker, Script]:
    port = Script(answer)
    servo = ServoSpec(0, "jaw", "rc-180", -0.5, 0.5, 5.0, 50.0)
    return Talker([servo], port=port, margin_s=0.01, clock=port.clock), port


def honest(data: bytes) -> list[tuple[float, bytes]]:
    return [(0.0, data[:-1].lower() + b"v!")]


def test_answers_come_in_order() -> None:
    conversation, _ = talk(honest)
    assert conversation.ask(b"AB", 2) == b"ab"
    assert conversation.ask(b"", 0) == b""


@pytest.mark.parametrize(
    "wrong",
    [
        [(0.0, b"xabv!")],  # noise before
        [(0.0, b"av!")],  # one byte lost
        [(0.0, b"abv!x")],  # noise behind
        [(0.0, b"abv?")],  # damaged where it is known
        [],
        [(0.015, b"abv!")],  # late, and heard in the next batch
        [(0.025, b"abv!")],  # later than that
    ],
)
def test_nothing_counts_of_a_batch_that_is_not_whole(wrong: list[tuple[float, bytes]]) -> None:
    replies = [[(0.0, b"v!")], wrong]
    conversation, _ = talk(lambda data: replies.pop(0) if replies else honest(data))
    assert conversation.ask(b"AB", 2) is None
    got = [conversation.ask(b"CD", 2, insist=True) for _ in range(3)]
    assert got[-1] == b"cd"
    assert set(got) <= {None, b"cd"}


def test_a_silent_board_is_tried_once_in_a_while() -> None:
    asked: list[bytes] = []

    def silent(data: bytes) -> list[tuple[float, bytes]]:
        asked.append(data)
        return []

    conversation, port = talk(silent)
    for _ in range(50):
        assert conversation.ask(b"A", 1) is None
    assert asked == [b"V"]
    port.clock.sleep(1.0)
    assert conversation.ask(b"A", 1) is None
    assert asked == [b"V", b"V"]


def test_a_probe_may_be_answered_in_pieces() -> None:
    replies = [[(0.0, b"v"), (0.005, b"!")]]
    conversation, _ = talk(lambda data: replies.pop(0) if replies else honest(data))
    assert conversation.ask(b"A", 1) == b"a"


def test_what_came_before_a_request_does_not_count() -> None:
    conversation, port = talk(honest)
    port.due.append((0.0, b"noise"))
    assert conversation.ask(b"A", 1) == b"a"
    port.due.append((port.clock(), b"noise"))
    assert conversation.ask(b"B", 1) == b"b"


def test_one_that_insists_is_not_kept_waiting() -> None:
    asked: list[bytes] = []
    conversation, _ = talk(lambda data: asked.append(data) or [])  # type: ignore[func-returns-value]
    for _ in range(3):
        assert conversation.ask(b"A", 1, insist=True) is None
    assert asked == [b"V"] * 3


def test_a_board_that_never_stops_talking_is_not_listened_to_for_ever() -> None:
    conversation, port = talk(lambda data: [(0.002 * k, b"x") for k in range(10_000)])
    assert conversation.ask(b"A", 1) is None
    assert port.clock() < 1.0


def test_a_slow_wire_has_the_time_that_its_bytes_take() -> None:
    conversation, port = talk(lambda data: [(0.008 * len(data), answer) for _, answer in honest(data)])
    port.baud = 1000
    assert conversation.ask(b"ABC", 3) == b"abc"
    assert port.clock() == pytest.approx(0.008 + 0.01 + 0.032)


@pytest.mark.parametrize("family", ["ssc32", "maestro"])
def test_a_board_that_does_not_answer_is_told_at_the_start_and_counted_later(family: str) -> None:
    servos = [ServoSpec(i, f"s{i}", "rc-180", -0.5, 0.5, 8.0, 200.0) for i in (1, 2)]
    board = VirtualBus(servos, family, driver={"stagger_s": 0.0, "margin_s": 0.02}, baud=115_200)
    with board.bus() as bus:
        board.fault("mute:*")
        with pytest.raises(NoReply) as caught:
            bus.start()
        assert caught.value.servo_ids == (1, 2)
        board.clear()
        board.clock.sleep(2.0)
        bus.start()
        for _ in range(3):
            bus.write([0.1, 0.1])
            state = bus.read()
        assert bus.report().errors == {}
        assert not state.silent.any()
        board.fault("mute:*")
        assert bus.read().silent.all()
        assert bus.report().errors == {"no_reply": 1}
        board.clear()
        board.clock.sleep(2.0)
        assert not bus.read().silent.any()
