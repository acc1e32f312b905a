"""controller.fleet.hearing: faces go to their heads, are recorded, and hurry what shows them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.fleet.batch import Batches
from controller.fleet.follower import Follower
from controller.fleet.hearing import MANY, Hearing
from controller.fleet.lease import Lease, Token
from controller.fleet.offset import Clocks
from controller.fleet.payload import Header, Payloads
from controller.fleet.wire import ALL
from tests.controller.fleet.samples import Sample, Wire

ME, OTHER = 1, 2
NAMES = tuple("abcdef")


class Recorder:
    """Keeps rows."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, np.ndarray]] = []

    def add(self, time_ns: int, values: np.ndarray) -> None:
        """Keep one."""
        self.rows.append((time_ns, values))


class Process:
    """A process with so many heads that hears; hurried : how often it was to show something at once."""

    def __init__(self, heads: int, recorded: tuple[str, ...] = ()) -> None:
        self.wire, self.lease, self.clocks, self.hurried = Wire(), Lease(ME, 0.25, 0.0, 0.0), Clocks(), 0
        self.followers = {name: Follower(P) for name in NAMES[:heads]}
        self.recordings = {name: Recorder() for name in recorded}
        self.payloads = Payloads(P)
        recordings: Any = self.recordings
        Hearing(self.wire, self.followers, self.payloads, self.lease, self.clocks, recordings, self._hurry)  # type: ignore[arg-type]

    def _hurry(self) -> None:
        self.hurried += 1

    def one(self, head: str, header: Header | None, values: np.ndarray) -> None:
        """A face of one head arrives."""
        data = self.payloads.encode(values)
        self.wire.heard[head, "parameters"](Sample(header, data, self.payloads.encoding))

    def many(self, header: Header | None, faces: list[tuple[str, int, int, np.ndarray]]) -> None:
        """Faces of a tick arrive: head, sequence, stamp and values of each."""
        batches = Batches(self.payloads)
        data = batches.encode([(*face, self.payloads.encode(values)) for *face, values in faces])  # type: ignore[misc]
        self.wire.heard[ALL, "faces"](Sample(header, data, batches.encoding))

    def taken(self) -> list[int]:
        """How many faces every head took."""
        return [follower.taken for follower in self.followers.values()]


def face(jaw: float) -> np.ndarray:
    values = P.neutral()
    values[P.index("jawOpen")] = jaw
    return values


def shown(follower: Follower) -> float:
    """The jaw that a follower shows at its next step."""
    out = P.neutral()
    follower.step(10**9, 0.01, P.neutral(), out)
    return float(out[P.index("jawOpen")])


@pytest.mark.parametrize("heads", [1, MANY - 1, MANY, MANY + 2])
def test_few_heads_hear_their_own_faces_and_many_hear_all_in_one_message(heads: int) -> None:
    process = Process(heads)
    single = {(name, "parameters") for name in NAMES[:heads]}
    assert process.wire.heard.keys() == ({(ALL, "faces")} if heads >= 4 else single)


def test_a_face_goes_to_its_head_alone_and_hurries_it() -> None:
    process = Process(3, recorded=("b",))
    values, header = face(0.5), Header(Token(3, OTHER), 8, 77_000, 66_000, True)
    process.one("b", header, values)
    assert process.taken() == [0, 1, 0] and process.hurried == 1
    assert shown(process.followers["b"]) == 0.5 and process.followers["b"].header == header
    ((at, row),) = process.recordings["b"].rows
    assert at == 77_000 and np.array_equal(row, values)
    process.one("a", header, values)
    assert process.taken() == [1, 1, 0] and len(process.recordings["b"].rows) == 1  # a is not recorded


def test_a_face_that_its_head_refuses_is_not_recorded_and_hurries_nobody() -> None:
    process, header = Process(1, recorded=("a",)), Header(Token(3, OTHER), 8, 77_000)
    for again in range(3):
        process.one("a", header, face(0.1 * again))
    assert process.hurried == 1 and len(process.recordings["a"].rows) == 1
    assert process.followers["a"].refused["older than the last one"] == 2


def test_faces_of_a_tick_have_their_own_sequences_and_stamps_and_hurry_once() -> None:
    process = Process(MANY, recorded=("c",))
    token = Token(3, OTHER)
    faces = [("c", 5, 51, face(0.5)), ("nobody", 9, 91, face(0.9)), ("a", 3, 31, face(0.25))]
    process.many(Header(token, 0, 77_000, 0, True), faces)
    assert process.taken() == [1, 0, 1, 0] and process.hurried == 1
    assert (shown(process.followers["c"]), shown(process.followers["a"])) == (0.5, 0.25)
    assert process.followers["c"].header == Header(token, 5, 77_000, 51, True)
    assert process.followers["a"].header == Header(token, 3, 77_000, 31, True)
    assert [at for at, _ in process.recordings["c"].rows] == [77_000]
    process.many(Header(token, 0, 78_000), [("c", 5, 51, face(0.5)), ("a", 4, 32, face(0.5))])
    assert process.taken() == [2, 0, 1, 0] and process.hurried == 2  # one of both was new
    process.many(Header(token, 0, 79_000), [("c", 5, 51, face(0.5)), ("a", 4, 32, face(0.5))])
    assert process.hurried == 2
    process.many(Header(token, 0, 80_000), [("c", 6, 51, face(0.5)), ("a", 4, 32, face(0.5))])
    assert process.hurried == 3  # the first of both was new
    process.many(Header(token, 0, 81_000), [("nobody", 7, 51, face(0.5))])
    assert process.hurried == 3


@pytest.mark.parametrize("heads", [1, MANY])
def test_one_s_own_faces_are_left_and_say_nothing_of_the_lease(heads: int) -> None:
    process, header = Process(heads), Header(Token(9, ME), 1, 77_000)
    if heads == 1:
        process.one("a", header, face(0.5))
    else:
        process.many(header, [("a", 1, 1, face(0.5))])
    assert process.taken() == [0] * heads and process.hurried == 0
    assert process.lease.highest == Token(0, 0) or process.lease.highest < Token(1, 0)
    assert process.clocks.offset_ns(ME) == 0


@pytest.mark.parametrize("heads", [1, MANY])
def test_the_lease_and_the_clocks_take_note_of_who_conducts(heads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("controller.fleet.hearing.time.monotonic_ns", lambda: 1_000_000)
    monkeypatch.setattr("controller.fleet.hearing.time.monotonic", lambda: 0.2)
    process, header = Process(heads), Header(Token(9, OTHER), 1, 77_000_000)
    if heads == 1:
        process.one("a", header, face(0.5))
    else:
        process.many(header, [("a", 1, 1, face(0.5))])
    assert process.lease.highest == Token(9, OTHER)
    assert process.clocks.offset_ns(OTHER) == 76_000_000  # what one's own clock lacks
    assert not process.lease.tick(0.21) and not process.lease.tick(0.2 + 0.249)  # it was heard at 0.2 s
    assert process.lease.tick(0.2 + 0.26)


@pytest.mark.parametrize("heads", [1, MANY])
def test_a_message_without_a_header_or_with_a_damaged_face_is_refused_whole(heads: int) -> None:
    process, header = Process(heads), Header(Token(3, OTHER), 8, 77_000)
    with pytest.raises(LinkError, match="without a header"):
        if heads == 1:
            process.one("a", None, face(0.5))
        else:
            process.many(None, [("a", 1, 1, face(0.5))])
    broken = face(np.nan)
    with pytest.raises(LinkError, match="not a finite number"):
        if heads == 1:
            process.one("a", header, broken)
        else:
            process.many(header, [("a", 1, 1, face(0.5)), ("b", 1, 1, broken)])
    assert process.taken() == [0] * heads and process.hurried == 0
